//! Gradients on the host, in the order and the shapes of the scene's parameters.

use super::backward::GroupGradients;
use super::scene::{Group, plane_of};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::scene::Splats;

/// Gradients of sum(cotangent * output) by parameter group, in the units of the file (SPEC 2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gradients {
    /// `[N][3]`.
    pub position: Vec<[f32; 3]>,
    /// `[N][4]`, (w, x, y, z).
    pub rotation: Vec<[f32; 4]>,
    /// `[N][3]`, of the logs.
    pub scale: Vec<[f32; 3]>,
    /// `[N]`, of the logits.
    pub opacity: Vec<f32>,
    /// `[N][K]`, RGB.
    pub sh: Vec<[f32; 3]>,
    /// `[N][3]`; zero for static Gaussians, which have none.
    pub velocity: Vec<[f32; 3]>,
    /// `[N]`; zero for static Gaussians.
    pub t_center: Vec<f32>,
    /// `[N]`, of log tau; zero for static Gaussians.
    pub t_scale: Vec<f32>,
    /// Of the camera's time offset, per frame.
    pub time_offset: f64,
    /// Gaussians whose gradient was not finite and is given as zero.
    pub n_bad: u32,
}

impl Gradients {
    /// Zeros in the shapes of `n` Gaussians of `n_coefficients` SH coefficients each.
    pub fn zero(n: usize, n_coefficients: usize) -> Self {
        Gradients {
            position: vec![[0.0; 3]; n],
            rotation: vec![[0.0; 4]; n],
            scale: vec![[0.0; 3]; n],
            opacity: vec![0.0; n],
            sh: vec![[0.0; 3]; n * n_coefficients],
            velocity: vec![[0.0; 3]; n],
            t_center: vec![0.0; n],
            t_scale: vec![0.0; n],
            time_offset: 0.0,
            n_bad: 0,
        }
    }

    /// Adds a group's gradients, which begin at Gaussian `start`.
    pub(super) fn add(&mut self, gpu: &Gpu, group: &Group, d: &GroupGradients, start: usize, dt: f64) -> Result<()> {
        let n = group.n as usize;
        let k = self.sh.len() / self.position.len().max(1);
        let geometry = gpu.read(&d.geometry)?;
        let sh0 = gpu.read(&d.sh0)?;
        let bands = d.bands.iter().map(|band| gpu.read(band)).collect::<Result<Vec<_>>>()?;
        let motion = d.motion.as_ref().map(|motion| gpu.read(motion)).transpose()?;
        for i in 0..n {
            let at = start + i;
            let [a, q, s] = [0, 1, 2].map(|plane| geometry[plane_of(i, 3, plane)]);
            add3(&mut self.position[at], a);
            self.opacity[at] += a[3];
            self.rotation[at].iter_mut().zip(q).for_each(|(sum, x)| *sum += x);
            add3(&mut self.scale[at], s);
            add3(&mut self.sh[at * k], sh0[i]);
            for (band, data) in bands.iter().enumerate().map(|(b, data)| (b + 1, data)) {
                let n_planes = [3, 4, 6][band - 1];
                for c in 0..2 * band + 1 {
                    let float = |f: usize| data[plane_of(i, n_planes, f / 4)][f % 4];
                    add3(
                        &mut self.sh[at * k + band * band + c],
                        [float(3 * c), float(3 * c + 1), float(3 * c + 2), 0.0],
                    );
                }
            }
            if let Some(motion) = &motion {
                add3(&mut self.velocity[at], motion[i]);
                self.t_center[at] += motion[i][3];
                self.t_scale[at] += s[3];
                // A later camera clock and an earlier t_center are the same to a Gaussian.
                self.time_offset -= f64::from(motion[i][3]) * dt;
            }
        }
        Ok(())
    }

    /// In the order of the file that `splats` was read from.
    pub fn in_file_order(&self, splats: &Splats) -> Self {
        let k = splats.n_coefficients();
        let mut out = Gradients { time_offset: self.time_offset, n_bad: self.n_bad, ..Self::zero(splats.len(), k) };
        for (i, row) in splats.source_row.iter().map(|row| *row as usize).enumerate() {
            out.position[row] = self.position[i];
            out.rotation[row] = self.rotation[i];
            out.scale[row] = self.scale[i];
            out.opacity[row] = self.opacity[i];
            out.sh[row * k..(row + 1) * k].copy_from_slice(&self.sh[i * k..(i + 1) * k]);
            out.velocity[row] = self.velocity[i];
            out.t_center[row] = self.t_center[i];
            out.t_scale[row] = self.t_scale[i];
        }
        out
    }
}

fn add3(sum: &mut [f32; 3], x: [f32; 4]) {
    sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
}
