//! The axes of the poses of a path, as an option.

use ivv::internals::sound::path::Convention;

/// Axes of poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Axes {
    /// x right, y down, z forward.
    Opencv,
    /// x right, y up, z backward.
    Opengl,
    /// As OpenGL.
    Openxr,
    /// x forward, y left, z up.
    Head,
}

impl From<Axes> for Convention {
    fn from(axes: Axes) -> Self {
        match axes {
            Axes::Opencv => Convention::OpenCv,
            Axes::Opengl => Convention::OpenGl,
            Axes::Openxr => Convention::OpenXr,
            Axes::Head => Convention::Head,
        }
    }
}
