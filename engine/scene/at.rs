//! A dynamic scene at one time, as a static one.

use super::Splats;

impl Splats {
    /// The scene at normalised time `time` (SPEC 2) as static Gaussians, without those less opaque than `min_opacity` then: with the
    /// alpha_min of a rendering, that changes no picture. Rows keep their order and are numbered anew.
    pub fn at(&self, time: f64, min_opacity: f32) -> Splats {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&i| self.source_row[i]);
        let k = self.n_coefficients();
        let mut still = Splats::new(self.sh_degree);
        for i in order {
            let motion = i.checked_sub(self.n_static).map(|dynamic| &self.motion[dynamic]);
            let (mut position, mut x2) = (self.position[i], 0.0);
            if let Some(motion) = motion {
                let past = time - f64::from(motion.t_center);
                let moved = |k: usize| f64::from(position[k]) + f64::from(motion.velocity[k]) * past;
                position = std::array::from_fn(|k| moved(k) as f32);
                x2 = (past / f64::from(motion.t_scale).exp()).powi(2);
            }
            let (opacity, logit) = faded(f64::from(self.opacity[i]), x2);
            // Written so that NaN is left out too.
            if !(self.is_there(i, time) && opacity >= f64::from(min_opacity) && (logit as f32).is_finite()) {
                continue;
            }
            still.source_row.push(still.len() as u32);
            still.position.push(position);
            still.rotation.push(self.rotation[i]);
            still.scale.push(self.scale[i]);
            still.opacity.push(logit as f32);
            still.sh.extend_from_slice(&self.sh[i * k..(i + 1) * k]);
        }
        still.n_static = still.len();
        still
    }
}

/// Opacity and its logit of sigmoid(logit) exp(-x2), without cancellation near 0 and 1.
fn faded(logit: f64, x2: f64) -> (f64, f64) {
    let sigmoid = |o: f64| 1.0 / (1.0 + (-o).exp());
    let opacity = sigmoid(logit) * (-x2).exp();
    if x2 == 0.0 {
        return (opacity, logit);
    }
    let rest = sigmoid(-logit) - sigmoid(logit) * (-x2).exp_m1();
    (opacity, -(-logit).exp().ln_1p() - x2 - rest.ln())
}
