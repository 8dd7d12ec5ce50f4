//! What a term of the loss is, before a run and in it.

use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording};
use crate::scene::capture::Capture;
use crate::stage::{Outputs, PriorPlanes};
use crate::train::config::Config;

/// Pixels that a term needs to be used: a mean over fewer would pull hard on them.
pub(super) const LEAST_PIXELS: u32 = 64;

/// Sums by workgroup; none where there are none.
pub(in crate::train) type Left = Option<Buf<[f32; 4]>>;

/// A term; none where it is off.
pub(super) type Begun = Result<Option<Box<dyn Term>>>;

/// What is known of a term before a run.
pub(super) struct TermKind {
    /// The numbers that it logs.
    pub logged: &'static [Logged],
    /// What it takes of a clip beside the colours, where the clip has it.
    pub data: fn(&Config, &Capture) -> TermData,
    /// Its buffers that grow with the picture, on a clip of which it takes so much: name, bytes per pixel.
    pub buffers: fn(TermData) -> &'static [(&'static str, f64)],
    /// The term; none where it is off.
    pub new: fn(&Gpu, &Config, TermData) -> Begun,
}

impl TermKind {
    /// A term that is always off, from which others begin.
    pub const NONE: TermKind =
        TermKind { logged: &[], data: |_, _| TermData::NONE, buffers: |_| &[], new: |_, _, _| Ok(None) };
}

/// What the terms take of a clip beside its colours: only what it has, and only where a weight is not 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TermData {
    /// Priors of the depth.
    pub depth: bool,
    /// Optical flow.
    pub flow: bool,
}

impl TermData {
    /// Nothing.
    pub const NONE: TermData = TermData { depth: false, flow: false };
}

/// A number that a term logs in every step that has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Logged {
    /// Its key, in [`crate::train::StepReport::terms`] and train.jsonl.
    pub key: &'static str,
    /// The title of its plot in the report; empty for none.
    pub plot: &'static str,
    /// Whether the plot's vertical axis begins at 0.
    pub from_zero: bool,
}

/// A term in a run.
pub(in crate::train) trait Term: Send + Sync {
    /// What the pictures of a frame must hold for it.
    fn outputs(&self) -> Outputs {
        Outputs::Color
    }

    /// Makes room for pictures of `pixels` pixels.
    fn fit(&mut self, _gpu: &Gpu, _pixels: usize) -> Result<()> {
        Ok(())
    }

    /// Appends its passes and its part of the cotangents, where it is due. Gives what it leaves, sums by workgroup; none in a step
    /// without it.
    fn record(&mut self, gpu: &Gpu, rec: &mut Recording, shown: &Shown, on: &Rendered) -> Result<Left>;

    /// Its parts, from the total of what it left.
    fn parts(&self, shown: &Shown, sums: [f32; 4]) -> Vec<Part>;
}

/// The picture of a step, as far as it decides what the terms do.
#[derive(Clone, Copy, Debug)]
pub(in crate::train) struct Shown {
    /// Number of the step, from 1.
    pub step: u64,
    /// Width and height.
    pub size: [u32; 2],
    /// Full pixels across one of this picture's.
    pub reduction: u32,
    /// Pixels that the mask does not hide, at least 1.
    pub n_visible: u32,
    /// Those of them that have a prior of the depth.
    pub n_depth: u32,
    /// Those of them that have flow.
    pub n_flow: u32,
}

/// A picture and its cotangent.
pub(in crate::train) type WithCotangent<'a> = (&'a Buf<[f32; 4]>, &'a Buf<[f32; 4]>);

/// What the terms compare, and where their cotangents go.
pub(in crate::train) struct Rendered<'a> {
    /// The colours, as the camera shows them.
    pub image: &'a Buf<[f32; 4]>,
    /// Their cotangent.
    pub d_image: &'a Buf<[f32; 4]>,
    /// Depth, inverse depth and flow, and their cotangent; where [`Term::outputs`] of any asks for them.
    pub geometry: Option<WithCotangent<'a>>,
    /// The picture: RGB and the mask.
    pub truth: &'a Buf<u32>,
    /// The total variation of the camera's grid by workgroup, which is there when the step ends; none where it has no grid.
    pub grid_variation: Option<&'a Buf<[f32; 4]>>,
    /// Its priors.
    pub priors: &'a PriorPlanes,
}

/// A part of the loss in one step: an error with its weight, and what is logged of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::train) struct Part {
    /// As in the log.
    pub key: &'static str,
    /// What is logged.
    pub value: f64,
    /// What the loss has of it, before the weight.
    pub error: f64,
    /// The weight; 0 of what is logged alone.
    pub weight: f64,
}

impl Part {
    /// An error that is logged as it is.
    pub fn error(key: &'static str, error: f64, weight: f64) -> Self {
        Part { key, value: error, error, weight }
    }
}
