//! Checks of the settings.

use super::{Config, all_settings};
use crate::error::{Error, Result as Checked};
use crate::gpu::Gpu;
use crate::settings::{Range, Setting, as_written};
use crate::stage::{AdamMode, LAZY_BYTES, Lpips};
use crate::words::nearest;
use serde_json::Value;

/// The default of `setting`, as config.json has it; one number for a rate that is constant.
pub fn default_of(setting: &Setting) -> Value {
    let all = as_written(&Config::default()).unwrap_or_default();
    let default = setting.of(&all).cloned().unwrap_or_default();
    let constant = default.get("start").filter(|start| default.get("end") == Some(start)).cloned();
    constant.unwrap_or(default)
}

/// Checks settings in the form of [`Config`], of which any may be left out. The fault names the setting, its value and
/// what was expected.
pub fn check_settings(settings: &Value) -> Result<(), String> {
    let mut names = Vec::new();
    leaves("", settings, &mut names);
    names.iter().try_for_each(|name| check_name(name))?;
    all_settings().try_for_each(|setting| setting.of(settings).map_or(Ok(()), |value| setting.check(value)))
}

/// Checks that `name` is that of a single setting, or of an end of a learning rate; the fault has the nearest name.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_known = |setting: &Setting| {
        let is_end = setting.range == Range::Rate
            && ["start", "end"].iter().any(|end| name.strip_suffix(end) == Some(&format!("{}.", setting.name)));
        setting.name == name || is_end
    };
    if all_settings().any(is_known) {
        return Ok(());
    }
    if all_settings().any(|setting| setting.name.starts_with(&format!("{name}."))) {
        return Err(format!(
            "{name} is a group of settings, not a single value; `ivv train --list-settings {name}` lists them"
        ));
    }
    let near = nearest(name, all_settings().map(|setting| setting.name));
    let like = near.first().map_or(String::new(), |like| format!("; did you mean {like}?"));
    Err(format!("there is no setting {name}{like} (`ivv train --list-settings` lists all)"))
}

fn leaves(prefix: &str, settings: &Value, names: &mut Vec<String>) {
    let Value::Object(inner) = settings else { return names.push(prefix.to_owned()) };
    for (key, value) in inner {
        // Records of what a run began from, not settings.
        let is_record = key == "preset" && !value.is_string() || key == "holds_static" && value.is_boolean();
        match prefix {
            "" if is_record => {}
            "" => leaves(key, value, names),
            prefix => leaves(&format!("{prefix}.{key}"), value, names),
        }
    }
}

impl Config {
    /// Checks what a run of `total` steps needs beside its capture: the weights of LPIPS, and room on the device for
    /// what `adam=lazy` keeps of every step.
    ///
    /// # Errors
    /// Those of [`Lpips::load`]; [`Error::OutOfMemory`] where the run has too many steps for `adam=lazy`.
    pub fn check_on(&self, gpu: &Gpu, total: u64) -> Checked<()> {
        let (needed, limit) = (LAZY_BYTES.saturating_mul(total.saturating_add(1)), gpu.caps().max_binding_bytes);
        if self.adam == AdamMode::Lazy && needed > limit {
            return Err(Error::OutOfMemory {
                what: format!("what adam=lazy keeps of {total} steps (bytes in one binding)"),
                needed,
                limit,
                remedy: format!("set adam=dense, or train for {} steps at most", limit / LAZY_BYTES - 1),
            });
        }
        self.loss.lpips_weights.as_ref().map_or(Ok(()), |weights| Lpips::load(gpu, weights).map(drop))
    }

    /// Checks every setting; the fault names the first, its value and what was expected.
    ///
    /// # Errors
    /// The first that cannot be: its name, its value and what was expected.
    pub fn check(&self) -> Result<(), String> {
        check_settings(&as_written(self)?)?;
        if self.epochs == 0 && self.steps == 0 {
            return Err("epochs and steps are both 0; expected one of them to be positive".to_owned());
        }
        if self.batch > 1 && self.adam == AdamMode::Lazy {
            return Err("adam is lazy, and batch above 1; expected adam=dense with steps on several images".to_owned());
        }
        self.frame.check().map_err(|fault| format!("frame.{fault}"))
    }
}
