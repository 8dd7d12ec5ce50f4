//! Facts of a capture that a trainer needs beside its pictures.

use super::lenses;
use super::terms::{self};
use super::{Config, PoseKind, Rate, TermData};
use crate::parallel::{in_parallel, threads};
use crate::recon::{cameras_look_inward, evenly_chosen};
use crate::scene::capture::{Camera, Capture, Extent, alpha_of, decode_image, has_alpha, read_size};
use crate::scene::{Clearing, FlowModel, View};
use glam::DVec3;
use std::collections::BTreeSet;
use std::path::Path;

/// Images that are tested for the background.
const MOST_LOOKED_AT: usize = 8;
/// Colours within so many levels of 255 count as equal.
const LEVELS_ALIKE: i32 = 2;
/// Images show the background if more than this share of most of them has its colour; the darkest real one has 0.06 %.
const MOST_BEHIND: f64 = 0.05;

/// The learning rate of poses in a run of 30,000 steps. It is lower than that of positions: calibrations are seldom far
/// off, and a scene can follow its cameras.
const POSE_RATE: Rate = Rate { start: 3e-5, end: 3e-7 };

/// Facts of a capture that a trainer needs, in the frame of training.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    pub extent: Extent,
    /// Views before which density control removes floaters: of training cameras, between them, and viewpoints.
    pub lenses: Vec<View>,
    /// Spaces that are kept clear of Gaussians.
    pub clearings: Vec<Clearing>,
    /// Normalised time between two frames.
    pub dt: f64,
    /// Cameras that are trained on and film, photographs aside.
    pub n_filming: usize,
    /// Index of the first photograph among the cameras: photographs come last.
    pub first_photo: usize,
    /// By camera, whether its time offset is learnt; empty if none is.
    pub learns_offset: Vec<bool>,
    /// By camera, its mean place in scene units, if its pose is learnt; empty if none is.
    pub learns_pose: Vec<Option<DVec3>>,
    /// By camera, whether it has a bilateral grid; empty if none has.
    pub has_grid: Vec<bool>,
    pub most_grids: usize,
    /// Data of the capture that the terms of the loss use beside its colours.
    pub data: TermData,
    pub flow_model: FlowModel,
    /// Learning rate of the poses: of turns in radians, of shifts in scene extents.
    pub pose_rate: Rate,
    /// Images show the background: through transparent pixels, or in its colour.
    pub shows_background: bool,
    /// Each image of a step has a random background.
    pub varies_background: bool,
}

impl Setup {
    /// The setup of a training that uses the pictures alone.
    pub fn plain(extent: Extent, dt: f64) -> Self {
        Setup {
            extent,
            lenses: Vec::new(),
            clearings: Vec::new(),
            dt,
            n_filming: 1,
            first_photo: usize::MAX,
            learns_offset: Vec::new(),
            learns_pose: Vec::new(),
            has_grid: Vec::new(),
            most_grids: 0,
            data: TermData::NONE,
            flow_model: FlowModel::Velocity,
            pose_rate: POSE_RATE,
            shows_background: true,
            varies_background: false,
        }
    }

    /// The setup of a run of `config` on `capture`. Cameras have offsets and grids in clips of several cameras alone: one image
    /// of a static scene is too little to tell a grid from the scene.
    pub fn new(capture: &Capture, config: &Config) -> Self {
        let trained: Vec<bool> = capture.cameras.iter().map(|camera| !camera.is_test).collect();
        let may_have_grids = config.grids.is_some() && capture.is_rig_clip();
        let n_trained = trained.iter().filter(|trained| **trained).count();
        // One picture fits any clock: the scene absorbs the error.
        let has_pictures = |camera: usize| capture.cameras[camera].shots.len() > 1;
        let observable: Vec<bool> = trained.iter().enumerate().map(|(i, is)| *is && has_pictures(i)).collect();
        let learns_offset = if observable.contains(&true) { observable } else { Vec::new() };
        let shows_background = shows_background(capture, config.background);
        let moves = capture.cameras.iter().any(Camera::moves);
        Setup {
            extent: capture.extent(),
            lenses: [lenses::of_cameras(capture), lenses::between_cameras(capture)].concat(),
            clearings: lenses::clearings(capture),
            dt: 1.0 / f64::from(capture.n_frames.max(1)),
            n_filming: capture.cameras.iter().filter(|camera| camera.films()).count(),
            first_photo: capture.cameras.iter().take_while(|camera| !camera.is_photo).count(),
            learns_offset: if config.offsets && capture.is_rig_clip() { learns_offset } else { Vec::new() },
            learns_pose: match config.poses {
                // A camera with one image has no other that could contradict it.
                PoseKind::Auto if capture.is_rig_clip() => centers(capture),
                PoseKind::Learnt => centers(capture),
                PoseKind::Auto | PoseKind::Given => Vec::new(),
            },
            pose_rate: POSE_RATE,
            // A review decides later which cameras get one.
            has_grid: if may_have_grids && config.required.grids_at == 0.0 { trained } else { Vec::new() },
            most_grids: if may_have_grids { n_trained } else { 0 },
            data: terms::data(config, capture),
            // As in the priors; the projected velocity is the paper's.
            flow_model: if moves { FlowModel::Displacement } else { FlowModel::Velocity },
            shows_background,
            varies_background: config.vary_background && !shows_background && cameras_look_inward(capture),
        }
    }
}

/// True if training images of `capture` show the `background`: through transparent pixels, or because much of most has
/// its colour. Tests some images, of cameras and times evenly chosen, since a clip may fade in from black.
fn shows_background(capture: &Capture, background: [f32; 3]) -> bool {
    let is_used = |(_, camera): &(usize, &Camera)| !camera.is_test && !camera.shots.is_empty();
    let cameras: Vec<(usize, &Camera)> = capture.cameras.iter().enumerate().filter(is_used).collect();
    let firsts = cameras.iter().map(|(_, camera)| camera.shots[0].image.as_path());
    let with_alpha: Vec<&Path> = firsts.filter(|image| has_alpha(image)).collect();
    let some = evenly_chosen(with_alpha, MOST_LOOKED_AT);
    let shows_through = in_parallel(some.len(), threads(), |k| Ok(is_transparent(some[k])), |_| {});
    if shows_through.unwrap_or_default().contains(&true) {
        return true;
    }
    let behind = background.map(|level| (255.0 * level).round() as i32);
    let is_behind = |word: &u32| (0..3).all(|k| ((word >> (8 * k)) as u8 as i32 - behind[k]).abs() <= LEVELS_ALIKE);
    let chosen = |k: usize| {
        let (index, camera) = cameras.get(k * cameras.len() / MOST_LOOKED_AT)?;
        Some((*index, camera.shots[k * camera.shots.len() / MOST_LOOKED_AT].frame))
    };
    let some: BTreeSet<(usize, u32)> = (0..MOST_LOOKED_AT).filter_map(chosen).collect();
    let some: Vec<(usize, u32)> = some.into_iter().collect();
    // The share of an image. The run reports one that cannot be read.
    let look = |k: usize| {
        let (camera, frame) = some[k];
        let Ok(picture) = capture.picture(camera, frame) else { return Ok(0.0) };
        let counting = || picture.pixels.iter().filter(|word| **word >> 24 != 0);
        Ok(counting().filter(|word| is_behind(word)).count() as f64 / counting().count().max(1) as f64)
    };
    let mut shares: Vec<f64> = in_parallel(some.len(), threads(), look, |_| {}).unwrap_or_default();
    shares.sort_unstable_by(f64::total_cmp);
    shares.get(shares.len().saturating_sub(1) / 2).is_some_and(|share| *share > MOST_BEHIND)
}

/// An image that cannot be read is opaque here; the run reports it.
fn is_transparent(image: &Path) -> bool {
    let decoded = read_size(image).ok().and_then(|(width, height)| decode_image(image, width, height).ok());
    decoded.is_some_and(|image| alpha_of(image).iter().any(|alpha| *alpha < 255))
}

/// The mean places of the training cameras that film; none for others, or for a camera without images.
fn centers(capture: &Capture) -> Vec<Option<DVec3>> {
    let of_camera = |(index, camera): (usize, &Camera)| {
        let frames = camera.shots.iter().map(|shot| shot.frame);
        let centers: Vec<DVec3> =
            frames.filter_map(|frame| Some(capture.view(index, frame).ok()?.pose.center())).collect();
        let is_learnt = camera.films() && !centers.is_empty();
        is_learnt.then(|| centers.iter().sum::<DVec3>() / centers.len() as f64)
    };
    capture.cameras.iter().enumerate().map(of_camera).collect()
}
