//! A camera at one frame in f64 on the host.

use crate::scene::View;
use glam::{DMat3, DVec2, DVec3};

/// A pinhole camera; x right, y down, z forward.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pinhole {
    width: u32,
    height: u32,
    focal: DVec2,
    principal: DVec2,
    /// World to camera.
    rotation: DMat3,
    translation: DVec3,
}

impl Pinhole {
    pub fn new(view: &View) -> Self {
        let m = &view.world_to_camera;
        let row = |k: usize| DVec3::new(m[k][0], m[k][1], m[k][2]);
        Pinhole {
            width: view.width,
            height: view.height,
            focal: DVec2::new(view.fx, view.fy),
            principal: DVec2::new(view.cx, view.cy),
            rotation: DMat3::from_cols(row(0), row(1), row(2)).transpose(),
            translation: DVec3::new(m[0][3], m[1][3], m[2][3]),
        }
    }

    /// Place in the image, pixels, and depth; `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let at = self.rotation * world + self.translation;
        (at.z > 1e-9).then(|| (at.truncate() / at.z * self.focal + self.principal, at.z))
    }

    /// The place in the image and its derivative by the world position, for x and y; `None` behind the camera.
    pub fn linearised(&self, world: DVec3) -> Option<(DVec2, [DVec3; 2])> {
        let (place, z) = self.project(world)?;
        let slope = (place - self.principal) / (z * self.focal);
        // Row k of J R (SPEC 3).
        let by = |k: usize| (self.rotation.row(k) / z - self.rotation.row(2) * slope[k]) * self.focal[k];
        Some((place, [by(0), by(1)]))
    }

    /// Whether the ball of a radius around a point reaches into the image, by its outline's size in the middle.
    pub fn holds(&self, world: DVec3, radius: f64) -> bool {
        self.project(world).is_some_and(|(at, depth)| {
            let (reach, size) = (self.focal * radius / depth, DVec2::new(self.width.into(), self.height.into()));
            at.cmpge(-reach).all() && at.cmplt(size + reach).all()
        })
    }

    /// Index of the pixel at a place of the image, row by row.
    pub fn pixel(&self, place: DVec2) -> Option<usize> {
        let [width, height] = [self.width, self.height].map(f64::from);
        let is_inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width && place.y < height;
        is_inside.then(|| place.y as usize * self.width as usize + place.x as usize)
    }
}
