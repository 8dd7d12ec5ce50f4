//! Videos in step: what is worth knowing of their lengths and rates, and which picture each frame of the capture shows.

use std::collections::BTreeMap;

use crate::prepare::settings::PrepareSettings;
use crate::prepare::timeline::{Timeline, is_same};
use crate::prepare::video::{Selection, Video};
use crate::words::listed;

/// Frames by which pictures may be off their frames before that is told.
const EVEN: f64 = 0.1;

#[derive(Default)]
pub(super) struct Paired {
    pub pictures: Vec<Option<usize>>,
    /// How much later the pictures are than their frames in the mean, frames of the capture.
    pub rest: f64,
    pub notes: Vec<String>,
}

pub(super) fn pair(timeline: &Timeline, name: &str, video: &Video, select: Selection) -> Paired {
    let frames = || (0..select.n).map(|k| select.start + k * select.every);
    let pictures: Vec<Option<usize>> = frames().map(|frame| timeline.picture(name, video, frame)).collect();
    let there = frames().zip(&pictures).filter_map(|(frame, picture)| Some((frame, (*picture)?)));
    let rests: Vec<f64> = there.map(|(frame, picture)| timeline.rest(name, video, frame, picture)).collect();
    let rest = rests.iter().sum::<f64>() / rests.len().max(1) as f64;
    let mut notes = Vec::new();
    notes.extend(of_gaps(timeline, name, video, &frames().zip(pictures.iter().copied()).collect::<Vec<_>>()));
    let uneven = rests.iter().map(|it| (it - rest).abs()).fold(0.0, f64::max);
    if is_same(video.fps, timeline.fps) && uneven > EVEN {
        notes.push(format!("its pictures come unevenly: paired by time, they are up to {uneven:.1} frames off"));
    }
    Paired { pictures, rest: rest / f64::from(select.every), notes }
}

fn of_gaps(timeline: &Timeline, name: &str, video: &Video, frames: &[(u32, Option<usize>)]) -> Option<String> {
    let absent = |at: usize| frames[at].1.is_none();
    let n = (0..frames.len()).filter(|at| absent(*at)).count();
    if n > 0 && video.fps < timeline.fps && !is_same(video.fps, timeline.fps) {
        return Some(format!(
            "it has pictures of {} of {} frames, since it has fewer a second",
            frames.len() - n,
            frames.len()
        ));
    }
    let begins: Vec<usize> = (0..frames.len()).filter(|at| absent(*at) && (*at == 0 || !absent(at - 1))).collect();
    let first = timeline.time(name, frames[*begins.first()?].0) - video.times[0];
    let what = if n == 1 { "1 frame is".to_owned() } else { format!("{n} frames are") };
    let places = match begins.len() {
        1 => format!("at {first:.2} s"),
        many => format!("in {many} places, the first at {first:.2} s"),
    };
    Some(format!("{what} missing {places} of its video: the capture has no picture of it then"))
}

/// That the cameras have different numbers of frames, from where the clip begins on, and nothing says that they are in step.
pub(super) fn of_lengths(
    left: &[(u32, &str)],
    videos: &[(&str, &Video)],
    settings: &PrepareSettings,
) -> Option<String> {
    let ((least, shortest), (most, longest)) = (left.iter().min()?, left.iter().max()?);
    let mut note = format!(
        "the cameras have different numbers of frames, {least} (`{shortest}`) to {most} (`{longest}`): what all have is used"
    );
    if settings.shifts.is_empty() {
        note += ", in the hope that they begin together (--shift tells when they do not";
        if videos.len() == left.len() && videos.iter().all(|(_, video)| video.has_sound) {
            note += "; all have sound, and --shift sound finds out by it";
        }
        note += ")";
    }
    (least != most).then_some(note)
}

/// That rates differ, or pictures begin late, and what is made of that.
pub(super) fn of_rates(videos: &[(&str, &Video)], timeline: &Timeline) -> Option<String> {
    let mut rates: BTreeMap<u64, Vec<&str>> = BTreeMap::new();
    for (name, video) in videos {
        // Hundredths, as people name rates.
        rates.entry((video.fps * 100.0).round() as u64).or_default().push(name);
    }
    let mut parts = Vec::new();
    if videos.iter().any(|(_, video)| !is_same(video.fps, timeline.fps)) {
        let of = |(rate, names): (&u64, &Vec<&str>)| format!("{} ({})", *rate as f64 / 100.0, listed(names));
        let all = rates.iter().map(of).collect::<Vec<_>>().join(", ");
        parts.push(format!("have {all} frames per second"));
    }
    let late: Vec<&str> =
        videos.iter().filter(|(_, video)| video.times[0] > video.began).map(|(name, _)| *name).collect();
    if let Some(most) = videos.iter().map(|(_, video)| video.times[0] - video.began).max_by(f64::total_cmp)
        && !late.is_empty()
    {
        parts.push(format!("begin late in their files ({}), by up to {most:.2} s", listed(&late)));
    }
    let fps = (timeline.fps * 100.0).round() / 100.0;
    (!parts.is_empty()).then(|| {
        format!(
            "the cameras' videos {}: they are paired by time; the capture has {fps} frames per second (--fps), and of each camera the \
             picture nearest to each",
            parts.join(" and ")
        )
    })
}
