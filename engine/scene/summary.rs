//! The contents of a scene in numbers.

use serde::Serialize;

use super::Splats;

/// Bytes of a Gaussian on the device by group, as the renderer lays them out.
const GEOMETRY_BYTES: u64 = 48;
const MOTION_BYTES: u64 = 16;
/// Spherical harmonics by band: degree 0 to 3.
const BAND_BYTES: [u64; 4] = [16, 48, 64, 96];

/// What a scene holds (the output of `ivv inspect`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub n: usize,
    pub n_static: usize,
    pub n_dynamic: usize,
    /// Gaussians with a parameter that is not finite; the renderer culls them.
    pub n_non_finite: usize,
    /// The highest degree of any Gaussian, 0 to 3.
    pub sh_degree: u32,
    pub static_by_degree: [usize; 4],
    pub dynamic_by_degree: [usize; 4],
    /// 4 for each number that is modelled: 14 of a static Gaussian of degree 0 (SPEC 2), 5 more of a dynamic one, 9, 15 and 21 of the
    /// bands above.
    pub parameter_bytes: u64,
    /// Only this project's PLY has it.
    pub ply_bytes_per_gaussian: u64,
    /// Without the header.
    pub ply_bytes: u64,
    pub device: DeviceBytes,
    /// Around the positions that are finite; none when there is no such position.
    pub bounds: Option<Bounds>,
    /// Base opacity, sigmoid of the logit.
    pub opacity: Option<Quantiles>,
    /// Standard deviations along all axes, scene units.
    pub scale: Option<Quantiles>,
    /// First and last time of peak visibility of the dynamic Gaussians, normalised.
    pub time_range: Option<[f32; 2]>,
}

/// Bytes on the device, by parameter group.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBytes {
    pub geometry: u64,
    pub motion: u64,
    /// By band up to the scene's degree.
    pub sh_bands: Vec<u64>,
    pub total: u64,
}

/// [`Quantiles`] of positions by axis, scene units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    pub min: [f32; 3],
    pub p01: [f32; 3],
    pub p99: [f32; 3],
    pub max: [f32; 3],
}

/// Quantiles of the finite values of a quantity (nearest rank).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    pub min: f32,
    pub p01: f32,
    pub p25: f32,
    pub p50: f32,
    pub p75: f32,
    pub p99: f32,
    pub max: f32,
}

impl Quantiles {
    fn of(values: impl Iterator<Item = f32>) -> Option<Self> {
        let mut sorted: Vec<f32> = values.filter(|v| v.is_finite()).collect();
        sorted.sort_by(f32::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let at = |fraction: f64| sorted[(fraction * last as f64).round() as usize];
        let [min, p01, p25, p50, p75, p99, max] = [0.0, 0.01, 0.25, 0.5, 0.75, 0.99, 1.0].map(at);
        Some(Quantiles { min, p01, p25, p50, p75, p99, max })
    }
}

impl Splats {
    #[doc(hidden)]
    pub fn summary(&self) -> Summary {
        let (n, n_dynamic) = (self.len() as u64, self.motion.len() as u64);
        // Position, normal, opacity, scale, rotation; velocity, time of peak visibility and tau when it is dynamic; its span.
        let of_time = if n_dynamic > 0 { 5 } else { 0 } + if self.span.is_empty() { 0 } else { 2 };
        let floats = 14 + 3 * self.n_coefficients() as u64 + of_time;
        let mut by_degree = [[0usize; 4]; 2];
        (0..self.len()).for_each(|i| by_degree[usize::from(i >= self.n_static)][self.degree_of(i)] += 1);
        let with_band = |band: usize| by_degree.iter().flat_map(|counts| &counts[band..]).sum::<usize>() as u64;
        let sh_bands: Vec<u64> = (0..=self.sh_degree as usize).map(|band| BAND_BYTES[band] * with_band(band)).collect();
        let numbers = 14 * n + 5 * n_dynamic + 9 * with_band(1) + 15 * with_band(2) + 21 * with_band(3);
        let (geometry, motion) = (GEOMETRY_BYTES * n, MOTION_BYTES * n_dynamic);
        let total = geometry + motion + sh_bands.iter().sum::<u64>();
        let times = Quantiles::of(self.motion.iter().map(|m| m.t_center));
        Summary {
            n: self.len(),
            n_static: self.n_static,
            n_dynamic: self.motion.len(),
            n_non_finite: (0..self.len()).filter(|&i| !self.is_finite(i)).count(),
            sh_degree: self.sh_degree,
            static_by_degree: by_degree[0],
            dynamic_by_degree: by_degree[1],
            parameter_bytes: 4 * numbers,
            ply_bytes_per_gaussian: 4 * floats,
            ply_bytes: 4 * floats * n,
            device: DeviceBytes { geometry, motion, sh_bands, total },
            bounds: self.bounds(),
            opacity: Quantiles::of(self.opacity.iter().map(|&o| 1.0 / (1.0 + (-o).exp()))),
            scale: Quantiles::of(self.scale.as_flattened().iter().map(|s| s.exp())),
            time_range: times.map(|times| [times.min, times.max]),
        }
    }

    fn bounds(&self) -> Option<Bounds> {
        let finite = || self.position.iter().filter(|p| p.iter().all(|v| v.is_finite()));
        let [x, y, z] = [0, 1, 2].map(|axis: usize| Quantiles::of(finite().map(|p| p[axis])));
        let axes = [x?, y?, z?];
        let each = |of: fn(Quantiles) -> f32| axes.map(of);
        Some(Bounds { min: each(|q| q.min), p01: each(|q| q.p01), p99: each(|q| q.p99), max: each(|q| q.max) })
    }

    /// True if every parameter of Gaussian `i` is finite; a tau of +infinity counts as finite.
    pub(crate) fn is_finite(&self, i: usize) -> bool {
        let k = self.n_coefficients();
        let motion = i.checked_sub(self.n_static).map(|dynamic| &self.motion[dynamic]);
        let moves = motion.is_none_or(|m| {
            let tau = m.t_scale.is_finite() || m.t_scale == f32::INFINITY;
            m.velocity.iter().all(|v| v.is_finite()) && m.t_center.is_finite() && tau
        });
        let vectors = [&self.position[i], &self.scale[i]].into_iter().chain(&self.sh[i * k..(i + 1) * k]);
        moves
            && self.opacity[i].is_finite()
            && self.rotation[i].iter().all(|v| v.is_finite())
            && vectors.flatten().all(|v| v.is_finite())
    }
}
