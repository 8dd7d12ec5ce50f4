//! Learning rates over a run, on the host in f64.

use super::config::Config;
use crate::stage::Rates;

/// The rates of step `step` (from 1) of `total` for a scene of `extent`; past the end they go on as they were.
pub fn rates(config: &Config, step: u64, total: u64, extent: f64) -> Rates {
    let done = (step.saturating_sub(1)) as f64 / total.max(1) as f64;
    let lr = &config.lr;
    let pace = lr.pace.at(done, total);
    // SPEC 6: the degree grows by one every thirtieth of the run.
    let degree = ((30.0 * done) as usize).min(config.sh_degree as usize);
    let sh = std::array::from_fn(|band| match band {
        0 => pace * lr.sh0.at(done),
        band if band <= degree => pace * lr.sh_rest.at(done),
        _ => 0.0,
    });
    Rates {
        // That of positions falls by itself.
        position: lr.pace.at(0.0, total) * lr.position.at(done) * extent,
        opacity: pace * lr.opacity.at(done),
        rotation: pace * lr.rotation.at(done),
        scale: pace * lr.scale.at(done),
        t_scale: lr.t_scale.at(done),
        velocity: lr.velocity.at(done),
        t_center: lr.t_center.at(done),
        sh,
    }
}
