//! What a step minimises: the sum of the terms (SPEC 4), on a picture as its camera shows it.

use super::cameras::{Cameras, OwnGrid};
use super::config::Config;
use super::images::{Counts, Images, Loaded, Planes};
use super::setup::Setup;
use super::terms::{self, Part, Rendered, Shown, Term};
use crate::error::Result;
use crate::gpu::generated::{Status, ViewParams};
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

/// The picture of a step.
pub(super) struct Truth {
    shown: Shown,
    camera: usize,
    grid: Option<OwnGrid>,
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

    /// Changes what the terms must of how a view is rendered.
    pub fn adjust(&self, view: &mut ViewParams) {
        self.terms.iter().for_each(|term| term.adjust(view));
    }

    /// Room for pictures of `pixels` pixels.
    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.images.fit(gpu, pixels)?;
        self.cameras.fit(gpu, pixels)?;
        self.terms.iter_mut().try_for_each(|term| term.fit(gpu, pixels))
    }

    /// Takes the picture of step `step`, which `camera` took and which was reduced by `reduction`.
    pub fn target(&mut self, loaded: Loaded, camera: usize, step: u64, reduction: u32) -> Truth {
        let grid = self.cameras.next(camera);
        let Counts { size, n_visible, n_depth, n_flow } = loaded.counts;
        let shown = Shown { step, size, reduction, n_visible, n_depth, n_flow };
        Truth { shown, camera, grid, loaded }
    }

    /// Keeps the picture of a step that the device has been given, if it is to stay.
    pub fn keep(&mut self, target: &Truth) {
        self.images.keep(&target.loaded);
    }

    /// Appends the upload of `target` and what is learnt of its camera's clock and pose, in a run of `total` steps.
    pub fn record_upload(&self, rec: &mut Recording, work: &Workspace, target: &Truth, total: u64) {
        self.images.record_upload(rec, &target.loaded);
        self.cameras.record_view(rec, work, target.camera, (target.shown.step, total));
    }

    /// Appends the terms on the frame that was rendered, and the cotangents of its pictures.
    ///
    /// # Errors
    /// Those of [`Term::record`].
    pub fn record_loss(&mut self, gpu: &Gpu, rec: &mut Recording, work: &Workspace, target: &Truth) -> Result<()> {
        let Some(backward) = &work.backward else { return Ok(()) };
        let (shown, rendered) = (&target.shown, (&work.blend.image0, &backward.d_image0));
        let grid_variation = target.grid.and(self.cameras.grids()).map(|grids| grids.tv_sums.clone());
        let (image, d_image) = self.cameras.record_shown(gpu, rec, rendered, shown.size, target.grid)?;
        let geometry = work.blend.image1.as_ref().zip(backward.d_image1.as_ref());
        let grid_variation = grid_variation.as_ref();
        let Planes { colors: truth, priors } = &self.images.planes(&target.loaded);
        let on = Rendered { image, d_image, geometry, truth, priors, grid_variation };
        self.left = self.terms.iter_mut().map(|term| term.record(gpu, rec, shown, &on)).collect::<Result<_>>()?;
        self.cameras.record_back(rec, rendered, shown.size, target.grid);
        Ok(())
    }

    /// Appends step `step` of `total` of the cameras' own parameters, after the backward pass.
    pub fn record_step(&self, rec: &mut Recording, work: &Workspace, target: &Truth, step: u64, total: u64) {
        self.cameras.record_step(rec, work, (target.camera, target.grid), (step, total));
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
