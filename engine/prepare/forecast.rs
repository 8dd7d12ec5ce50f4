//! What COLMAP will have to do for pictures without cameras, and about how long that takes.

use std::fmt;

use super::costs::{About, Batch};
use super::foreign::read_size;
use super::pictures::{Photos, Pictures};
use super::reconstruct::{MAX_SIDE, OVERLAP, of_video, require, videos};
use super::settings::{PrepareSettings, Triangulate};
use super::source::footage::video_names;
use super::{track, triangulate, video};
use crate::error::Result;

/// What is to be expected of COLMAP.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// What the source holds, as `photos`.
    pub what: &'static str,
    /// Pictures that are to be placed.
    pub pictures: usize,
    /// Pairs of them that are matched.
    pub pairs: usize,
    /// A rough estimate, from the number and size of the pictures alone.
    pub seconds: f64,
    /// The same of what follows, until the capture is made.
    pub then: f64,
    /// Cores that are used.
    pub threads: usize,
    /// Cameras that the videos are taken for, by name.
    pub cameras: Vec<String>,
    /// What is worth knowing before it begins.
    pub notes: Vec<String>,
}

/// Cameras that are named.
const NAMED: usize = 12;

impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Forecast { what, pictures, pairs, seconds, then, threads, cameras, .. } = self;
        let (time, then) = (About(*seconds), About(*then));
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

/// How many pictures COLMAP will be given, photographs of the same place among them.
fn count(pictures: &Pictures, settings: &PrepareSettings) -> Result<usize> {
    let n = match pictures {
        Pictures::Photos(folder) => Photos::of(folder)?.files.len(),
        Pictures::Video(path) => of_video(settings, &video::probe(path)?).len(),
        Pictures::Videos(folder) => video_names(folder).len(),
    };
    match settings.photos.as_deref().and_then(Pictures::at) {
        Some(Pictures::Photos(folder)) => Ok(n + Photos::of(&folder)?.files.len()),
        _ => Ok(n),
    }
}

/// How long COLMAP will take; nothing where the source needs none to place its pictures.
pub(super) fn forecast(settings: &PrepareSettings, pictures: &Pictures) -> Result<Forecast> {
    require(settings, pictures)?;
    let n = count(pictures, settings)?;
    let pairs = match pictures {
        Pictures::Video(_) => (0..n).map(|later| OVERLAP.min(later)).sum(),
        _ => n * n.saturating_sub(1) / 2,
    };
    let (n, pairs) = match (settings.moving, pictures) {
        (Some(step), Pictures::Videos(folder)) => {
            let later = track::load(settings, folder, step)?;
            (n + later.0, pairs + later.1)
        }
        _ => (n, pairs),
    };
    let threads = settings.threads.max(1);
    let (width, height, frames) = footage(settings, pictures)?;
    let shrunk = (f64::from(MAX_SIDE) / f64::from(width.max(height))).min(1.0);
    let side = |side: u32| (f64::from(side) * shrunk) as u32;
    let given = Batch::new(n, (side(width), side(height)));
    // The mapper uses one core for much of its time.
    let seconds = (given.features() + given.pairs(pairs, false)) / threads as f64 + given.places();
    let scaled = |side: u32| (f64::from(side) * settings.scale) as u32;
    let then = match pictures {
        Pictures::Videos(folder) => {
            let moment = Batch::new(video_names(folder).len(), (scaled(width), scaled(height)));
            moment.clip(
                frames,
                triangulate::of_frames(settings.triangulate.unwrap_or(Triangulate::Every(1)), frames),
                true,
            )
        }
        _ => Batch::new(n, (scaled(width), scaled(height))).images(true),
    };
    let then = then / threads as f64;
    let cameras = if let Pictures::Videos(folder) = pictures { video_names(folder) } else { Vec::new() };
    Ok(Forecast {
        what: pictures.name(),
        pictures: n,
        pairs,
        seconds,
        then,
        threads,
        cameras,
        notes: pictures.notes(&settings.source)?,
    })
}

/// Width and height of the first picture, and frames of the clip.
fn footage(settings: &PrepareSettings, pictures: &Pictures) -> Result<(u32, u32, usize)> {
    let first = match pictures {
        Pictures::Photos(folder) => Photos::of(folder)?.files.into_iter().next(),
        Pictures::Video(path) => Some(path.clone()),
        Pictures::Videos(folder) => videos(folder).next().map(|(_, path)| path),
    };
    let Some(first) = first else { return Ok((1, 1, 0)) };
    if matches!(pictures, Pictures::Photos(_)) {
        let (width, height) = read_size(&first)?;
        return Ok((width, height, 1));
    }
    let video = video::probe(&first)?;
    Ok((video.width, video.height, settings.frames.of(video.n_frames()).len()))
}
