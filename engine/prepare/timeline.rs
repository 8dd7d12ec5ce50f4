//! Which picture of each video shows a moment: videos are paired by time, whatever their rates are and wherever frames are lost.

use std::collections::BTreeMap;

use super::settings::PrepareSettings;
use super::video::{RATE_TOLERANCE, Video};
use crate::report::statistics::median;

/// The rounding of times in containers, beyond half a frame, seconds.
const ROUNDED: f64 = 1e-3;
/// Pictures that tell where a video's frames are between those of the clip.
const ASKED: usize = 101;

pub(super) struct Timeline {
    /// Frames per second, before any are left out.
    pub fps: f64,
    clips: BTreeMap<String, Clip>,
}

struct Clip {
    /// When frame 0 is, seconds of the file's clock.
    begins: f64,
    /// As `begins`, moved to the nearest picture where the video has the clip's rate: then no picture lies between two frames.
    snapped: f64,
    n: u32,
}

impl Timeline {
    /// The rate is the lowest of the videos, unless the settings have one; frame 0 is when the last camera has planned, later by its shift.
    pub fn new<'a>(
        videos: impl IntoIterator<Item = (&'a str, &'a Video)>,
        settings: &PrepareSettings,
    ) -> Option<Timeline> {
        let videos: Vec<_> = videos.into_iter().collect();
        let lowest = videos.iter().map(|(_, video)| video.fps).min_by(f64::total_cmp)?;
        // Of rates that are the same but for rounding the first is taken.
        let lowest = videos.iter().map(|(_, video)| video.fps).find(|fps| is_same(*fps, lowest))?;
        let fps = settings.fps.unwrap_or(lowest);
        // Pictures that begin long after their file make the clip begin later, for all.
        let late = videos.iter().map(|(_, video)| video.times[0] - video.began).fold(0.0, f64::max);
        let clip = |(name, video): &(&str, &Video)| {
            let begins = video.began + late + settings.shift(name) / fps;
            let snapped = if is_same(video.fps, fps) { snapped(&video.times, begins, fps) } else { begins };
            let last = video.times.last().copied().unwrap_or(begins);
            // To the end of the last picture, as far as a picture may stand for a frame.
            let n = ((last - snapped) * fps + 0.5 * fps / video.fps.max(fps)).floor() + 1.0;
            ((*name).to_owned(), Clip { begins, snapped, n: n.clamp(0.0, f64::from(u32::MAX)) as u32 })
        };
        Some(Timeline { fps, clips: videos.iter().map(clip).collect() })
    }

    /// Frames from the clip's beginning to the last picture of a video.
    pub fn n(&self, name: &str) -> Option<u32> {
        self.clips.get(name).map(|clip| clip.n)
    }

    /// When a frame is, by the clock of a video's file, seconds.
    pub fn time(&self, name: &str, frame: u32) -> f64 {
        self.clips.get(name).map_or(0.0, |clip| clip.begins + f64::from(frame) / self.fps)
    }

    /// The number of a frame in a video of the clip's rate from its first picture on; below 0 before that.
    pub fn index(&self, name: &str, video: &Video, frame: u32) -> Option<i64> {
        Some(((self.snapped(name, frame)? - video.times[0]) * self.fps).round() as i64)
    }

    /// The number of the picture that is nearest to a frame; none where even that is more than half a frame away.
    pub fn picture(&self, name: &str, video: &Video, frame: u32) -> Option<usize> {
        let nearest = self.nearest(name, video, frame)?;
        let away = (video.times[nearest] - self.snapped(name, frame)?).abs();
        (away <= 0.5 / self.fps + ROUNDED.min(0.1 / self.fps)).then_some(nearest)
    }

    /// The number of the picture that is nearest to a frame, however far away.
    pub fn nearest(&self, name: &str, video: &Video, frame: u32) -> Option<usize> {
        let time = self.snapped(name, frame)?;
        let after = video.times.partition_point(|shown| *shown < time);
        let around = [after.checked_sub(1), (after < video.times.len()).then_some(after)];
        let away = |picture: &usize| (video.times[*picture] - time).abs();
        around.into_iter().flatten().min_by(|a, b| away(a).total_cmp(&away(b)))
    }

    /// How much later than its frame a picture is, frames.
    pub fn rest(&self, name: &str, video: &Video, frame: u32, picture: usize) -> f64 {
        (video.times[picture] - self.time(name, frame)) * self.fps
    }

    fn snapped(&self, name: &str, frame: u32) -> Option<f64> {
        self.clips.get(name).map(|clip| clip.snapped + f64::from(frame) / self.fps)
    }
}

pub(super) fn is_same(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < RATE_TOLERANCE
}

/// `begins` moved to the nearest of the moments at which pictures of the rate `fps` are; a first one at an odd time does not tell them.
fn snapped(times: &[f64], begins: f64, fps: f64) -> f64 {
    let off = |time: &f64| {
        let frames = (time - times[0]) * fps;
        frames - frames.round()
    };
    let phase = median(&times.iter().take(ASKED).map(off).collect::<Vec<_>>());
    let first = times[0] + phase / fps;
    first + ((begins - first) * fps).round() / fps
}
