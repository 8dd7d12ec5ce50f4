//! The options of `ivv train`.

use crate::run::capture::CaptureArgs;
use crate::run::constants::ConstantArgs;
use crate::run::device::DeviceArgs;
use crate::run::schedule::ScheduleArgs;
use crate::run::settings::SettingArgs;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct Args {
    /// A capture, see `ivv check`. With --resume only if it has moved.
    #[arg(required_unless_present_any = ["resume", "list_settings"])]
    pub capture: Option<PathBuf>,
    /// The run folder, for run.json, config.json, train.jsonl, train.json, checkpoints, scene.ply, eval.json, renders and report.html.
    #[arg(short, long, required_unless_present_any = ["list_settings", "only_init"])]
    pub output: Option<PathBuf>,
    #[command(flatten)]
    pub settings: SettingArgs,
    /// Bytes of images to decode ahead. By default a quarter of the machine's memory, for all processes of the run on it.
    #[arg(long)]
    pub cache_bytes: Option<u64>,
    /// Bytes of images to keep in device memory. By default three quarters of what the plan leaves free; none if it is host
    /// memory.
    #[arg(long)]
    pub device_image_bytes: Option<u64>,
    /// Steps between two lines of train.jsonl.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..))]
    pub log_every: u64,
    #[command(flatten)]
    pub read: CaptureArgs,
    /// A cameras file of views from which the scene will be seen, not of test views: training keeps the space just before them
    /// clear.
    #[arg(long, conflicts_with = "resume")]
    pub viewpoints: Option<PathBuf>,
    /// Continues the run in the run folder from its newest checkpoint. --steps or --epochs change its length, also after its end.
    #[arg(long)]
    pub resume: bool,
    /// Trains the dynamic part on top of a finished run on the same cameras, whose static Gaussians, time offsets and poses stay
    /// fixed.
    #[arg(long, value_name = "RUN", conflicts_with = "resume")]
    pub base: Option<PathBuf>,
    /// Replaces the run in the run folder, once capture and settings are checked and the first Gaussians are made.
    #[arg(long, conflicts_with = "resume")]
    pub overwrite: bool,
    #[command(flatten)]
    pub schedule: ScheduleArgs,
    /// Only prints the steps, memory and disk space of the run, for a clip of FRAMES frames if that is given. Writes nothing.
    #[arg(long, value_name = "FRAMES", num_args = 0..=1, conflicts_with = "resume")]
    pub plan: Option<Option<u32>>,
    /// With `--plan`: plans for another card: H200, RTX4090, RX7900XTX or A770.
    #[arg(long, value_name = "CARD", requires = "plan")]
    pub card: Option<String>,
    /// Only lists the settings of a run; with NAME, such as density or lr.scale, those whose names begin with it.
    #[arg(long, value_name = "NAME", num_args = 0..=1, conflicts_with_all = ["capture", "output", "resume", "plan"])]
    pub list_settings: Option<Option<String>>,
    /// Only writes the first Gaussians of the run to this file, a PLY in the capture's own frame.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["output", "resume", "base", "plan", "list_settings"])]
    pub only_init: Option<PathBuf>,
    /// Shows the training in a browser, at this port of this machine: its curves, test views, and the scene of the newest checkpoint.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "8080")]
    pub view: Option<u16>,
    #[command(flatten)]
    pub constants: ConstantArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
}
