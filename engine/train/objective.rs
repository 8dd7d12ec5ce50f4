//! What a step minimises: the sum of the terms (SPEC 4), on a picture as its camera shows it.

use super::cameras::{Cameras, OwnGrid};
use super::config::Config;
use super::setup::Setup;
use super::terms::{self, Left, Part, Rendered, Shown, Term};
use crate::error::Result;
use crate::gpu::generated::ViewParams;
use crate::gpu::{Buf, Gpu, Recording, Slice};
use crate::scene::capture::Picture;
use crate::stage::{MOST_TERMS, Outputs, Workspace, record_totals};
use std::collections::BTreeMap;

/// The terms of the loss, with their scratch, and the cameras' own parameters.
pub(super) struct Objective {
    terms: Vec<Box<dyn Term>>,
    /// The training image: RGB and the mask in the top byte, 8 bits each, row-major.
    truth: Buf<u32>,
    /// What each term leaves of the step that is recorded, and the totals of those that leave something.
    left: Vec<Left>,
    totals: Buf<[f32; 4]>,
    pub cameras: Cameras,
}

/// The part of one picture that is uploaded to the device.
pub(super) struct Truth {
    shown: Shown,
    camera: usize,
    grid: Option<OwnGrid>,
    colors: Slice,
    /// What each term needs beside the colours.
    staged: Vec<Option<Slice>>,
}

/// Where a step leaves the totals of its terms, and which terms it has.
pub(super) struct Sums {
    totals: Slice,
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
            truth: gpu.alloc("truth", 1)?,
            left: Vec::new(),
            totals: gpu.alloc("loss totals", MOST_TERMS)?,
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
        self.truth = gpu.alloc("truth", pixels)?;
        self.cameras.fit(gpu, pixels)?;
        self.terms.iter_mut().try_for_each(|term| term.fit(gpu, pixels))
    }

    /// Takes the picture of step `step`, which `camera` took and which was reduced by `reduction`, to where the device copies it
    /// from.
    pub fn upload(&mut self, gpu: &Gpu, picture: &Picture, camera: usize, step: u64, reduction: u32) -> Result<Truth> {
        let n_visible = picture.pixels.iter().filter(|word| **word >> 24 != 0).count().max(1) as u32;
        let grid = self.cameras.next(camera);
        let shown = Shown {
            step,
            size: [picture.width, picture.height],
            reduction,
            n_visible,
            n_depth: picture.n_depth,
            n_flow: picture.n_flow,
        };
        let staged = self.terms.iter().map(|term| term.upload(gpu, picture, &shown)).collect::<Result<_>>()?;
        Ok(Truth { shown, camera, grid, colors: gpu.staged("staged truth", &picture.pixels)?, staged })
    }

    /// Appends the upload of `target` and the shift of the view by its camera's clock.
    pub fn record_upload(&self, rec: &mut Recording, work: &Workspace, target: &Truth) {
        let n = (target.shown.size[0] * target.shown.size[1]) as usize;
        rec.copy(target.colors.clone(), self.truth.range(0, n).slice());
        for (term, staged) in self.terms.iter().zip(&target.staged) {
            if let Some(staged) = staged {
                term.record_upload(rec, staged, &target.shown);
            }
        }
        self.cameras.record_clock(rec, work, target.camera);
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
        let on = Rendered { image, d_image, geometry, truth: &self.truth, grid_variation };
        self.left = self.terms.iter_mut().map(|term| term.record(gpu, rec, shown, &on)).collect::<Result<_>>()?;
        self.cameras.record_back(rec, rendered, shown.size, target.grid);
        Ok(())
    }

    /// Appends step `step` of `total` of the cameras' own parameters, after the backward pass.
    pub fn record_step(&self, rec: &mut Recording, work: &Workspace, target: &Truth, step: u64, total: u64) {
        self.cameras.record_step(rec, work, (target.camera, target.grid), (step, total));
    }

    /// Appends the totals of the terms, to where the host can read them.
    pub fn record_report(&self, rec: &mut Recording, gpu: &Gpu) -> Result<Sums> {
        let there: Vec<_> = self.left.iter().flatten().cloned().collect();
        record_totals(rec, &there, &self.totals);
        let totals = gpu.readback::<[f32; 4]>("loss of a step", there.len())?;
        rec.copy(self.totals.range(0, there.len()).slice(), totals.clone());
        Ok(Sums { totals, has: self.left.iter().map(Option::is_some).collect() })
    }

    /// The values of a step that has ended.
    pub fn values(&self, gpu: &Gpu, target: &Truth, sums: &Sums) -> Result<Values> {
        let totals = gpu.peek::<[f32; 4]>(&sums.totals)?;
        let there = self.terms.iter().zip(&sums.has).filter(|(_, has)| **has);
        let mut values = Values::default();
        for ((term, _), sums) in there.zip(totals) {
            let parts = term.parts(&target.shown, sums);
            values.loss += parts.iter().fold(0.0, |sum, Part { weight, error, .. }| sum + weight * error);
            values.logged.extend(parts.iter().map(|part| (part.key, part.value)));
        }
        Ok(values)
    }
}
