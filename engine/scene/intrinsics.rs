//! The pinhole camera.

use glam::{DVec2, DVec3};

/// A pinhole camera, pixels. A point (x, y, z) of the camera's axes (x right, y down, z forward) projects to
/// (fx x / z + cx, fy y / z + cy). Pixel (0, 0) has its corner at (0, 0) and its centre at (0.5, 0.5).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Intrinsics {
    /// Pixels of a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length in x.
    pub fx: f64,
    /// Focal length in y.
    pub fy: f64,
    /// Principal point in x.
    pub cx: f64,
    /// Principal point in y.
    pub cy: f64,
}

/// The factor by which a picture of another shape may show more in one direction, before it is cropped in the other.
const MOST_SHOWN: f64 = 1.35;

impl Intrinsics {
    /// A picture of `width` by `height` square pixels, with `fov` degrees from its lower border to its upper one.
    pub fn of_fov(width: u32, height: u32, fov: f64) -> Self {
        let focal = f64::from(height) / (2.0 * (fov.to_radians() / 2.0).tan());
        Intrinsics { width, height, fx: focal, fy: focal, cx: f64::from(width) / 2.0, cy: f64::from(height) / 2.0 }
    }

    #[doc(hidden)]
    pub fn focal(&self) -> DVec2 {
        DVec2::new(self.fx, self.fy)
    }

    #[doc(hidden)]
    pub fn principal(&self) -> DVec2 {
        DVec2::new(self.cx, self.cy)
    }

    #[doc(hidden)]
    pub fn size(&self) -> DVec2 {
        DVec2::new(self.width.into(), self.height.into())
    }

    #[doc(hidden)]
    pub fn n_pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// The pixel position of a point in the camera's axes, which must be before the camera: z > 0.
    pub fn project(&self, at: DVec3) -> DVec2 {
        at.truncate() / at.z * self.focal() + self.principal()
    }

    /// The direction of a pixel position in the camera's axes; its z is 1.
    pub fn ray(&self, at: DVec2) -> DVec3 {
        ((at - self.principal()) / self.focal()).extend(1.0)
    }

    /// True if a pixel position lies in the picture.
    #[doc(hidden)]
    pub fn holds(&self, at: DVec2) -> bool {
        at.cmpge(DVec2::ZERO).all() && at.cmplt(self.size()).all()
    }

    /// Intrinsics of the same picture at another size: each axis scales by the ratio of the sizes.
    pub fn scaled(&self, width: u32, height: u32) -> Self {
        let (x, y) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Intrinsics { width, height, fx: self.fx * x, fy: self.fy * y, cx: self.cx * x, cy: self.cy * y }
    }

    /// Intrinsics of pictures whose pixels are the means of `factor` x `factor` of these, without a remainder at the right and the bottom.
    pub fn reduced(&self, factor: u32) -> Self {
        let [fx, fy, cx, cy] = [self.fx, self.fy, self.cx, self.cy].map(|pixels| pixels / f64::from(factor));
        Intrinsics { width: self.width / factor, height: self.height / factor, fx, fy, cx, cy }
    }

    /// Intrinsics of a picture of another shape that shows all that this one does; but where one direction would show more than 1.35 times
    /// as much as before, the other is cropped.
    #[doc(hidden)]
    pub fn fitted(&self, [width, height]: [u32; 2]) -> Self {
        let [w, h, old_w, old_h] = [width, height, self.width, self.height].map(f64::from);
        let (a, b) = (w / old_w, h / old_h);
        let zoom = a.max(b).min(MOST_SHOWN * a.min(b));
        Intrinsics {
            width,
            height,
            fx: self.fx * zoom,
            fy: self.fy * zoom,
            cx: w / 2.0 + (self.cx - old_w / 2.0) * zoom,
            cy: h / 2.0 + (self.cy - old_h / 2.0) * zoom,
        }
    }
}
