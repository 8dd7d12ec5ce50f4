//! Synthetic captures: their bytes repeat, and what they call true is true when it is computed another way.

mod bytes;
mod disturbances;
mod geometry;
mod model;
mod priors;
mod rigs;
mod sound;

use crate::common::prelude::*;
use crate::common::program::json;
use ivv::internals::synth::Options;

/// A small capture: two training cameras would see too little, more would take too long.
fn options() -> Options {
    let tiny = Preset::Tiny.options(7);
    Options { cameras: 4, test_cameras: 1, width: 48, height: 36, frames: 6, samples: 2, points: 150, ..tiny }
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("synth-{name}"))
}

fn make(name: &str, options: &Options, threads: usize) -> PathBuf {
    let folder = folder(name);
    write_capture(&folder, options, threads, &mut |_, _| {}).unwrap();
    folder
}

fn shared() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| make("shared", &options(), 2))
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut left = vec![folder.to_owned()];
    while let Some(path) = left.pop() {
        for entry in fs::read_dir(&path).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                left.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn rgb(path: &Path) -> image::RgbImage {
    image::open(path).unwrap().into_rgb8()
}

pub fn exr(path: &Path) -> BTreeMap<String, Vec<f32>> {
    use exr::prelude::{FlatSamples, read_first_flat_layer_from_file};
    let image = read_first_flat_layer_from_file(path).unwrap();
    let channels = image.layer_data.channel_data.list.into_iter();
    let values = channels.map(|channel| match channel.sample_data {
        FlatSamples::F32(values) => (channel.name.to_string(), values),
        other => panic!("{} has samples {other:?}", channel.name),
    });
    values.collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

pub struct Body {
    name: String,
    pub dynamic: bool,
    shape: Value,
    /// Body to world at each frame and one more; of a body at rest only one.
    poses: Vec<(DMat3, DVec3)>,
    life: [Option<f64>; 2],
}

impl Body {
    pub fn pose(&self, frame: usize) -> (DMat3, DVec3) {
        if self.dynamic { self.poses[frame] } else { self.poses[0] }
    }

    pub fn exists(&self, frame: f64) -> bool {
        self.life[0].is_none_or(|from| frame >= from - 1e-9) && self.life[1].is_none_or(|to| frame < to + 1e-9)
    }

    pub fn local(&self, pose: (DMat3, DVec3), world: DVec3) -> DVec3 {
        pose.0.inverse() * (world - pose.1)
    }

    pub fn distance(&self, local: DVec3) -> f64 {
        let number = |key: &str| self.shape[key].as_f64().unwrap();
        match self.shape["kind"].as_str().unwrap() {
            "sphere" => (local.length() - number("radius")).abs(),
            "capsule" => {
                let half = number("half_length");
                let axis = DVec3::new(0.0, local.y.clamp(-half, half), 0.0);
                ((local - axis).length() - number("radius")).abs()
            }
            "block" | "room" => {
                let outside = local.abs() - DVec3::from_slice(&numbers(&self.shape["half_sides"]));
                (outside.max(DVec3::ZERO).length() + outside.max_element().min(0.0)).abs()
            }
            other => panic!("no shape {other}"),
        }
    }
}

pub fn bodies(capture: &Path) -> Vec<Body> {
    let truth = json(&capture.join("truth.json"));
    let matrix = |pose: &Value| {
        let rows: Vec<Vec<f64>> = pose.as_array().unwrap().iter().map(numbers).collect();
        let row = |i: usize| DVec3::from_slice(&rows[i][..3]);
        let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        (rotation, DVec3::new(rows[0][3], rows[1][3], rows[2][3]))
    };
    let body = |body: &Value| Body {
        name: body["name"].as_str().unwrap().to_owned(),
        dynamic: body["dynamic"].as_bool().unwrap(),
        shape: body["shape"].clone(),
        poses: body["pose"].as_array().unwrap().iter().map(matrix).collect(),
        life: [body["exists_from_frame"].as_f64(), body["exists_to_frame"].as_f64()],
    };
    truth["bodies"].as_array().unwrap().iter().map(body).collect()
}
