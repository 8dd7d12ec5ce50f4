//! The names that most rows use.

pub(crate) use crate::adjoint::{check_adjoint, cotangents, is_finite};
pub(crate) use crate::case::Case;
pub(crate) use crate::frames::{Tolerance, bits, check_finite, rms};
pub(crate) use crate::one::{One, at_pixel, backdrop, ball, camera, logit, ones, scene_of, with};
pub(crate) use crate::random::{Random, noise, scene, small_view, view};
pub(crate) use crate::row::{Bench, Tally};
pub(crate) use anyhow::{Result, bail, ensure};
pub(crate) use ivv::Constants;
pub(crate) use ivv::internals::reference::render_f64;
pub(crate) use ivv::internals::scene::capture::Extent;
pub(crate) use ivv::internals::scene::{Frame, Motion, Splats, View};
pub(crate) use std::sync::Arc;
