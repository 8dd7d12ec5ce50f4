//! COLMAP's camera models as lenses.

use super::raw::{DAMAGED, RawCamera};
use crate::scene::Intrinsics;
use crate::scene::capture::decoder::MAX_SIDE;
use crate::scene::undistort::{Distortion, Lens};

impl RawCamera {
    /// The lens, or what is wrong with it and what to do.
    pub fn lens(&self) -> Result<Lens, (String, &'static str)> {
        let side = |side: u64| u32::try_from(side).ok().filter(|side| (1..=MAX_SIDE).contains(side));
        let (Some(width), Some(height)) = (side(self.width), side(self.height)) else {
            let reason = format!("has {} x {} pixels, 1 to {MAX_SIDE} each is allowed", self.width, self.height);
            return Err((reason, "give the size of the images"));
        };
        let name = self.kind.name;
        if name == "EQUIRECTANGULAR" {
            let reason = "is a panorama (EQUIRECTANGULAR), which is not read".to_owned();
            return Err((reason, "cut it into views of a pinhole, as COLMAP's panorama_sfm.py does"));
        }
        let (pinhole, more) = self.params.split_at(if self.kind.has_one_focal { 3 } else { 4 });
        let (fx, fy, cx, cy) = match *pinhole {
            [f, cx, cy] => (f, f, cx, cy),
            [fx, fy, cx, cy] => (fx, fy, cx, cy),
            _ => (0.0, 0.0, 0.0, 0.0),
        };
        let radial = |k: &[f64]| std::array::from_fn(|index| k.get(index).copied().unwrap_or(0.0));
        let angular =
            |k: &[f64]| Distortion::Fisheye(std::array::from_fn(|index| k.get(index).copied().unwrap_or(0.0)));
        let distortion = match (name, more) {
            ("SIMPLE_PINHOLE" | "PINHOLE", []) => Distortion::None,
            ("SIMPLE_RADIAL" | "RADIAL", k) => Distortion::brown(radial(k), [0.0; 2]),
            ("OPENCV", &[k1, k2, p1, p2]) => Distortion::brown(radial(&[k1, k2]), [p1, p2]),
            ("FULL_OPENCV", &[k1, k2, p1, p2, k3, k4, k5, k6]) => Distortion::brown([k1, k2, k3, k4, k5, k6], [p1, p2]),
            ("OPENCV_FISHEYE" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" | "SIMPLE_FISHEYE" | "FISHEYE", k) => {
                angular(k)
            }
            ("SIMPLE_DIVISION" | "DIVISION", &[k]) => Distortion::division(k),
            ("EUCM", &[alpha, beta]) => Distortion::unified(alpha, beta),
            ("FOV", &[omega]) => Distortion::field_of_view(omega),
            _ => {
                let remedy = "undistort the images with `colmap image_undistorter`";
                return Err((format!("has the model {name}, which is not undistorted here"), remedy));
            }
        };
        let lens = Lens { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, distortion };
        lens.fault().map_or(Ok(lens), |reason| Err((reason, DAMAGED)))
    }
}
