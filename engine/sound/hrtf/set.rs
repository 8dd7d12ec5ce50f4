//! A set of responses that is ready for any direction.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use glam::DVec3;

use super::{Measured, Meta, sadie, sofa, sphere};
use crate::error::{Error, Result};
use crate::internals::sound::FS;
use crate::internals::sound::align::{Aligner, LEAD, before_onset, choose};
use crate::internals::sound::geometry::angles;
use crate::internals::sound::hull::Hull;
use crate::internals::sound::sinc::Resampler;

/// Taps that a measured response may have, after resampling.
const TAPS: std::ops::RangeInclusive<usize> = 8..=16_384;

/// How a response is looked up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lookup {
    /// The measured response whose direction is nearest.
    Nearest,
    /// Responses of the triangle around the direction, aligned, mixed, with their delays mixed apart.
    #[default]
    Aligned,
}

/// Responses to both ears of one direction. An ear hears its response late by its delay less [`LEAD`] samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Filter {
    pub responses: [Vec<f32>; 2],
    /// Samples; negative where the response has more than [`LEAD`] samples before its onset.
    pub delays: [f64; 2],
}

/// A set of responses at 48 kHz, ready for any direction.
pub struct HrtfSet {
    /// Unit vectors in the head's frame.
    #[doc(hidden)]
    pub directions: Vec<DVec3>,
    responses: Vec<Responses>,
    lead: usize,
    /// Samples that all responses were late by and that were taken away.
    #[doc(hidden)]
    pub latency: usize,
    /// Largest part of a response's energy that alignment cut off, dB.
    #[doc(hidden)]
    pub alignment_db: f64,
    #[doc(hidden)]
    pub hull: Hull,
    /// Where the set comes from.
    pub meta: Meta,
}

/// Those of a direction, by ear.
#[derive(Clone)]
struct Responses {
    /// As measured and normalised, [`LEAD`] taps and one at least.
    raw: [Vec<f32>; 2],
    /// Samples by which the measured response is later than its taps say.
    extra: [f64; 2],
    /// With the onset at `lead`.
    aligned: [Vec<f32>; 2],
    /// Samples; `latency` has been taken away.
    delays: [f64; 2],
}

impl HrtfSet {
    /// Opens `sphere` (the built-in model), a SOFA file, or a folder of WAV files named as SADIE's.
    ///
    /// # Errors
    /// [`crate::Error::Data`] naming the file and the values that are missing or cannot be.
    pub fn open(source: impl AsRef<Path>) -> Result<Self> {
        let source = source.as_ref();
        if source == Path::new("sphere") {
            return HrtfSet::new(sphere::Sphere::default().measured(12), source);
        }
        let measured = if source.is_dir() { sadie::read(source)? } else { sofa::read(source)? };
        HrtfSet::new(measured, source)
    }

    /// Prepares measured responses: 48 kHz, directions once each, frontal energy 1, aligned.
    #[doc(hidden)]
    pub fn new(measured: Measured, source: &Path) -> Result<Self> {
        check(&measured, source)?;
        let fault = |place: &str, reason: String, remedy: &str| Error::data(source, place, reason, remedy);
        let keep = distinct(&measured.directions);
        let directions: Vec<DVec3> = keep.iter().map(|i| measured.directions[*i].normalize()).collect();
        // A change of rate rings a little before a response begins; it is moved so that this is kept.
        let rate = measured.fs.round() as u32;
        let resampler = Resampler::new(rate, FS, if rate == FS { 0.0 } else { 16.0 / f64::from(FS) });
        let irs: Vec<[Vec<f32>; 2]> =
            keep.iter().map(|i| measured.irs[*i].each_ref().map(|ir| resampler.apply(ir))).collect();
        let extra = keep.iter().map(|i| measured.delays[*i].map(|delay| delay * f64::from(FS) / measured.fs));
        let raw_taps = irs[0][0].len();
        if !TAPS.contains(&raw_taps) {
            let reason = format!("a response has {raw_taps} samples, not {} to {}", TAPS.start(), TAPS.end());
            return Err(fault("Data.IR", reason, "give free-field head-related responses, not those of a room"));
        }
        let hull = Hull::new(&directions).ok_or_else(|| {
            let reason = format!("its {} directions do not surround the head", directions.len());
            fault("SourcePosition", reason, "give a set measured on a sphere")
        })?;

        let mut aligner = Aligner::new(raw_taps);
        let onsets = onsets(&mut aligner, &directions, &irs, &hull);
        let pairs = irs.iter().flatten().zip(onsets.iter().flatten());
        // Nothing but silence is cut off before any onset.
        let lead = pairs.map(|(response, onset)| before_onset(response, *onset)).fold(LEAD, usize::max);
        // Close to the head both ears hear what sounds at this tap.
        let least_taps = LEAD + 1;
        let (mut responses, mut lost) = (Vec::new(), 0.0);
        for ((ears, onsets), extra) in irs.into_iter().zip(onsets).zip(extra) {
            let aligned = [0, 1].map(|ear| aligner.align(&ears[ear], onsets[ear], lead));
            lost = aligned.iter().map(|found| found.lost).fold(lost, f64::max);
            let raw = ears.map(|mut ear| {
                ear.resize(raw_taps.max(least_taps), 0.0);
                ear
            });
            let delays = [0, 1].map(|ear| extra[ear] + onsets[ear]);
            responses.push(Responses { raw, extra, aligned: aligned.map(|found| found.response), delays });
        }
        let earliest = responses.iter().flat_map(|of| of.delays).fold(f64::INFINITY, f64::min);
        let latency = (earliest.max(0.0) as usize).min(LEAD);
        let taken = (latency + lead - LEAD) as f64;
        responses.iter_mut().flat_map(|of| &mut of.delays).for_each(|delay| *delay -= taken);
        let mut set = HrtfSet {
            directions,
            responses,
            lead,
            latency,
            alignment_db: 10.0 * lost.max(1e-30).log10(),
            hull,
            meta: measured.meta,
        };
        set.normalise();
        set.check_sides(source)?;
        Ok(set)
    }

    /// Makes the mean energy of the two frontal responses 1, so that a gain of 1 keeps a recording's level.
    fn normalise(&mut self) {
        let front = self.filter(DVec3::X, Lookup::Aligned);
        let scale = (1.0 / energy(&front).max(f64::MIN_POSITIVE)).sqrt() as f32;
        let responses = self.responses.iter_mut().flat_map(|of| of.raw.iter_mut().chain(&mut of.aligned));
        responses.flatten().for_each(|value| *value *= scale);
    }

    /// From the left the left ear hears first and loudest: else azimuths run the other way, or the ears are swapped.
    fn check_sides(&self, source: &Path) -> Result<()> {
        let at = self.nearest(DVec3::Y);
        if self.directions[at].dot(DVec3::Y) < 0.7 {
            return Ok(());
        }
        let [left, right] = [0, 1].map(|ear| self.raw(at, ear).iter().map(|v| f64::from(*v).powi(2)).sum::<f64>());
        let [first, second] = self.responses[at].delays;
        if first < second && left > right {
            return Ok(());
        }
        let (az, el) = angles(self.directions[at]);
        let reason = format!(
            "at azimuth {:.0}, elevation {:.0} degrees, on the left, the left ear hears {:.0} us later and {:.1} dB louder",
            az.to_degrees(),
            el.to_degrees(),
            (first - second) / f64::from(FS) * 1e6,
            10.0 * (left / right).log10()
        );
        Err(Error::data(source, "", reason, "count azimuth counter-clockwise from the front, the left ear first"))
    }
}

#[doc(hidden)]
impl HrtfSet {
    /// The filter of a direction in the head's frame.
    pub fn filter(&self, to: DVec3, lookup: Lookup) -> Filter {
        match lookup {
            Lookup::Nearest => {
                let nearest = &self.responses[self.nearest(to)];
                let delays = nearest.extra.map(|extra| extra + (LEAD - self.latency) as f64);
                Filter { responses: nearest.raw.clone(), delays }
            }
            Lookup::Aligned => {
                let taps = self.taps(lookup);
                let mut filter = Filter { responses: [0, 1].map(|_| vec![0.0; taps]), delays: [0.0; 2] };
                for (at, weight) in self.hull.locate(to) {
                    let from = &self.responses[at];
                    for (ear, response) in filter.responses.iter_mut().enumerate() {
                        response.iter_mut().zip(&from.aligned[ear]).for_each(|(to, from)| *to += weight as f32 * from);
                        filter.delays[ear] += weight * from.delays[ear];
                    }
                }
                filter
            }
        }
    }

    pub fn nearest(&self, to: DVec3) -> usize {
        let closeness = |at: &usize| self.directions[*at].dot(to);
        (0..self.directions.len()).max_by(|a, b| closeness(a).total_cmp(&closeness(b))).unwrap_or(0)
    }

    /// A measured response, normalised.
    pub fn raw(&self, at: usize, ear: usize) -> &[f32] {
        &self.responses[at].raw[ear]
    }

    /// Taps of the responses that a lookup gives.
    pub fn taps(&self, lookup: Lookup) -> usize {
        match lookup {
            Lookup::Nearest => self.responses[0].raw[0].len(),
            Lookup::Aligned => self.responses[0].aligned[0].len(),
        }
    }

    /// The longest delay of a filter, samples.
    pub fn max_delay(&self) -> f64 {
        let nearest = self.responses.iter().flat_map(|of| of.extra).map(|extra| extra + LEAD as f64);
        self.responses.iter().flat_map(|of| of.delays).chain(nearest).fold(LEAD as f64, f64::max)
    }

    /// The sample of a lookup's responses at which they begin to sound.
    pub fn onset(&self, lookup: Lookup) -> usize {
        match lookup {
            Lookup::Nearest => LEAD,
            Lookup::Aligned => self.lead,
        }
    }

    /// The set without some directions, as if they had not been measured; none where the others do not surround the head.
    pub fn without(&self, left_out: &[usize]) -> Option<Self> {
        let kept: Vec<usize> = (0..self.directions.len()).filter(|at| !left_out.contains(at)).collect();
        let directions: Vec<DVec3> = kept.iter().map(|at| self.directions[*at]).collect();
        let responses = kept.iter().map(|at| self.responses[*at].clone()).collect();
        Some(HrtfSet { hull: Hull::new(&directions)?, responses, directions, meta: self.meta.clone(), ..*self })
    }
}

fn onsets(aligner: &mut Aligner, directions: &[DVec3], irs: &[[Vec<f32>; 2]], hull: &Hull) -> Vec<[f64; 2]> {
    let neighbours = hull.neighbours();
    let by_ear = [(0, DVec3::Y), (1, -DVec3::Y)].map(|(ear, side)| {
        let candidates: Vec<_> = irs.iter().map(|ears| aligner.candidates(&ears[ear])).collect();
        // Woodworth's sphere: straight to an ear in sight, around the head to one in its shadow.
        let way = |to: &DVec3| {
            let incidence = to.dot(side).clamp(-1.0, 1.0).acos();
            if incidence < FRAC_PI_2 { -incidence.cos() } else { incidence - FRAC_PI_2 }
        };
        let scale = sphere::Sphere::default().radius / sphere::SPEED_OF_SOUND * f64::from(FS);
        let expected: Vec<f64> = directions.iter().map(|to| scale * way(to)).collect();
        choose(&candidates, &expected, &neighbours)
    });
    by_ear[0].iter().zip(&by_ear[1]).map(|(left, right)| [*left, *right]).collect()
}

fn energy(filter: &Filter) -> f64 {
    0.5 * filter.responses.iter().flatten().map(|value| f64::from(*value).powi(2)).sum::<f64>()
}

fn check(measured: &Measured, source: &Path) -> Result<()> {
    let fault = |place: String, reason: &str| {
        Err(Error::data(source, place, reason, "the file is damaged or no set of head-related responses; get it again"))
    };
    let n = measured.directions.len();
    if n < 4 || measured.irs.len() != n || measured.delays.len() != n {
        return fault(String::new(), "it has fewer than four directions, or responses and directions differ in number");
    }
    if !(8_000.0..=400_000.0).contains(&measured.fs) {
        return fault("sample rate".into(), "it is not between 8 and 400 kHz");
    }
    let taps = measured.irs[0][0].len();
    for (at, ears) in measured.irs.iter().enumerate() {
        let place = || format!("direction {at}");
        if !(measured.directions[at].is_finite() && measured.directions[at].length() > 1e-9) {
            return fault(place(), "it has no direction");
        }
        if measured.delays[at].iter().any(|delay| !(0.0..1e4).contains(delay)) {
            return fault(place(), "its delay is not between 0 and 10,000 samples");
        }
        for ir in ears {
            if ir.len() != taps || ir.iter().any(|value| !value.is_finite()) {
                return fault(place(), "a response is not finite, or not as long as the others");
            }
            if ir.iter().all(|value| value.abs() < 1e-12) {
                return fault(place(), "a response is silent");
            }
        }
    }
    Ok(())
}

/// Indices of directions, each direction once: poles and seams are often measured several times.
fn distinct(directions: &[DVec3]) -> Vec<usize> {
    let mut seen = std::collections::HashSet::new();
    let key = |to: &DVec3| (to.normalize() * 1e5).to_array().map(|value| value.round() as i64);
    (0..directions.len()).filter(|at| seen.insert(key(&directions[*at]))).collect()
}
