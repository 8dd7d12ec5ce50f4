//! The loss of a step: the sum of the terms (SPEC 4), on a picture as its camera shows it.

use super::cameras::{Cameras, Taken};
use super::images::{Counts, Planes, Resident, Residents};
use super::terms::{self, Pair, Part, Rendered, Shown, Term};
use super::{Config, Setup};
use crate::error::Result;
use crate::gpu::generated::Status;
use crate::gpu::{Buf, Gpu, Recording, Staging};
use crate::stage::{self, MOST_TERMS, Outputs, Workspace};
use std::collections::BTreeMap;

pub(super) struct Objective {
    terms: Vec<Box<dyn Term>>,
    /// Sums that each term left in the step that is being recorded.
    left: Vec<terms::Left>,
    pub cameras: Cameras,
}

pub(super) struct Truth {
    shown: Shown,
    by: Taken,
    pub resident: Resident,
}

/// Host memory for the results of a step, and which terms it has.
pub(super) struct Report {
    totals: Vec<Buf<[f32; 4]>>,
    pub status: Buf<Status>,
    pub n_bad: Buf<u32>,
    has: Vec<bool>,
}

impl Objective {
    pub fn new(gpu: &Gpu, config: &Config, setup: &Setup, total: u64) -> Result<Self> {
        Ok(Objective {
            terms: terms::begin(gpu, config, setup.data)?,
            left: Vec::new(),
            cameras: Cameras::new(gpu, config, setup, total)?,
        })
    }

    pub fn outputs(&self) -> Outputs {
        let is_all = self.terms.iter().any(|term| term.outputs() == Outputs::All);
        if is_all { Outputs::All } else { Outputs::Color }
    }

    pub fn fit(&mut self, gpu: &Gpu, pixels: usize) -> Result<()> {
        self.cameras.fit(gpu, pixels)?;
        self.terms.iter_mut().try_for_each(|term| term.fit(gpu, pixels))
    }

    /// The image of step `step` that was taken `by` a camera and reduced by `reduction`.
    pub fn target(&self, resident: Resident, by: Taken, step: u64, reduction: u32) -> Truth {
        let Counts { size, n_visible, n_depth, n_flow } = resident.counts;
        let shown = Shown { step, size, reduction, n_visible, n_depth, n_flow };
        Truth { shown, by, resident }
    }

    /// Appends the terms on the rendered frame, and the cotangents of its pictures.
    pub fn record_loss(
        &mut self,
        gpu: &Gpu,
        rec: &mut Recording,
        work: &Workspace,
        images: &Residents,
        target: &Truth,
    ) -> Result<()> {
        let Some(backward) = &work.backward else { return Ok(()) };
        let shown = &target.shown;
        let rendered = Pair { image: &work.blend.image0, cotangent: &backward.d_image0 };
        let grid_variation = target.by.grid.and(self.cameras.grids()).map(|grids| grids.tv_sums.clone());
        let colors = self.cameras.record_shown(gpu, rec, rendered, shown.size, target.by.grid)?;
        let geometry = work.blend.image1.as_ref().zip(backward.d_image1.as_ref());
        let geometry = geometry.map(|(image, cotangent)| Pair { image, cotangent });
        let grid_variation = grid_variation.as_ref();
        let Planes { colors: truth, priors } = &images.planes(&target.resident);
        let on = Rendered { colors, geometry, truth, priors, grid_variation };
        self.left = self.terms.iter_mut().map(|term| term.record(gpu, rec, shown, &on)).collect::<Result<_>>()?;
        self.cameras.record_back(rec, rendered, shown.size, target.by.grid);
        Ok(())
    }

    /// Appends the copy of the totals of the terms, the status of the step and its bad gradients to host memory.
    pub fn record_report(
        &self,
        rec: &mut Recording,
        staging: &Staging,
        status: &Buf<Status>,
        n_bad: &Buf<u32>,
    ) -> Result<Report> {
        let there: Vec<_> = self.left.iter().flatten().cloned().collect();
        let n_totals = there.len().div_ceil(MOST_TERMS).max(1);
        let totals = (0..n_totals).map(|_| Ok(staging.readback::<[f32; 4]>("loss of a step", MOST_TERMS)?.of()));
        let report = Report {
            totals: totals.collect::<Result<_>>()?,
            status: staging.readback::<Status>("status of a step", 1)?.of(),
            n_bad: staging.readback::<u32>("bad gradients of a step", 1)?.of(),
            has: self.left.iter().map(Option::is_some).collect(),
        };
        let to = stage::Report { totals: &report.totals, status: &report.status, n_bad: &report.n_bad };
        stage::record_report(rec, &there, status, n_bad, &to);
        Ok(report)
    }

    /// The loss of a picture, and its logged numbers by key.
    pub fn values(&self, gpu: &Gpu, target: &Truth, report: &Report) -> Result<(f64, BTreeMap<&'static str, f64>)> {
        let totals = report.totals.iter().map(|totals| gpu.peek::<[f32; 4]>(&totals.slice()));
        let totals = totals.collect::<Result<Vec<_>>>()?.concat();
        let there = self.terms.iter().zip(&report.has).filter(|(_, has)| **has);
        let (mut loss, mut logged) = (0.0, BTreeMap::new());
        for ((term, _), sums) in there.zip(totals) {
            let parts = term.parts(&target.shown, sums);
            loss += parts.iter().fold(0.0, |sum, Part { weight, error, .. }| sum + weight * error);
            logged.extend(parts.iter().map(|part| (part.key, part.value)));
        }
        Ok((loss, logged))
    }
}
