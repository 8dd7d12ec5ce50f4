//! What a step minimises: the sum of the terms (SPEC 4), on a picture as its camera shows it.

use super::cameras::{Cameras, OwnGrid};
use super::config::Config;
use super::images::{Counts, Images, Loaded, Planes};
use super::setup::Setup;
use super::terms::{self, Part, Rendered, Shown, Term};
use crate::error::Result;
use crate::gpu::generated::Status;
use crate::gpu::{Buf, Gpu, Recording, Staging};
use crate::stage::{self, MOST_TERMS, Outputs, Workspace};
use std::collections::BTreeMap;

/// The terms of the loss, with their scratch, the training images, and the cameras' own parameters.
pub(super) struct Objective {
    terms: Vec<Box<dyn Term>>,
    /// What each term leaves of the step that is recorded.
    left: Vec<terms::Left>,
    pub images: Images,
    pub cameras: Cameras,
}

/// The camera of an image of a step.
#[derive(Clone, Copy)]
pub(super) struct Taken {
    camera: usize,
    grid: Option<OwnGrid>,
}

/// An image of a step, to compare with.
pub(super) struct Truth {
    shown: Shown,
    by: Taken,
    loaded: Loaded,
}

/// Where a step leaves its numbers, all of them in the host's memory, and which terms it has.
pub(super) struct Report {
    totals: Buf<[f32; 4]>,
    pub status: Buf<Status>,
    pub n_bad: Buf<u32>,
    has: Vec<bool>,
}

/// The terms of one picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Values {
    pub loss: f64,
    /// What is logged, by key.
    pub logged: BTreeMap<&'static str, f64>,
}

impl Objective {
    pub fn new(gpu: &Gpu, config: &Config, setup: &Setup) -> Result<Self> {
        Ok(Objective {
            terms: terms::begin(gpu, config, setup.data)?,
            left: Vec::new(),
            images: Images::new(gpu, setup.data)?,
            cameras: Cameras::new(gpu, config, setup)?,
        })
    }

    /// What the pictures of a frame must hold.
    pub fn outputs(&self) -> Outputs {
        let is_all = self.terms.iter().any(|term| term.outputs() == Outputs::All);
        if is_all { Outputs::All } else { Outputs::Color }
    }

    /// Room for pictures of `pixels` pixels.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.images.fit(gpu, pixels)?;
        self.cameras.fit(gpu, pixels)?;
        self.terms.iter_mut().try_for_each(|term| term.fit(gpu, pixels))
    }

    /// The camera of an image of the next step; its grid's steps are counted.
    pub fn taken(&mut self, camera: usize) -> Taken {
        Taken { camera, grid: self.cameras.next(camera) }
    }

    /// Notes that the step on an image has ended well.
    pub fn end(&mut self, by: Taken) {
        self.cameras.end(by.grid);
    }

    /// The image of step `step` that was taken `by` a camera and reduced by `reduction`.
    pub fn target(&self, loaded: Loaded, by: Taken, step: u64, reduction: u32) -> Truth {
        let Counts { size, n_visible, n_depth, n_flow } = loaded.counts;
        let shown = Shown { step, size, reduction, n_visible, n_depth, n_flow };
        Truth { shown, by, loaded }
    }

    /// Appends the upload of `target` and what is learnt of its camera's clock and pose, in a run of `total` steps.
    pub fn record_upload(&self, rec: &mut Recording, work: &Workspace, target: &Truth, total: u64) {
        self.images.record_upload(rec, &target.loaded);
        self.record_view(rec, work, target.by, (target.shown.step, total));
    }

    /// Appends the terms on the frame that was rendered, and the cotangents of its pictures.
    ///
    /// # Errors
    /// Those of [`Term::record`].
    pub fn record_loss(&mut self, gpu: &Gpu, rec: &mut Recording, work: &Workspace, target: &Truth) -> Result<()> {
        let Some(backward) = &work.backward else { return Ok(()) };
        let (shown, rendered) = (&target.shown, (&work.blend.image0, &backward.d_image0));
        let grid_variation = target.by.grid.and(self.cameras.grids()).map(|grids| grids.tv_sums.clone());
        let (image, d_image) = self.cameras.record_shown(gpu, rec, rendered, shown.size, target.by.grid)?;
        let geometry = work.blend.image1.as_ref().zip(backward.d_image1.as_ref());
        let grid_variation = grid_variation.as_ref();
        let Planes { colors: truth, priors } = &self.images.planes(&target.loaded);
        let on = Rendered { image, d_image, geometry, truth, priors, grid_variation };
        self.left = self.terms.iter_mut().map(|term| term.record(gpu, rec, shown, &on)).collect::<Result<_>>()?;
        self.cameras.record_back(rec, rendered, shown.size, target.by.grid);
        Ok(())
    }

    /// Appends what is learnt of the clock and the pose of the camera `by` to the view of step `step` of `total`.
    pub fn record_view(&self, rec: &mut Recording, work: &Workspace, by: Taken, (step, total): (u64, u64)) {
        self.cameras.record_view(rec, work, by.camera, (step, total));
    }

    /// Appends step `step` of `total` of the own parameters of the camera `by`, after the backward pass of its image, which is image
    /// `at` of the step.
    pub fn record_step(&self, rec: &mut Recording, work: &Workspace, by: Taken, (step, total): (u64, u64), at: usize) {
        self.cameras.record_step(rec, work, (by.camera, by.grid), (step, total), at);
    }

    /// Appends the keeping of what image `at` of a step says of the parameters of the camera `by`, until all have been seen.
    pub fn record_keep(&self, rec: &mut Recording, work: &Workspace, by: Taken, at: usize) {
        self.cameras.record_keep(rec, work, by.grid, at);
    }

    /// Appends the taking up again of what [`Objective::record_keep`] kept.
    pub fn record_take(&self, rec: &mut Recording, work: &Workspace, by: Taken, at: usize) {
        self.cameras.record_take(rec, work, by.grid, at);
    }

    /// Appends the totals of the terms, beside the status of the step and its bad gradients, to where the host can read them.
    pub fn record_report(
        &self,
        rec: &mut Recording,
        staging: &Staging,
        (status, n_bad): (&Buf<Status>, &Buf<u32>),
    ) -> Result<Report> {
        let there: Vec<_> = self.left.iter().flatten().cloned().collect();
        let report = Report {
            totals: staging.readback::<[f32; 4]>("loss of a step", MOST_TERMS)?.of(),
            status: staging.readback::<Status>("status of a step", 1)?.of(),
            n_bad: staging.readback::<u32>("bad gradients of a step", 1)?.of(),
            has: self.left.iter().map(Option::is_some).collect(),
        };
        let to = stage::Report { totals: &report.totals, status: &report.status, n_bad: &report.n_bad };
        stage::record_report(rec, &there, (status, n_bad), &to);
        Ok(report)
    }

    /// The values of a step that has ended.
    pub fn values(&self, gpu: &Gpu, target: &Truth, report: &Report) -> Result<Values> {
        let totals = gpu.peek::<[f32; 4]>(&report.totals.slice())?;
        let there = self.terms.iter().zip(&report.has).filter(|(_, has)| **has);
        let mut values = Values::default();
        for ((term, _), sums) in there.zip(totals) {
            let parts = term.parts(&target.shown, sums);
            values.loss += parts.iter().fold(0.0, |sum, Part { weight, error, .. }| sum + weight * error);
            values.logged.extend(parts.iter().map(|part| (part.key, part.value)));
        }
        Ok(values)
    }
}
