//! The head as a rigid sphere: a set of responses without a file or a licence.
//!
//! Duda and Martens, "Range dependence of the response of a spherical head model", JASA 104 (1998). Without an outer ear it does not
//! tell above from below, and front from back only weakly.

use std::collections::HashMap;
use std::f64::consts::PI;

use glam::DVec3;
use realfft::num_complex::Complex64;

use super::{Measured, Meta};
use crate::internals::sound::FS;
use crate::internals::sound::geometry::direction;
use crate::internals::sound::spectrum::Spectra;

/// Speed of sound of the model, metres per second.
pub const SPEED_OF_SOUND: f64 = 343.0;
const TAPS: usize = 256;
/// Samples by which responses are late, so that none begins before 0.
const LEAD: f64 = 48.0;
/// The band is rolled off from here to the Nyquist frequency, hertz.
const ROLL_OFF: f64 = 18_000.0;

/// A rigid sphere with two points for ears.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Metres.
    pub radius: f64,
    /// Azimuth of the left ear, radians; the right one mirrors it.
    pub ear: f64,
    /// Distance of the sources from the centre, metres.
    pub distance: f64,
}

impl Default for Sphere {
    fn default() -> Self {
        Sphere { radius: 0.0875, ear: 100f64.to_radians(), distance: 1.2 }
    }
}

impl Sphere {
    /// Responses in the directions of an icosahedron whose edges are cut in `cuts` (10 cuts^2 + 2 directions).
    pub fn measured(&self, cuts: usize) -> Measured {
        self.responses(&icosphere(cuts))
    }

    /// Responses in directions of any length in the head's frame.
    pub fn responses(&self, directions: &[DVec3]) -> Measured {
        let mut spectra = Spectra::new(TAPS);
        let bins: Vec<Bin> = (0..=TAPS / 2).map(|k| self.bin(k)).collect();
        let ears = [direction(self.ear, 0.0), direction(-self.ear, 0.0)];
        let mut response = |to: DVec3, ear: DVec3| {
            let cos = to.dot(ear).clamp(-1.0, 1.0);
            let spectrum: Vec<Complex64> = bins.iter().map(|bin| bin.at(cos)).collect();
            spectra.inverse(&spectrum).into_iter().map(|value| value as f32).collect::<Vec<f32>>()
        };
        let irs = directions.iter().map(|to| ears.map(|ear| response(to.normalize(), ear))).collect();
        Measured {
            fs: f64::from(FS),
            directions: directions.to_vec(),
            irs,
            delays: vec![[0.0; 2]; directions.len()],
            meta: Meta {
                title: format!("rigid sphere, radius {} m (Duda and Martens 1998)", self.radius),
                licence: "not needed (computed)".into(),
                sha256: String::new(),
            },
        }
    }

    /// The terms of the series at a bin of the spectrum.
    fn bin(&self, k: usize) -> Bin {
        let frequency = k as f64 * f64::from(FS) / TAPS as f64;
        let nyquist = f64::from(FS) / 2.0;
        let down = ((frequency - ROLL_OFF) / (nyquist - ROLL_OFF)).max(0.0);
        let late = Complex64::from_polar(0.5 + 0.5 * (PI * down).cos(), -2.0 * PI * k as f64 * LEAD / TAPS as f64);
        let rho = self.distance / self.radius;
        if k == 0 {
            // The limit of the series below.
            let term = |m: i32| f64::from(2 * m + 1) / f64::from(m + 1) * rho.powi(-m);
            return Bin { terms: (0..60).map(|m| Complex64::from(term(m))).collect() };
        }
        let mu = 2.0 * PI * frequency * self.radius / SPEED_OF_SOUND;
        // With time as e^{i w t} an outgoing wave is the Hankel function of the second kind. It is divided by the wave
        // at the centre of the head, were that not there.
        let scale = -(rho / mu) * Complex64::from_polar(1.0, mu * rho) * late;
        let (mut far, mut near) = (Hankel::new(mu * rho), Hankel::new(mu));
        let mut terms: Vec<Complex64> = Vec::new();
        let mut largest: f64 = 0.0;
        for m in 0..200 {
            let term = scale * f64::from(2 * m + 1) * far.value() / near.derivative();
            if !term.is_finite() {
                break;
            }
            largest = largest.max(term.norm());
            terms.push(term);
            if f64::from(m) > mu && term.norm() < 1e-10 * largest {
                break;
            }
            far.step();
            near.step();
        }
        Bin { terms }
    }
}

/// Coefficients of Legendre's polynomials of the cosine of incidence.
struct Bin {
    terms: Vec<Complex64>,
}

impl Bin {
    fn at(&self, cos: f64) -> Complex64 {
        let (mut before, mut now) = (0.0, 1.0);
        let mut sum = Complex64::ZERO;
        for (m, term) in self.terms.iter().enumerate() {
            sum += term * now;
            let m = m as f64;
            (before, now) = (now, ((2.0 * m + 1.0) * cos * now - m * before) / (m + 1.0));
        }
        sum
    }
}

/// Spherical Hankel functions of the second kind by upward recurrence, which is stable for them.
struct Hankel {
    x: f64,
    m: f64,
    before: Complex64,
    now: Complex64,
}

impl Hankel {
    fn new(x: f64) -> Self {
        let wave = Complex64::from_polar(1.0, -x);
        // h_0 = i e^{-ix} / x, and h_{-1} = e^{-ix} / x.
        Hankel { x, m: 0.0, before: wave / x, now: Complex64::I * wave / x }
    }

    fn value(&self) -> Complex64 {
        self.now
    }

    fn derivative(&self) -> Complex64 {
        self.before - (self.m + 1.0) / self.x * self.now
    }

    fn step(&mut self) {
        let next = (2.0 * self.m + 1.0) / self.x * self.now - self.before;
        (self.before, self.now) = (self.now, next);
        self.m += 1.0;
    }
}

/// Directions that are symmetric to the head's three planes: the corners of an icosahedron whose edges are cut evenly.
pub fn icosphere(cuts: usize) -> Vec<DVec3> {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for a in [-1.0, 1.0] {
        for b in [-golden, golden] {
            corners.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
        }
    }
    // Corners of the icosahedron are 2 apart.
    let is_edge = |a: DVec3, b: DVec3| (a.distance(b) - 2.0).abs() < 1e-6;
    let mut found: HashMap<[i64; 3], DVec3> = HashMap::new();
    let n = cuts.max(1);
    for (i, a) in corners.iter().enumerate() {
        for (j, b) in corners.iter().enumerate().skip(i + 1) {
            for c in corners.iter().skip(j + 1).filter(|c| is_edge(*a, *b) && is_edge(*a, **c) && is_edge(*b, **c)) {
                for k in 0..=n {
                    for l in 0..=n - k {
                        let sum = *a * k as f64 + *b * l as f64 + *c * (n - k - l) as f64;
                        let key = (sum * 1e6 / n as f64).to_array().map(|value| value.round() as i64);
                        found.entry(key).or_insert_with(|| sum.normalize());
                    }
                }
            }
        }
    }
    let mut keys: Vec<_> = found.into_iter().collect();
    keys.sort_unstable_by_key(|(key, _)| *key);
    keys.into_iter().map(|(_, to)| to).collect()
}
