//! A few key frames placed among the cameras of the one before them.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs;
use std::ops::Range;
use std::path::Path;

use super::motion::back;
use super::{MATCHED, Track, picture};
use crate::error::Result;
use crate::files::make_folder;
use crate::prepare::colmap::{Colmap, OFF, ON};
use crate::prepare::model::{self, ModelCamera};
use crate::scene::Pose;
use crate::scene::undistort::Lens;

/// Pictures are searched for features in this size at most, and for so many: the time to match two grows with their square.
const MAX_SIDE: &str = "1600";
const MAX_FEATURES: &str = "4096";
/// Pixels by which a feature may miss the still scene, per pixel of the longer side, and at least. COLMAP's 4 would include moving things.
const MISS: f64 = 1.0 / 640.0;
const LEAST_MISS: f64 = 1.0;

impl Track<'_> {
    /// The poses that are found at the key frames `new`, among the cameras of the key frame before them, whose poses are `held`.
    pub(super) fn place(&self, new: Range<usize>, held: &[Pose]) -> Result<Vec<Vec<Option<Pose>>>> {
        let work = self.project.join("block");
        let _ = fs::remove_dir_all(&work);
        make_folder(&work)?;
        let (input, points, found) = (work.join("model"), work.join("points"), work.join("found"));
        make_folder(&points)?;
        make_folder(&found)?;
        let colmap = Colmap {
            about: &self.settings.source,
            folder: std::path::absolute(self.pictures()).unwrap_or(self.pictures()),
            database: work.join("database.db"),
            threads: self.settings.threads.max(1).to_string(),
            on_gpu: OFF,
        };
        let of_camera = |camera: usize| (new.start - 1..new.end).map(|key| picture(camera, key)).collect();
        let names: Vec<Vec<String>> = (0..self.cameras.len()).map(of_camera).collect();
        // A camera of the database for each of the rig, in their order, so that its number there is the model's.
        let images = self.cameras.iter().zip(&names);
        let images: Vec<(Lens, Vec<&str>)> =
            images.map(|(camera, names)| (camera.lens, names.iter().map(String::as_str).collect())).collect();
        let few = [
            ("--SiftExtraction.max_image_size", OsStr::new(MAX_SIDE)),
            ("--SiftExtraction.max_num_features", OsStr::new(MAX_FEATURES)),
        ];
        colmap.extract(&images, &work, &few)?;
        colmap.match_pairs(&pairs(&names, held), &work, &[])?;
        let known = |(index, lens): (usize, Lens)| ModelCamera {
            id: index as u32 + 1,
            lens,
            images: vec![(names[index][0].clone(), held[index])],
        };
        let lenses = self.cameras.iter().map(|camera| camera.lens);
        model::write(&input, &lenses.enumerate().map(known).collect::<Vec<_>>(), &[])?;
        let sizes = self.cameras.iter().map(|camera| camera.lens.intrinsics);
        let side = sizes.map(|size| size.width.max(size.height)).max().unwrap_or(0);
        let miss = (MISS * f64::from(side)).max(LEAST_MISS).to_string();
        let near = [
            ("--Mapper.filter_max_reproj_error", OsStr::new(&miss)),
            ("--Mapper.tri_merge_max_reproj_error", OsStr::new(&miss)),
            ("--Mapper.tri_complete_max_reproj_error", OsStr::new(&miss)),
        ];
        if !colmap.triangulate(&input, &points, &near)? {
            return Ok(vec![vec![None; names.len()]; new.len()]);
        }
        let place = [
            ("--image_path", colmap.folder.as_os_str()),
            // Images have the numbers of the database here: the triangulation has given them those.
            ("--input_path", points.as_os_str()),
            ("--output_path", found.as_os_str()),
            ("--Mapper.fix_existing_images", OsStr::new(ON)),
            ("--Mapper.ba_refine_focal_length", OsStr::new(OFF)),
            ("--Mapper.ba_refine_extra_params", OsStr::new(OFF)),
            ("--Mapper.multiple_models", OsStr::new(OFF)),
            ("--Mapper.extract_colors", OsStr::new(OFF)),
            ("--Mapper.num_threads", OsStr::new(&colmap.threads)),
        ];
        colmap.run("mapper", &[&place[..], &near].concat())?;
        found_poses(&found, &names, held)
    }
}

/// Cameras with each other within a frame, and each with itself over time.
fn pairs(names: &[Vec<String>], held: &[Pose]) -> String {
    let mut text = String::new();
    for (a, b) in MATCHED.pairs(held) {
        names[a].iter().zip(&names[b]).for_each(|(one, other)| text += &format!("{one} {other}\n"));
    }
    for names in names {
        for (earlier, name) in names.iter().enumerate() {
            names[earlier + 1..].iter().for_each(|later| text += &format!("{name} {later}\n"));
        }
    }
    text
}

/// By key frame after the first, the poses of the model `found`, in the scale and place of those that are `held`.
fn found_poses(found: &Path, names: &[Vec<String>], held: &[Pose]) -> Result<Vec<Vec<Option<Pose>>>> {
    let model = model::read(found)?;
    let poses: HashMap<&str, Pose> =
        model.iter().filter_map(|image| Some((image.name.to_str()?, image.pose))).collect();
    let pose = |camera: usize, key: usize| poses.get(names[camera][key].as_str()).copied();
    let known = (0..names.len()).filter_map(|camera| Some((held[camera], pose(camera, 0)?)));
    let (before, now): (Vec<Pose>, Vec<Pose>) = known.unzip();
    let back = back(&before, &now);
    let of_key = |key: usize| (0..names.len()).map(|camera| pose(camera, key).map(|pose| back(&pose))).collect();
    Ok((1..names.first().map_or(1, Vec::len)).map(of_key).collect())
}
