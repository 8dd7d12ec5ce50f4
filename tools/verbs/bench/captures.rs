//! The captures of a study.

use glam::DVec3;
use ivv::internals::scene::capture::Capture;
use ivv::internals::study::{Arm, Study};
use ivv::internals::train::{CaptureSummary, Config, first_gaussians};
use std::path::{Path, PathBuf};

/// The captures by the names of their folders, which also name their runs.
pub fn named(captures: &[PathBuf]) -> anyhow::Result<Vec<(String, &Path)>> {
    let mut all: Vec<(String, &Path)> = Vec::new();
    for capture in captures {
        let path = std::path::absolute(capture)?;
        let name = path.file_name().map_or("capture".into(), |name| name.to_string_lossy()).into_owned();
        anyhow::ensure!(
            all.iter().all(|(other, _)| *other != name),
            "{}: two captures are called {name}; their runs would go to one folder; rename one",
            capture.display()
        );
        all.push((name, capture));
    }
    Ok(all)
}

/// A capture that all arms of a study train on.
pub struct StudyCapture {
    pub name: String,
    pub path: PathBuf,
    /// With its photographs, and without.
    pub summaries: [CaptureSummary; 2],
    pub peripheral: Option<String>,
    /// Most Gaussians of each arm, if all have the same budget.
    pub budget: Option<usize>,
}

impl StudyCapture {
    /// Opens the capture `path`. Its runs are named after `name`.
    pub fn new(name: &str, path: &Path, study: &Study, shared: &Config) -> anyhow::Result<Self> {
        let capture = Capture::open(path)?;
        let summaries = [CaptureSummary::new(&capture), CaptureSummary::new(&capture.clone().without_photos())];
        let untested = "expected test cameras, found none; name some in its capture.toml";
        anyhow::ensure!(summaries[0].test_images > 0, "{}: {untested}", path.display());
        let budget = if study.equal_budgets { Some(2 * largest_start(&capture, study, shared)?) } else { None };
        Ok(StudyCapture {
            name: name.to_owned(),
            path: path.to_owned(),
            summaries,
            peripheral: peripheral(&capture),
            budget,
        })
    }
}

/// The most first Gaussians of any arm of `study`.
fn largest_start(capture: &Capture, study: &Study, shared: &Config) -> anyhow::Result<usize> {
    let capture = capture.clone().transformed(&capture.normalisation());
    let start = |arm: &Arm| {
        let own = Config { max_gaussians: usize::MAX, ..study.config(shared, arm)? };
        Ok(first_gaussians(&capture, &own, &mut |_, _| {})?.splats.len())
    };
    let starts: Vec<usize> = study.arms.iter().map(start).collect::<ivv::Result<_>>()?;
    Ok(starts.into_iter().max().unwrap_or(0))
}

/// The test camera that is farthest from the centre of all cameras.
fn peripheral(capture: &Capture) -> Option<String> {
    let centers: Vec<DVec3> = capture.cameras.iter().map(|camera| camera.pose(0).center()).collect();
    let middle = centers.iter().sum::<DVec3>() / centers.len() as f64;
    let distance = |c: &DVec3| c.distance_squared(middle);
    let tests = capture.cameras.iter().zip(&centers).filter(|(camera, _)| camera.is_test);
    let farthest = tests.max_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
    farthest.map(|(camera, _)| camera.name.clone())
}
