//! Learning rates over a run, on the host in f64.

use super::Config;
use crate::stage::Rates;

/// The rate of the constant colour over that of the higher bands, as in 3DGS.
const HIGHER_BANDS: f64 = 20.0;

/// The rates of step `step` (from 1) of `total` for a scene of `extent`; past the end they stay. A step on several images
/// takes the rates of as many steps, times the square root of their number, with which the noise of gradients grows.
pub fn rates(config: &Config, step: u64, total: u64, extent: f64) -> Rates {
    let done = (step.saturating_sub(1)) as f64 / total.max(1) as f64;
    let lr = &config.lr;
    let (images, root) = (total.saturating_mul(u64::from(config.batch)), f64::from(config.batch).sqrt());
    let pace = root * lr.pace.at(done, images);
    // SPEC 6: the degree grows by one every thirtieth of the run.
    let degree = ((30.0 * done) as usize).min(config.sh_degree as usize);
    let sh = std::array::from_fn(|band| match band {
        0 => pace * lr.sh.at(done),
        band if band <= degree => pace * (lr.sh.at(done) / HIGHER_BANDS),
        _ => 0.0,
    });
    Rates {
        // That of positions falls by itself.
        position: root * lr.pace.at(0.0, images) * lr.position.at(done) * extent,
        reference_size: lr.position_size * extent,
        opacity: pace * lr.opacity.at(done),
        rotation: pace * lr.rotation.at(done),
        scale: pace * lr.scale.at(done),
        t_scale: root * lr.t_scale.at(done),
        velocity: root * lr.velocity.at(done),
        t_center: root * lr.t_center.at(done),
        sh,
    }
}
