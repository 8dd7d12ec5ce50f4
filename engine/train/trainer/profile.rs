//! Steps with the time of every pass, or with one dispatch taken out.

use super::{Step, Trainer};
use crate::error::Result;
use crate::gpu::{Dispatch, PassTime, Recording};
use crate::internals::train::images::StepImage;
use crate::scene::View;
use crate::scene::capture::Picture;
use crate::stage::{Counters, PassReport, add_passes};
use std::time::{Duration, Instant};

/// A step whose passes were timed.
pub struct ProfiledStep {
    /// By label, in the order of their first.
    pub passes: Vec<PassReport>,
    pub times: Vec<PassTime>,
    pub counters: Counters,
    /// Barriers between the passes.
    pub barriers: usize,
    /// The work of the host: name, when it began, seconds.
    pub host: Vec<(&'static str, Instant, f64)>,
}

impl ProfiledStep {
    /// The time since the host was done with the step.
    pub(in crate::internals::train) fn counting(&self) -> Duration {
        self.host.last().map_or(Duration::ZERO, |(_, begun, seconds)| {
            begun.elapsed().saturating_sub(Duration::from_secs_f64(*seconds))
        })
    }
}

impl Trainer {
    /// As [`Trainer::train`], but waits for the end and gives the time of every pass.
    #[tracing::instrument(level = "debug", name = "step", skip_all, fields(step = self.step + 1))]
    pub fn profile(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<ProfiledStep> {
        let begun = Instant::now();
        let image = self.passing(camera, view, picture)?;
        self.profile_on(vec![image], begun)
    }

    /// As [`Trainer::profile`], on images that have been loaded since `begun`.
    pub(crate) fn profile_on(&mut self, images: Vec<StepImage>, mut begun: Instant) -> Result<ProfiledStep> {
        let mut host = Vec::new();
        let mut done = |what| {
            host.push((what, begun, begun.elapsed().as_secs_f64()));
            begun = Instant::now();
        };
        done("upload images");
        self.finish()?;
        let mut inputs = self.inputs(images);
        loop {
            let (rec, results) = self.record(&inputs)?;
            done("record");
            let step = Step { inputs, running: self.gpu.start_timed(&rec)?, results };
            self.step = step.inputs.step;
            let times = match step.running.wait() {
                Ok(times) => times,
                Err(error) => {
                    // It may have moved the scene.
                    self.in_flight.push_back(step);
                    return Err(error);
                }
            };
            done("submit and wait");
            let is_complete = self.end(&step.inputs, &step.results)?;
            done("read back");
            inputs = step.inputs;
            if !is_complete {
                continue;
            }
            let counters = match (&self.work, &step.results.last) {
                (Some(work), Some((lists, size))) => {
                    Counters::read(&self.gpu, work, &self.scene, lists, size.n_tiles, size.n_pixels)?
                }
                _ => Counters::default(),
            };
            let passes = add_passes(Vec::new(), &rec, &times, &counters);
            let barriers = step.running.barriers();
            return Ok(ProfiledStep { passes, times, counters, barriers, host });
        }
    }

    /// The passes of a step on `picture`, which is not run.
    pub fn recorded(&mut self, camera: usize, view: &View, picture: &Picture) -> Result<Recording> {
        let image = self.passing(camera, view, picture)?;
        self.finish()?;
        let inputs = self.inputs(vec![image]);
        Ok(self.record(&inputs)?.0)
    }

    /// As [`Trainer::train_on`], but waits for the end and gives the step's first dispatch of a kernel, with its data.
    pub(crate) fn dump(&mut self, images: Vec<StepImage>, kernel: &str) -> Result<Option<Dispatch>> {
        self.finish()?;
        let inputs = self.inputs(images);
        loop {
            let (rec, results) = self.record(&inputs)?;
            let dispatch = self.gpu.run_dumping(rec, kernel)?;
            if self.end(&inputs, &results)? {
                self.step = inputs.step;
                return Ok(dispatch);
            }
        }
    }
}
