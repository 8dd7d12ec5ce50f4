//! The images of the steps to come, decoded ahead.

use super::residency::{Residency, plan};
use crate::error::{Error, Result};
use crate::internals::train::Config;
use crate::parallel::threads;
use crate::random::permutation;
use crate::scene::capture::{Asked, CacheStats, Capture, FrameCache, Picture, PriorPlan, pixel_bytes};
use std::ops::Range;
use std::sync::Arc;
use std::vec::IntoIter;

#[derive(Clone, Copy)]
pub struct Source<'a> {
    pub capture: &'a Capture,
    pub frames: &'a [(usize, u32)],
    pub priors: &'a PriorPlan,
}

pub struct Steps<'a> {
    pub config: &'a Config,
    pub done: u64,
    pub total: u64,
    /// The images of a step that this process sees.
    pub own: Range<usize>,
}

#[derive(Clone, Copy, Default)]
pub struct ImageLimits {
    pub cache_bytes: u64,
    pub device_bytes: u64,
    /// Images whose order is known ahead.
    pub listed: u64,
}

/// The images of as many of the next steps as are listed at a time.
pub(super) struct ImageStream {
    images: IntoIter<(usize, u32)>,
    own: IntoIter<(Asked, Residency)>,
    /// Those of this process that must be decoded.
    cache: FrameCache,
}

pub(super) struct Next {
    pub asked: Asked,
    pub residency: Residency,
    /// None if it is on the device.
    pub picture: Option<Arc<Picture>>,
}

impl ImageStream {
    /// Lists images of whole steps: `limits.listed` or somewhat fewer, but of one step at least.
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

    pub fn next_image(&mut self) -> Option<(usize, u32)> {
        self.images.next()
    }

    pub fn next_own(&mut self) -> Result<Option<Next>> {
        let Some((asked, residency)) = self.own.next() else { return Ok(None) };
        let picture = if residency.is_decoded() { self.cache.next_picture().transpose()? } else { None };
        Ok(Some(Next { asked, residency, picture }))
    }

    pub fn stats(&self) -> CacheStats {
        self.cache.stats()
    }
}

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

/// `frames` as they follow one another after the first `done` images of a run on `total`: every epoch all of them,
/// shuffled by the seed and the epoch.
pub fn training_order(frames: &[(usize, u32)], seed: u64, done: u64, total: u64) -> Vec<(usize, u32)> {
    let n = frames.len() as u64;
    let shuffled = |epoch| permutation(n as usize, &[seed, epoch]).into_iter().map(|at| frames[at]);
    let epochs = (done / n..total.div_ceil(n)).flat_map(shuffled);
    epochs.skip((done % n) as usize).take(total.saturating_sub(done) as usize).collect()
}

/// The images of `order`, which begins after step `done` of `total`, at the size that their steps train on.
pub fn reduced_order(order: &[(usize, u32)], config: &Config, done: u64, total: u64) -> impl Iterator<Item = Asked> {
    let batch = config.batch as usize;
    order.iter().enumerate().map(move |(at, &(camera, frame))| {
        let reduction = config.resolution.reduction(done + 1 + (at / batch) as u64, total);
        Asked { camera, frame, reduction }
    })
}

pub fn training_frames(capture: &Capture) -> Result<Vec<(usize, u32)>> {
    let frames = capture.training_frames();
    if frames.is_empty() {
        return Err(Error::data(&capture.path, "", "has no training image", "see `ivv check`"));
    }
    Ok(frames)
}
