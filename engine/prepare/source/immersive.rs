//! Google Immersive (DeepView video): `models.json` and a fisheye video of each camera.

use super::opencv::Rotation;
use super::recording::{Place, Source};
use crate::files::read_json;
use crate::scene::capture::{Faults, whole_side};
use crate::scene::undistort::{Distortion, Lens};
use crate::scene::{Intrinsics, Pose};

const REMEDY: &str = "give the file that came with the videos";

#[derive(serde::Deserialize)]
struct Model {
    name: String,
    width: f64,
    height: f64,
    focal_length: f64,
    #[serde(default = "one")]
    pixel_aspect_ratio: f64,
    /// Pixels, from the corner of the image.
    principal_point: [f64; 2],
    /// k1, k2 and sometimes a third, which is 0.
    radial_distortion: Vec<f64>,
    projection_type: String,
    /// Centre in the world.
    position: [f64; 3],
    /// Rotation vector from world to camera, radians.
    orientation: [f64; 3],
}

fn one() -> f64 {
    1.0
}

pub(super) fn read(place: Place, faults: &mut Faults) -> Source {
    let calibration = place.folder.join("models.json");
    let mut source = Source::of(&calibration);
    let models: Vec<Model> = faults.take(read_json(&calibration, "models.json", REMEDY)).unwrap_or_default();
    for model in &models {
        let pose = Pose::at(model.position.into(), Rotation::Vector(model.orientation).matrix());
        source.add(&model.name, model.lens().map(|lens| (lens, pose)), place.footage, REMEDY, faults);
    }
    source
}

impl Model {
    fn lens(&self) -> Result<Lens, String> {
        let [k1, k2] = [0, 1].map(|k| self.radial_distortion.get(k).copied().unwrap_or(0.0));
        if self.radial_distortion.iter().skip(2).any(|k| *k != 0.0) {
            return Err(format!("has the radial distortion {:?}, two numbers are read", self.radial_distortion));
        }
        let distortion = match self.projection_type.as_str() {
            "fisheye" => Distortion::Fisheye([k1, k2, 0.0, 0.0]),
            "perspective" => Distortion::brown([k1, k2, 0.0, 0.0, 0.0, 0.0], [0.0; 2]),
            other => return Err(format!("has the projection type `{}`", other.escape_debug())),
        };
        let (Some(width), Some(height)) = (whole_side(self.width), whole_side(self.height)) else {
            return Err(format!("has {} x {} pixels", self.width, self.height));
        };
        let pose = self.position.iter().chain(&self.orientation);
        if !pose.clone().all(|v| v.is_finite()) {
            return Err("has a pose that is not finite".to_owned());
        }
        let intrinsics = Intrinsics {
            width,
            height,
            fx: self.focal_length,
            fy: self.focal_length * self.pixel_aspect_ratio,
            cx: self.principal_point[0],
            cy: self.principal_point[1],
        };
        let lens = Lens { intrinsics, distortion };
        lens.fault().map_or(Ok(lens), Err)
    }
}
