//! Which images a run takes, in what order and at what size.

use crate::error::{Error, Result};
use crate::internals::train::config::Config;
use crate::random::permutation;
use crate::scene::capture::{Asked, Capture};

/// The images `frames` as they follow one another after the first `done` images of a run on `total`: every epoch all of
/// them, shuffled by the seed and the epoch.
pub fn training_order(frames: &[(usize, u32)], seed: u64, done: u64, total: u64) -> Vec<(usize, u32)> {
    let n = frames.len() as u64;
    let shuffled = |epoch| permutation(n as usize, &[seed, epoch]).into_iter().map(|at| frames[at]);
    let epochs = (done / n..total.div_ceil(n)).flat_map(shuffled);
    epochs.skip((done % n) as usize).take(total.saturating_sub(done) as usize).collect()
}

/// The images of `order`, which begins after step `done` of `total`, with the step of each, from 1, and at the size
/// that it trains on: the threads that decode reduce them, and not the one that records steps.
pub fn reduced_order(order: &[(usize, u32)], config: &Config, done: u64, total: u64) -> impl Iterator<Item = Asked> {
    let batch = config.batch as usize;
    order.iter().enumerate().map(move |(at, &(camera, frame))| {
        let reduction = config.resolution.reduction(done + 1 + (at / batch) as u64, total);
        Asked { camera, frame, reduction }
    })
}

/// The images that are trained on, at least one.
pub(in crate::internals::train) fn training_frames(capture: &Capture) -> Result<Vec<(usize, u32)>> {
    let frames = capture.training_frames();
    if frames.is_empty() {
        return Err(Error::data(&capture.path, "", "has no training image", "see `ivv check`"));
    }
    Ok(frames)
}
