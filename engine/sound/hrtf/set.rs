//! A set of responses that is ready for any direction.

use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use glam::DVec3;

use super::{Measured, Meta, sadie, sofa, sphere};
use crate::error::{Error, Result};
use crate::internals::sound::FS;
use crate::internals::sound::align::{Aligner, EXTRA, LEAD, before_onset, choose};
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
    /// Left and right.
    pub responses: [Vec<f32>; 2],
    /// Samples; negative where the response has more than [`LEAD`] samples before its onset.
    pub delays: [f64; 2],
}

/// A set of responses at 48 kHz, ready for any direction.
pub struct HrtfSet {
    directions: Vec<DVec3>,
    /// [direction][ear][taps], as measured and normalised, [`LEAD`] taps and one at least.
    raw: Vec<f32>,
    raw_taps: usize,
    /// By direction and ear, samples by which a measured response is later than its taps say.
    extra: Vec<[f64; 2]>,
    /// [direction][ear][taps], onset at `lead`.
    aligned: Vec<f32>,
    taps: usize,
    lead: usize,
    /// By direction and ear, samples; `latency` has been taken away.
    delays: Vec<[f64; 2]>,
    latency: usize,
    alignment_db: f64,
    hull: Hull,
    /// Distance of the measured sources, metres.
    pub radius_m: f64,
    /// Where the set comes from.
    pub meta: Meta,
}

impl HrtfSet {
    /// Opens `sphere` (the built-in model), a SOFA file, or a folder of WAV files named as SADIE's.
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
        let extra: Vec<[f64; 2]> = extra.collect();
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
        let taps = raw_taps + EXTRA + lead - LEAD;
        let (mut raw, mut aligned) = (Vec::new(), Vec::new());
        let mut delays = Vec::with_capacity(irs.len());
        let mut lost: f64 = 0.0;
        // Close to the head both ears hear what sounds at this tap.
        let padding = (LEAD + 1).saturating_sub(raw_taps);
        for ((ears, onsets), extra) in irs.iter().zip(onsets).zip(&extra) {
            let mut both = *extra;
            for ((ear, onset), delay) in ears.iter().zip(onsets).zip(&mut both) {
                let found = aligner.align(ear, onset, lead);
                *delay += onset;
                lost = lost.max(found.lost);
                raw.extend_from_slice(ear);
                raw.resize(raw.len() + padding, 0.0);
                aligned.extend_from_slice(&found.response);
            }
            delays.push(both);
        }
        let earliest = delays.as_flattened().iter().copied().fold(f64::INFINITY, f64::min);
        let latency = (earliest.max(0.0) as usize).min(LEAD);
        delays.as_flattened_mut().iter_mut().for_each(|delay| *delay -= (latency + lead - LEAD) as f64);
        let mut set = HrtfSet {
            directions,
            raw,
            raw_taps: raw_taps + padding,
            extra,
            aligned,
            taps,
            lead,
            delays,
            latency,
            alignment_db: 10.0 * lost.max(1e-30).log10(),
            hull,
            radius_m: measured.radius_m,
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
        self.raw.iter_mut().chain(&mut self.aligned).for_each(|value| *value *= scale);
    }

    /// From the left the left ear hears first and loudest: else azimuths run the other way, or the ears are swapped.
    fn check_sides(&self, source: &Path) -> Result<()> {
        let at = self.nearest(DVec3::Y);
        if self.directions[at].dot(DVec3::Y) < 0.7 {
            return Ok(());
        }
        let [left, right] = [0, 1].map(|ear| self.raw(at, ear).iter().map(|v| f64::from(*v).powi(2)).sum::<f64>());
        let [first, second] = self.delays[at];
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

    /// The filter of a direction in the head's frame.
    #[doc(hidden)]
    pub fn filter(&self, to: DVec3, lookup: Lookup) -> Filter {
        match lookup {
            Lookup::Nearest => {
                let at = self.nearest(to);
                let delays = self.extra[at].map(|extra| extra + (LEAD - self.latency) as f64);
                Filter { responses: [0, 1].map(|ear| self.raw(at, ear).to_vec()), delays }
            }
            Lookup::Aligned => {
                let mut filter = Filter { responses: [0, 1].map(|_| vec![0.0; self.taps]), delays: [0.0; 2] };
                for (at, weight) in self.hull.locate(to) {
                    for (ear, response) in filter.responses.iter_mut().enumerate() {
                        let from = &self.aligned[(2 * at + ear) * self.taps..][..self.taps];
                        response.iter_mut().zip(from).for_each(|(to, from)| *to += weight as f32 * from);
                        filter.delays[ear] += weight * self.delays[at][ear];
                    }
                }
                filter
            }
        }
    }

    /// The index of the direction that is nearest to `to`.
    #[doc(hidden)]
    pub fn nearest(&self, to: DVec3) -> usize {
        let closeness = |at: &usize| self.directions[*at].dot(to);
        (0..self.directions.len()).max_by(|a, b| closeness(a).total_cmp(&closeness(b))).unwrap_or(0)
    }

    /// Unit vectors of the measured directions.
    #[doc(hidden)]
    pub fn directions(&self) -> &[DVec3] {
        &self.directions
    }

    /// The triangles between directions.
    #[doc(hidden)]
    pub fn hull(&self) -> &Hull {
        &self.hull
    }

    /// A measured response, normalised.
    #[doc(hidden)]
    pub fn raw(&self, at: usize, ear: usize) -> &[f32] {
        &self.raw[(2 * at + ear) * self.raw_taps..][..self.raw_taps]
    }

    /// Taps of the responses that a lookup gives.
    #[doc(hidden)]
    pub fn taps(&self, lookup: Lookup) -> usize {
        match lookup {
            Lookup::Nearest => self.raw_taps,
            Lookup::Aligned => self.taps,
        }
    }

    /// The longest delay of a filter, samples.
    #[doc(hidden)]
    pub fn max_delay(&self) -> f64 {
        let nearest = self.extra.as_flattened().iter().map(|extra| extra + LEAD as f64);
        self.delays.as_flattened().iter().copied().chain(nearest).fold(LEAD as f64, f64::max)
    }

    /// Samples that all responses were late by and that were taken away.
    #[doc(hidden)]
    pub fn latency(&self) -> usize {
        self.latency
    }

    /// The sample of a lookup's responses at which they begin to sound.
    #[doc(hidden)]
    pub fn onset(&self, lookup: Lookup) -> usize {
        match lookup {
            Lookup::Nearest => LEAD,
            Lookup::Aligned => self.lead,
        }
    }

    /// Largest part of a response's energy that alignment cut off, dB.
    #[doc(hidden)]
    pub fn alignment_db(&self) -> f64 {
        self.alignment_db
    }

    /// The set without some directions, as if they had not been measured.
    #[doc(hidden)]
    pub fn without(&self, left_out: &[usize]) -> Result<Self> {
        let keep: Vec<usize> = (0..self.directions.len()).filter(|at| !left_out.contains(at)).collect();
        let directions: Vec<DVec3> = keep.iter().map(|at| self.directions[*at]).collect();
        let pick = |from: &[f32], taps: usize| -> Vec<f32> {
            keep.iter().flat_map(|at| from[2 * at * taps..][..2 * taps].to_vec()).collect()
        };
        let hull = Hull::new(&directions).ok_or_else(|| {
            Error::data(
                Path::new(&self.meta.title),
                "",
                "the directions left do not surround the head",
                "leave out fewer",
            )
        })?;
        Ok(HrtfSet {
            raw: pick(&self.raw, self.raw_taps),
            aligned: pick(&self.aligned, self.taps),
            extra: keep.iter().map(|at| self.extra[*at]).collect(),
            delays: keep.iter().map(|at| self.delays[*at]).collect(),
            directions,
            hull,
            meta: self.meta.clone(),
            ..*self
        })
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
