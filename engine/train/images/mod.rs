//! The images of a run, decoded ahead and kept on the device as far as its memory goes.
//!
//! Which image stays on the device is planned for all steps that are listed ([`residency`]). If images had to give way to something else
//! meanwhile, the plan no longer holds, and a new one is made for as many bytes as there are left.

mod order;
mod residency;
mod resident;
mod stream;

pub(super) use order::training_frames;
pub use order::{reduced_order, training_order};
pub(super) use resident::{Counts, Planes, Resident};

use super::terms::TermData;
use crate::error::Result;
use crate::gpu::{Gpu, Recording, Staging};
use crate::scene::View;
use crate::scene::capture::{Capture, Picture, PriorPlan};
use crate::train::config::Config;
use residency::Residency;
use resident::Residents;
use std::ops::Range;
use std::time::{Duration, Instant};
use stream::{ImageStream, Next};

/// An image of the next step.
pub(super) struct StepImage {
    /// The camera that took it.
    pub camera: usize,
    /// As that camera saw.
    pub view: View,
    /// The image itself; none where another process sees it.
    pub resident: Option<Resident>,
}

/// The images of the next step; none at the end of the run.
pub(super) struct StepImages {
    pub images: Vec<StepImage>,
    /// How long it took to bring them to where the device can get them, without the wait for their decoding.
    pub loading: Duration,
}

/// Where the images of a run come from.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub capture: &'a Capture,
    /// The images that are trained on.
    pub frames: &'a [(usize, u32)],
    pub priors: &'a PriorPlan,
}

/// The steps that images are wanted for.
pub(super) struct Steps<'a> {
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
pub(super) struct ImageLimits {
    /// Bytes that are decoded ahead.
    pub cache_bytes: u64,
    /// Bytes that stay on the device.
    pub device_bytes: u64,
    /// Images whose order is known ahead.
    pub listed: u64,
}

/// The images of a run.
pub(super) struct ImageStore {
    residents: Residents,
    limits: ImageLimits,
    /// Made for the first step that needs it.
    stream: Option<ImageStream>,
    /// How long steps waited for streams that have ended.
    waited: Duration,
}

impl ImageStore {
    /// Of a run whose terms of the loss take `data` beside the colours.
    pub fn new(gpu: &Gpu, data: TermData) -> Result<Self> {
        let residents = Residents::new(gpu, data)?;
        Ok(ImageStore { residents, limits: ImageLimits::default(), stream: None, waited: Duration::ZERO })
    }

    /// Keeps to `limits` from the next stream on.
    pub fn limit(&mut self, limits: ImageLimits) {
        self.limits = limits;
    }

    /// The images of the next step.
    ///
    /// # Errors
    /// Those of the images, and of the device.
    pub fn next(&mut self, gpu: &Gpu, staging: &Staging, source: &Source, steps: &Steps) -> Result<StepImages> {
        loop {
            let mut stream = match self.stream.take() {
                Some(stream) => stream,
                None => {
                    self.residents.release();
                    ImageStream::new(source, steps, &self.limits)?
                }
            };
            let found = self.of_step(gpu, staging, source, steps, &mut stream)?;
            let is_short = found.as_ref().is_some_and(|found| found.images.is_empty()) && steps.done < steps.total;
            match found {
                Some(found) if !is_short => {
                    self.stream = Some(stream);
                    return Ok(found);
                }
                // All that were listed have been seen.
                Some(_) => {}
                // Images gave way to what needed the device's memory more. From here on as many stay as there are now.
                None => self.limits.device_bytes = self.residents.bytes(),
            }
            self.waited += stream.stats().waited;
        }
    }

    /// The next images of `stream`; none where one that should be on the device is not.
    fn of_step(
        &mut self,
        gpu: &Gpu,
        staging: &Staging,
        source: &Source,
        steps: &Steps,
        stream: &mut ImageStream,
    ) -> Result<Option<StepImages>> {
        let batch = steps.config.batch as usize;
        let mut images = Vec::with_capacity(batch);
        let mut loading = Duration::ZERO;
        for at in 0..batch {
            let Some((camera, frame)) = stream.next_image() else { break };
            let next = if steps.own.contains(&at) { stream.next_own()? } else { None };
            let view = source.capture.view(camera, frame)?;
            let mut resident = None;
            if let Some(next) = next {
                let begun = Instant::now();
                let Some(loaded) = self.load(gpu, staging, &next)? else { return Ok(None) };
                resident = Some(loaded);
                loading += begun.elapsed();
            }
            images.push(StepImage { camera, view, resident });
        }
        Ok(Some(StepImages { images, loading }))
    }

    /// Brings an image to where the device can get it; none where it should be on the device and is not.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    fn load(&mut self, gpu: &Gpu, staging: &Staging, next: &Next) -> Result<Option<Resident>> {
        match (&next.picture, next.residency) {
            (Some(picture), Residency::Stays) => self.residents.keep(gpu, staging, next.asked, picture).map(Some),
            (Some(picture), _) => self.residents.pass(gpu, staging, picture).map(Some),
            (None, Residency::Leaves) => Ok(self.residents.take(&next.asked)),
            (None, _) => Ok(self.residents.get(&next.asked)),
        }
    }

    /// Brings `picture` to where the device can get it, for one step.
    #[tracing::instrument(level = "debug", name = "upload", skip_all)]
    pub fn pass(&mut self, gpu: &Gpu, staging: &Staging, picture: &Picture) -> Result<Resident> {
        self.residents.pass(gpu, staging, picture)
    }

    /// Makes room for pictures of `pixels` pixels that pass.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.residents.fit(gpu, pixels)
    }

    /// Where the planes of an image lie.
    pub fn planes(&self, resident: &Resident) -> Planes {
        self.residents.planes(resident)
    }

    /// Appends the copy of an image that is not on the device yet.
    pub fn record_upload(&self, rec: &mut Recording, resident: &Resident) {
        self.residents.record_upload(rec, resident);
    }

    /// Seconds in which steps waited for images.
    pub fn waited_s(&self) -> f64 {
        let own = self.stream.as_ref().map_or(Duration::ZERO, |stream| stream.stats().waited);
        (self.waited + own).as_secs_f64()
    }

    /// Lists the images anew before the next step, for a run of another length.
    pub fn restart(&mut self) {
        self.waited += self.stream.take().map_or(Duration::ZERO, |stream| stream.stats().waited);
    }

    /// Frees the memory of the images that stay on the device; false where there are none. Steps on the device keep theirs.
    pub fn release(&mut self) -> bool {
        self.residents.release()
    }

    /// Takes over all images of `other`, the store of an earlier trainer of the same run.
    pub fn inherit(&mut self, other: &mut ImageStore) {
        self.residents.inherit(&mut other.residents);
        (self.limits, self.stream, self.waited) = (other.limits, other.stream.take(), other.waited);
    }
}
