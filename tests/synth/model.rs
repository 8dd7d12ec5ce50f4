//! A reader of COLMAP's files of its own, and what it finds in a capture's.

use super::{options, rgb, shared};
use crate::common::prelude::*;

#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    pub name: String,
    pub size: [u64; 2],
    pub intrinsics: [f64; 4],
    pub quaternion: [f64; 4],
    pub translation: [f64; 3],
    pub observations: Vec<(f64, f64, u64)>,
}

/// A point: its number, place, colour, error and track of (image, observation).
pub type Point = (u64, [f64; 3], [u8; 3], f64, Vec<(u32, u32)>);

impl Camera {
    pub fn rotation(&self) -> DMat3 {
        let [w, x, y, z] = self.quaternion;
        DMat3::from_quat(DQuat::from_xyzw(x, y, z, w))
    }

    /// The pixel and the depth of a point.
    pub fn project(&self, world: DVec3) -> (DVec2, f64) {
        let at = self.rotation() * world + DVec3::from_array(self.translation);
        let [fx, fy, cx, cy] = self.intrinsics;
        (DVec2::new(fx * at.x / at.z + cx, fy * at.y / at.z + cy), at.z)
    }

    pub fn unproject(&self, pixel: DVec2, depth: f64) -> DVec3 {
        let [fx, fy, cx, cy] = self.intrinsics;
        let at = DVec3::new((pixel.x - cx) / fx, (pixel.y - cy) / fy, 1.0) * depth;
        self.rotation().transpose() * (at - DVec3::from_array(self.translation))
    }

    pub fn center(&self) -> DVec3 {
        self.rotation().transpose() * -DVec3::from_array(self.translation)
    }

    pub fn holds(&self, pixel: DVec2) -> bool {
        pixel.min_element() >= 0.0 && pixel.x <= self.size[0] as f64 && pixel.y <= self.size[1] as f64
    }
}

pub fn read_model(capture: &Path) -> (Vec<Camera>, Vec<Point>) {
    let rows = |name: &str| -> Vec<Vec<String>> {
        let text = fs::read_to_string(capture.join("sparse/0").join(name)).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        lines.map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
    };
    let f64s = |words: &[String]| -> Vec<f64> { words.iter().map(|word| word.parse().unwrap()).collect() };
    let (images, mut cameras) = (rows("images.txt"), Vec::new());
    for (row, image) in rows("cameras.txt").iter().zip(images.chunks(2)) {
        assert_eq!(row[1], "PINHOLE");
        cameras.push(Camera {
            name: image[0][9].strip_suffix("/00000.png").unwrap().to_owned(),
            size: [row[2].parse().unwrap(), row[3].parse().unwrap()],
            intrinsics: f64s(&row[4..]).try_into().unwrap(),
            quaternion: f64s(&image[0][1..5]).try_into().unwrap(),
            translation: f64s(&image[0][5..8]).try_into().unwrap(),
            observations: f64s(&image[1]).chunks(3).map(|o| (o[0], o[1], o[2] as u64)).collect(),
        });
    }
    let point = |row: &Vec<String>| {
        let color = [4, 5, 6].map(|i| row[i].parse().unwrap());
        let track: Vec<u32> = row[8..].iter().map(|word| word.parse().unwrap()).collect();
        let track = track.chunks(2).map(|pair| (pair[0], pair[1])).collect();
        (row[0].parse().unwrap(), f64s(&row[1..4]).try_into().unwrap(), color, row[7].parse().unwrap(), track)
    };
    (cameras, rows("points3D.txt").iter().map(point).collect())
}

#[test]
fn the_model_agrees_with_the_images() {
    let capture = shared();
    let (cameras, points) = read_model(capture);
    assert_eq!(cameras.len(), 4);
    assert!(points.len() > 100, "{} points", points.len());
    for camera in &cameras {
        assert_eq!(camera.size, [u64::from(options().width), u64::from(options().height)]);
        let norm: f64 = camera.quaternion.iter().map(|v| v * v).sum();
        assert!((norm - 1.0).abs() < 1e-12, "{} has a quaternion of length {norm}", camera.name);
        for frame in 0..options().frames {
            let image = rgb(&capture.join(format!("images/{}/{frame:05}.png", camera.name)));
            assert_eq!([u64::from(image.width()), u64::from(image.height())], camera.size);
        }
    }
    let mut n_observations = 0;
    for (id, at, _, error, track) in &points {
        assert!(track.len() >= 2 && (0.0..1.1).contains(error), "point {id}: {track:?}, error {error}");
        for &(image, index) in track {
            let camera = &cameras[image as usize - 1];
            let (x, y, seen) = camera.observations[index as usize];
            assert_eq!(seen, *id, "the observation is of another point");
            let (pixel, depth) = camera.project(DVec3::from_array(*at));
            assert!(
                depth > 0.1 && (pixel - DVec2::new(x, y)).length() < 0.3 * 3.47 * 1.42,
                "point {id}: {pixel} {x} {y}"
            );
            n_observations += 1;
        }
    }
    assert_eq!(n_observations, cameras.iter().map(|c| c.observations.len()).sum::<usize>());
    let test = cameras.iter().filter(|camera| camera.observations.is_empty()).map(|camera| camera.name.as_str());
    assert_eq!(test.collect::<Vec<_>>(), ["cam02"], "only the test camera takes no part in the reconstruction");
    let manifest = fs::read_to_string(capture.join("capture.toml")).unwrap();
    assert!(manifest.contains("test_cameras = [\"cam02\"]\n") && manifest.contains("frames = 6\n"), "{manifest}");
}
