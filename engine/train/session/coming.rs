//! The images of the steps to come, step by step.

use super::feed::Feed;
use super::order::{reduced_order, training_order};
use crate::error::Result;
use crate::scene::capture::{CacheStats, Capture, PriorPlan};
use crate::train::config::Config;
use crate::train::trainer::{Seen, Trainer};
use std::time::{Duration, Instant};
use std::vec::IntoIter;

/// The images of the steps to come: of all of them, or of as many as are listed at a time.
pub(super) struct Coming {
    images: IntoIter<(usize, u32)>,
    /// Those that this process sees.
    feed: Feed,
    /// Images of a step.
    batch: usize,
}

impl Coming {
    /// The next images of a run of `total` steps on `frames`, which `trainer` takes: those of whole steps, `listed` images or somewhat
    /// fewer, but of one step at least. At most `cache_bytes` of them are kept on the host and `image_bytes` on the device.
    ///
    /// # Errors
    /// As [`Feed::new`].
    pub fn new(
        capture: &Capture,
        frames: &[(usize, u32)],
        (config, plan): (&Config, &PriorPlan),
        (trainer, total): (&Trainer, u64),
        (cache_bytes, image_bytes, listed): (u64, u64, u64),
    ) -> Result<Self> {
        let (done, batch) = (trainer.step(), config.batch as usize);
        let images = |steps: u64| steps.saturating_mul(u64::from(config.batch));
        let until = done.saturating_add((listed / u64::from(config.batch)).max(1)).min(total);
        let order = training_order(frames, config.seed, images(done), images(until));
        let own = trainer.own_images(batch);
        let asked = reduced_order(&order, config, done, total).enumerate();
        let asked = asked.filter(|(at, _)| own.contains(&(at % batch))).map(|(_, asked)| asked).collect();
        let feed = Feed::new(capture, asked, plan, cache_bytes, image_bytes)?;
        Ok(Coming { images: order.into_iter(), feed, batch })
    }

    /// The images of the next step, loaded by `trainer`, and how long that took; no images where no more are listed. None where one that
    /// should be on the device is not.
    ///
    /// # Errors
    /// Those of the images, and of the device.
    pub fn next_step(&mut self, capture: &Capture, trainer: &mut Trainer) -> Result<Option<(Vec<Seen>, Duration)>> {
        let own = trainer.own_images(self.batch);
        let (mut images, mut spent) = (Vec::with_capacity(self.batch), Duration::ZERO);
        for (at, (camera, frame)) in self.images.by_ref().take(self.batch).enumerate() {
            let next = if own.contains(&at) { self.feed.next_image()? } else { None };
            let view = capture.view(camera, frame)?;
            let mut loaded = None;
            if let Some(next) = next {
                if next.on_device().is_some_and(|name| !trainer.has_image(name)) {
                    return Ok(None);
                }
                let begun = Instant::now();
                loaded = Some(trainer.load(&view, next.shot())?);
                spent += begun.elapsed();
            }
            images.push(Seen { camera, view, loaded });
        }
        Ok(Some((images, spent)))
    }

    /// What the decoding has done so far.
    pub fn stats(&self) -> CacheStats {
        self.feed.stats()
    }
}
