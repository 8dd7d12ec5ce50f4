//! A few key frames placed among the cameras of the one before them.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::motion::back;
use super::{MATCHED, Placed, Tracked, picture};
use crate::error::Result;
use crate::files::make_folder;
use crate::prepare::colmap::{Colmap, OFF, ON};
use crate::prepare::model::{self, ModelCamera};
use crate::prepare::settings::PrepareSettings;
use crate::scene::Pose;
use crate::scene::undistort::Lens;

/// Pictures are searched for features in this size at most, and for so many: the time to match two grows with their square.
const MAX_SIDE: &str = "1600";
const MAX_FEATURES: &str = "4096";
/// Pixels by which a feature may miss the still scene, per pixel of the longer side, and at least. COLMAP's 4 would include moving things.
const MISS: f64 = 1.0 / 640.0;
const LEAST_MISS: f64 = 1.0;

pub(super) struct Block<'a> {
    pub settings: &'a PrepareSettings,
    pub project: &'a Path,
    pub pictures: &'a Path,
    pub cameras: &'a [Tracked],
    /// Where the poses are known.
    pub old: usize,
    /// Where they are to be found, in the order of time.
    pub new: &'a [usize],
    pub held: &'a Placed,
}

impl Block<'_> {
    pub fn place(&self) -> Result<Vec<Vec<Option<Pose>>>> {
        let work = self.project.join("block");
        let _ = fs::remove_dir_all(&work);
        make_folder(&work)?;
        let (input, points, found) = (work.join("model"), work.join("points"), work.join("found"));
        make_folder(&points)?;
        make_folder(&found)?;
        let colmap = Colmap {
            about: &self.settings.source,
            folder: std::path::absolute(self.pictures).unwrap_or(self.pictures.to_owned()),
            database: work.join("database.db"),
            threads: self.settings.threads.max(1).to_string(),
            on_gpu: OFF,
        };
        let names: Vec<Vec<String>> =
            (0..self.cameras.len()).map(|camera| self.keys().map(|key| picture(camera, key)).collect()).collect();
        // A camera of the database for each of the rig, in their order, so that its number there is the model's.
        let images: Vec<(Lens, Vec<&str>)> = self
            .cameras
            .iter()
            .zip(&names)
            .map(|(camera, names)| (camera.lens, names.iter().map(String::as_str).collect()))
            .collect();
        let few = [
            ("--SiftExtraction.max_image_size", OsStr::new(MAX_SIDE)),
            ("--SiftExtraction.max_num_features", OsStr::new(MAX_FEATURES)),
        ];
        colmap.extract(&images, &work, &few)?;
        colmap.match_pairs(&self.pairs(&names), &work, &[])?;
        let known = |(index, lens): (usize, Lens)| ModelCamera {
            id: index as u32 + 1,
            lens,
            images: vec![(names[index][0].clone(), self.held.poses[index])],
        };
        let lenses = self.cameras.iter().map(|camera| camera.lens);
        model::write(&input, &lenses.enumerate().map(known).collect::<Vec<_>>(), &[])?;
        let miss = self.miss();
        let near = [
            ("--Mapper.filter_max_reproj_error", OsStr::new(&miss)),
            ("--Mapper.tri_merge_max_reproj_error", OsStr::new(&miss)),
            ("--Mapper.tri_complete_max_reproj_error", OsStr::new(&miss)),
        ];
        if !colmap.triangulate(&input, &points, &near)? {
            return Ok(vec![vec![None; names.len()]; self.new.len()]);
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
        self.read(&found, &names)
    }

    fn keys(&self) -> impl Iterator<Item = usize> {
        std::iter::once(self.old).chain(self.new.iter().copied())
    }

    /// Cameras with each other within a frame, and each with itself over time.
    fn pairs(&self, names: &[Vec<String>]) -> String {
        let mut text = String::new();
        let within = MATCHED.pairs(&self.held.poses);
        // Writing to a string cannot fail.
        for (a, b) in within {
            for (one, other) in names[a].iter().zip(&names[b]) {
                let _ = writeln!(text, "{one} {other}");
            }
        }
        for names in names {
            for (earlier, name) in names.iter().enumerate() {
                names[earlier + 1..].iter().for_each(|later| {
                    let _ = writeln!(text, "{name} {later}");
                });
            }
        }
        text
    }

    fn miss(&self) -> String {
        let sizes = self.cameras.iter().map(|camera| camera.lens.intrinsics);
        let side = sizes.map(|size| size.width.max(size.height)).max().unwrap_or(0);
        (MISS * f64::from(side)).max(LEAST_MISS).to_string()
    }

    /// The found poses, in the scale and place of the known ones.
    fn read(&self, found: &Path, names: &[Vec<String>]) -> Result<Vec<Vec<Option<Pose>>>> {
        let model = model::read(found)?;
        let poses: HashMap<&str, Pose> =
            model.iter().filter_map(|image| Some((image.name.to_str()?, image.pose))).collect();
        let pose = |camera: usize, key: usize| poses.get(names[camera][key].as_str()).copied();
        let held = (0..names.len()).filter_map(|camera| Some((self.held.poses[camera], pose(camera, 0)?)));
        let (before, now): (Vec<Pose>, Vec<Pose>) = held.unzip();
        let back = back(&before, &now);
        let of_key = |key: usize| (0..names.len()).map(|camera| pose(camera, key).map(|pose| back(&pose))).collect();
        Ok((1..=self.new.len()).map(of_key).collect())
    }
}
