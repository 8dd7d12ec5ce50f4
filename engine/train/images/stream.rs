//! The images of the steps to come, decoded ahead.

use super::order::{reduced_order, training_order};
use super::residency::{Residency, plan};
use crate::error::Result;
use crate::internals::train::config::Config;
use crate::parallel::threads;
use crate::scene::capture::{Asked, CacheStats, Capture, FrameCache, Picture, PriorPlan, pixel_bytes};
use std::ops::Range;
use std::sync::Arc;
use std::vec::IntoIter;

/// Where the images of a run come from.
#[derive(Clone, Copy)]
pub(in crate::internals::train) struct Source<'a> {
    pub capture: &'a Capture,
    /// The images that are trained on.
    pub frames: &'a [(usize, u32)],
    pub priors: &'a PriorPlan,
}

/// The steps that images are wanted for.
pub(in crate::internals::train) struct Steps<'a> {
    pub config: &'a Config,
    /// Steps that have their images.
    pub done: u64,
    /// Steps of the run.
    pub total: u64,
    /// The images of a step that this process sees.
    pub own: Range<usize>,
}

/// How many images are held where.
#[derive(Clone, Copy, Default)]
pub(in crate::internals::train) struct ImageLimits {
    /// Bytes that are decoded ahead.
    pub cache_bytes: u64,
    /// Bytes that stay on the device.
    pub device_bytes: u64,
    /// Images whose order is known ahead.
    pub listed: u64,
}

/// The images of as many of the next steps as are listed at a time.
pub(super) struct ImageStream {
    /// Of all processes: camera and frame.
    images: IntoIter<(usize, u32)>,
    /// Of this process.
    own: IntoIter<(Asked, Residency)>,
    /// Those of this process that must be decoded.
    cache: FrameCache,
}

/// An image of this process.
pub(super) struct Next {
    pub asked: Asked,
    pub residency: Residency,
    /// None if it is on the device.
    pub picture: Option<Arc<Picture>>,
}

impl ImageStream {
    /// Lists images of whole steps: `limits.listed` or somewhat fewer, but of one step at least.
    ///
    /// # Errors
    /// [`crate::Error::Data`] where the capture has no such image.
    pub fn new(source: &Source, steps: &Steps, limits: &ImageLimits) -> Result<Self> {
        let Steps { config, done, total, own } = steps;
        let batch = u64::from(config.batch);
        let until = done.saturating_add((limits.listed / batch).max(1)).min(*total);
        let images = |steps: u64| steps.saturating_mul(batch);
        let order = training_order(source.frames, config.seed, images(*done), images(until));
        let asked = reduced_order(&order, config, *done, *total).enumerate();
        let asked = asked.filter(|(at, _)| own.contains(&(at % config.batch as usize)));
        let asked: Vec<Asked> = asked.map(|(_, asked)| asked).collect();
        let planned = plan(&asked, |asked| bytes(source, asked), limits.device_bytes);
        let own: Vec<(Asked, Residency)> = asked.into_iter().zip(planned).collect();
        let decoded: Vec<Asked> =
            own.iter().filter(|(_, residency)| residency.is_decoded()).map(|(asked, _)| *asked).collect();
        let cache = FrameCache::new(source.capture, decoded, source.priors, limits.cache_bytes, threads())?;
        Ok(ImageStream { images: order.into_iter(), own: own.into_iter(), cache })
    }

    /// Camera and frame of the next image; none if no more are listed.
    pub fn next_image(&mut self) -> Option<(usize, u32)> {
        self.images.next()
    }

    /// The next image of this process.
    ///
    /// # Errors
    /// Those of the image.
    pub fn next_own(&mut self) -> Result<Option<Next>> {
        let Some((asked, residency)) = self.own.next() else { return Ok(None) };
        let picture = if residency.is_decoded() { self.cache.next_picture().transpose()? } else { None };
        Ok(Some(Next { asked, residency, picture }))
    }

    /// Counts of the decoding so far.
    pub fn stats(&self) -> CacheStats {
        self.cache.stats()
    }
}

/// Bytes of an image on the device.
fn bytes(source: &Source, asked: &Asked) -> u64 {
    let camera = source.capture.cameras.get(asked.camera);
    let shot = camera.and_then(|camera| camera.shot(asked.frame));
    let has_depth = source.priors.depth.contains_key(&(asked.camera, asked.frame));
    let has_flow = source.priors.flow && shot.is_some_and(|shot| shot.flow.is_some());
    let pixels = camera.map_or(0, |camera| {
        let reduced = |side: u32| u64::from(side / asked.reduction.min(side).max(1));
        reduced(camera.intrinsics.width) * reduced(camera.intrinsics.height)
    });
    pixels * pixel_bytes(has_depth, has_flow)
}
