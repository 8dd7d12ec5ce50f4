//! What a trainer needs to know of a capture beside its pictures.

use super::config::{Config, FlowChoice};
use crate::scene::FlowModel;
use crate::scene::capture::{Capture, Extent};

/// A capture, to a trainer.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Where the cameras are.
    pub extent: Extent,
    /// Normalised time between two frames.
    pub dt: f64,
    /// By camera, whether its time offset is learnt; empty where none is.
    pub learns_offset: Vec<bool>,
    /// Whether pictures may come with priors of depth or flow.
    pub has_priors: bool,
    /// What the rendered flow is, to be like the priors'.
    pub flow_model: FlowModel,
}

impl Setup {
    /// A capture of which nothing is used but its pictures.
    pub fn plain(extent: Extent, dt: f64) -> Self {
        Setup { extent, dt, learns_offset: Vec::new(), has_priors: false, flow_model: FlowModel::Velocity }
    }

    /// What `config` makes of `capture`. A test camera's offset is not learnt; nor is any where time stands still or one
    /// camera alone is trained on, whose offset the scene's own times take up.
    pub fn new(capture: &Capture, config: &Config) -> Self {
        let learns_offset: Vec<bool> = capture.cameras.iter().map(|camera| !camera.is_test).collect();
        let n_free = learns_offset.iter().filter(|free| **free).count();
        let learns = config.offsets && capture.n_frames > 1 && n_free > 1;
        let shots = || capture.cameras.iter().filter(|camera| !camera.is_test).flat_map(|camera| &camera.shots);
        let has_depth = config.loss.depth > 0.0 && shots().any(|shot| shot.depth.is_some());
        let has_flow = config.loss.flow > 0.0 && shots().any(|shot| shot.flow.is_some());
        let moves = capture.cameras.iter().any(|camera| camera.shots.iter().any(|s| s.world_to_camera.is_some()));
        Setup {
            extent: capture.extent(),
            dt: 1.0 / f64::from(capture.n_frames.max(1)),
            learns_offset: if learns { learns_offset } else { Vec::new() },
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
