//! What a trainer needs to know of a capture beside its pictures.

use super::config::{Config, FlowChoice};
use crate::scene::capture::{Capture, Extent, camera_center};
use crate::scene::{FlowModel, View};
use glam::{DMat3, DQuat, DVec3};
use std::collections::BTreeSet;

/// Lenses that a Gaussian is compared with, at most: a round of density control asks each Gaussian about all.
const MOST_LENSES: usize = 64;
/// Neighbours of a view between which and it somebody may stand.
const NEIGHBOURS: usize = 4;
/// Cosine of the angle between the axes of neighbours, at least.
const ALIKE: f64 = 0.5;

/// A capture, to a trainer.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Where the cameras are.
    pub extent: Extent,
    /// Views of every pose of every training camera, and those that somebody named ([`Capture::viewpoints`]): at most
    /// `MOST_LENSES`, evenly chosen.
    pub lenses: Vec<View>,
    /// Normalised time between two frames.
    pub dt: f64,
    /// Cameras that are trained on.
    pub n_trained: usize,
    /// By camera, whether its time offset is learnt; empty where none is.
    pub learns_offset: Vec<bool>,
    /// By camera, whether it has a bilateral grid; empty where none has.
    pub has_grid: Vec<bool>,
    /// Whether pictures may come with priors of depth or flow.
    pub has_priors: bool,
    /// What the rendered flow is, to be like the priors'.
    pub flow_model: FlowModel,
}

impl Setup {
    /// A capture of which nothing is used but its pictures.
    pub fn plain(extent: Extent, dt: f64) -> Self {
        Setup {
            extent,
            lenses: Vec::new(),
            dt,
            n_trained: 1,
            learns_offset: Vec::new(),
            has_grid: Vec::new(),
            has_priors: false,
            flow_model: FlowModel::Velocity,
        }
    }

    /// What `config` makes of `capture`. Offsets and grids are those of the training cameras, of clips that several cameras
    /// took; a static scene's cameras have one image each, too few to tell a grid from the scene.
    pub fn new(capture: &Capture, config: &Config) -> Self {
        let trained: Vec<bool> = capture.cameras.iter().map(|camera| !camera.is_test).collect();
        let where_set = |is_set: bool| if is_set && is_rig(capture) { trained.clone() } else { Vec::new() };
        // One picture fits any clock: the scene takes up what is off.
        let has_pictures = |camera: usize| capture.cameras[camera].shots.len() > 1;
        let observable: Vec<bool> = trained.iter().enumerate().map(|(i, is)| *is && has_pictures(i)).collect();
        let learns_offset = if observable.contains(&true) { observable } else { Vec::new() };
        let shots = || capture.cameras.iter().filter(|camera| !camera.is_test).flat_map(|camera| &camera.shots);
        let has_depth = config.loss.depth > 0.0 && shots().any(|shot| shot.depth.is_some());
        let has_flow = config.loss.flow > 0.0 && shots().any(|shot| shot.flow.is_some());
        let moves = capture.cameras.iter().any(|camera| camera.shots.iter().any(|s| s.world_to_camera.is_some()));
        Setup {
            extent: capture.extent(),
            lenses: lenses(capture),
            dt: 1.0 / f64::from(capture.n_frames.max(1)),
            n_trained: trained.iter().filter(|trained| **trained).count(),
            learns_offset: if config.offsets && is_rig(capture) { learns_offset } else { Vec::new() },
            // Those that are required come later.
            has_grid: where_set(config.grids && config.required.reviews == 0),
            has_priors: has_depth || has_flow,
            flow_model: match config.loss.flow_model {
                FlowChoice::Velocity => FlowModel::Velocity,
                FlowChoice::Displacement => FlowModel::Displacement,
                FlowChoice::Auto if moves => FlowModel::Displacement,
                FlowChoice::Auto => FlowModel::Velocity,
            },
        }
    }
}

/// The views of `capture`, and views half-way between neighbours: who looks at the scene stands between its cameras.
fn lenses(capture: &Capture) -> Vec<View> {
    let views = capture.lens_views();
    let each = views.len().div_ceil(MOST_LENSES).max(1);
    let mut views: Vec<View> = views.into_iter().step_by(each).collect();
    let poses: Vec<(DVec3, DQuat)> = views.iter().map(pose).collect();
    let axis = |i: usize| poses[i].1 * DVec3::Z;
    let mut pairs = BTreeSet::new();
    for (i, (place, _)) in poses.iter().enumerate() {
        let others = (0..poses.len()).filter(|j| *j != i && axis(*j).dot(axis(i)) > ALIKE);
        let mut others: Vec<(f64, usize)> = others.map(|j| (place.distance(poses[j].0), j)).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.extend(others.into_iter().take(NEIGHBOURS).map(|(_, j)| (i.min(j), i.max(j))));
    }
    for (i, j) in pairs {
        let place = 0.5 * (poses[i].0 + poses[j].0);
        let turn = DMat3::from_quat(poses[i].1.slerp(poses[j].1, 0.5)).transpose();
        let moved = -(turn * place);
        let row = |k: usize| [turn.row(k).x, turn.row(k).y, turn.row(k).z, moved[k]];
        views.push(View { world_to_camera: [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]], ..views[i].clone() });
    }
    views
}

/// Where a view is, and its turn from camera to world.
fn pose(view: &View) -> (DVec3, DQuat) {
    let [x, y, z, _] = view.world_to_camera.map(|row| DVec3::from_slice(&row[..3]));
    (DVec3::from(camera_center(&view.world_to_camera)), DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize())
}

/// Whether `capture` is a clip that several training cameras took: of one alone, the scene's own times and colours take up
/// what is off.
pub(super) fn is_rig(capture: &Capture) -> bool {
    capture.n_frames > 1 && capture.cameras.iter().filter(|camera| !camera.is_test).count() > 1
}
