//! Synthetic captures (SPEC 11): a room of analytic surfaces, cast ray by ray, with everything that is true of it.
//!
//! All arithmetic is +, -, *, / and sqrt in f64 and integer hashes, so equal options give equal bytes on every machine and with any number
//! of threads. A capture has, beside the parts of SPEC 8, `foreground/` (255 where any ray of the pixel meets a body that moves) and
//! `covisible/` (255 where a training camera sees what a test camera's pixel shows at its centre):
//!
//! ```text
//! capture.toml                            written last: a folder without it is unfinished
//! synth.json                              the options; marks the folder as made by this module
//! truth.json                              hidden values: clocks, colours, depth scales, outliers, poses, source
//! truth/exact/<camera>/<frame:05>.exr     depth.Z (scene units), flow.X, flow.Y (pixels until the next frame), body
//! truth/source.wav                        the voice without delay at a distance of one
//! ```
//!
//! A camera of a moving rig has a pose for each frame. Pictures, flow and depth of frame f are of the camera's own time, f + its offset;
//! points are of the true time f. Flow is that of the surface point, also where that is hidden or gone in the next frame; `flow/` has none
//! for the last frame. `depth/` holds inverse depth with a scale and a shift of its own per picture. The microphone of a camera is at its
//! lens and runs by its clock. Keypoints are in MMPose's format, 133 per person.

mod cast;
mod colmap;
mod files;
mod math;
mod options;
mod points;
mod priors;
mod rig;
mod room;
mod shape;
mod sound;
mod texture;
mod truth;
mod world;
mod write;

pub use options::{Noise, Options, Preset, Rig};
pub use write::{Summary, write_capture};
