//! Density control over a run: when a round is due, and what the settings make of it. The round itself runs on the device
//! ([`DensityRound`]).

use super::average::Average;
use super::config::{Config, Round, Strategy};
use super::schedule::rates;
use crate::random::Keyed;
use crate::scene::capture::Extent;
use crate::stage::{Choice, DensityRound, PruneLimits, StepSettings};

/// Purposes of the random numbers of a step.
const ROUND: u64 = 1;
const NOISE: u64 = 2;
/// Share of `max_gaussians` that the first Gaussians may take. On the tiny synthetic capture with 3,000 Gaussians, 400 steps, seed 1: of 2,000
/// a run came to 18.7 dB, of 1,500 to 18.2; with every frame twice, 3,000 came to 13.8 dB, 2,000 to 18.1 and 1,500 to 18.2.
const FIRST: f64 = 2.0 / 3.0;
/// Gaussians that a round may add, however few there are: a capture may begin with few points.
const LEAST_GROWTH: f64 = 1000.0;
/// A Gaussian grows where the mean gradient of its projected centre is larger than this, half images, as in 3DGS. `density.growth` bounds
/// how many do.
const GRADIENT: f32 = 2e-4;
/// A growing Gaussian larger than this is split, a smaller one is cloned: extents, as in 3DGS.
const SPLIT_ABOVE: f32 = 0.01;
/// A Gaussian that is never more opaque than this goes, as in 3DGS.
const PRUNE_OPACITY: f32 = 0.005;
/// A Gaussian larger than this goes while others are added, extents: it reaches through the space in which the cameras are.
const PRUNE_SCALE: f32 = 0.5;
/// A Gaussian that reaches further than this share of its distance towards a lens, or towards a view between cameras, goes while others are
/// added. A share of 0.2 scored lower (`assets/lab/techniques.md`).
const PRUNE_VEIL: f32 = 0.33;
/// A reset lowers opacities to this: ten times what is pruned, so that none goes before it was seen again.
const RESET_TO: f32 = 0.05;
/// Part of the steps between two resets of the opacities in which the scene recovers from one.
const RECOVERY: f64 = 1.0 / 3.0;
/// Size of the random movement of faint Gaussians under 3DGS-MCMC, position rates. This and the two below are those of its authors.
const MCMC_NOISE: f64 = 5e5;
/// Weight of the mean opacity in its loss.
const MCMC_OPACITY: f64 = 0.01;
/// Weight of the mean size in its loss, per scene unit.
const MCMC_SCALE: f64 = 0.01;

/// The round of density control of `n` Gaussians, of which `n_trained` are trained, that is due after step `step` (from 1) of
/// `total`; `None` where none is. `origin` is that of the scene on the device.
pub fn density_round(
    config: &Config,
    (step, total): (u64, u64),
    (n, n_trained): (u32, u32),
    extent: &Extent,
    origin: [f64; 3],
    n_frames: u32,
) -> Option<DensityRound> {
    // Scenes that are averaged are of the same Gaussians.
    if step > Average::begins_after(config, total) {
        return None;
    }
    let density = &config.density;
    let due = density.due(step, total);
    let is_adc = density.strategy == Strategy::Adc;
    let is_early = (step as f64) < density.stop * total as f64;
    let resets = is_adc && is_early && step > 0 && step.is_multiple_of(density.reset_every);
    if due.is_none() && !resets {
        return None;
    }
    let radius = extent.radius as f32;
    let pulled = Choice::Pulled { gradient: GRADIENT, split_above: SPLIT_ABOVE * radius };
    let grows = due == Some(Round::Growth);
    // None grows twice in a round.
    let most = f64::from(n_trained) / f64::from(n.max(1));
    // Once none are added, removing those that are wide leaves holes: walls are large.
    let may_leave_holes = grows || resets;
    let (choice, growth) = match density.strategy {
        Strategy::Adc => {
            let least = (LEAST_GROWTH / f64::from(n.max(1))).min(most);
            (pulled, (density.growth * most).max(least))
        }
        Strategy::Mcmc if grows => (Choice::Drawn, density.growth),
        // Drawn copies need steps to come apart: late in the run the dead only go.
        Strategy::Mcmc => (pulled, 0.0),
    };
    Some(DensityRound {
        choice,
        n_frames,
        center: std::array::from_fn(|k| (extent.center[k] - origin[k]) as f32),
        extent: radius,
        limits: PruneLimits {
            opacity: PRUNE_OPACITY,
            log_scale: if is_adc && may_leave_holes { (PRUNE_SCALE * radius).ln() } else { f32::INFINITY },
            veil: if may_leave_holes { PRUNE_VEIL } else { f32::INFINITY },
        },
        opacity_ceiling: if resets { (RESET_TO / (1.0 - RESET_TO)).ln() } else { f32::MAX },
        max_gaussians: u32::try_from(config.max_gaussians).unwrap_or(u32::MAX),
        growth: if grows { growth as f32 } else { 0.0 },
        key: key(config, step, ROUND),
    })
}

/// The most Gaussians that a run begins with, of those found in its capture: where rounds clone and split, they keep room to do so.
/// Drawn copies replace others, and need none.
pub(super) fn most_first(config: &Config) -> usize {
    let grows = config.density.strategy == Strategy::Adc && config.density.stop > 0.0;
    if grows { ((config.max_gaussians as f64 * FIRST) as usize).max(1) } else { config.max_gaussians }
}

/// The most Gaussians that density control makes in a run that ends with `backdrop` more, on a device that has at most `most` in view at a
/// time: a view that sees more of a larger scene would end the run.
pub(super) fn most_gaussians(config: &Config, most: u32, backdrop: u32) -> u32 {
    let most = u32::try_from(config.max_gaussians).unwrap_or(u32::MAX).min(most);
    most - backdrop.min(most / 10)
}

/// Whether `step` of `total` follows so soon on a reset of the opacities that the scene has not recovered.
pub(super) fn recovers(config: &Config, step: u64, total: u64) -> bool {
    let density = &config.density;
    let every = density.reset_every;
    let reset = step - step.checked_rem(every).unwrap_or(step);
    density.strategy == Strategy::Adc
        && reset > 0
        && (reset as f64) < density.stop * total as f64
        && (step - reset) as f64 <= RECOVERY * every as f64
}

/// The step of `total` at which to look at the scene where `step` was meant: `step` itself, or, while the scene recovers
/// from a reset of the opacities, the first step at which it has recovered, if the run is that long. What a faded scene
/// lacks would be blamed on the cameras.
pub(super) fn recovered_from(config: &Config, step: u64, total: u64) -> u64 {
    if !recovers(config, step, total) {
        return step;
    }
    let every = config.density.reset_every;
    let recovered = step - step % every + (RECOVERY * every as f64) as u64 + 1;
    if recovered < total { recovered } else { step }
}

/// Rate and key of the noise of 3DGS-MCMC in step `step` (from 1) of `total` for a scene of `extent`; `None` without MCMC.
pub fn noise(config: &Config, step: u64, total: u64, extent: f64) -> Option<(f32, u32)> {
    let rate = rates(config, step, total, extent).position * MCMC_NOISE;
    (config.density.strategy == Strategy::Mcmc).then(|| (rate as f32, key(config, step, NOISE)))
}

/// What 3DGS-MCMC adds to the loss, so that Gaussians that are not needed fade and shrink.
pub fn regularisers(config: &Config) -> StepSettings {
    let plain = StepSettings { images: config.batch, ..StepSettings::default() };
    match config.density.strategy {
        Strategy::Adc => plain,
        Strategy::Mcmc => StepSettings { opacity_reg: MCMC_OPACITY, scale_reg: MCMC_SCALE, ..plain },
    }
}

/// Key of the device's random numbers.
fn key(config: &Config, step: u64, purpose: u64) -> u32 {
    Keyed::new(&[config.seed, step, purpose]).bits(0) as u32
}

#[cfg(test)]
mod tests {
    use super::most_gaussians;
    use crate::internals::train::config::Config;

    #[test]
    fn a_scene_grows_no_larger_than_the_settings_and_the_device_allow_with_room_for_the_end() {
        let grown = |max_gaussians: usize, most: u32, backdrop: u32| {
            most_gaussians(&Config { max_gaussians, ..Config::default() }, most, backdrop)
        };
        assert_eq!(grown(500_000, 2_097_152, 0), 500_000);
        assert_eq!(grown(500_000, 2_097_152, 1000), 499_000);
        assert_eq!(grown(5000, 2_097_152, 1000), 4500, "a tenth of them at most");
        assert_eq!(grown(3_000_000, 2_097_152, 1000), 2_096_152);
    }
}
