//! The settings of a training run from the command line.

use crate::files::read_json;
use anyhow::Context;
use ivv::train::Config;
use std::path::PathBuf;

/// Settings of a run.
#[derive(clap::Args)]
pub struct SettingArgs {
    /// Passes over all training images.
    #[arg(long)]
    epochs: Option<u32>,
    /// Steps, instead of what the epochs give.
    #[arg(long)]
    steps: Option<u64>,
    /// Settings, JSON; as config.json of an earlier run has them.
    #[arg(long)]
    config: Option<PathBuf>,
    /// One setting, KEY=VALUE, after the file; nested keys with dots, as density.strategy=mcmc or lr.scale=1e-2.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Gaussians never exceed this.
    #[arg(long)]
    max_gaussians: Option<usize>,
    /// Seed of the order of the images, the initial points and density control.
    #[arg(long)]
    seed: Option<u64>,
    /// Highest degree of the spherical harmonics.
    #[arg(long)]
    sh_degree: Option<u32>,
}

impl SettingArgs {
    /// The defaults, then the file, then each `--set`, then the flags.
    pub fn resolve(&self) -> anyhow::Result<Config> {
        let begin = match &self.config {
            Some(file) => read_json(file, "start from the config.json of a run")?,
            None => Config::default(),
        };
        let mut value = serde_json::to_value(begin)?;
        for set in &self.set {
            let (key, text) = set.split_once('=').with_context(|| format!("--set {set}: KEY=VALUE is needed"))?;
            let pointer = format!("/{}", key.replace('.', "/"));
            let place =
                value.pointer_mut(&pointer).with_context(|| format!("--set {set}: there is no such setting"))?;
            // JSON, or a bare word.
            *place = serde_json::from_str(text).unwrap_or_else(|_| text.into());
        }
        let mut config: Config = serde_json::from_value(value).context("--set")?;
        config.epochs = self.epochs.unwrap_or(config.epochs);
        config.steps = self.steps.unwrap_or(config.steps);
        config.max_gaussians = self.max_gaussians.unwrap_or(config.max_gaussians);
        config.seed = self.seed.unwrap_or(config.seed);
        config.sh_degree = self.sh_degree.unwrap_or(config.sh_degree);
        config.check().map_err(|fault| anyhow::anyhow!("settings: {fault}"))?;
        anyhow::ensure!(config.sh_degree <= 3, "--sh-degree is 0 to 3");
        anyhow::ensure!(config.epochs > 0 || config.steps > 0, "--epochs or --steps must be positive");
        Ok(config)
    }
}
