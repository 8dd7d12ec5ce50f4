//! Messages of a session: progress of long work, and events.

use crate::internals::train::{DepthSummary, Plan, Review, StepReport};
use crate::recon::Initial;

/// Receives the notices of a session.
pub type Watch<'a> = Box<dyn FnMut(Notice) + 'a>;

/// Progress of a session.
#[derive(Debug)]
pub enum Notice<'a> {
    /// Work under way.
    Work {
        phase: Phase,
        done: usize,
        /// Pieces in all; 0 if unknown.
        total: usize,
    },
    /// The first Gaussians are made.
    Initialised(&'a Initial),
    /// The depth priors are fitted.
    DepthPriors(&'a DepthSummary),
    /// The memory plan, before the buffers are made.
    Planned(&'a Plan),
}

/// Kinds of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The first Gaussians: frames, pictures or depths.
    Initialisation,
    /// Depth priors are fitted to points: frames.
    DepthPriors,
    /// A review of the scene: pictures.
    Review,
    /// Errors of time offsets: cameras.
    OffsetErrors,
}

/// An event of a run.
#[derive(Clone, Debug)]
pub enum Event {
    /// A step has ended.
    Step(StepReport),
    /// The scene was reviewed.
    Review(Review),
    /// The time offsets of these cameras were fixed at 0, since the images do not determine them.
    Frozen(Vec<String>),
    /// A backdrop was made for directions that no training camera sees.
    Backdrop {
        /// Its Gaussians.
        n: usize,
        /// True if they were added; otherwise the scene would exceed `max_gaussians`.
        is_added: bool,
    },
    /// The learnt poses were compared with the capture's.
    Poses {
        /// The shift of a camera's image by the learnt correction of its pose, pixels: the median over the cameras.
        pixels: f64,
        /// True if the poses are learnt to the end; otherwise they are the capture's again.
        are_learnt: bool,
    },
}

/// Reports work of a phase to `watch`.
pub(in crate::internals::train) fn work<'w>(watch: &'w mut Watch, phase: Phase) -> impl FnMut(usize, usize) + 'w {
    watch(Notice::Work { phase, done: 0, total: 0 });
    move |done, total| watch(Notice::Work { phase, done, total })
}
