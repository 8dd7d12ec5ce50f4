//! From the mouths that cameras see to where each speaker is over time.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use super::keypoints::{Mouth, Mouths};
use super::rig::Rig;
use super::smooth::{Motion, State, smooth};
use super::source_track::{Flag, SourceSample, SourceTrack};
use super::triangulate::{Fix, Sight, triangulate_all};
use crate::report::statistics::{mean, median_high};

/// Clocks that are off by less are not interpolated, seconds.
const SAME_TIME: f64 = 2e-3;
/// Between two frames a mouth moves at most this far, relative to its width or its standard deviation.
const MOVES: f64 = 3.0;
/// Spectral density of a head's acceleration, m^2/s^3.
const DENSITY: f64 = 2.0;
/// Standard deviation of the velocity of a head that has just been found, m/s.
const SPEED: f64 = 2.0;
/// Width of a mouth, metres.
const MOUTH_WIDTH: f64 = 0.05;
/// The middle of a mouth is not the same point from all sides and with every vowel; standard deviation, metres.
const VAGUENESS: f64 = 0.01;
/// Gaps up to this are smoothed through; up to this the place is held; seconds.
const FILLED: f64 = 0.5;
const HELD: f64 = 3.0;
/// A person found in fewer frames, or for a shorter time in seconds, is an error of the detectors.
const MIN_FRAMES: usize = 3;
const MIN_SECONDS: f64 = 0.1;

/// Squared Mahalanobis distance beyond which a place is of someone else: 0.999 of chi squared with three degrees.
const GATE: f64 = 16.27;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalizeSettings {
    /// Metres in a scene unit. `None` estimates it from the width of mouths, well enough for the smoothing.
    pub metres_per_unit: Option<f64>,
    /// Holds the place of a source through gaps of any length; otherwise it is silent in those above 3 s.
    pub hold: bool,
}

#[derive(Clone, Debug)]
pub struct Localized {
    /// The one that is found most often first; ids `p0`, `p1`, and so on. A sample for each frame of the clip.
    pub tracks: Vec<SourceTrack>,
    /// Mean opening of the lips by track and frame, relative to their width; NaN where it is not seen.
    pub openings: Vec<Vec<f64>>,
    pub report: LocalizeReport,
}

#[derive(Clone, Debug, serde::Serialize)]
pub struct LocalizeReport {
    pub frames: usize,
    /// Mouths that the detectors saw, by camera.
    pub mouths: BTreeMap<String, usize>,
    /// Of the mouths at the frames' times, the part on which two cameras or more agree.
    pub agreeing: f64,
    /// How large the detectors' noise is relative to what was taken for it at first: a pixel, and more for large mouths.
    pub noise: f64,
    /// Places that were found in too few frames to be a person.
    pub stray_places: usize,
    /// Metres in a scene unit, as given or estimated; the smoothing uses it.
    pub metres_per_unit: f64,
    pub is_scale_estimated: bool,
    pub sources: Vec<SourceReport>,
}

/// Numbers of a source that was localised.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SourceReport {
    /// Its name.
    pub id: String,
    /// Frames by how its place was found.
    pub flags: BTreeMap<&'static str, usize>,
    /// Mean number of cameras that agree, of the frames where it is seen.
    pub mean_views: f64,
    /// Root mean square of the distance in the pictures, pixels.
    pub reproj_px: f64,
    /// Root mean square of the place's standard deviation along its worst axis in the frames where it is seen, scene units.
    pub worst_sd: f64,
}

/// Localises all who speak: triangulates the mouths of each frame, joins those of one person, smooths. `mouths` is parallel to the
/// rig's cameras; where the rig knows of one frame alone, the clip is as long as the keypoints.
pub fn localize(rig: &Rig, mouths: &[Mouths], settings: &LocalizeSettings) -> Localized {
    let last = mouths.iter().filter_map(|mouths| mouths.frames.keys().next_back()).max();
    let n_seen = last.map_or(0, |last| *last as usize + 1);
    let n_frames = if rig.n_frames > 1 { rig.n_frames as usize } else { n_seen };
    let dt = 1.0 / rig.fps;
    let seen: Vec<Vec<(Sight, Mouth)>> = (0..n_frames).map(|frame| sights(rig, mouths, frame as f64)).collect();
    let mut fixes: Vec<Vec<Fix>> =
        seen.iter().map(|seen| triangulate_all(&seen.iter().map(|(sight, _)| *sight).collect::<Vec<_>>())).collect();
    let noise = noise(&seen, &fixes);
    let scale = settings.metres_per_unit.or_else(|| scale(&seen, &fixes));
    let metres_per_unit = scale.unwrap_or(1.0);
    let vague = DMat3::from_diagonal(DVec3::splat((VAGUENESS / metres_per_unit).powi(2)));
    for fix in fixes.iter_mut().flatten() {
        // A place whose sights disagree by more than chance allows keeps its own covariance.
        let noise = if fix.excess > 1.0 { 1.0 } else { noise };
        fix.cov = fix.cov * noise * noise + vague;
    }
    let motion = Motion { density: DENSITY / (metres_per_unit * metres_per_unit), speed: SPEED / metres_per_unit };
    let mut persons = associate(&fixes, dt, motion);
    let enough = MIN_FRAMES.max((MIN_SECONDS * rig.fps).round() as usize);
    let n_places = |persons: &[Vec<(usize, usize)>]| persons.iter().map(Vec::len).sum::<usize>();
    let before = n_places(&persons);
    persons.retain(|places| places.len() >= enough);
    let stray_places = before - n_places(&persons);
    // Stable: of two that are seen as often, the one found first.
    persons.sort_by_key(|places| std::cmp::Reverse(places.len()));

    let n_agreeing: usize = fixes.iter().flatten().map(|fix| fix.sights.len()).sum();
    let n_mouths = mouths.iter().map(|mouths| mouths.frames.values().flatten().count());
    let n_sights: usize = seen.iter().map(Vec::len).sum();
    let mut localized = Localized {
        tracks: Vec::new(),
        openings: Vec::new(),
        report: LocalizeReport {
            frames: n_frames,
            mouths: rig.cameras.iter().map(|camera| camera.name.clone()).zip(n_mouths).collect(),
            agreeing: n_agreeing as f64 / n_sights.max(1) as f64,
            noise,
            stray_places,
            metres_per_unit,
            is_scale_estimated: settings.metres_per_unit.is_none(),
            sources: Vec::new(),
        },
    };
    for (index, places) in persons.iter().enumerate() {
        let by_frame: BTreeMap<usize, &Fix> =
            places.iter().map(|(frame, fix)| (*frame, &fixes[*frame][*fix])).collect();
        let is_approx = |frame: usize, fix: &Fix| fix.sights.iter().all(|sight| seen[frame][*sight].1.approx);
        let samples = samples(&by_frame, n_frames, dt, motion, settings.hold, &is_approx);
        let track = SourceTrack { id: format!("p{index}"), samples, fps: rig.fps };
        let opening = |frame: usize| {
            let sights = by_frame.get(&frame).map_or(&[][..], |fix| &fix.sights);
            mean(sights.iter().filter_map(|sight| seen[frame][*sight].1.opening)).unwrap_or(f64::NAN)
        };
        localized.openings.push((0..n_frames).map(opening).collect());
        localized.report.sources.push(report(&track));
        localized.tracks.push(track);
    }
    localized
}

/// The places of each person: (frame, index among its fixes), in order of time. The likeliest pairs of predicted persons and places
/// are taken first, and a place without a person begins a new one.
pub fn associate(fixes: &[Vec<Fix>], dt: f64, motion: Motion) -> Vec<Vec<(usize, usize)>> {
    let mut persons: Vec<(State, Vec<(usize, usize)>)> = Vec::new();
    for (frame, found) in fixes.iter().enumerate() {
        let mut pairs = Vec::new();
        for (person, (state, places)) in persons.iter().enumerate() {
            let steps = places.last().map_or(0, |(last, _)| frame - last);
            let state = state.predicted(dt * steps as f64, motion);
            for (index, fix) in found.iter().enumerate() {
                let (distance, spread) = state.distance(fix.p, fix.cov);
                // The spread keeps one who was lost long ago from explaining everything.
                if distance < GATE {
                    pairs.push((distance + spread, person, index, state));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut has_place, mut is_taken) = (vec![false; persons.len()], vec![false; found.len()]);
        for (_, person, index, state) in pairs {
            if has_place[person] || is_taken[index] {
                continue;
            }
            (has_place[person], is_taken[index]) = (true, true);
            persons[person].0 = state.updated(found[index].p, found[index].cov);
            persons[person].1.push((frame, index));
        }
        for (index, fix) in found.iter().enumerate().filter(|(index, _)| !is_taken[*index]) {
            persons.push((State::new(fix.p, fix.cov, motion), vec![(frame, index)]));
        }
    }
    persons.into_iter().map(|(_, places)| places).collect()
}

fn report(track: &SourceTrack) -> SourceReport {
    let mut flags = BTreeMap::new();
    track.samples.iter().for_each(|sample| *flags.entry(sample.flag.name()).or_insert(0) += 1);
    let seen: Vec<&SourceSample> = track.samples.iter().filter(|sample| sample.views > 0).collect();
    let mean = |value: &dyn Fn(&SourceSample) -> f64| mean(seen.iter().map(|sample| value(sample))).unwrap_or(0.0);
    SourceReport {
        id: track.id.clone(),
        flags,
        mean_views: mean(&|sample| f64::from(sample.views)),
        reproj_px: mean(&|sample| f64::from(sample.reproj_px).powi(2)).sqrt(),
        worst_sd: mean(&|sample| largest_eigenvalue(&sample.cov)).sqrt(),
    }
}

/// By the power method: the matrix is a covariance.
fn largest_eigenvalue([xx, xy, xz, yy, yz, zz]: &[f64; 6]) -> f64 {
    let m = DMat3::from_cols_array(&[*xx, *xy, *xz, *xy, *yy, *yz, *xz, *yz, *zz]);
    let mut v = DVec3::new(1.0, 1.1, 1.2);
    for _ in 0..100 {
        v = (m * v).normalize_or_zero();
    }
    v.dot(m * v)
}

/// The sights of all cameras at a frame of the clip's time.
fn sights(rig: &Rig, mouths: &[Mouths], frame: f64) -> Vec<(Sight, Mouth)> {
    let mut found = Vec::new();
    for (index, (camera, mouths)) in rig.cameras.iter().zip(mouths).enumerate() {
        // A picture of frame f shows what is at f + offset.
        let local = frame - camera.offset;
        let (pose, focal) = (camera.pose(local), camera.lens.intrinsics.focal());
        found.extend(at(mouths, local, rig.fps).into_iter().filter_map(|mouth| {
            let Mouth { sigma, weight, .. } = mouth;
            Some((Sight { camera: index, pose, focal, at: camera.plane(mouth.at)?, sigma, weight }, mouth))
        }));
    }
    found
}

/// The mouths of a camera at a time of its own clock, frames: those of the nearest frame, moved towards the same mouth in the frame on
/// the other side. A mouth without one there is left out.
fn at(mouths: &Mouths, local: f64, fps: f64) -> Vec<Mouth> {
    let of = |frame: f64| {
        let frame = (frame >= 0.0 && frame <= f64::from(u32::MAX)).then_some(frame as u32);
        frame.and_then(|frame| mouths.frames.get(&frame)).map_or(&[][..], Vec::as_slice)
    };
    let near = local.round();
    if (local - near).abs() <= SAME_TIME * fps {
        return of(near).to_vec();
    }
    let far = if local > near { near + 1.0 } else { near - 1.0 };
    let part = (local - near).abs();
    let nearest = |mouth: &Mouth, among: &[Mouth]| {
        let distances = among.iter().map(|other| (other.at - mouth.at).length());
        distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (here, there) = (of(near), of(far));
    let moved = |(index, mouth): (usize, &Mouth)| {
        let (other, distance) = nearest(mouth, there)?;
        let same = &there[other];
        let (back, _) = nearest(same, here)?;
        let is_same = back == index && distance <= MOVES * mouth.width.max(mouth.sigma) && same.approx == mouth.approx;
        is_same.then(|| Mouth { at: mouth.at.lerp(same.at, part), ..*mouth })
    };
    here.iter().enumerate().filter_map(moved).collect()
}

/// The root of what chi squared of all places is over its degrees of freedom.
fn noise(seen: &[Vec<(Sight, Mouth)>], fixes: &[Vec<Fix>]) -> f64 {
    let (mut chi2, mut freedom) = (0.0, 0.0);
    for (seen, fix) in seen.iter().zip(fixes).flat_map(|(seen, fixes)| fixes.iter().map(move |fix| (seen, fix))) {
        let error =
            |sight: &usize| Some(seen[*sight].0.residual(fix.p)?.length_squared() / seen[*sight].0.sigma.powi(2));
        chi2 += fix.sights.iter().filter_map(error).sum::<f64>();
        freedom += 2.0 * fix.sights.len() as f64 - 3.0;
    }
    if freedom > 0.0 { (chi2 / freedom).sqrt() } else { 1.0 }
}

/// Metres in a scene unit, if mouths have the width of a mouth: the median over all places of what their widest sight says.
fn scale(seen: &[Vec<(Sight, Mouth)>], fixes: &[Vec<Fix>]) -> Option<f64> {
    let mut widths: Vec<f64> = Vec::new();
    for (seen, fix) in seen.iter().zip(fixes).flat_map(|(seen, fixes)| fixes.iter().map(move |fix| (seen, fix))) {
        let width = |sight: &usize| {
            let (sight, mouth) = &seen[*sight];
            mouth.width / sight.focal.x * sight.pose.to_camera(fix.p).z
        };
        // From the side a mouth is narrow.
        widths.push(fix.sights.iter().map(width).fold(0.0, f64::max));
    }
    widths.retain(|width| *width > 0.0);
    median_high(widths).map(|width| MOUTH_WIDTH / width)
}

/// A sample for each frame of the clip.
fn samples(
    fixes: &BTreeMap<usize, &Fix>,
    n_frames: usize,
    dt: f64,
    motion: Motion,
    hold: bool,
    is_approx: &dyn Fn(usize, &Fix) -> bool,
) -> Vec<SourceSample> {
    let frames: Vec<usize> = fixes.keys().copied().collect();
    let (Some(&first), Some(&last)) = (frames.first(), frames.last()) else { return Vec::new() };
    let seen: Vec<_> = (first..=last).map(|frame| fixes.get(&frame).map(|fix| (fix.p, fix.cov))).collect();
    let states = smooth(&seen, dt, motion);
    let flag = |n_missing: usize| match n_missing as f64 * dt {
        gap if gap <= FILLED => Flag::Filled,
        gap if hold || gap <= HELD => Flag::Held,
        _ => Flag::Inactive,
    };
    let sample = |frame: usize| {
        let t = frame as f64 * dt;
        let at = frame.clamp(first, last);
        let state = &states[at - first];
        let c = state.cov[0][0];
        let cov = [c.x_axis.x, c.x_axis.y, c.x_axis.z, c.y_axis.y, c.y_axis.z, c.z_axis.z];
        let unseen = |p: DVec3, flag: Flag| SourceSample { t, p, cov, views: 0, reproj_px: 0.0, flag };
        if at != frame {
            let n_missing = if frame < first { first } else { n_frames - 1 - last };
            return unseen(state.p, flag(n_missing));
        }
        if let Some(fix) = fixes.get(&frame) {
            let flag = if is_approx(frame, fix) { Flag::Approx } else { Flag::Seen };
            let views = u16::try_from(fix.sights.len()).unwrap_or(u16::MAX);
            return SourceSample { t, p: state.p, cov, views, reproj_px: fix.reproj_px as f32, flag };
        }
        // Both ends of the gap are seen.
        let next = frames.partition_point(|seen| *seen < frame);
        let (from, to) = (frames[next - 1], frames[next]);
        let found = flag(to - from - 1);
        if found == Flag::Filled {
            return unseen(state.p, found);
        }
        let part = (frame - from) as f64 / (to - from) as f64;
        unseen(states[from - first].p.lerp(states[to - first].p, part), found)
    };
    (0..n_frames).map(sample).collect()
}
