//! Head-related transfer functions: the effect of a direction on a sound on its way to the two ears.

mod sadie;
mod set;
mod sofa;
pub mod sphere;

use glam::DVec3;

pub use crate::internals::sound::geometry::degrees;
pub use set::{Filter, HrtfSet, Lookup};

#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Meta {
    pub title: String,
    /// Terms of use as the file states them.
    pub licence: String,
    /// Of the file, or of a folder's files in the order of their names; empty for what is computed.
    pub sha256: String,
}

/// Responses as they were measured.
pub struct Measured {
    /// Samples per second.
    pub fs: f64,
    /// Directions in the head's frame, x forward, y left, z up; of any length.
    pub directions: Vec<DVec3>,
    /// By direction, the responses of the left and the right ear; all of one length.
    pub irs: Vec<[Vec<f32>; 2]>,
    /// By direction and ear, what the response is delayed by beyond its samples; samples.
    pub delays: Vec<[f64; 2]>,
    pub meta: Meta,
}
