//! A rough forecast of a preparation in seconds of one core, from the number and the size of pictures alone; measured with COLMAP 3.8
//! on 14 pictures of 266 x 474, 12 of 640 x 360 and 7 of 1280 x 720.

use std::fmt;

use super::foreign::read_size;
use super::images::{Camera, Images};
use super::pictures::{Photos, Pictures};
use super::reconstruct::{MAX_SIDE, OVERLAP, of_video, require, videos};
use super::settings::{PrepareSettings, Triangulate};
use super::source::Source;
use super::source::footage::video_names;
use super::video::{self, Video};
use super::{track, triangulate};
use crate::error::Result;
use crate::scene::Intrinsics;
use crate::scene::undistort::Distortion;
use crate::words;

/// A picture that is decoded and written: for each million of its pixels; undistorting it takes as much again.
const IMAGE: f64 = 0.25;
/// Features of a picture: its start, and each million of pixels.
const FEATURES: [f64; 2] = [0.1, 1.4];
/// Features of a million pixels, and the most that COLMAP takes.
const PER_MILLION: f64 = 5000.0;
const MOST_FEATURES: f64 = 8192.0;
/// A pair: its start, and each feature of a picture.
const PAIR: [f64; 2] = [0.05, 1e-4];
/// With guided matching a pair takes so many times as long.
const GUIDED: f64 = 1.2;
/// A picture that is placed; and each of those that were placed before, which are adjusted again and again.
const PLACE: [f64; 2] = [0.1, 0.004];
/// Points of a frame: programs that start, and the triangulation of each picture.
const FRAME: [f64; 2] = [0.3, 0.05];

#[derive(Clone, Copy, Debug)]
struct Batch {
    n: usize,
    /// Millions.
    pixels: f64,
}

impl Batch {
    fn new(n: usize, (width, height): (u32, u32)) -> Self {
        Batch { n, pixels: f64::from(width) * f64::from(height) / 1e6 }
    }

    fn images(self, distort: bool) -> f64 {
        self.n as f64 * self.pixels * if distort { 2.0 * IMAGE } else { IMAGE }
    }

    fn features(self) -> f64 {
        self.n as f64 * (FEATURES[0] + FEATURES[1] * self.pixels)
    }

    fn pairs(self, n: usize, guided: bool) -> f64 {
        let features = (PER_MILLION * self.pixels).min(MOST_FEATURES);
        n as f64 * (PAIR[0] + PAIR[1] * features) * if guided { GUIDED } else { 1.0 }
    }

    fn places(self) -> f64 {
        let n = self.n as f64;
        n * (PLACE[0] + n * PLACE[1])
    }

    fn clip(self, frames: usize, with_points: usize, distort: bool) -> f64 {
        frames as f64 * self.images(distort) + with_points as f64 * self.points(triangulate::n_pairs(self.n))
    }

    fn points(self, pairs: usize) -> f64 {
        self.features() + self.pairs(pairs, true) + FRAME[0] + self.n as f64 * FRAME[1]
    }
}

fn rough(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("about {s:.0} s"),
        s if s < 5400.0 => format!("about {:.0} minutes", s / 60.0),
        s => format!("about {:.1} hours", s / 3600.0),
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// The kind of source, as `photos`.
    pub what: &'static str,
    /// Pictures that are to be placed.
    pub pictures: usize,
    /// Pairs of them that are matched.
    pub pairs: usize,
    pub seconds: f64,
    /// Seconds of the stages that follow, until the capture is made.
    pub then: f64,
    pub threads: usize,
    /// Cameras that the videos are taken for.
    pub cameras: Vec<String>,
    pub notes: Vec<String>,
}

const NAMED: usize = 12;

impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Forecast { what, pictures, pairs, seconds, then, threads, cameras, .. } = self;
        let (time, then) = (rough(*seconds), rough(*then));
        let named = match cameras.len() {
            0 => String::new(),
            1..=NAMED => format!(" ({})", cameras.join(", ")),
            n => format!(" ({}, ... {n} in all)", cameras[..NAMED].join(", ")),
        };
        write!(
            f,
            "{what} without cameras{named}: COLMAP places {pictures} pictures, matching {pairs} pairs, in {time} (CPU, threads: \
             {threads}), and the capture is made in {then} more; an interrupted run goes on where it stopped"
        )
    }
}

/// Pictures for COLMAP, photographs of the same place among them; width and height of the first; frames of the clip.
fn footage(settings: &PrepareSettings, pictures: &Pictures) -> Result<(usize, (u32, u32), usize)> {
    let clip = |video: &Video| ((video.width, video.height), settings.frames.of(video.n_frames()).len());
    let (n, (size, frames)) = match pictures {
        Pictures::Photos(folder) => {
            let files = Photos::of(folder)?.files;
            (files.len(), (files.first().map_or(Ok((1, 1)), |first| read_size(first))?, 1))
        }
        Pictures::Video(path) => {
            let video = video::probe(path)?;
            (of_video(settings, &video).len(), clip(&video))
        }
        Pictures::Videos(folder) => {
            let first = videos(folder).next().map(|(_, path)| video::probe(&path)).transpose()?;
            (video_names(folder).len(), first.as_ref().map_or(((1, 1), 0), clip))
        }
    };
    let n_photos = match settings.photos.as_deref().and_then(Pictures::at) {
        Some(Pictures::Photos(folder)) => Photos::of(&folder)?.files.len(),
        _ => 0,
    };
    Ok((n + n_photos, size, frames))
}

pub(super) fn forecast(settings: &PrepareSettings, pictures: &Pictures) -> Result<Forecast> {
    require(settings, pictures)?;
    let (n, (width, height), frames) = footage(settings, pictures)?;
    let pairs = match pictures {
        Pictures::Video(_) => (0..n).map(|later| OVERLAP.min(later)).sum(),
        _ => n * n.saturating_sub(1) / 2,
    };
    let later = match (settings.moving, pictures) {
        (Some(step), Pictures::Videos(folder)) => track::load(settings, folder, step)?,
        _ => (0, 0),
    };
    let (n, pairs) = (n + later.0, pairs + later.1);
    let threads = settings.threads.max(1);
    let shrunk = (f64::from(MAX_SIDE) / f64::from(width.max(height))).min(1.0);
    let side = |side: u32| (f64::from(side) * shrunk) as u32;
    let given = Batch::new(n, (side(width), side(height)));
    // The mapper uses one core for much of its time.
    let seconds = (given.features() + given.pairs(pairs, false)) / threads as f64 + given.places();
    let scaled = |side: u32| (f64::from(side) * settings.scale) as u32;
    let then = match pictures {
        Pictures::Videos(folder) => {
            let moment = Batch::new(video_names(folder).len(), (scaled(width), scaled(height)));
            let points = settings.triangulate.unwrap_or(Triangulate::Every(1));
            moment.clip(frames, triangulate::of_frames(points, frames), true)
        }
        _ => Batch::new(n, (scaled(width), scaled(height))).images(true),
    };
    let then = then / threads as f64;
    let cameras = if let Pictures::Videos(folder) = pictures { video_names(folder) } else { Vec::new() };
    let (what, notes) = (pictures.name(), pictures.notes(&settings.source)?);
    Ok(Forecast { what, pictures: n, pairs, seconds, then, threads, cameras, notes })
}

/// Less is not worth a line before it begins, seconds.
const LONG: f64 = 10.0;

/// The announcement of pictures and points of a source with cameras and their time; nothing where little is left.
pub(super) fn announced(images: &Images, source: &Source, settings: &PrepareSettings) -> Option<String> {
    let n = images.n_frames() as usize;
    let is_left = |folder: &str, name: String| !images.output.join(folder).join(name).is_file();
    let of_camera = |camera: &Camera| {
        let left = (0..images.n_frames()).filter(|frame| is_left("images", images.image_name(camera, *frame))).count();
        let Intrinsics { width, height, .. } = camera.lens.intrinsics;
        Batch::new(left, (width, height)).images(camera.lens.distortion != Distortion::None)
    };
    let of_images: f64 = images.cameras.iter().map(of_camera).sum();
    let what = triangulate::asked(source, settings).0;
    let with_points = triangulate::of_frames(what, n);
    let done = (0..images.n_frames()).filter(|frame| !is_left("points", format!("{frame:05}.ply"))).count();
    let training: Vec<Intrinsics> =
        images.cameras.iter().filter(|camera| !camera.is_test).map(|camera| camera.pinhole.intrinsics).collect();
    let of_frame = training.first().map_or(0.0, |of| {
        Batch::new(training.len(), (of.width, of.height)).points(triangulate::n_pairs(training.len()))
    });
    let of_points = with_points.saturating_sub(done) as f64 * of_frame;
    let seconds = (of_images + of_points) / settings.threads.max(1) as f64;
    let points =
        if of_points > 0.0 { format!(", and points of {}", words::count(with_points, "frame")) } else { String::new() };
    (seconds >= LONG).then(|| {
        format!(
            "{} of {}{points}: {} (CPU, threads: {}); an interrupted run goes on where it stopped",
            words::count(n, "frame"),
            words::count(images.cameras.len(), "camera"),
            rough(seconds),
            settings.threads
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds of one core that COLMAP 3.8 took on a busy machine for what the estimates are of.
    #[test]
    fn estimates_are_of_the_size_of_what_was_measured() {
        let placed = |n: usize, size: (u32, u32)| {
            let pictures = Batch::new(n, size);
            pictures.features() + pictures.pairs(n * (n - 1) / 2, false) + pictures.places()
        };
        let clip = Batch::new(12, (640, 360)).clip(6, 6, false);
        for (about, measured) in [
            (placed(14, (266, 474)), 26.4),
            (placed(7, (1280, 720)), 35.9),
            (placed(12, (640, 360)), 11.8),
            (clip, 77.8),
        ] {
            assert!((0.5..1.6).contains(&(about / measured)), "{about} s instead of {measured} s");
        }
    }

    #[test]
    fn seconds_are_told_in_what_people_count_in() {
        let texts = [12.3, 200.0, 9000.0].map(rough);
        assert_eq!(texts, ["about 12 s", "about 3 minutes", "about 2.5 hours"]);
    }
}
