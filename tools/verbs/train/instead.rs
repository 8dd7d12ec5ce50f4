//! `ivv train` without a training: a plan, the settings, or the first Gaussians.

use crate::verbs::train::Args;
use crate::verbs::train::initial_scene;
use crate::verbs::train::list_settings;
use crate::verbs::train::plan;
use std::path::PathBuf;

/// Options for something else than a training.
#[derive(clap::Args)]
pub struct InsteadArgs {
    /// Only tells what the run will take: steps, memory, bytes on the disk; as if the clip had so many frames, where that is given.
    /// Nothing is written.
    #[arg(long, value_name = "FRAMES", num_args = 0..=1, conflicts_with = "resume")]
    plan: Option<Option<u32>>,
    /// With `--plan`: plans for a card that is not here: H200, RTX4090, RX7900XTX or A770.
    #[arg(long, value_name = "CARD", requires = "plan")]
    pub card: Option<String>,
    /// Only lists the settings of a run: default, unit, range, meaning, and the presets that change each; those whose names begin with
    /// NAME, such as density or lr.scale, where that is given.
    #[arg(long, value_name = "NAME", num_args = 0..=1, conflicts_with_all = ["capture", "output", "resume", "plan"])]
    list_settings: Option<Option<String>>,
    /// Only writes the first Gaussians of the run to this file, a PLY in the capture's own frame.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["output", "resume", "base", "plan", "list_settings"])]
    only_init: Option<PathBuf>,
}

/// Does what `args` ask for instead of a training, and says whether they do.
pub fn of_training(args: &Args, json: bool) -> anyhow::Result<bool> {
    let InsteadArgs { plan, list_settings, only_init, card: _ } = &args.instead;
    if let Some(name) = list_settings {
        list_settings::print(name.as_deref().unwrap_or_default(), json)?;
    } else if let Some(frames) = plan {
        plan::tell(args, *frames, json)?;
    } else if let Some(file) = only_init {
        initial_scene::write(args, file, json)?;
    } else {
        return Ok(false);
    }
    Ok(true)
}
