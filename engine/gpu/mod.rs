//! The safe layer over [`crate::vk`]: typed buffers, kernels with generated bindings, and recordings of passes as data.

pub mod generated;
pub mod kernel;
mod record;
mod run;
/// The table of kernels, shared with the build.
#[path = "../../shaders-glsl/table.rs"]
pub mod table;

pub use kernel::{Buf, Kernel, KernelInfo, Slice};
pub use record::{Grid, Pass, Recording, Work};
pub use run::{Gpu, Options, PassTime, Running};
