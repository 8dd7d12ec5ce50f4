//! Immersive volumetric video: dynamic scenes as spatio-temporal 3D Gaussians, trained and rendered in Vulkan compute.
//!
//! A *scene* is a set of Gaussians ([`Splats`]), static ones first; a dynamic one has a velocity, a time at which it is brightest and a
//! duration. Times are *normalised*: 0 to 1 is the clip. Lengths are in units of the scene; its [`World`](formats::World) says how long a
//! unit is, where known. Cameras look along +z, with x to the right and y down, as in COLMAP and OpenCV. Colours are the images' own
//! values, 0 to 1, without conversion.
//!
//! # Read and write scenes
//!
//! [`formats::read`] takes every supported format. [`formats::write`] chooses the format by the file's ending, and reports what the
//! format cannot hold.
//!
//! ```
//! use ivv::formats::{self, Clip, Clock, Scene, WriteOptions};
//!
//! # fn main() -> ivv::Result<()> {
//! # let folder = std::env::temp_dir().join(format!("ivv-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder).expect("a temporary folder");
//! // A small scene with everything in it: static and dynamic Gaussians, and views of them.
//! let (splats, views) = ivv::demo();
//! formats::write(folder.join("demo.ply"), &Scene::from(splats.clone()), &WriteOptions::default())?;
//! let read = formats::read(folder.join("demo.ply"))?;
//! assert_eq!(read.splats.len(), splats.len());
//!
//! // A `.4dgs` also holds the clock, views to start from, and sound.
//! let clip = Clip { clock: Some(Clock { fps: 30.0, frames: 60 }), views, ..Clip::default() };
//! let options = WriteOptions { clamp_colors: true, ..WriteOptions::default() };
//! let written = formats::write(folder.join("demo.4dgs"), &Scene { splats, clip, notes: vec![] }, &options)?;
//! println!("{} Gaussians, {} bytes", written.n, written.bytes);
//! for note in written.notes {
//!     println!("{note}");
//! }
//!
//! // Formats without motion take the scene at one time.
//! let scene = formats::read(folder.join("demo.4dgs"))?;
//! assert_eq!(scene.clip.clock.map(|clock| clock.seconds()), Some(2.0));
//! formats::write(folder.join("moment.spz"), &scene, &WriteOptions::at(0.25))?;
//! # std::fs::remove_dir_all(&folder).expect("the folder is removed");
//! # Ok(())
//! # }
//! ```
//!
//! # Render
//!
//! A [`Renderer`] holds one scene on the device. [`Outputs::All`] gives colour, alpha, depth, inverse depth and optical flow.
//!
//! ```no_run
//! use ivv::{Constants, Gpu, GpuOptions, Intrinsics, Outputs, Renderer, View, formats};
//! use std::sync::Arc;
//!
//! # fn main() -> ivv::Result<()> {
//! let gpu = Arc::new(Gpu::open(&GpuOptions::default())?);
//! println!("{}", gpu.caps().name);
//! # fn shared<T: Send + Sync>(_: &T) {}
//! # shared(&gpu);
//!
//! let scene = formats::read("scene.4dgs")?;
//! let mut renderer = Renderer::new(gpu, &scene.splats, scene.clip.constants)?;
//! // From where, to where, upwards; pixels; vertical field of view, degrees.
//! let view = View::look_at([0.0, -1.0, -4.0], [0.0; 3], [0.0, -1.0, 0.0], Intrinsics::of_fov(1280, 720, 50.0));
//! let view = View { time: 0.5, ..view };
//! let (frame, report) = renderer.render(&view, Outputs::All)?;
//! assert_eq!(frame.color.len(), 1280 * 720);
//! println!("{} of {} Gaussians are visible", report.visible, report.gaussians);
//! frame.write_png("frame.png")?; // colour; write_exr has all outputs
//! # Ok(())
//! # }
//! ```
//!
//! # Gradients
//!
//! [`Renderer::vjp`] takes the derivative of a loss by each output of each pixel, and gives its derivatives by each parameter of each
//! Gaussian, by the camera's pose and time offset, and by the background.
//!
//! ```no_run
//! # use ivv::{Frame, Gpu, GpuOptions, Outputs, Renderer};
//! # fn main() -> ivv::Result<()> {
//! # let gpu = std::sync::Arc::new(Gpu::open(&GpuOptions::default())?);
//! # let (splats, views) = ivv::demo();
//! # let view = &views[0];
//! let mut renderer = Renderer::new(gpu, &splats, ivv::Constants::default())?;
//! let (frame, _) = renderer.render(view, Outputs::All)?;
//! // The loss: half the sum of squared colours. Its derivative by a colour is that colour.
//! let n = frame.color.len();
//! let cotangents = Frame {
//!     alpha: vec![0.0; n],
//!     depth: vec![0.0; n],
//!     inverse_depth: vec![0.0; n],
//!     flow: vec![[0.0; 2]; n],
//!     ..frame
//! };
//! let (gradients, _) = renderer.vjp(view, &cotangents)?;
//! assert_eq!(gradients.params.position.len(), splats.len());
//! println!("camera: {:?} by turn, {:?} by shift", gradients.camera_rotation, gradients.camera_translation);
//! # Ok(())
//! # }
//! ```
//!
//! # Open a capture
//!
//! A [`Capture`] is a folder with calibrated images: this project's own format, COLMAP, nerfstudio, LLFF, OpenSfM, and others.
//!
//! ```no_run
//! use ivv::Capture;
//!
//! # fn main() -> ivv::Result<()> {
//! let capture = Capture::open("captures/fox")?;
//! println!("{} cameras, {} frames at {} per second", capture.cameras.len(), capture.n_frames, capture.fps);
//! capture.notes.iter().for_each(|note| println!("{note}"));
//! let (camera, frame) = capture.training_frames()[0];
//! let view = capture.view(camera, frame)?;
//! let picture = capture.picture(camera, frame)?;
//! assert_eq!((picture.width, picture.height), (view.intrinsics.width, view.intrinsics.height));
//! # Ok(())
//! # }
//! ```
//!
//! # Train
//!
//! A [`train::Session`] makes the first Gaussians and takes one step after the other. Settings are a [`train::Config`]; the manual's
//! page *Settings* explains each.
//!
//! ```no_run
//! use ivv::formats::{self, Scene, WriteOptions};
//! use ivv::train::{Config, Event, Session, SessionOptions};
//! use ivv::{Capture, Gpu, GpuOptions};
//!
//! # fn main() -> ivv::Result<()> {
//! let gpu = std::sync::Arc::new(Gpu::open(&GpuOptions::default())?);
//! let capture = Capture::open("captures/fox")?;
//! let config = Config { steps: 7_000, ..Config::default() };
//! let mut session = Session::begin(gpu, &capture, config, SessionOptions::default())?;
//! while session.step()? {
//!     for event in session.take_events() {
//!         if let Event::Step(report) = event {
//!             println!("step {}: loss {:.4}, {} Gaussians", report.step, report.loss, report.gaussians);
//!         }
//!     }
//! }
//! formats::write("fox.ply", &Scene::from(session.finish()?), &WriteOptions::default())?;
//! # Ok(())
//! # }
//! ```
//!
//! # Sound
//!
//! A [`sound::SoundScene`] has recordings and the places of their sources. [`sound::render`] gives what the two ears of a head hear
//! that moves along a path.
//!
//! ```no_run
//! use ivv::sound::{Depth, HrtfSet, RenderConfig, SoundScene, read_path, render, write_wav};
//!
//! # fn main() -> ivv::Result<()> {
//! let scene = SoundScene::read("sound/scene.json")?;
//! let head = read_path("head.csv", None)?.track;
//! let ears = HrtfSet::open("ears.sofa")?;
//! let heard = render(&scene, &head, &ears, &RenderConfig::default())?;
//! write_wav("heard.wav", &heard.samples, Depth::Int24)?; // left and right, 48 kHz
//! # Ok(())
//! # }
//! ```
//!
//! # Errors, threads, versions
//!
//! Every fallible function returns an [`Error`] that says what is wrong, where, and what to do about it. A [`Gpu`] may be shared by
//! threads; a [`Renderer`] and a session belong to one thread at a time. The same inputs give the same bits on the same device and
//! driver. The command line `ivv` is in the same package; without it, depend on `ivv` with `default-features = false`.
#![deny(unsafe_code)]
#![warn(missing_docs)]

/// The engine's rooms, for the program `ivv`, its tests and tools. Nothing here is stable.
#[doc(hidden)]
#[path = "."]
pub mod internals {
    pub mod error;
    pub mod files;
    pub mod formats;
    pub mod gpu;
    pub mod parallel;
    pub mod prepare;
    pub mod profile;
    pub mod random;
    pub(crate) mod recon;
    pub mod reference;
    pub mod report;
    pub mod scene;
    pub mod settings;
    pub mod sound;
    pub mod stage;
    pub mod study;
    pub mod synth;
    pub mod train;
    pub mod video;
    pub mod vk;
    pub mod words;
}

// So that `crate::stage` is a room of the engine.
use internals::{
    error, files, gpu, parallel, prepare, random, recon, report, scene, settings, stage, video, vk, words,
};

pub use internals::error::{Error, Result};
pub use internals::gpu::{Gpu, Options as GpuOptions};
pub use internals::scene::capture::Capture;
pub use internals::scene::{
    ALWAYS, FlowModel, Frame, Intrinsics, Motion, Pose, SH_C0, Similarity, Splats, View, demo, read_views, write_views,
};
pub use internals::settings::{Constants, Knobs};
pub use internals::stage::{FrameReport, Gradients, Outputs, Renderer};
pub use internals::vk::{Caps, DeviceChoice, DeviceKind};

/// Captures: folders of calibrated images, with masks, priors and points.
pub mod capture {
    pub use crate::internals::scene::capture::{
        Alpha, Calibration, Camera, Capture, CaptureSettings, Extent, Fault, FramePoint, Frames, Picture, Point,
        Report, Shot, check_capture,
    };
}

/// Files of scenes: one entry to read them, one to write them.
pub mod formats {
    pub use crate::internals::formats::{
        Clip, Clock, Ears, Grades, Keeps, Scene, Sound, Sounds, WRITERS, World, WriteOptions, Writer, Written,
        by_ending, endings, read, write,
    };

    pub(crate) use crate::internals::formats::*;
}

/// Training: Gaussians fitted to the images of a capture.
pub mod train {
    pub use crate::internals::settings::{Range, Setting};
    pub use crate::internals::train::{
        Checkpoint, Config, Density, Evaluation, Event, GridKind, Init, LearningRates, Loss, Meter, Notice, PRESETS,
        Pace, Phase, Plan, PoseKind, Preset, PresetId, Priors, Rate, Required, Resolution, Review, Scores, Session,
        SessionOptions, Sight, StepReport, ViewScores, Watch, all_settings, evaluate, psnr,
    };

    pub(crate) use crate::internals::train::*;
}

/// Sound: sources in a scene, and what two ears hear of them on their way.
pub mod sound {
    pub use crate::internals::sound::geometry::Mode;
    pub use crate::internals::sound::hrtf::{HrtfSet, Lookup};
    pub use crate::internals::sound::path::{Convention, HeadPath, PathCamera, read_path};
    pub use crate::internals::sound::pose::{HeadPose, PoseTrack};
    pub use crate::internals::sound::render::{Cue, RenderConfig, Rendered, Report, SourceReport, render};
    pub use crate::internals::sound::scene_file::SoundScene;
    pub use crate::internals::sound::wav::{Depth, write as write_wav};
    pub use crate::internals::sound::{FS, clip::ears, clip::sounds};

    pub(crate) use crate::internals::sound::*;
}
