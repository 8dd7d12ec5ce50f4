//! The surfaces that the pictures show: static ones at the reference frame, and the hulls of moving ones.

use super::agree::{self, Agreed};
use super::chosen::shown;
use super::eye::{Ground, Seen, ViewBuffers};
use super::points::Found;
use super::settings::Settings;
use super::sizing::Lenses;
use super::{hull, sweep};
use crate::error::Result;
use crate::parallel::{in_parallel, threads};
use crate::scene::capture::{Capture, Point};

/// Longest side of the pictures that silhouettes are taken from, pixels.
const HULL_SIDE: usize = 320;
/// Longest side of the pictures that are swept, pixels.
const SWEEP_SIDE: usize = 128;
/// Gaussians from the hull of one frame, at most. With 600, dynamic parts lost some 0.8 dB (`assets/lab/techniques.md`).
const MOVING_POINTS: usize = 1500;
/// Pixels of the training pictures of a frame for each point of a surface, at least: small pictures resolve no more.
const PIXELS_PER_POINT: u64 = 16;
/// Key of the random choice among a hull's points.
const HULL_KEY: u64 = 0x6875_6c6c;

pub(super) struct Views<'a> {
    pub capture: &'a Capture,
    /// Points of the capture that may be static.
    pub points: &'a [Point],
    pub settings: &'a Settings,
    pub cameras: &'a [usize],
    pub hull_frames: &'a [u32],
    pub finds_static: bool,
    pub cut_out: bool,
}

#[derive(Default)]
pub(super) struct Surfaces {
    pub still: Vec<Found>,
    pub moving: Vec<(u32, Vec<Found>)>,
    pub n_known: usize,
    /// Static points that were found, before thinning.
    pub n_found: usize,
}

impl Views<'_> {
    /// The surfaces, frame by frame. `known` are static points; if none are given, the pictures decide which of `points`
    /// are static. `done` is called after each picture and each sweep.
    pub fn surfaces(&self, known: Option<&[Found]>, lenses: &Lenses, done: &mut dyn FnMut()) -> Result<Surfaces> {
        let at_rest = Some(self.capture.reference_frame).filter(|_| self.finds_static);
        let mut frames: Vec<u32> = self.hull_frames.iter().copied().chain(at_rest).collect();
        frames.sort_unstable();
        frames.dedup();
        let threads = threads();
        let mut surfaces = Surfaces::default();
        for frame in frames {
            let (is_reference, has_hull) = (at_rest == Some(frame), self.hull_frames.contains(&frame));
            // A picture is dropped as soon as it is reduced: thirty of 8K take gigabytes.
            let eyes_of = |i: usize| {
                let camera = self.cameras[i];
                let Some(shown) = shown(self.capture, camera, frame, is_reference) else { return Ok((None, None)) };
                let seen = Seen::read(self.capture, camera, shown, self.cut_out)?;
                let eye = |is_wanted: bool, longest: usize| is_wanted.then(|| ViewBuffers::new(&seen, longest));
                // A camera without a mask at this frame does not mark moving objects.
                let carves = has_hull && shown == frame && seen.foreground.is_some();
                Ok((eye(is_reference, SWEEP_SIDE), eye(carves || is_reference && self.cut_out, HULL_SIDE)))
            };
            let eyes = in_parallel(self.cameras.len(), threads, eyes_of, |_| done())?;
            let (swept, carving): (Vec<Option<ViewBuffers>>, Vec<Option<ViewBuffers>>) = eyes.into_iter().unzip();
            let carving: Vec<ViewBuffers> = carving.into_iter().flatten().collect();
            if is_reference {
                let eyes: Vec<ViewBuffers> = swept.into_iter().flatten().collect();
                let known = known.map_or_else(|| agree::still(self.points, &eyes), <[Found]>::to_vec);
                surfaces.n_known = known.len();
                let depths = sweep::sweep(&eyes, threads, &mut *done)?;
                let found = agree::agree(&eyes, &depths, &known, threads)?;
                let found = found.into_iter().filter(|point| !self.cut_out || hull::may_be_shown(&eyes, &point.found));
                let of_before = known.into_iter().map(|found| Agreed { found, n_cameras: usize::MAX });
                let key = [self.settings.seed, HULL_KEY];
                let most_of_hull = if self.cut_out { self.settings.n_points } else { 0 };
                let of_hull = hull::surface(&carving, Ground::Still, most_of_hull, &key);
                let of_hull = of_hull.into_iter().map(|found| Agreed { found, n_cameras: 1 });
                let mut all: Vec<Agreed> = of_before.chain(found).chain(of_hull).collect();
                all.retain(|point| !lenses.are_veiled_by(&point.found));
                surfaces.n_found = all.iter().filter(|point| point.n_cameras < usize::MAX).count();
                let most = (self.n_pixels() / PIXELS_PER_POINT).min(self.settings.n_points as u64) as usize;
                surfaces.still = agree::thin(&all, most.max(surfaces.n_known));
            }
            if has_hull {
                let key = [self.settings.seed, HULL_KEY, u64::from(frame)];
                let found = hull::surface(&carving, Ground::Moving, MOVING_POINTS, &key);
                surfaces.moving.push((frame, found));
            }
        }
        Ok(surfaces)
    }

    /// Pixels of all training pictures of one frame, or of all photographs.
    fn n_pixels(&self) -> u64 {
        let are_photos = self.cameras.iter().any(|camera| self.capture.cameras[*camera].is_photo);
        let all = self.capture.cameras.iter().filter(|camera| !camera.is_test && camera.is_photo == are_photos);
        all.map(|camera| camera.intrinsics.n_pixels()).sum()
    }
}
