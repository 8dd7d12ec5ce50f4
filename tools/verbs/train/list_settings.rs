//! The settings of a run: `ivv train --list-settings`.

use crate::ui::screen::{out, print_json};
use anyhow::bail;
use ivv::internals::settings::Setting;
use ivv::internals::train::{PRESETS, Preset, all_settings, check_name, default_of};
use ivv::internals::words::count;
use serde_json::{Value, json};

pub fn print(prefix: &str, json: bool) -> anyhow::Result<()> {
    let listed: Vec<&Setting> = all_settings().filter(|setting| setting.name.starts_with(prefix)).collect();
    if listed.is_empty() {
        match check_name(prefix) {
            // An end of a rate.
            Ok(()) => bail!("{prefix} is a part of {}", prefix.rsplit_once('.').map_or(prefix, |(name, _)| name)),
            Err(fault) => bail!("{fault}"),
        }
    }
    let presets = PRESETS.map(|(name, _)| Preset::find(name)).into_iter().collect::<ivv::Result<Vec<_>>>()?;
    let changes = |setting: &Setting| -> Vec<(String, Value)> {
        let own = |preset: &Preset| Some((preset.id.name.clone(), setting.of(&preset.settings)?.clone()));
        presets.iter().filter_map(own).collect()
    };
    if json {
        let line = |setting: &&Setting| {
            let changes: serde_json::Map<String, Value> = changes(setting).into_iter().collect();
            json!({
                "name": setting.name, "default": default_of(setting), "unit": setting.unit,
                "range": setting.range.to_string(), "meaning": setting.meaning, "presets": changes,
            })
        };
        let all: Vec<Value> = listed.iter().map(line).collect();
        return print_json(&all);
    }
    for setting in &listed {
        let unit = if setting.unit.is_empty() { String::new() } else { format!(" ({})", setting.unit) };
        out!("{} = {}{unit}", setting.name, default_of(setting));
        out!("    {}", setting.meaning);
        out!("    Expected: {}.", setting.range);
        let changes: Vec<String> = changes(setting).iter().map(|(preset, value)| format!("{preset} {value}")).collect();
        if !changes.is_empty() {
            out!("    Presets: {}.", changes.join(", "));
        }
    }
    out!("{}; change one with `--set NAME=VALUE`", count(listed.len(), "setting"));
    Ok(())
}
