//! Studies, JSON files: arms, scores, seeds and lengths.

use super::measure::Measure;
use crate::error::{Error, Result};
use crate::files::read_text;
use crate::train::{Config, LearningRates, check_settings, merge};
use serde::Deserialize;
use serde::de::Error as _;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names and texts of the files `assets/studies/NAME.json`.
macro_rules! studies {
    ($($name:literal)*) => {
        [$(($name, include_str!(concat!("../../assets/studies/", $name, ".json")))),*]
    };
}
const STUDIES: &[(&str, &str)] = &studies![
    "trade" "presets" "schedule" "quality" "clips" "required" "initialisation" "offsets" "supervision" "perceptual"
];

const REMEDY: &str = "see the manual's page Benchmarks and the studies in assets/studies";

#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// Names the folders of its runs.
    pub key: String,
    /// The name in tables; the key if empty.
    #[serde(default)]
    pub name: String,
    /// Name or path.
    #[serde(default)]
    pub preset: Option<String>,
    /// Changes, in the form of [`Config`].
    #[serde(default = "nothing")]
    pub settings: Value,
    /// Figures of a paper, on another capture.
    #[serde(default)]
    pub paper: BTreeMap<Measure, String>,
}

/// The settings that the arms change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Base {
    /// The given settings; LPIPS is measured and no part of the loss.
    #[default]
    Given,
    /// The same with the paper's weights and rates, one background, no backdrop, and LPIPS in the loss if it has weights.
    Paper,
}

#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    pub title: String,
    pub question: String,
    /// At least one.
    pub arms: Vec<Arm>,
    /// The columns, at least one. The first judges captures together.
    pub scores: Vec<Measure>,
    pub seeds: Vec<u64>,
    /// Lengths of runs, each with its own schedule; epochs if empty.
    #[serde(default, deserialize_with = "lengths")]
    pub steps: Vec<u64>,
    /// Each arm may have twice as many Gaussians as the largest start.
    #[serde(default)]
    pub equal_budgets: bool,
    #[serde(default)]
    pub base: Base,
    /// The arm that others are compared with; by default the first.
    #[serde(default)]
    pub baseline: String,
    #[serde(skip)]
    pub file: PathBuf,
}

fn nothing() -> Value {
    Value::Object(serde_json::Map::new())
}

/// A number or a list.
fn lengths<'de, D: serde::Deserializer<'de>>(from: D) -> std::result::Result<Vec<u64>, D::Error> {
    let value = Value::deserialize(from)?;
    let of = |value: &Value| value.as_u64().filter(|steps| *steps > 0);
    let all = value.as_array().map_or_else(|| Some(vec![of(&value)?]), |some| some.iter().map(of).collect());
    all.ok_or_else(|| D::Error::custom(format!("steps: expected a number above 0 or a list of them, found {value}")))
}

impl Study {
    /// The studies that come with the engine.
    pub fn names() -> String {
        STUDIES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
    }

    /// By name, or by the path of a `.json`.
    pub fn find(name: &str) -> Result<Self> {
        let path = Path::new(name);
        if path.extension().is_some_and(|extension| extension == "json") {
            let fault = |e| Error::data(path, "", format!("cannot be read: {e}"), "give the path of a study");
            return Self::parse(path, &read_text(path).map_err(fault)?);
        }
        let Some((_, text)) = STUDIES.iter().find(|(known, _)| *known == name) else {
            let remedy = format!("there are {}; or give the path of a .json file", Self::names());
            return Err(Error::data(path, "", "unknown study", remedy));
        };
        Self::parse(Path::new(&format!("assets/studies/{name}.json")), text)
    }

    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let fault = |place: &str, reason: String| Error::data(path, place, reason, REMEDY);
        let mut study: Study = serde_json::from_str(text).map_err(|e| fault("study", e.to_string()))?;
        study.file = path.to_owned();
        for (place, is_empty) in
            [("arms", study.arms.is_empty()), ("scores", study.scores.is_empty()), ("seeds", study.seeds.is_empty())]
        {
            if is_empty {
                return Err(fault(place, "expected at least one".to_owned()));
            }
        }
        for (index, arm) in study.arms.iter().enumerate() {
            let is_name = |c: char| c.is_ascii_alphanumeric() || "._=-".contains(c);
            if arm.key.is_empty() || arm.key.starts_with('.') || !arm.key.chars().all(is_name) {
                let reason = "key: expected letters, digits and any of ._=- for a folder, found";
                return Err(fault("arms", format!("{reason} {:?}", arm.key)));
            }
            if study.arms[..index].iter().any(|other| other.key == arm.key) {
                return Err(fault("arms", format!("key: two are called {}", arm.key)));
            }
        }
        study.arms.iter_mut().filter(|arm| arm.name.is_empty()).for_each(|arm| arm.name.clone_from(&arm.key));
        if study.baseline.is_empty() {
            study.baseline.clone_from(&study.arms[0].key);
        }
        if study.arms.iter().all(|arm| arm.key != study.baseline) {
            return Err(fault("baseline", format!("no arm has the key {:?}", study.baseline)));
        }
        study.arms.iter().try_for_each(|arm| study.config(&Config::default(), arm).map(drop))?;
        Ok(study)
    }

    /// The settings of `arm`, where all arms share `shared`.
    pub fn config(&self, shared: &Config, arm: &Arm) -> Result<Config> {
        let fault = |reason: String| Error::data(&self.file, format!("arm {}", arm.key), reason, REMEDY);
        check_settings(&arm.settings).map_err(fault)?;
        if let Some(name) = ["seed", "steps", "epochs"].iter().find(|name| arm.settings.get(name).is_some()) {
            let remedy = "give it to the study or with an option";
            return Err(fault(format!("settings: `{name}` is the same for all arms; {remedy}")));
        }
        let json = |e: serde_json::Error| fault(e.to_string());
        let mut value = serde_json::to_value(shared).map_err(json)?;
        self.base.apply(&mut value);
        if let Some(name) = &arm.preset {
            let config: Config = serde_json::from_value(value).map_err(json)?;
            value = serde_json::to_value(config.with_preset(name)?).map_err(json)?;
        }
        merge(&mut value, &arm.settings);
        let config: Config = serde_json::from_value(value).map_err(json)?;
        config.check().map_err(fault)?;
        Ok(config)
    }
}

impl Base {
    /// The rates of velocities, times and tau are the paper's own, all others are 3DGS's (Kerbl et al. 2023).
    fn apply(self, config: &mut Value) {
        config["loss"]["lpips"] = json!(0.0);
        if self == Base::Paper {
            config["lr"] = json!(LearningRates::default());
            let constant = |rate: f64| json!({ "start": rate, "end": rate });
            let paper = json!({
                "loss": { "depth": 1.0, "flow": 1.0, "offset": 1e-4, "lpips": 0.1 },
                "lr": {
                    "pace": { "steps": 0 },
                    "position": { "start": 1.6e-4, "end": 1.6e-6 }, "position_size": 0.0,
                    "sh": constant(2.5e-3), "opacity": constant(2.5e-2), "scale": constant(5e-3), "rotation": constant(1e-3),
                    "velocity": constant(2e-3), "t_center": constant(1e-5), "t_scale": constant(3e-2),
                },
                "backdrop": 0,
                "vary_background": false,
            });
            merge(config, &paper);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_arm_of_the_engines_studies_changes_the_settings_or_is_the_baseline() {
        let files = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/studies")).unwrap();
        assert_eq!(files.count(), STUDIES.len(), "each has its name in STUDIES");
        for (name, _) in STUDIES {
            let study = Study::find(name).unwrap();
            let of = |arm: &Arm| Config { preset: None, ..study.config(&Config::default(), arm).unwrap() };
            let baseline = study.arms.iter().find(|arm| arm.key == study.baseline).map(of).unwrap();
            for arm in study.arms.iter().filter(|arm| arm.key != study.baseline) {
                assert_ne!(of(arm), baseline, "{name}: {}", arm.name);
            }
            let papers = || study.arms.iter().flat_map(|arm| arm.paper.keys());
            assert!(papers().all(|measure| study.scores.contains(measure)), "{name}");
        }
    }

    #[test]
    fn a_study_has_defaults_and_its_arms_win_over_what_all_share() {
        let text = r#"{"title": "T", "question": "Q?", "scores": ["psnr"], "seeds": [1], "steps": 5,
                       "arms": [{"key": "a"}, {"key": "b", "preset": "fast", "settings": {"sh_degree": 2}}]}"#;
        let study = Study::parse(Path::new("own.json"), text).unwrap();
        assert_eq!((study.baseline.as_str(), study.arms[1].name.as_str(), &study.steps[..]), ("a", "b", &[5][..]));
        let shared = Config { sh_degree: 0, epochs: 7, ..Config::default() };
        let [a, b] = [0, 1].map(|arm| study.config(&shared, &study.arms[arm]).unwrap());
        assert_eq!((a.sh_degree, a.epochs, a.loss.lpips), (0, 7, 0.0));
        assert_eq!((b.sh_degree, b.epochs, b.preset.unwrap().name.as_str()), (2, 7, "fast"));
    }

    #[test]
    fn a_study_that_is_none_is_refused_with_the_file_and_the_reason() {
        let with = |arms: &str, more: &str| {
            format!(r#"{{"title": "", "question": "", "scores": ["psnr"], "seeds": [1], "arms": [{arms}]{more}}}"#)
        };
        for (text, reason) in [
            ("{".to_owned(), "EOF"),
            (with("", ""), "at least one"),
            (with(r#"{"key": "a"}"#, r#", "colour": 1"#), "unknown field `colour`"),
            (with(r#"{"key": "a", "preset_name": "fast"}"#, ""), "unknown field `preset_name`"),
            (with(r#"{"key": "a"}, {"key": "a"}"#, ""), "two are called a"),
            (with(r#"{"key": "../a"}"#, ""), "for a folder"),
            (with(r#"{"key": "a", "preset": "quick"}"#, ""), "unknown preset"),
            (with(r#"{"key": "a", "settings": {"frame": {"depth_bit": 16}}}"#, ""), "depth_bit"),
            (with(r#"{"key": "a", "settings": {"loss": {"ssim_stride": 3}}}"#, ""), "ssim_stride"),
            (with(r#"{"key": "a", "settings": {"steps": 3}}"#, ""), "`steps` is the same for all"),
            (with(r#"{"key": "a", "paper": {"beauty": "1"}}"#, ""), "beauty"),
            (with(r#"{"key": "a"}"#, r#", "steps": [10, 0]"#), "above 0"),
            (with(r#"{"key": "a"}"#, r#", "base": "mine"}"#), "mine"),
            (with(r#"{"key": "a"}"#, r#", "baseline": "b""#), "no arm has the key"),
        ] {
            let fault = Study::parse(Path::new("own.json"), &text).unwrap_err();
            assert!(fault.to_string().contains(reason) && fault.exit_code() == 3, "{text}: {fault}");
            assert!(fault.to_string().contains("own.json") || reason == "unknown preset", "{fault}");
        }
        assert!(Study::find("best").unwrap_err().to_string().contains("trade"));
        assert!(Study::find("/no/such.json").unwrap_err().to_string().contains("cannot be read"));
    }
}
