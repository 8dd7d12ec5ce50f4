//! What a session tells: of work that takes a while, and of what has happened.

use crate::recon::Initial;
use crate::train::depth::DepthSummary;
use crate::train::plan::Plan;
use crate::train::require::Review;
use crate::train::trainer::StepReport;

/// Is told what a session does that takes a while.
pub type Watch<'a> = Box<dyn FnMut(Notice) + 'a>;

/// What a session does that takes a while.
#[derive(Debug)]
pub enum Notice<'a> {
    /// Work, so much of so much.
    Work {
        /// Of what kind.
        phase: Phase,
        /// Done.
        done: usize,
        /// In all; 0 where that is not known.
        total: usize,
    },
    /// The first Gaussians are there.
    Initialised(&'a Initial),
    /// The priors of the depth are there.
    DepthPriors(&'a DepthSummary),
    /// What the run needs is known, and is allocated next.
    Planned(&'a Plan),
}

/// Kinds of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The first Gaussians: frames, pictures or depths.
    Initialisation,
    /// Priors of the depth are compared with points: frames.
    DepthPriors,
    /// It is looked at what the scene requires: pictures.
    Review,
    /// Errors of time offsets: cameras.
    OffsetErrors,
}

/// What has happened.
#[derive(Clone, Debug)]
pub enum Event {
    /// A step has ended.
    Step(StepReport),
    /// It was looked at what the scene requires.
    Review(Review),
    /// The time offsets of these cameras were fixed at 0, since the images do not tell them.
    Frozen(Vec<String>),
    /// What no training camera looks at was to have a backdrop.
    Backdrop {
        /// Its Gaussians.
        n: usize,
        /// Whether they were added; otherwise there would be more than `max_gaussians`.
        is_added: bool,
    },
    /// It was looked at whether the cameras stand where the capture says.
    Poses {
        /// How far what a camera sees moves by what was learnt of its pose, pixels: the median over the cameras.
        pixels: f64,
        /// Whether the poses are learnt to the end; otherwise they are the capture's again.
        are_learnt: bool,
    },
}

/// Tells `watch` of work that begins.
pub(in crate::train) fn work<'w>(watch: &'w mut Watch, phase: Phase) -> impl FnMut(usize, usize) + 'w {
    watch(Notice::Work { phase, done: 0, total: 0 });
    move |done, total| watch(Notice::Work { phase, done, total })
}
