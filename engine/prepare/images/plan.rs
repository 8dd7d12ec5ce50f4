//! The plan of a source's images: frames, crops, sizes. Everything that does not fit is a fault before anything is written.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::Images;
use super::camera::{Camera, Material};
use super::paired::{self, Paired};
use crate::error::{Error, Result};
use crate::parallel::in_parallel;
use crate::prepare::fit::{Crop, fitted};
use crate::prepare::foreign::{Kind, decode_image, kind, read_size, size_for};
use crate::prepare::journal::stamps;
use crate::prepare::settings::PrepareSettings;
use crate::prepare::shifts;
use crate::prepare::source::{Footage, Source, SourceCamera};
use crate::prepare::timeline::Timeline;
use crate::prepare::video::{self, Selection, Video, can_convert};
use crate::scene::Intrinsics;
use crate::scene::capture::{Faults, Frames, RATES, Shot, camera_place};
use crate::scene::undistort::Lens;

pub(in crate::internals::prepare) fn plan(source: &Source, settings: &PrepareSettings, faults: &mut Faults) -> Images {
    let mut notes = Vec::new();
    // Several at a time: a program is started for each video.
    let probe = |index: usize| Ok(Recorded::probe(&source.cameras[index], source));
    let probed = in_parallel(source.cameras.len(), settings.threads, probe, |_| {}).unwrap_or_default();
    let material: Vec<_> = probed.into_iter().map(|recorded| faults.take(recorded)).collect();
    let videos = material.iter().map(|recorded| recorded.as_ref()?.video.as_ref());
    let videos: Vec<(&str, Option<&Video>)> =
        source.cameras.iter().map(|camera| camera.name.as_str()).zip(videos).collect();
    let of_videos: Vec<(&str, &Video)> = videos.iter().filter_map(|(name, video)| Some((*name, (*video)?))).collect();
    let timeline = Timeline::new(of_videos.iter().copied(), settings);
    // Frames of the clip until each camera's last picture.
    let left = |(camera, recorded): (&SourceCamera, &Recorded)| {
        let of_video = timeline.as_ref().filter(|_| recorded.video.is_some()).and_then(|it| it.n(&camera.name));
        let of_images = i64::from(recorded.n_frames) - i64::from(settings.whole_shift(&camera.name));
        of_video.unwrap_or(u32::try_from(of_images).unwrap_or(0))
    };
    let recorded =
        source.cameras.iter().zip(&material).filter_map(|(camera, recorded)| Some((camera, recorded.as_ref()?)));
    let left: Vec<(u32, &str)> = recorded.map(|it| (left(it), it.0.name.as_str())).collect();
    notes.extend(paired::of_lengths(&left, &of_videos, settings));
    notes.extend(timeline.as_ref().and_then(|timeline| paired::of_rates(&of_videos, timeline)));
    if settings.shifts.is_empty() {
        notes.extend(shifts::note_timecodes(&videos));
    }
    let select = select(source, settings, &left, &mut notes, faults);
    let of_images = settings.fps.or(source.fps).unwrap_or(settings.capture.fps);
    let fps = timeline.as_ref().map_or(of_images, |timeline| timeline.fps) / f64::from(select.every);
    if !RATES.contains(&fps) {
        let reason = format!("has {fps} frames per second, {} to {} are allowed", RATES.start(), RATES.end());
        faults.add(&source.calibration, "", reason, "give the rate at which the pictures were taken with --fps");
    }
    let is_converted = of_videos.iter().any(|(_, video)| video.colour.is_some());
    let converts = !is_converted || faults.take(can_convert(&settings.source)).unwrap_or(true);
    let rests = BTreeMap::new();
    let mut planned =
        Planner { source, settings, select, timeline, converts, notes, of_cameras: Vec::new(), rests, faults };
    let pairs = source.cameras.iter().zip(material);
    let cameras: Vec<Camera> = pairs.filter_map(|(camera, material)| planned.camera(camera, material?)).collect();
    let Planner { mut notes, timeline, rests, .. } = planned;
    notes.extend(grouped(&planned.of_cameras, source.cameras.len()));
    if cameras.iter().all(|camera| camera.is_test) && faults.n() == 0 {
        let remedy = "choose fewer cameras with --test-cameras";
        faults.add(&source.calibration, "", "has only test cameras", remedy);
    }
    let Selection { start, every, n } = select;
    let mut made_from = json!({
        "source": settings.source.to_string_lossy(), "source format": source.format, "start": start, "every": every, "frames": n,
        "scale": settings.scale, "format": settings.format, "cameras": cameras.iter().map(|camera| camera.stamp(every)).collect::<Vec<_>>(),
    });
    made_from["priors"] = stamps(cameras.iter().flat_map(Camera::priors));
    if !settings.shifts.is_empty() {
        made_from["shifts"] = settings.shifts_noted();
    }
    let (output, format, threads) = (settings.output.clone(), settings.format, settings.threads);
    Images { output, cameras, fps, notes, rests, select, timeline, format, threads, made_from }
}

/// The frames that are asked for and that all cameras have.
fn select(
    source: &Source,
    settings: &PrepareSettings,
    left: &[(u32, &str)],
    notes: &mut Vec<String>,
    faults: &mut Faults,
) -> Selection {
    let Frames { from: start, to, every } = settings.frames;
    let available = left.iter().map(|(n, _)| *n).min().unwrap_or(0);
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

struct Planner<'a> {
    source: &'a Source,
    settings: &'a PrepareSettings,
    select: Selection,
    timeline: Option<Timeline>,
    converts: bool,
    notes: Vec<String>,
    of_cameras: Vec<(String, String)>,
    rests: BTreeMap<String, f64>,
    faults: &'a mut Faults,
}

fn grouped(of_cameras: &[(String, String)], n_cameras: usize) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for (camera, note) in of_cameras {
        match groups.iter_mut().find(|(text, _)| text == note) {
            Some((_, cameras)) => cameras.push(camera),
            None => groups.push((note, vec![camera])),
        }
    }
    let notes = groups.into_iter().map(|(note, cameras)| match cameras.as_slice() {
        [camera] => format!("camera `{}`: {note}", camera.escape_debug()),
        all if all.len() == n_cameras => format!("all {n_cameras} cameras: {note}"),
        some => format!("{} cameras ({}): {note}", some.len(), some.join(", ")),
    });
    notes.collect()
}

impl Planner<'_> {
    /// Adds a fault of a camera, which is not planned then.
    fn fault<T>(&mut self, camera: &str, reason: impl Into<String>, remedy: impl Into<String>) -> Option<T> {
        self.faults.add(&self.source.calibration, camera_place(camera), reason, remedy);
        None
    }

    fn note(&mut self, camera: &str, note: String) {
        self.of_cameras.push((camera.to_owned(), note));
    }

    fn camera(&mut self, camera: &SourceCamera, recorded: Recorded) -> Option<Camera> {
        let (width, height) = recorded.size;
        let fitted = fitted(&camera.lens, recorded.size, || recorded.first(&camera.footage));
        let rescaled = self.settings.capture.rescale.then(|| {
            let note = format!("the calibration is scaled to the pictures, {width} x {height}");
            (camera.lens.resized(width, height), Crop::whole(recorded.size), Some(note))
        });
        let Some((lens, part, note)) = self.faults.take(fitted)?.or(rescaled) else {
            let Intrinsics { width: w, height: h, .. } = camera.lens.intrinsics;
            let reason = format!("is calibrated for {w} x {h}, its pictures are {width} x {height}");
            let remedy =
                "give the footage of this calibration, calibrate again, or scale the calibration with --rescale";
            return self.fault(&camera.name, reason, remedy);
        };
        note.into_iter().for_each(|note| self.note(&camera.name, note));
        let side = |side: u32| ((f64::from(side) * self.settings.scale).round() as u32).max(1);
        let lens = lens.resized(side(part.width), side(part.height));
        let kept = |pinhole: &Lens| {
            let (kept, whole) = (pinhole.intrinsics, lens.intrinsics);
            kept.width >= whole.width.div_ceil(16) && kept.height >= whole.height.div_ceil(16)
        };
        let Some(pinhole) = lens.pinhole().filter(kept) else {
            let reason = "has a distortion after which no rectangle of a sixteenth of the picture's sides is left";
            return self.fault(&camera.name, reason, "calibrate it again");
        };
        let (start, paired) = match &recorded.video {
            Some(video) => self.paired(camera, video)?,
            None => {
                let shift = self.settings.whole_shift(&camera.name);
                if f64::from(shift) != self.settings.shift(&camera.name) {
                    let why = "since images are known by their numbers";
                    self.note(&camera.name, format!("its shift is rounded to {shift} frames, {why}"));
                }
                let n_before = shift.unsigned_abs().saturating_sub(self.select.start);
                let start = self.select.start.checked_add_signed(shift);
                (start.or_else(|| self.begins_early(camera, n_before))?, Paired::default())
            }
        };
        let frames: Vec<u32> = (0..self.select.n).map(|i| start + i * self.select.every).collect();
        let poses = if camera.poses.is_empty() {
            vec![camera.pose]
        } else {
            let absent: Vec<_> = frames.iter().filter(|frame| !camera.poses.contains_key(frame)).collect();
            if let Some(first) = absent.first() {
                let reason = format!("moves and has no pose at {} frames, the first is {first}", absent.len());
                return self.fault(&camera.name, reason, "add the poses, or take fewer frames");
            }
            frames.iter().filter_map(|frame| camera.poses.get(frame).copied()).collect()
        };
        let masks = self.masks(&camera.name, &frames, recorded.size)?;
        let (material, masks) = match (&camera.footage, recorded.video) {
            (Footage::Video(_), Some(video)) => {
                self.note_conversions(&camera.name, &video)?;
                (Material::Video(video, paired.pictures), masks)
            }
            (Footage::Images(shots), _) => {
                let mut shots = self.shots(&camera.name, shots, &frames, recorded.size)?;
                for (shot, mask) in shots.iter_mut().zip(masks) {
                    shot.iter_mut().for_each(|shot| shot.mask = Some(mask.clone()));
                }
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

    fn begins_early<T>(&mut self, camera: &SourceCamera, n_before: u32) -> Option<T> {
        let reason = format!("is to begin {n_before} frames before its footage");
        let remedy = format!("begin at frame {} or later: --frames {0}:", self.select.start + n_before);
        self.fault(&camera.name, reason, remedy)
    }

    /// The first frame of a video that is taken, and the pictures of the chosen frames.
    fn paired(&mut self, camera: &SourceCamera, video: &Video) -> Option<(u32, Paired)> {
        let timeline = self.timeline.as_ref()?;
        let first = timeline.index(&camera.name, video, self.select.start)?;
        let Ok(start) = u32::try_from(first) else {
            return self.begins_early(camera, u32::try_from(-first).unwrap_or(u32::MAX));
        };
        let paired = paired::pair(timeline, &camera.name, video, self.select);
        if paired.pictures.iter().all(Option::is_none) && self.select.n > 0 {
            let remedy = "choose frames that it has with --frames, or leave the camera out";
            return self.fault(&camera.name, "has no picture of any chosen frame", remedy);
        }
        paired.notes.iter().for_each(|note| self.note(&camera.name, note.clone()));
        if self.settings.shifts.values().any(|shift| shift.fract() != 0.0) {
            self.rests.insert(camera.name.clone(), paired.rest);
        }
        Some((start, paired))
    }

    fn note_conversions(&mut self, name: &str, video: &Video) -> Option<()> {
        if let Some(colour) = &video.colour {
            if !self.converts {
                let reason = format!("is {}; this ffmpeg has no zscale and tonemap, which make it BT.709", colour.name);
                let remedy = format!(
                    "install an ffmpeg with zimg, or convert it elsewhere: ffmpeg -i IN -vf {},format=yuv420p OUT",
                    colour.filter
                );
                self.faults.add(&video.path, "", reason, remedy);
                return None;
            }
            let mapped = "tone-mapped to BT.709, all pictures by one curve";
            let how = if colour.tone_maps { mapped } else { "converted to BT.709" };
            self.note(name, format!("its video is {}: {how}", colour.name));
        }
        if let Some(top_first) = video.top_first {
            let field = if top_first { "top" } else { "bottom" };
            let how = "de-interlaced by ffmpeg's bwdif, a picture for each frame";
            self.note(name, format!("its video is interlaced ({field} field first): {how}"));
        }
        if let Some(named) = video.named {
            let n = video.n_frames();
            self.note(name, format!("its video is cut off: {n} of {named} pictures that its index names are there"));
        }
        Some(())
    }

    /// Flow leads to the next frame of the source, which must be the next frame of the capture.
    fn choose_flow(&mut self, shots: &mut [Option<Shot>]) {
        // The frame that the last flow leads to is not taken.
        shots.last_mut().and_then(|shot| shot.as_mut()?.flow.take());
        if self.settings.frames.every == 1 || shots.iter().flatten().all(|shot| shot.flow.is_none()) {
            return;
        }
        let note = "flow does not skip frames: left out".to_owned();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
        shots.iter_mut().flatten().for_each(|shot| shot.flow = None);
    }

    /// The shots of the chosen frames, each compared with the size of the camera's images.
    fn shots(&mut self, camera: &str, shots: &[Shot], frames: &[u32], size: (u32, u32)) -> Option<Vec<Option<Shot>>> {
        let there: BTreeMap<u32, &Shot> = shots.iter().map(|shot| (shot.frame, shot)).collect();
        let chosen: Vec<Option<Shot>> =
            frames.iter().map(|frame| there.get(frame).map(|shot| (*shot).clone())).collect();
        let absent: Vec<u32> = frames.iter().copied().filter(|frame| !there.contains_key(frame)).collect();
        let may_lack = self.source.may_lack || self.settings.capture.skip_missing;
        if may_lack && !absent.is_empty() {
            self.note(camera, format!("{} of {} frames have no image", absent.len(), frames.len()));
        } else if let Some(first) = absent.first() {
            let more = if absent.len() > 1 { format!(" and of {} more", absent.len() - 1) } else { String::new() };
            let reason =
                format!("has no image of frame {first}{more}; a capture folder has all frames of every camera");
            let longest = frames.split(|frame| !there.contains_key(frame)).max_by_key(|run| run.len()).unwrap_or(&[]);
            let take = match (longest.first(), longest.last()) {
                (Some(first), Some(last)) => format!("take frames that are there with --frames {first}:{}", last + 1),
                _ => "choose other frames".to_owned(),
            };
            let remedy = format!("add what is missing, {take}, or leave it out with --skip-missing");
            self.faults.add(&self.source.calibration, camera_place(camera), reason, remedy);
        }
        let before = self.faults.n();
        // Those that ffmpeg reads are compared when they are decoded: it would be started for each.
        for path in chosen.iter().flatten().flat_map(Shot::pictures).filter(|path| kind(path) != Kind::Converted) {
            if let Some((w, h)) = self.faults.take(size_for(path, size)).filter(|found| *found != size) {
                let reason = format!("is {w} x {h}, the camera's first image is {} x {}", size.0, size.1);
                self.faults.add(path, "", reason, "give images and masks of one size");
            }
        }
        ((may_lack || absent.is_empty()) && self.faults.n() == before).then_some(chosen)
    }
}

struct Recorded {
    size: (u32, u32),
    /// For images, the highest number plus one.
    n_frames: u32,
    video: Option<Video>,
}

impl Recorded {
    fn probe(camera: &SourceCamera, source: &Source) -> Result<Recorded> {
        match &camera.footage {
            Footage::Video(path) => {
                let video = video::probe(path)?;
                let size = (video.width, video.height);
                Ok(Recorded { size, n_frames: video.n_frames(), video: Some(video) })
            }
            Footage::Images(shots) => {
                let Some(last) = shots.iter().map(|shot| shot.frame).max() else {
                    let place = camera_place(&camera.name);
                    let remedy = "add its images, or remove the camera";
                    return Err(Error::data(&source.calibration, place, "has no image", remedy));
                };
                let lens = camera.lens.intrinsics;
                let size = size_for(&shots[0].image, (lens.width, lens.height))?;
                Ok(Recorded { size, n_frames: last + 1, video: None })
            }
        }
    }

    fn first(&self, footage: &Footage) -> Result<Vec<[u8; 3]>> {
        let (width, height) = self.size;
        match (footage, &self.video) {
            (Footage::Video(_), Some(video)) => {
                let mut pixels = Vec::new();
                video::decode(video, &[0], Crop::whole(self.size), self.size, 1, |_, rgb| {
                    pixels.extend_from_slice(rgb.as_chunks().0);
                    Ok(())
                })?;
                Ok(pixels)
            }
            (Footage::Video(_), None) => Ok(Vec::new()),
            (Footage::Images(shots), _) => {
                let image = decode_image(&shots[0].image, width, height)?.into_rgb8();
                Ok(image.as_raw().as_chunks().0.to_vec())
            }
        }
    }
}
