//! The first Gaussians, as the settings of a run ask for them.

use super::Config;
use super::density::most_first;
use crate::error::Result;
use crate::recon::{self, Initial, Progress, Settings};
use crate::scene::Splats;
use crate::scene::capture::{Capture, Point};

/// Makes the first Gaussians of `capture`, which is in the frame of training.
#[tracing::instrument(level = "info", name = "initialise", skip_all)]
pub fn initialise(capture: &Capture, config: &Config, progress: &mut Progress) -> Result<Initial> {
    let settings = Settings {
        init: config.init,
        seed: config.seed,
        sh_degree: config.sh_degree,
        trains_static: !config.holds_static,
        n_points: config.init_points,
        most: most_first(config),
        static_tau: config.init_static_tau,
    };
    recon::initialise(capture, &settings, progress)
}

/// As [`initialise`], from a capture in its own world to Gaussians there.
pub fn first_gaussians(capture: &Capture, config: &Config, progress: &mut Progress) -> Result<Initial> {
    let world = capture.normalisation();
    let initial = initialise(&capture.clone().transformed(&world), config, progress)?;
    Ok(Initial { splats: world.inverse().splats(&initial.splats), ..initial })
}

pub fn from_points(points: &[Point], capture: &Capture, config: &Config) -> Splats {
    recon::from_points(points, capture, config.sh_degree)
}

pub fn random_points(capture: &Capture, config: &Config) -> Vec<Point> {
    recon::random_points(capture, config.init_points, config.seed)
}
