//! Imports that many tests share.

pub use crate::common::device::{Watched, gpu, timed};
pub use crate::common::folder::Folder;
pub use crate::common::frames::render;
pub(crate) use crate::common::notes::needs;
pub use crate::common::notes::{has_program, shared, skip};
pub use crate::common::one::{One, ball, camera, scene_of};
pub use crate::common::program::{fails, ivv, tells, text, works};
pub use crate::common::random::{Random, wild_scene};
pub(crate) use crate::common::references::tested;
pub use crate::common::same::{assert_same, assert_same_frame, assert_same_gradients, assert_same_splats};
pub use crate::common::{exact, zip};
pub use glam::{DMat3, DQuat, DVec2, DVec3};
pub use image::ExtendedColorType;
pub use ivv::Constants;
pub use ivv::internals::formats::{
    Clock, Encoded, FourDgs, Grades, SpzVersion, read_ply, read_scene, write_ply, write_spz,
};
pub use ivv::internals::gpu::table::KERNELS;
pub use ivv::internals::gpu::{Grid, KernelInfo, Recording, Rewrite};
pub use ivv::internals::prepare::{PrepareSettings, Triangulate};
pub use ivv::internals::reference::{Camera, Params, Projected, Rules, render_f64};
pub use ivv::internals::scene::capture::{
    Capture, CaptureSettings, Frames, Manifest, Picture, Point, PriorPlan, check_capture,
};
pub use ivv::internals::scene::prior::{read_depth, read_flow};
pub use ivv::internals::scene::undistort::Distortion;
pub use ivv::internals::scene::{
    FlowModel, Frame, Intrinsics, Motion, Pose, SeenPoint, Similarity, Splats, View, demo, read_views, write_points,
    write_views,
};
pub use ivv::internals::sound::hrtf::{HrtfSet, Lookup};
pub use ivv::internals::sound::pose::{HeadPose, PoseTrack};
pub use ivv::internals::sound::render::{RenderConfig, render_signals};
pub use ivv::internals::sound::scene_file::SoundScene;
pub use ivv::internals::sound::source_track::{SourceSample, SourceTrack};
pub use ivv::internals::sound::sphere::Sphere;
pub use ivv::internals::stage::{
    AdamMode, FrameReport, Gradients, Outputs, Purpose, Renderer, SceneBuffers, Strip, Sums, view_params,
};
pub use ivv::internals::synth::{Preset, write_capture};
pub use ivv::internals::train::{
    Checkpoint, Config, Density, Event, GridKind, Init, Pace, PoseKind, Rate, Required, Run, Session, SessionOptions,
    Setup, TermData, Trainer, from_points, initialise,
};
pub use ivv::internals::vk::DeviceKind;
pub use serde_json::Value;
pub use std::collections::{BTreeMap, BTreeSet, HashMap};
pub use std::fs;
pub use std::fs::File;
pub use std::path::{Path, PathBuf};
pub use std::process::{Command, Output, Stdio};
pub use std::sync::{Arc, Mutex, OnceLock};
pub use std::time::{Duration, Instant};
