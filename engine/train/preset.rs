//! Presets: named settings of a run, as data.

use super::{Config, PresetId, check_settings};
use crate::error::{Error, Result};
use crate::files::read_text;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::path::Path;

/// The presets that come with the engine, from the most exact to the fastest, and the one for size: name and text.
pub const PRESETS: [(&str, &str); 4] = [
    ("exact", include_str!("../../assets/presets/exact.json")),
    ("balanced", include_str!("../../assets/presets/balanced.json")),
    ("fast", include_str!("../../assets/presets/fast.json")),
    ("small", include_str!("../../assets/presets/small.json")),
];

/// Settings that differ from the defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// Which it is.
    pub id: PresetId,
    /// Its purpose.
    pub about: String,
    /// Some settings, in the form of [`Config`].
    pub settings: Value,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    about: String,
    settings: Value,
}

impl Preset {
    /// The engine's preset of this name, or the one in the file of this path, which ends in `.json`.
    ///
    /// # Errors
    /// [`Error::Data`] naming what there is, the file that cannot be read, or the setting that cannot be.
    pub fn find(name: &str) -> Result<Self> {
        let path = Path::new(name);
        if path.extension().is_some_and(|extension| extension == "json") {
            let fault = |e| Error::data(path, "", format!("cannot be read: {e}"), "give the path of a preset");
            let text = read_text(path).map_err(fault)?;
            let stem = path.file_stem().map_or(name.into(), |stem| stem.to_string_lossy());
            return Self::parse(path, &stem, &text);
        }
        let Some((_, text)) = PRESETS.iter().find(|(known, _)| *known == name) else {
            let known = PRESETS.map(|(known, _)| known).join(", ");
            let remedy = format!("there are {known}; or give the path of a .json file");
            return Err(Error::data(Path::new("--preset"), name, "unknown preset", remedy));
        };
        Self::parse(path, name, text)
    }

    /// The preset `name` that the file `path` holds as `text`.
    ///
    /// # Errors
    /// [`Error::Data`] when it has not the form of one, or a setting is unknown or cannot be.
    pub fn parse(path: &Path, name: &str, text: &str) -> Result<Self> {
        let fault = |reason: String| {
            Error::data(path, "preset", reason, "an object with `about` and `settings`, these as config.json has them")
        };
        let Form { about, settings } = serde_json::from_str(text).map_err(|e| fault(e.to_string()))?;
        if !settings.is_object() {
            return Err(fault("its settings are no object".to_owned()));
        }
        check_settings(&settings).map_err(fault)?;
        let config: Config = serde_json::from_value(settings.clone()).map_err(|e| fault(e.to_string()))?;
        config.check().map_err(fault)?;
        let digest = Sha256::digest(text.as_bytes());
        let hash = digest.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        Ok(Preset { id: PresetId { name: name.to_owned(), hash }, about, settings })
    }
}

impl Config {
    /// These settings with those of the preset `name`: exact, balanced (the defaults), fast, small, or the path of a .json file.
    ///
    /// # Errors
    /// [`Error::Data`] where there is no such preset, or its file has a setting that does not exist or cannot be.
    pub fn with_preset(&self, name: &str) -> Result<Config> {
        let Preset { id, settings, .. } = Preset::find(name)?;
        let fault =
            |e: serde_json::Error| Error::data(Path::new("--preset"), name, e.to_string(), "check its settings");
        let mut value = serde_json::to_value(self).map_err(fault)?;
        merge(&mut value, &settings);
        Ok(Config { preset: Some(id), ..serde_json::from_value(value).map_err(fault)? })
    }
}

/// Puts the settings of `patch` in the place of those of `base`: objects key by key, all else as a whole.
pub fn merge(base: &mut Value, patch: &Value) {
    match (base, patch) {
        (Value::Object(base), Value::Object(patch)) => {
            for (key, value) in patch {
                merge(base.entry(key.as_str()).or_insert(Value::Null), value);
            }
        }
        (base, patch) => *base = patch.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_engines_presets_are_settings_and_balanced_is_the_default() {
        let presets = PRESETS.map(|(name, _)| Preset::find(name).unwrap());
        let config = |preset: &Preset| serde_json::from_value::<Config>(preset.settings.clone()).unwrap();
        assert_eq!(config(&presets[1]), Config::default());
        let others = presets.iter().filter(|preset| preset.id.name != "balanced");
        others.for_each(|preset| assert_ne!(config(preset), Config::default(), "{}", preset.id.name));
        let mut hashes = presets.map(|preset| preset.id.hash);
        hashes.sort();
        assert!(hashes.iter().all(|hash| hash.len() == 16) && hashes.windows(2).all(|pair| pair[0] != pair[1]));
    }

    #[test]
    fn a_preset_that_is_none_is_told_with_what_is_wrong() {
        let parse = |text: &str| Preset::parse(Path::new("my.json"), "my", text);
        assert_eq!(parse(r#"{"about": "", "settings": {"epochs": 3}}"#).unwrap().settings, json!({ "epochs": 3 }));
        for (text, told) in [
            ("{", "EOF"),
            (r#"{"settings": {}}"#, "about"),
            (r#"{"about": "", "settings": 3}"#, "no object"),
            (r#"{"about": "", "settings": {"epoch": 3}}"#, "epoch"),
            (r#"{"about": "", "settings": {"frame": {"depth_bits": 20}}}"#, "depth_bits"),
            (r#"{"about": "", "settings": {"frame": {"alpha_cut": -1}}}"#, "alpha_cut"),
            (r#"{"about": "", "settings": {"resolution": {"until": 2}}}"#, "resolution"),
            (r#"{"about": "", "settings": {"loss": {"ssim_stride": 3}}}"#, "ssim_stride"),
        ] {
            let fault = parse(text).unwrap_err();
            assert!(fault.to_string().contains(told) && fault.exit_code() == 3, "{text}: {fault}");
        }
        assert!(Preset::find("quick").unwrap_err().to_string().contains("balanced"));
        assert!(Preset::find("/no/such.json").unwrap_err().to_string().contains("cannot be read"));
    }

    #[test]
    fn merged_settings_keep_what_the_patch_does_not_name() {
        let mut base = json!({ "a": { "b": 1, "c": 2 }, "d": 3 });
        merge(&mut base, &json!({ "a": { "c": { "e": 4 } }, "f": [5] }));
        assert_eq!(base, json!({ "a": { "b": 1, "c": { "e": 4 } }, "d": 3, "f": [5] }));
    }
}
