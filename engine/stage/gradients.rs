//! Gradients on the host, in the order and the shapes of the scene's parameters.

use crate::scene::{Motion, Splats};

/// Gradients of sum(cotangent * output), in the units of the file (SPEC 2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// By parameter, in the scene's order: each field holds the gradient of the parameter that it names.
    pub params: Splats,
    /// Of the camera's time offset, per frame.
    pub time_offset: f64,
    /// Of a turn of the camera, radians about its own axes: x_camera becomes exp(turn) x_camera.
    pub camera_rotation: [f64; 3],
    /// Of a shift of the world along the camera's axes, scene units: x_camera becomes x_camera + shift.
    pub camera_translation: [f64; 3],
    /// Of the background's colour.
    pub background: [f64; 3],
    /// Gaussians whose gradient was not finite and is given as zero.
    pub n_bad: u32,
}

impl Gradients {
    /// Adds the gradients of one strip, for a frame step of `dt`.
    pub(super) fn add(&mut self, strip: Splats, camera: &[[f32; 4]], n_bad: u32, dt: f64) {
        let sums = [&mut self.camera_rotation, &mut self.camera_translation, &mut self.background];
        for (sum, part) in sums.into_iter().zip(camera) {
            sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        self.time_offset += camera.first().map_or(0.0, |turn| f64::from(turn[3])) * dt;
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
