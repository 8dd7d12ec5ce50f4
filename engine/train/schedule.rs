//! Learning rates over a run, on the host in f64.

use super::config::Config;

/// Learning rates of one step, by parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Scene units.
    pub position: f64,
    /// Of the logits.
    pub opacity: f64,
    /// Of the quaternions.
    pub rotation: f64,
    /// Of the log-scales.
    pub scale: f64,
    /// Of log tau.
    pub t_scale: f64,
    /// Scene units per unit of time.
    pub velocity: f64,
    /// Normalised time.
    pub t_center: f64,
    /// Of SH bands 0 to 3; 0 for a band that is not active yet.
    pub sh: [f64; 4],
}

/// The rates of step `step` (from 1) of `total` for a scene of `extent`.
pub fn rates(config: &Config, step: u64, total: u64, extent: f64) -> Rates {
    let done = (step.saturating_sub(1)) as f64 / total.max(1) as f64;
    let position = config.lr_position * (config.lr_position_end / config.lr_position).powf(done);
    // SPEC 6: the degree grows by one every thirtieth of the run.
    let degree = ((30.0 * done) as usize).min(config.sh_degree as usize);
    let sh = std::array::from_fn(|band| match band {
        0 => config.lr_sh0,
        band if band <= degree => config.lr_sh_rest,
        _ => 0.0,
    });
    Rates {
        position: position * extent,
        opacity: config.lr_opacity,
        rotation: config.lr_rotation,
        scale: config.lr_scale,
        t_scale: config.lr_t_scale,
        velocity: config.lr_velocity,
        t_center: config.lr_t_center,
        sh,
    }
}
