//! What a scene holds, in numbers.

use serde::Serialize;

use super::splats::Splats;

/// Bytes of a Gaussian on the device by group, as the renderer lays them out.
const GEOMETRY_BYTES: u64 = 48;
const MOTION_BYTES: u64 = 16;
/// Spherical harmonics by band: degree 0 to 3.
const BAND_BYTES: [u64; 4] = [16, 48, 64, 96];

/// What a scene holds (the output of `ivv inspect`).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Gaussians in all.
    pub n: usize,
    /// Gaussians that neither move nor fade.
    pub n_static: usize,
    /// Gaussians with temporal parameters.
    pub n_dynamic: usize,
    /// Gaussians with a parameter that is not finite; the renderer culls them.
    pub n_non_finite: usize,
    /// Degree of the spherical harmonics, 0 to 3: the highest of any Gaussian.
    pub sh_degree: u32,
    /// Static Gaussians by SH degree, 0 to 3.
    pub static_by_degree: [usize; 4],
    /// Dynamic Gaussians by SH degree, 0 to 3.
    pub dynamic_by_degree: [usize; 4],
    /// Bytes of the numbers that are modelled, 4 each: 14 of a static Gaussian of degree 0 (SPEC 2), 5 more of a dynamic
    /// one, 9, 15 and 21 of the bands above.
    pub parameter_bytes: u64,
    /// Bytes of a row in this project's PLY.
    pub ply_bytes_per_gaussian: u64,
    /// Bytes of all rows in this project's PLY, without the header.
    pub ply_bytes: u64,
    /// Bytes on the device.
    pub device: DeviceBytes,
    /// Box around the positions that are finite; none when there is no such position.
    pub bounds: Option<Bounds>,
    /// Base opacity, sigmoid of the logit, in [0, 1].
    pub opacity: Option<Quantiles>,
    /// Standard deviations along all axes, scene units.
    pub scale: Option<Quantiles>,
    /// Times of peak visibility of the dynamic Gaussians, normalised: (first, last).
    pub time_range: Option<[f32; 2]>,
}

/// Bytes on the device, by parameter group.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeviceBytes {
    /// Position, rotation, scale and opacity: three vectors of four floats.
    pub geometry: u64,
    /// Velocity, time of peak visibility and tau of the dynamic Gaussians.
    pub motion: u64,
    /// Spherical harmonics, by band up to the scene's degree.
    pub sh_bands: Vec<u64>,
    /// Sum of the above.
    pub total: u64,
}

/// A box around positions, world, scene units. Each axis on its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: [f32; 3],
    /// Coordinates below which 1 % of the Gaussians lie.
    pub p01: [f32; 3],
    /// Coordinates below which 99 % of the Gaussians lie.
    pub p99: [f32; 3],
    /// Largest coordinates.
    pub max: [f32; 3],
}

/// Quantiles of the finite values of a quantity (nearest rank).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// Smallest.
    pub min: f32,
    /// 1 %.
    pub p01: f32,
    /// A quarter.
    pub p25: f32,
    /// The median.
    pub p50: f32,
    /// Three quarters.
    pub p75: f32,
    /// 99 %.
    pub p99: f32,
    /// Largest.
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
    /// Counts, sizes and distributions of the scene.
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
        Some(Bounds {
            min: axes.map(|q| q.min),
            p01: axes.map(|q| q.p01),
            p99: axes.map(|q| q.p99),
            max: axes.map(|q| q.max),
        })
    }

    /// Whether every parameter of Gaussian `i` is finite; a tau of +infinity counts as finite.
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
