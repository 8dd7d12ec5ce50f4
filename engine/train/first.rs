//! The first Gaussians, as the settings of a run ask for them.

use super::config::Config;
use super::density::most_first;
use crate::error::Result;
use crate::recon::{self, Initial, Settings};
use crate::scene::Splats;
use crate::scene::capture::{Capture, Point};

impl Config {
    fn recon(&self) -> Settings {
        Settings {
            init: self.init,
            seed: self.seed,
            sh_degree: self.sh_degree,
            trains_static: !self.holds_static,
            n_points: self.init_points,
            most: most_first(self),
            static_tau: self.init_static_tau,
        }
    }
}

/// Makes the first Gaussians of `capture`, which is in the frame of training. `progress` is called as (pieces done,
/// pieces in all).
///
/// # Errors
/// [`crate::Error::Data`] when the capture lacks what `config.init` asks for, or when an image does not decode.
#[tracing::instrument(level = "info", name = "initialise", skip_all)]
pub fn initialise(capture: &Capture, config: &Config, progress: &mut dyn FnMut(usize, usize)) -> Result<Initial> {
    recon::initialise(capture, &config.recon(), progress)
}

/// As [`initialise`], from a capture in its own world to Gaussians there.
///
/// # Errors
/// As [`initialise`].
pub fn first_gaussians(capture: &Capture, config: &Config, progress: &mut dyn FnMut(usize, usize)) -> Result<Initial> {
    let world = capture.normalisation();
    let initial = initialise(&capture.clone().transformed(&world), config, progress)?;
    Ok(Initial { splats: world.inverse().splats(&initial.splats), ..initial })
}

/// One isotropic Gaussian per point: its size from the mean distance to the 3 nearest neighbours, opacity 0.1, colour
/// of degree 0. In a clip of several frames all are dynamic, at rest, and visible throughout.
pub fn from_points(points: &[Point], capture: &Capture, config: &Config) -> Splats {
    recon::from_points(points, capture, config.sh_degree)
}

/// Grey points, uniform in the space that the capture's cameras share if most look at the space between them, else in
/// the ball around them.
pub fn random_points(capture: &Capture, config: &Config) -> Vec<Point> {
    recon::random_points(capture, config.init_points, config.seed)
}
