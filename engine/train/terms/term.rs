//! A term of the loss, before a run and in it.

use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording};
use crate::internals::train::Config;
use crate::stage::{Outputs, PriorPlanes};

/// Pixels that a term needs: a mean over fewer would pull hard on them.
pub(super) const LEAST_PIXELS: u32 = 64;

/// Sums by workgroup; none if the term is not due.
pub(in crate::internals::train) type Left = Option<Buf<[f32; 4]>>;

/// Gives none where the term is off.
pub(super) type NewTerm = fn(&Gpu, &Config, TermData) -> Result<Option<Box<dyn Term>>>;

/// A term before a run, which may be off.
pub(super) struct TermKind {
    pub logged: &'static [Logged],
    /// Those that grow with the picture, by the data that it uses: name, bytes per pixel.
    pub buffers: fn(TermData) -> &'static [(&'static str, f64)],
    pub new: NewTerm,
}

impl TermKind {
    /// A term that is always off, for struct updates.
    pub const NONE: TermKind = TermKind { logged: &[], buffers: |_| &[], new: |_, _, _| Ok(None) };
}

/// Data of a clip that the terms use beside its colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TermData {
    pub depth: bool,
    pub flow: bool,
}

impl TermData {
    pub const NONE: TermData = TermData { depth: false, flow: false };
}

/// A number that a term logs in every step that has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Logged {
    pub key: &'static str,
    /// The title of its plot in the report; empty for none.
    pub plot: &'static str,
    pub from_zero: bool,
}

pub(in crate::internals::train) trait Term: Send + Sync {
    /// The outputs that a frame must have for it.
    fn outputs(&self) -> Outputs {
        Outputs::Color
    }

    fn fit(&mut self, _gpu: &Gpu, _pixels: usize) -> Result<()> {
        Ok(())
    }

    /// Appends its passes and its part of the cotangents. Gives its sums by workgroup; none in a step without it.
    fn record(&mut self, gpu: &Gpu, rec: &mut Recording, shown: &Shown, on: &Rendered) -> Result<Left>;

    /// Its parts of the loss, from the total of its sums.
    fn parts(&self, shown: &Shown, sums: [f32; 4]) -> Vec<Part>;
}

#[derive(Clone, Copy, Debug)]
pub(in crate::internals::train) struct Shown {
    pub step: u64,
    pub size: [u32; 2],
    /// Full pixels along the side of one of this picture's.
    pub reduction: u32,
    /// Pixels that the mask does not hide, at least 1.
    pub n_visible: u32,
    /// Visible pixels with a depth prior.
    pub n_depth: u32,
    /// Visible pixels with flow.
    pub n_flow: u32,
}

#[derive(Clone, Copy)]
pub(in crate::internals::train) struct Pair<'a> {
    pub image: &'a Buf<[f32; 4]>,
    pub cotangent: &'a Buf<[f32; 4]>,
}

pub(in crate::internals::train) struct Rendered<'a> {
    /// The colours, as the camera shows them.
    pub colors: Pair<'a>,
    /// Depth, inverse depth and flow, where [`Term::outputs`] of any asks for them.
    pub geometry: Option<Pair<'a>>,
    /// The picture: RGB and the mask.
    pub truth: &'a Buf<u32>,
    /// The total variation of the camera's grid by workgroup, complete at the end of the step.
    pub grid_variation: Option<&'a Buf<[f32; 4]>>,
    pub priors: &'a PriorPlanes,
}

/// A part of the loss in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::internals::train) struct Part {
    pub key: &'static str,
    pub value: f64,
    /// Before the weight.
    pub error: f64,
    /// 0 of a number that is only logged.
    pub weight: f64,
}

impl Part {
    /// An error that is logged as it is.
    pub fn error(key: &'static str, error: f64, weight: f64) -> Self {
        Part { key, value: error, error, weight }
    }
}
