//! The images of a run, decoded ahead and kept on the device as far as its memory goes. If images had to give way to
//! something else, the plan of all listed steps ([`residency`]) is made anew.

mod residency;
mod resident;
mod stream;

pub(super) use resident::{Counts, Planes, Resident, Residents};
pub(super) use stream::{ImageLimits, Source, Steps, training_frames};
pub use stream::{reduced_order, training_order};

use crate::error::Result;
use crate::gpu::{Gpu, Staging};
use crate::internals::train::TermData;
use crate::scene::View;
use residency::Residency;
use std::sync::Arc;
use std::time::{Duration, Instant};
use stream::{ImageStream, Next};

pub struct StepImage {
    pub camera: usize,
    pub view: View,
    /// None if another process sees the image.
    pub resident: Option<Resident>,
}

pub(super) struct StepImages {
    pub images: Vec<StepImage>,
    /// Without the wait for their decoding.
    pub loading: Duration,
}

pub(super) struct ImageStore {
    gpu: Arc<Gpu>,
    staging: Arc<Staging>,
    pub residents: Residents,
    pub limits: ImageLimits,
    /// Made for the first step that needs it.
    stream: Option<ImageStream>,
    waited: Duration,
}

impl ImageStore {
    pub fn new(gpu: Arc<Gpu>, staging: Arc<Staging>, data: TermData) -> Result<Self> {
        let residents = Residents::new(&gpu, data)?;
        Ok(ImageStore { gpu, staging, residents, limits: ImageLimits::default(), stream: None, waited: Duration::ZERO })
    }

    pub fn next(&mut self, source: &Source, steps: &Steps) -> Result<StepImages> {
        loop {
            let mut stream = match self.stream.take() {
                Some(stream) => stream,
                None => {
                    self.residents.release();
                    ImageStream::new(source, steps, &self.limits)?
                }
            };
            let found = self.of_step(source, steps, &mut stream)?;
            match found {
                Some(found) if !found.images.is_empty() || steps.done >= steps.total => {
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

    /// The next images of `stream`; none if one that should be on the device is not.
    fn of_step(&mut self, source: &Source, steps: &Steps, stream: &mut ImageStream) -> Result<Option<StepImages>> {
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
                let Some(loaded) = self.load(&next)? else { return Ok(None) };
                resident = Some(loaded);
                loading += begun.elapsed();
            }
            images.push(StepImage { camera, view, resident });
        }
        Ok(Some(StepImages { images, loading }))
    }

    /// Brings an image to where the device can get it; none if it should be on the device and is not.
    fn load(&mut self, next: &Next) -> Result<Option<Resident>> {
        let (gpu, staging) = (&self.gpu, &self.staging);
        match (&next.picture, next.residency) {
            (Some(picture), Residency::Stays) => self.residents.keep(gpu, staging, next.asked, picture).map(Some),
            (Some(picture), _) => self.residents.pass(gpu, staging, picture).map(Some),
            (None, Residency::Leaves) => Ok(self.residents.take(&next.asked)),
            (None, _) => Ok(self.residents.get(&next.asked)),
        }
    }

    pub fn waited_s(&self) -> f64 {
        let own = self.stream.as_ref().map_or(Duration::ZERO, |stream| stream.stats().waited);
        (self.waited + own).as_secs_f64()
    }

    /// Lists the images anew before the next step, for a run of another length.
    pub fn restart(&mut self) {
        self.waited += self.stream.take().map_or(Duration::ZERO, |stream| stream.stats().waited);
    }

    pub fn inherit(&mut self, other: &mut ImageStore) {
        self.residents.inherit(&mut other.residents);
        (self.limits, self.stream, self.waited) = (other.limits, other.stream.take(), other.waited);
    }
}
