//! Gradients on the host, in the order and the shapes of the scene's parameters.

use crate::scene::{Motion, Splats};

/// Gradients of sum(cotangent * output), in the units of the file (SPEC 2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// By parameter, in the scene's order: each field holds the gradient of the parameter that it names.
    pub params: Splats,
    /// Of the camera's time offset, per frame.
    pub time_offset: f64,
    /// Gaussians whose gradient was not finite and is given as zero.
    pub n_bad: u32,
}

impl Gradients {
    /// Adds the gradients of one strip, for a frame step of `dt`.
    pub(super) fn add(&mut self, strip: Splats, n_bad: u32, dt: f64) {
        // A later camera clock and an earlier t_center are the same to a Gaussian.
        self.time_offset -= strip.motion.iter().map(|m| f64::from(m.t_center)).sum::<f64>() * dt;
        self.n_bad += n_bad;
        if self.params.is_empty() {
            self.params = strip;
            return;
        }
        let sum = &mut self.params;
        add(sum.position.as_flattened_mut(), strip.position.as_flattened());
        add(sum.rotation.as_flattened_mut(), strip.rotation.as_flattened());
        add(sum.scale.as_flattened_mut(), strip.scale.as_flattened());
        add(&mut sum.opacity, &strip.opacity);
        add(sum.sh.as_flattened_mut(), strip.sh.as_flattened());
        let motion: &mut [f32] = bytemuck::cast_slice_mut(&mut sum.motion);
        add(motion, bytemuck::cast_slice(&strip.motion));
    }

    /// The temporal gradients of Gaussian `i`; zero for a static one, which has none.
    pub fn motion(&self, i: usize) -> Motion {
        let none = Motion { velocity: [0.0; 3], t_center: 0.0, t_scale: 0.0 };
        i.checked_sub(self.params.n_static).and_then(|at| self.params.motion.get(at)).copied().unwrap_or(none)
    }
}

fn add(sum: &mut [f32], x: &[f32]) {
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
}
