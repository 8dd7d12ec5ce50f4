//! COLMAP at work on pictures whose lenses are known: features, matches of chosen pairs, points from known poses.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use super::model;
use super::program::COLMAP;
use crate::error::Result;
use crate::files::write_atomic;
use crate::scene::Pose;
use crate::scene::undistort::Lens;

pub(super) const ON: &str = "1";
pub(super) const OFF: &str = "0";

pub(super) type Arguments<'a> = [(&'a str, &'a OsStr)];

/// Options and their names in newer versions: the last one since COLMAP 3.12, the others since 3.13.
const RENAMED: [(&str, &str); 7] = [
    ("--SiftExtraction.use_gpu", "--FeatureExtraction.use_gpu"),
    ("--SiftExtraction.num_threads", "--FeatureExtraction.num_threads"),
    ("--SiftExtraction.max_image_size", "--FeatureExtraction.max_image_size"),
    ("--SiftMatching.use_gpu", "--FeatureMatching.use_gpu"),
    ("--SiftMatching.num_threads", "--FeatureMatching.num_threads"),
    ("--SiftMatching.guided_matching", "--FeatureMatching.guided_matching"),
    ("--Mapper.fix_existing_images", "--Mapper.fix_existing_frames"),
];

fn unknown_option(fault: &str, arguments: &Arguments) -> Option<(usize, &'static str)> {
    let (old, new) = RENAMED.into_iter().find(|(old, _)| fault.contains(&format!("'{old}'")))?;
    let place = arguments.iter().position(|(name, _)| *name == old)?;
    Some((place, new))
}

pub(super) struct Colmap<'a> {
    pub about: &'a Path,
    pub folder: PathBuf,
    pub database: PathBuf,
    pub threads: String,
    pub on_gpu: &'static str,
}

impl Colmap<'_> {
    /// Runs a command on the database: its output, and the result; `hear` gets each line. Where COLMAP does not know one option, it
    /// runs again with the newer name.
    pub fn attempt(
        &self,
        verb: &str,
        arguments: &Arguments,
        hear: &mut dyn FnMut(&str),
    ) -> Result<(Vec<u8>, Result<()>)> {
        let mut arguments = [&[("--database_path", self.database.as_os_str())], arguments].concat();
        loop {
            let pairs = arguments.iter().flat_map(|(name, value)| [OsStr::new(name), value]);
            let words: Vec<&OsStr> = std::iter::once(OsStr::new(verb)).chain(pairs).collect();
            let (said, outcome) = COLMAP.attempt(words, self.about, hear)?;
            let Some(renamed) = outcome.as_ref().err().and_then(|fault| unknown_option(&fault.to_string(), &arguments))
            else {
                return Ok((said, outcome));
            };
            arguments[renamed.0].0 = renamed.1;
        }
    }

    pub fn run(&self, verb: &str, arguments: &Arguments) -> Result<()> {
        self.attempt(verb, arguments, &mut |_| {})?.1
    }

    /// Features of all images, lens by lens: each lens becomes a camera of the database, numbered from 1 in this order.
    pub fn extract(&self, images: &[(Lens, Vec<&str>)], work: &Path, options: &Arguments) -> Result<()> {
        for (number, (lens, names)) in images.iter().enumerate() {
            let list = work.join(format!("images{number}.txt"));
            write_atomic(&list, |to| names.iter().try_for_each(|name| writeln!(to, "{name}")))?;
            let (kind, numbers) = model::parameters(lens);
            let numbers = model::joined(&numbers, ",");
            let arguments = [
                ("--image_path", self.folder.as_os_str()),
                ("--image_list_path", list.as_os_str()),
                ("--ImageReader.single_camera", OsStr::new(ON)),
                ("--ImageReader.camera_model", OsStr::new(kind)),
                ("--ImageReader.camera_params", OsStr::new(&numbers)),
                ("--SiftExtraction.use_gpu", OsStr::new(self.on_gpu)),
                ("--SiftExtraction.num_threads", OsStr::new(&self.threads)),
            ];
            self.run("feature_extractor", &[&arguments, options].concat())?;
        }
        Ok(())
    }

    pub fn matching(&self) -> [(&'static str, &OsStr); 2] {
        [("--SiftMatching.use_gpu", OsStr::new(self.on_gpu)), ("--SiftMatching.num_threads", OsStr::new(&self.threads))]
    }

    /// Matches pairs of images: a line each, two names without spaces. The list is written to `work`.
    pub fn match_pairs(&self, pairs: &str, work: &Path, options: &Arguments) -> Result<()> {
        let list = work.join("pairs.txt");
        write_atomic(&list, |to| to.write_all(pairs.as_bytes()))?;
        let what = [("--match_list_path", list.as_os_str()), ("--match_type", OsStr::new("pairs"))];
        self.run("matches_importer", &[&what[..], &self.matching(), options].concat())
    }

    /// Triangulates with the poses of the model in `input`; the points come to the folder `found`. False where there is no point.
    pub fn triangulate(&self, input: &Path, found: &Path, options: &Arguments) -> Result<bool> {
        let arguments = [
            ("--image_path", self.folder.as_os_str()),
            ("--input_path", input.as_os_str()),
            ("--output_path", found.as_os_str()),
            ("--clear_points", OsStr::new(ON)),
            ("--Mapper.num_threads", OsStr::new(&self.threads)),
        ];
        let (said, outcome) = self.attempt("point_triangulator", &[&arguments, options].concat(), &mut |_| {})?;
        if outcome.is_err() && found_nothing(&String::from_utf8_lossy(&said)) {
            return Ok(false);
        }
        outcome.map(|()| true)
    }
}

/// True if `point_triangulator` got as far as adjusting no point at all, which ends it with a failed check.
fn found_nothing(said: &str) -> bool {
    let mut counts = said.lines().filter_map(|line| line.trim().strip_prefix("=> Triangulated "));
    said.contains("Bundle adjustment") && counts.all(|count| count == "0 points")
}

/// Which cameras are matched with each other: up to `all` of them every pair, of more each with so many `neighbours`.
#[derive(Clone, Copy)]
pub(super) struct Matched {
    pub all: usize,
    pub neighbours: usize,
}

impl Matched {
    pub fn pairs(self, poses: &[Pose]) -> BTreeSet<(usize, usize)> {
        if poses.len() > self.all {
            return self.of_neighbours(poses);
        }
        (0..poses.len()).flat_map(|a| (a + 1..poses.len()).map(move |b| (a, b))).collect()
    }

    pub fn count(self, n: usize) -> usize {
        if n > self.all { n * self.neighbours } else { n * n.saturating_sub(1) / 2 }
    }

    /// Pairs of cameras that are likely to see the same: of each, those whose axes and centres differ least.
    fn of_neighbours(self, poses: &[Pose]) -> BTreeSet<(usize, usize)> {
        let centers: Vec<_> = poses.iter().map(Pose::center).collect();
        let distance = |a: usize, b: usize| centers[a].distance(centers[b]);
        let n = poses.len();
        let mean =
            (0..n).flat_map(|a| (0..n).map(move |b| (a, b))).map(|(a, b)| distance(a, b)).sum::<f64>() / (n * n) as f64;
        let mut pairs = BTreeSet::new();
        for a in 0..n {
            let unlike = |b: usize| {
                let cosine = poses[a].forward().dot(poses[b].forward());
                (1.0 - cosine) + distance(a, b) / mean.max(f64::MIN_POSITIVE)
            };
            let mut others: Vec<usize> = (0..n).filter(|&b| b != a).collect();
            others.sort_by(|&b, &c| unlike(b).total_cmp(&unlike(c)));
            pairs.extend(others.into_iter().take(self.neighbours).map(|b| (a.min(b), a.max(b))));
        }
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn few_cameras_are_matched_with_all_others_and_many_with_their_neighbours() {
        let matched = Matched { all: 40, neighbours: 20 };
        let row =
            |n: usize| (0..n).map(|i| Pose { translation: DVec3::X * i as f64, ..Pose::default() }).collect::<Vec<_>>();
        assert_eq!((matched.pairs(&row(40)).len(), matched.count(40)), (40 * 39 / 2, 40 * 39 / 2));
        let many = matched.pairs(&row(41));
        assert!(many.contains(&(0, 1)) && !many.contains(&(0, 40)) && many.iter().all(|(a, b)| a < b));
    }
}
