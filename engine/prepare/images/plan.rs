//! What becomes of a source's cameras: which frames, which part of their pictures, which size. Everything that does not fit is a
//! fault, so that nothing is written before all of it fits.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::camera::{Camera, Material};
use super::recorded::Recorded;
use crate::parallel::in_parallel;
use crate::prepare::fit::{Part, fitted};
use crate::prepare::foreign::{Kind, kind, read_size};
use crate::prepare::journal::{PRIORS, stamps};
use crate::prepare::settings::PrepareSettings;
use crate::prepare::source::{Footage, Source, SourceCamera};
use crate::prepare::timecodes;
use crate::prepare::video::{RATE_TOLERANCE, Selection};
use crate::scene::Intrinsics;
use crate::scene::capture::{Faults, Frames, RATES, Shot};
use crate::scene::undistort::Lens;

/// What is to be made.
pub(super) struct Plan {
    pub cameras: Vec<Camera>,
    /// Frames per second of the capture.
    pub fps: f64,
    pub notes: Vec<String>,
    pub select: Selection,
    /// What the pictures are made from, for the journal.
    pub made_from: Value,
}

/// Compares the cameras with their footage and with each other.
pub(super) fn plan(source: &Source, settings: &PrepareSettings, faults: &mut Faults) -> Plan {
    let mut notes = Vec::new();
    // Several at a time: a program is started for each video.
    let look = |index: usize| Ok(Recorded::look(&source.cameras[index], source));
    let looked = in_parallel(source.cameras.len(), settings.threads, look, |_| {}).unwrap_or_default();
    let material: Vec<_> = looked.into_iter().map(|recorded| faults.take(recorded)).collect();
    let counts: Vec<(u32, &String)> =
        material.iter().zip(&source.cameras).filter_map(|(m, c)| Some((m.as_ref()?.n_frames, &c.name))).collect();
    let rates: Vec<f64> = material.iter().flatten().filter_map(|recorded| recorded.fps).collect();
    note_differences(&counts, &rates, &mut notes);
    if settings.shifts.is_empty() {
        let videos = material.iter().map(|recorded| recorded.as_ref()?.video.as_ref());
        let videos: Vec<_> = source.cameras.iter().map(|camera| camera.name.as_str()).zip(videos).collect();
        notes.extend(timecodes::note(&videos));
    }
    let select = select(source, settings, &counts, &mut notes, faults);
    let fps = rates.first().copied().or(source.fps).unwrap_or(settings.capture.fps) / f64::from(select.every);
    if !RATES.contains(&fps) {
        let reason = format!("has {fps} frames per second, {} to {} are allowed", RATES.start(), RATES.end());
        faults.add(&source.calibration, "", reason, "give the rate at which the pictures were taken with --fps");
    }
    let mut planned = Planned { source, settings, select, notes, of_cameras: Vec::new(), faults };
    let pairs = source.cameras.iter().zip(material);
    let cameras: Vec<Camera> = pairs.filter_map(|(camera, material)| planned.camera(camera, material?)).collect();
    let mut notes = planned.notes;
    notes.extend(grouped(&planned.of_cameras, source.cameras.len()));
    if cameras.iter().all(|camera| camera.is_test) && faults.n() == 0 {
        let remedy = "choose fewer cameras with --test-cameras";
        faults.add(&source.calibration, "", "has only test cameras", remedy);
    }
    let Selection { start, every, n } = select;
    let mut made_from = json!({
        "source": settings.source.to_string_lossy(), "source format": source.format, "start": start, "every": every, "frames": n,
        "scale": settings.scale, "format": settings.format, "cameras": cameras.iter().map(Camera::stamp).collect::<Vec<_>>(),
    });
    made_from[PRIORS] = stamps(cameras.iter().flat_map(Camera::priors));
    if !settings.shifts.is_empty() {
        made_from["shifts"] = json!(settings.shifts);
    }
    Plan { cameras, fps, notes, select, made_from }
}

/// Notes that cameras have different numbers of frames (`counts`, with their names) or different rates.
fn note_differences(counts: &[(u32, &String)], rates: &[f64], notes: &mut Vec<String>) {
    if let (Some((least, shortest)), Some((most, longest))) = (counts.iter().min(), counts.iter().max())
        && least != most
    {
        notes.push(format!(
            "the cameras have different numbers of frames, {least} (`{shortest}`) to {most} (`{longest}`): \
             what all have is used, in the hope that they begin together (--shift tells when they do not)"
        ));
    }
    if let Some(other) = rates.iter().find(|rate| (*rate / rates[0] - 1.0).abs() > RATE_TOLERANCE) {
        notes.push(format!(
            "the cameras have different rates, {} and {other} frames per second: their frames are paired by number",
            rates[0]
        ));
    }
}

/// The frames that are asked for and that all cameras have.
fn select(
    source: &Source,
    settings: &PrepareSettings,
    counts: &[(u32, &String)],
    notes: &mut Vec<String>,
    faults: &mut Faults,
) -> Selection {
    let Frames { from: start, to, every } = settings.frames;
    let left = |n: u32, name: &str| u32::try_from(i64::from(n) - i64::from(settings.shift(name))).unwrap_or(0);
    let available = counts.iter().map(|(n, name)| left(*n, name)).min().unwrap_or(0);
    let n = settings.frames.of(available).len() as u32;
    if n == 0 && faults.n() == 0 {
        let reason = format!("begins at frame {start}, the cameras have {available}");
        faults.add(&source.calibration, "--frames", reason, "begin earlier");
    }
    if to.is_some_and(|to| to > available) && n > 0 {
        notes.push(format!("only {n} frames are there"));
    }
    Selection { start, every, n }
}

/// What the plan of a camera needs.
struct Planned<'a> {
    source: &'a Source,
    settings: &'a PrepareSettings,
    select: Selection,
    notes: Vec<String>,
    /// Cameras by name, and what is noted of each.
    of_cameras: Vec<(String, String)>,
    faults: &'a mut Faults,
}

/// Notes of cameras, those of one text together.
fn grouped(of_cameras: &[(String, String)], n_cameras: usize) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for (camera, note) in of_cameras {
        match groups.iter_mut().find(|(text, _)| text == note) {
            Some((_, cameras)) => cameras.push(camera),
            None => groups.push((note, vec![camera])),
        }
    }
    let told = groups.into_iter().map(|(note, cameras)| match cameras.as_slice() {
        [camera] => format!("camera `{}`: {note}", camera.escape_debug()),
        all if all.len() == n_cameras => format!("all {n_cameras} cameras: {note}"),
        some => format!("{} cameras ({}): {note}", some.len(), some.join(", ")),
    });
    told.collect()
}

impl Planned<'_> {
    fn camera(&mut self, camera: &SourceCamera, recorded: Recorded) -> Option<Camera> {
        let place = format!("camera `{}`", camera.name.escape_debug());
        let (width, height) = recorded.size;
        let fitted = fitted(&camera.lens, recorded.size, || recorded.first(&camera.footage));
        let rescaled = self.settings.capture.rescale.then(|| {
            let note = format!("the calibration is scaled to the pictures, {width} x {height}");
            (camera.lens.resized(width, height), Part::whole(recorded.size), Some(note))
        });
        let Some((lens, part, note)) = self.faults.take(fitted)?.or(rescaled) else {
            let Intrinsics { width: w, height: h, .. } = camera.lens.intrinsics;
            let reason = format!("is calibrated for {w} x {h}, its pictures are {width} x {height}");
            let remedy =
                "give the footage of this calibration, calibrate again, or scale the calibration with --rescale";
            self.faults.add(&self.source.calibration, place, reason, remedy);
            return None;
        };
        self.of_cameras.extend(note.map(|note| (camera.name.clone(), note)));
        let side = |side: u32| ((f64::from(side) * self.settings.scale).round() as u32).max(1);
        let lens = lens.resized(side(part.width), side(part.height));
        let kept = |pinhole: &Lens| {
            let (kept, whole) = (pinhole.intrinsics, lens.intrinsics);
            kept.width >= whole.width.div_ceil(16) && kept.height >= whole.height.div_ceil(16)
        };
        let Some(pinhole) = lens.pinhole().filter(kept) else {
            let reason = "has a distortion after which no rectangle of a sixteenth of the picture's sides is left";
            self.faults.add(&self.source.calibration, place, reason, "calibrate it again");
            return None;
        };
        let shift = self.settings.shift(&camera.name);
        let Some(start) = self.select.start.checked_add_signed(shift) else {
            let reason = format!("is to begin {} frames before its footage", shift.unsigned_abs() - self.select.start);
            let remedy = format!("begin at frame {} or later: --frames {0}:", shift.unsigned_abs());
            self.faults.add(&self.source.calibration, place, reason, remedy);
            return None;
        };
        let frames: Vec<u32> = (0..self.select.n).map(|i| start + i * self.select.every).collect();
        let poses = if camera.poses.is_empty() {
            vec![camera.pose]
        } else {
            let absent: Vec<_> = frames.iter().filter(|frame| !camera.poses.contains_key(frame)).collect();
            if let Some(first) = absent.first() {
                let reason = format!("moves and has no pose at {} frames, the first is {first}", absent.len());
                self.faults.add(&self.source.calibration, place, reason, "add the poses, or take fewer frames");
                return None;
            }
            frames.iter().filter_map(|frame| camera.poses.get(frame).copied()).collect()
        };
        let masks = self.masks(&camera.name, &frames, recorded.size)?;
        let (material, masks) = match (&camera.footage, recorded.video) {
            (Footage::Video(path), Some(video)) => (Material::Video(path.clone(), video), masks),
            (Footage::Images(shots), _) => {
                let mut shots = self.shots(&place, shots, &frames, recorded.size)?;
                shots.iter_mut().zip(masks).for_each(|(shot, mask)| shot.mask = Some(mask));
                self.choose_flow(&mut shots);
                (Material::Images(shots), Vec::new())
            }
            (Footage::Video(_), None) => return None,
        };
        let (name, is_test) = (camera.name.clone(), camera.is_test);
        Some(Camera { name, is_test, start, pinhole, poses, recorded: recorded.size, part, lens, material, masks })
    }

    /// The masks of the chosen frames, where a folder of masks has some of the camera: one of each, of the pictures' size.
    fn masks(&mut self, camera: &str, frames: &[u32], size: (u32, u32)) -> Option<Vec<PathBuf>> {
        let Some(all) = self.source.masks.get(camera) else { return Some(Vec::new()) };
        let folder = self.settings.masks.as_deref().unwrap_or(Path::new("")).join(camera);
        let absent: Vec<u32> = frames.iter().copied().filter(|frame| !all.contains_key(frame)).collect();
        if let Some(first) = absent.first() {
            let more = if absent.len() > 1 { format!(" and {} more", absent.len() - 1) } else { String::new() };
            let reason = format!("has {} masks, but none of frame {first}{more}", all.len());
            self.faults.add(&folder, "--masks", reason, "give one mask for each frame, numbered without gaps");
            return None;
        }
        let chosen: Vec<PathBuf> = frames.iter().filter_map(|frame| all.get(frame).cloned()).collect();
        let first = self.faults.take(read_size(chosen.first()?))?;
        if first != size {
            let reason = format!("has masks of {} x {}, the pictures are {} x {}", first.0, first.1, size.0, size.1);
            self.faults.add(&folder, "--masks", reason, "give masks of the pictures' size");
            return None;
        }
        Some(chosen)
    }

    /// Flow leads to the next frame of the source, which must be the next frame of the capture.
    fn choose_flow(&mut self, shots: &mut [Shot]) {
        // The frame that the last flow leads to is not taken.
        shots.last_mut().map(|shot| shot.flow.take());
        if self.settings.frames.every == 1 || shots.iter().all(|shot| shot.flow.is_none()) {
            return;
        }
        let note = "flow does not skip frames: left out".to_owned();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
        for shot in shots {
            shot.flow = None;
        }
    }

    /// The shots of the chosen frames, each compared with the size of the camera's images.
    fn shots(&mut self, place: &str, shots: &[Shot], frames: &[u32], size: (u32, u32)) -> Option<Vec<Shot>> {
        let there: BTreeMap<u32, &Shot> = shots.iter().map(|shot| (shot.frame, shot)).collect();
        let chosen: Vec<Shot> =
            frames.iter().filter_map(|frame| there.get(frame).map(|shot| (*shot).clone())).collect();
        let absent: Vec<u32> = frames.iter().copied().filter(|frame| !there.contains_key(frame)).collect();
        if let Some(first) = absent.first() {
            let more = if absent.len() > 1 { format!(" and of {} more", absent.len() - 1) } else { String::new() };
            let reason =
                format!("has no image of frame {first}{more}; a capture folder has all frames of every camera");
            let longest = frames.split(|frame| !there.contains_key(frame)).max_by_key(|run| run.len()).unwrap_or(&[]);
            let take = match (longest.first(), longest.last()) {
                (Some(first), Some(last)) => format!("take frames that are there with --frames {first}:{}", last + 1),
                _ => "choose other frames".to_owned(),
            };
            let remedy = format!("add what is missing, {take}, or number the images without gaps");
            self.faults.add(&self.source.calibration, place, reason, remedy);
        }
        let before = self.faults.n();
        // Those that ffmpeg reads are compared when they are decoded: it would be started for each.
        for path in chosen.iter().flat_map(Shot::pictures).filter(|path| kind(path) != Kind::Converted) {
            if let Some((w, h)) = self.faults.take(read_size(path)).filter(|found| *found != size) {
                let reason = format!("is {w} x {h}, the camera's first image is {} x {}", size.0, size.1);
                self.faults.add(path, "", reason, "give images and masks of one size");
            }
        }
        (chosen.len() == frames.len() && self.faults.n() == before).then_some(chosen)
    }
}
