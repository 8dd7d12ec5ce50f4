//! A COLMAP model of the tests, written in both of COLMAP's formats.

use super::{Folder, png};

/// Id, model number, model name, width, height, parameters.
type Camera = (u32, i32, &'static str, u64, u64, Vec<f64>);
/// Id, quaternion, translation, camera, name, observations.
type Image = (u32, [f64; 4], [f64; 3], u32, &'static str, Vec<(f64, f64, i64)>);
/// Id, position, colour, error, track.
type Point = (u64, [f64; 3], [u8; 3], f64, Vec<(u32, u32)>);

pub struct Model {
    pub cameras: Vec<Camera>,
    pub images: Vec<Image>,
    pub points: Vec<Point>,
}

/// Two cameras, three images, two points.
pub fn sample() -> Model {
    let seen = vec![(1.5, 2.25, -1), (3.0, 1.0, 7)];
    Model {
        cameras: vec![
            (3, 1, "PINHOLE", 6, 4, vec![5.5, 5.25, 3.125, 2.0]),
            (9, 0, "SIMPLE_PINHOLE", 6, 4, vec![4.75, 3.0, 1.875]),
        ],
        images: vec![
            (10, [1.0, 0.0, 0.0, 0.0], [0.5, -0.25, 4.0], 3, "b.png", seen.clone()),
            (11, [0.6, 0.8, 0.0, 0.0], [1.0, 2.0, 3.0], 9, "a.png", vec![]),
            (12, [0.6, 0.0, -0.8, 0.0], [-1.0, 0.0, 3.5], 3, "c d.png", seen),
        ],
        points: vec![
            (7, [0.125, -2.0, 3.0], [255, 0, 17], 0.5, vec![(10, 1), (12, 1), (10, 0)]),
            (1 << 40, [1e-3, 1e3, -0.1], [1, 2, 3], 0.25, vec![(11, 0)]),
        ],
    }
}

pub fn binary(model: &Model) -> [Vec<u8>; 3] {
    let count = |n: usize| (n as u64).to_le_bytes().to_vec();
    let mut cameras = count(model.cameras.len());
    for (id, number, _, width, height, params) in &model.cameras {
        cameras.extend(id.to_le_bytes().into_iter().chain(number.to_le_bytes()));
        cameras.extend([width, height].into_iter().flat_map(|v| v.to_le_bytes()));
        cameras.extend(params.iter().flat_map(|v| v.to_le_bytes()));
    }
    let mut images = count(model.images.len());
    for (id, quaternion, translation, camera, name, observations) in &model.images {
        images.extend(id.to_le_bytes());
        images.extend(quaternion.iter().chain(translation).flat_map(|v| v.to_le_bytes()));
        images.extend(camera.to_le_bytes().into_iter().chain(name.bytes()).chain([0]));
        images.extend(count(observations.len()));
        for (x, y, point) in observations {
            images.extend(x.to_le_bytes().into_iter().chain(y.to_le_bytes()).chain(point.to_le_bytes()));
        }
    }
    let mut points = count(model.points.len());
    for (id, position, color, error, track) in &model.points {
        points.extend(id.to_le_bytes());
        points.extend(position.iter().flat_map(|v| v.to_le_bytes()));
        points.extend(color.iter().copied().chain(error.to_le_bytes()));
        points.extend(count(track.len()));
        points.extend(track.iter().flat_map(|(image, at)| [*image, *at]).flat_map(u32::to_le_bytes));
    }
    [cameras, images, points]
}

pub fn text(model: &Model) -> [String; 3] {
    let join = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let mut files = ["# cameras\n".to_owned(), "# images\n".to_owned(), "# points\n\n".to_owned()];
    for (id, _, name, width, height, params) in &model.cameras {
        files[0] += &format!("{id} {name} {width} {height} {}\n", join(params));
    }
    for (id, quaternion, translation, camera, name, observations) in &model.images {
        let seen: Vec<_> = observations.iter().map(|(x, y, point)| format!("{x} {y} {point}")).collect();
        let pose = join(&[quaternion.as_slice(), translation].concat());
        files[1] += &format!("{id} {pose} {camera} {name}\n{}\n", seen.join(" "));
    }
    for (id, position, [r, g, b], error, track) in &model.points {
        let track: Vec<_> = track.iter().map(|(image, at)| format!("{image} {at}")).collect();
        files[2] += &format!("{id} {} {r} {g} {b} {error} {}\n", join(position), track.join(" "));
    }
    files
}

pub const STEMS: [&str; 3] = ["cameras", "images", "points3D"];

/// Writes the model as binary files to `sparse/0`.
pub fn write(folder: &Folder, model: &Model) {
    write_to(folder, "sparse/0", model);
}

/// Writes the model as binary files to the folder `to`.
pub fn write_to(folder: &Folder, to: &str, model: &Model) {
    for (stem, bytes) in STEMS.iter().zip(binary(model)) {
        folder.write(&format!("{to}/{stem}.bin"), bytes);
    }
}

/// As [`write_to`], without points.
pub fn write_cameras(folder: &Folder, to: &str, model: &Model) {
    for (stem, bytes) in STEMS.iter().zip(binary(model)).take(2) {
        folder.write(&format!("{to}/{stem}.bin"), bytes);
    }
}

/// The folder of [`sample`] with its images.
pub fn sample_project(name: &str) -> Folder {
    let folder = Folder::new(name);
    write(&folder, &sample());
    write_images(&folder);
    folder
}

/// As [`write_to`], as text.
pub fn write_text(folder: &Folder, to: &str, model: &Model) {
    for (stem, text) in STEMS.iter().zip(text(model)) {
        folder.write(&format!("{to}/{stem}.txt"), text);
    }
}

pub fn write_images(folder: &Folder) {
    for (index, name) in ["a.png", "b.png", "c d.png"].iter().enumerate() {
        folder.write(&format!("images/{name}"), png(6, 4, index as u8));
    }
}
