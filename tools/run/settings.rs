//! The settings of a training run from the command line.

use crate::run::files::read_json;
use anyhow::Context;
use ivv::internals::train::{Config, check_name, check_settings, merge};
use serde_json::{Value, json};
use std::fmt::Display;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct SettingArgs {
    /// Passes over all training images; with `train --resume`, of the whole run.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "steps")]
    epochs: Option<u32>,
    /// Steps, instead of what the epochs give; with `train --resume`, of the whole run.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    steps: Option<u64>,
    /// The preset to start from: balanced (the defaults), exact, fast, small, or the path of a preset's .json file.
    #[arg(long)]
    preset: Option<String>,
    /// A JSON file of settings, such as an earlier run's config.json. It overrides the preset.
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// One setting, KEY=VALUE, which overrides the file; see `ivv train --list-settings`. May be given several times.
    #[arg(long = "set")]
    set: Vec<String>,
    /// Most Gaussians of the scene, including the first ones.
    #[arg(long)]
    max_gaussians: Option<usize>,
    /// Seed of the image order, the first Gaussians and density control.
    #[arg(long)]
    seed: Option<u64>,
    /// Highest degree of the spherical harmonics.
    #[arg(long)]
    sh_degree: Option<u32>,
}

/// The patch of KEY=VALUE; dots separate the parts of nested keys.
pub fn patch(set: &str) -> anyhow::Result<Value> {
    let (key, text) = set.split_once('=').context("expected KEY=VALUE")?;
    let pointer = format!("/{}", key.replace('.', "/"));
    let mut all = serde_json::to_value(Config::default())?;
    if all.pointer(&pointer).is_none() {
        check_name(key).map_err(anyhow::Error::msg)?;
    }
    // JSON, or a bare word.
    let value = serde_json::from_str(text).unwrap_or_else(|_| text.into());
    let patch = key.rsplit('.').fold(value, |inner, key| json!({ key: inner }));
    merge(&mut all, &patch);
    check_settings(&all).map_err(anyhow::Error::msg)?;
    Ok(patch)
}

fn differences(key: &str, has: &Value, asked: &Value, found: &mut Vec<String>) {
    match (has, asked) {
        (Value::Object(has), Value::Object(asked)) => {
            for (name, value) in asked {
                let key = if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
                differences(&key, has.get(name).unwrap_or(&Value::Null), value, found);
            }
        }
        _ if has == asked => {}
        _ => found.push(contradiction(key, has, asked)),
    }
}

/// The message for an option that asks for another value than a run has and keeps.
pub fn contradiction(option: impl Display, has: impl Display, asked: impl Display) -> String {
    format!("{option}: the run has {has}, the option asks for {asked}")
}

impl SettingArgs {
    /// `run` with the length of --steps or --epochs. Epochs count only if no steps are set.
    pub fn extended(&self, run: &Config) -> Config {
        let mut config = run.clone();
        if let Some(epochs) = self.epochs {
            (config.epochs, config.steps) = (epochs, 0);
        }
        config.steps = self.steps.unwrap_or(config.steps);
        config
    }

    pub fn contradictions(&self, run: &Config) -> anyhow::Result<Vec<String>> {
        let asked = Config { steps: run.steps, epochs: run.epochs, ..self.on(run)? };
        let mut found = Vec::new();
        differences("", &serde_json::to_value(run)?, &serde_json::to_value(asked)?, &mut found);
        Ok(found)
    }

    /// The defaults, overridden by the preset, the file, each `--set` and the other options, in this order.
    pub fn resolve(&self) -> anyhow::Result<Config> {
        self.on(&Config::default())
    }

    fn on(&self, config: &Config) -> anyhow::Result<Config> {
        let mut value = serde_json::to_value(match &self.preset {
            Some(name) => config.with_preset(name)?,
            None => config.clone(),
        })?;
        if let Some(file) = &self.config {
            let remedy = "start from the config.json of a run";
            let settings: Value = read_json(file, remedy)?;
            check_settings(&settings).map_err(|fault| ivv::Error::data(file, "", fault, remedy))?;
            // Read it as settings too, so that an error names the file.
            read_json::<Config>(file, remedy)?;
            merge(&mut value, &settings);
        }
        for set in &self.set {
            let patch = patch(set).with_context(|| format!("--set {set}"))?;
            merge(&mut value, &patch);
        }
        let config: Config = serde_json::from_value(value).context("--set")?;
        let mut config = self.extended(&config);
        config.max_gaussians = self.max_gaussians.unwrap_or(config.max_gaussians);
        config.seed = self.seed.unwrap_or(config.seed);
        config.sh_degree = self.sh_degree.unwrap_or(config.sh_degree);
        config.check().map_err(|fault| anyhow::anyhow!("settings: {fault}"))?;
        Ok(config)
    }
}
