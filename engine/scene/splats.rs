//! Gaussians on the host.

use std::borrow::Cow;
use std::path::Path;

use crate::error::{Error, Result};

/// Y_0 of the real spherical harmonics, 1 / (2 sqrt(pi)): a colour is `0.5 + SH_C0 * f_dc`.
pub const SH_C0: f64 = 0.282_094_791_773_878_14;

/// The span of a Gaussian that is always there.
pub const ALWAYS: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

/// The degree-0 coefficient of a colour in [0, 1].
pub(crate) fn dc_of_color(color: f64) -> f32 {
    ((color - 0.5) / SH_C0) as f32
}

/// The temporal parameters of one dynamic Gaussian (SPEC 2).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Motion {
    /// Scene units per unit of normalised time.
    pub velocity: [f32; 3],
    /// Normalised time of peak visibility.
    pub t_center: f32,
    /// Log of tau, tau in normalised time.
    pub t_scale: f32,
}

/// A scene's Gaussians in raw parameters (SPEC 2), static ones first. A static Gaussian has no [`Motion`]: `motion[i]` belongs to Gaussian
/// `n_static + i`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Gaussians `0..n_static` are static, the rest dynamic.
    pub n_static: usize,
    /// Degree of the spherical harmonics, 0 to 3: the highest that a Gaussian may have.
    pub sh_degree: u32,
    /// Degree of each Gaussian, falling within each population; coefficients above it are 0. Empty where all have `sh_degree`.
    pub degree: Vec<u8>,
    /// Centres at the temporal centre, world, scene units.
    pub position: Vec<[f32; 3]>,
    /// Quaternions (w, x, y, z), not necessarily of unit length.
    pub rotation: Vec<[f32; 4]>,
    /// Logs of the standard deviations, scene units.
    pub scale: Vec<[f32; 3]>,
    /// Logits of the base opacity.
    pub opacity: Vec<f32>,
    /// Spherical harmonics, `[Gaussian][coefficient]` with `(sh_degree + 1)^2` coefficients each, RGB.
    pub sh: Vec<[f32; 3]>,
    /// Temporal parameters of the dynamic Gaussians.
    pub motion: Vec<Motion>,
    /// Start (included) and end (excluded) of the time in which each dynamic Gaussian exists, normalised. Empty where all always exist;
    /// joined segments of a long clip replace each other by it.
    pub span: Vec<[f32; 2]>,
    /// Row of the file that each Gaussian came from, for writers.
    pub source_row: Vec<u32>,
}

impl Splats {
    /// A scene without Gaussians.
    pub fn new(sh_degree: u32) -> Self {
        Splats { sh_degree, ..Splats::default() }
    }

    /// As many Gaussians of the same degrees, all of whose numbers are 0.
    #[must_use]
    pub(crate) fn zeros(&self) -> Self {
        let mut zeros = self.clone();
        zeros.position.fill([0.0; 3]);
        zeros.rotation.fill([0.0; 4]);
        zeros.scale.fill([0.0; 3]);
        zeros.opacity.fill(0.0);
        zeros.sh.fill([0.0; 3]);
        zeros.motion.fill(bytemuck::Zeroable::zeroed());
        zeros
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// True if there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// Coefficients per Gaussian and colour channel, `(sh_degree + 1)^2`.
    pub fn n_coefficients(&self) -> usize {
        let side = self.sh_degree as usize + 1;
        side * side
    }

    /// Degree of Gaussian `i`.
    pub fn degree_of(&self, i: usize) -> usize {
        self.degree.get(i).map_or(self.sh_degree as usize, |degree| usize::from(*degree))
    }

    /// True if Gaussian `i` exists at normalised time `time`, however faint.
    pub fn is_there(&self, i: usize, time: f64) -> bool {
        let span = i.checked_sub(self.n_static).and_then(|at| self.span.get(at));
        span.is_none_or(|[from, to]| f64::from(*from) <= time && time < f64::from(*to))
    }

    /// exp(-u^2) of Gaussian `i` at normalised time `time` (SPEC 2); 1 for a static one, and 0 where it is not there.
    pub fn weight_at(&self, i: usize, time: f64) -> f64 {
        if !self.is_there(i, time) {
            return 0.0;
        }
        let motion = i.checked_sub(self.n_static).and_then(|at| self.motion.get(at));
        motion.map_or(1.0, |m| (-((time - f64::from(m.t_center)) / f64::from(m.t_scale).exp()).powi(2)).exp())
    }

    /// The same Gaussians on another clock, on which time t is `scale t + shift`.
    #[must_use]
    pub fn on_clock(mut self, scale: f64, shift: f64) -> Self {
        for Motion { velocity, t_center, t_scale } in &mut self.motion {
            *velocity = velocity.map(|v| (f64::from(v) / scale) as f32);
            *t_center = (f64::from(*t_center) * scale + shift) as f32;
            *t_scale = (f64::from(*t_scale) + scale.ln()) as f32;
        }
        for time in self.span.as_flattened_mut() {
            *time = (f64::from(*time) * scale + shift) as f32;
        }
        self
    }

    /// The mean of [`Splats::weight_at`] over the clip, from eight times.
    #[doc(hidden)]
    pub fn mean_weight(&self, i: usize) -> f64 {
        (0..8).map(|k| self.weight_at(i, (f64::from(k) + 0.5) / 8.0)).sum::<f64>() / 8.0
    }

    /// Checks that every array fits `len()`, `n_static` and `sh_degree`, and that degrees are in order and at most `sh_degree`.
    ///
    /// # Errors
    /// A sentence that names the array, its length and the one it should have.
    pub fn check(&self) -> std::result::Result<(), String> {
        let n = self.len();
        if self.sh_degree > 3 {
            return Err(format!("sh_degree is {}, at most 3 is supported", self.sh_degree));
        }
        let Some(n_dynamic) = n.checked_sub(self.n_static) else {
            return Err(format!("n_static is {}, there are {n} Gaussians", self.n_static));
        };
        let lengths = [
            ("rotation", self.rotation.len(), n),
            ("scale", self.scale.len(), n),
            ("opacity", self.opacity.len(), n),
            ("sh", self.sh.len(), n * self.n_coefficients()),
            ("motion", self.motion.len(), n_dynamic),
            ("source_row", self.source_row.len(), n),
        ];
        if let Some((name, length, expected)) = lengths.iter().find(|(_, length, expected)| length != expected) {
            return Err(format!("{name} has {length} entries, it should have {expected}"));
        }
        if !self.span.is_empty() && self.span.len() != n_dynamic {
            return Err(format!("span has {} entries, it should have {n_dynamic} or none", self.span.len()));
        }
        if self.degree.is_empty() {
            return Ok(());
        }
        if self.degree.len() != n {
            return Err(format!("degree has {} entries, it should have {n} or none", self.degree.len()));
        }
        let (still, moving) = self.degree.split_at(self.n_static);
        let falls = |degrees: &[u8]| degrees.is_sorted_by(|a, b| a >= b);
        if !falls(still) || !falls(moving) || self.degree.iter().any(|degree| u32::from(*degree) > self.sh_degree) {
            return Err(format!("degrees are not falling from {} within each population", self.sh_degree));
        }
        Ok(())
    }

    /// Gives each Gaussian the degree of its highest band that is not 0, and orders them by population and falling degree, otherwise as
    /// they were.
    #[must_use]
    pub fn by_degree(self) -> Splats {
        let k = self.n_coefficients();
        let band = |c: usize| c.isqrt() as u8;
        let last = |sh: &[[f32; 3]]| sh.iter().rposition(|coefficient| *coefficient != [0.0; 3]);
        let degree: Vec<u8> = self.sh.chunks_exact(k).map(|sh| last(sh).map_or(0, band)).collect();
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_by_key(|&i| (i >= self.n_static, std::cmp::Reverse(degree[i])));
        Splats { degree, ..self }.in_order(&order)
    }

    /// The Gaussians that `order` names, in that order; static ones must come first and degrees must fall.
    #[must_use]
    #[doc(hidden)]
    pub fn in_order(&self, order: &[usize]) -> Splats {
        let k = self.n_coefficients();
        let dynamic = || order.iter().filter_map(|&i| i.checked_sub(self.n_static));
        Splats {
            n_static: order.iter().filter(|&&i| i < self.n_static).count(),
            sh_degree: self.sh_degree,
            degree: if self.degree.is_empty() { Vec::new() } else { order.iter().map(|&i| self.degree[i]).collect() },
            position: order.iter().map(|&i| self.position[i]).collect(),
            rotation: order.iter().map(|&i| self.rotation[i]).collect(),
            scale: order.iter().map(|&i| self.scale[i]).collect(),
            opacity: order.iter().map(|&i| self.opacity[i]).collect(),
            sh: order.iter().flat_map(|&i| self.sh[i * k..(i + 1) * k].iter().copied()).collect(),
            motion: dynamic().map(|at| self.motion[at]).collect(),
            span: if self.span.is_empty() { Vec::new() } else { dynamic().map(|at| self.span[at]).collect() },
            source_row: order.iter().map(|&i| self.source_row[i]).collect(),
        }
    }

    /// The Gaussians of which `keep` is true, by index.
    pub(crate) fn kept(&self, keep: impl Fn(usize) -> bool) -> Cow<'_, Splats> {
        let kept: Vec<usize> = (0..self.len()).filter(|&i| keep(i)).collect();
        if kept.len() == self.len() {
            return Cow::Borrowed(self);
        }
        Cow::Owned(self.in_order(&kept))
    }

    /// Refuses Gaussians that do not always exist, for the sake of `what`, which does not know spans.
    pub(crate) fn refuse_spans(&self, path: &Path, what: &str, remedy: &str) -> Result<()> {
        let n = self.span.iter().filter(|span| **span != ALWAYS).count();
        let reason = || format!("{n} Gaussians appear or disappear at once, which {what} cannot tell");
        if n == 0 { Ok(()) } else { Err(Error::data(path, "", reason(), remedy)) }
    }

    /// The Gaussians with finite parameters in the order of their rows, for a format of static ones. It fails when one is dynamic or the
    /// arrays disagree.
    pub(crate) fn static_rows(&self, path: &Path) -> Result<Vec<usize>> {
        let remedy = "this is a fault of the program that made the scene";
        self.check().map_err(|reason| Error::data(path, "", reason, remedy))?;
        if !self.motion.is_empty() {
            let reason = format!("this format cannot hold the {} dynamic Gaussians of the scene", self.motion.len());
            return Err(Error::data(path, "", reason, "export it as PLY, or as it is at one time (--time)"));
        }
        let mut rows: Vec<usize> = (0..self.len()).filter(|&i| self.is_finite(i)).collect();
        rows.sort_by_key(|&i| self.source_row[i]);
        Ok(rows)
    }

    /// Appends a scene of the same degree, so that static Gaussians still come first. Those that are there have the highest degree.
    pub(crate) fn append(&mut self, mut other: Splats) {
        debug_assert!((self.motion.is_empty() || other.n_static == 0) && other.sh_degree == self.sh_degree);
        debug_assert!(self.degree.is_empty());
        if !other.degree.is_empty() {
            self.degree = vec![self.sh_degree as u8; self.len()];
            self.degree.append(&mut other.degree);
        }
        self.position.append(&mut other.position);
        self.rotation.append(&mut other.rotation);
        self.scale.append(&mut other.scale);
        self.opacity.append(&mut other.opacity);
        self.sh.append(&mut other.sh);
        if !self.span.is_empty() || !other.span.is_empty() {
            self.span.resize(self.motion.len(), ALWAYS);
            other.span.resize(other.motion.len(), ALWAYS);
            self.span.append(&mut other.span);
        }
        self.n_static += other.n_static;
        self.motion.append(&mut other.motion);
        self.source_row.append(&mut other.source_row);
    }
}
