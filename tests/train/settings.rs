//! Every setting is known, has a meaning, and is refused outside its range with what was found and expected.

use super::Tiny;
use crate::common::prelude::*;
use ivv::internals::settings::Range;
use ivv::internals::train::{PRESETS, Preset, all_settings, check_settings, default_of, merge};
use serde_json::json;

fn defaults() -> Value {
    serde_json::to_value(Config::default()).unwrap()
}

/// `text`, a value in JSON, in the place that the name with dots names.
fn patch(name: &str, text: &str) -> Value {
    name.rsplit('.').fold(serde_json::from_str(text).unwrap(), |inner, key| json!({ key: inner }))
}

fn with(name: &str, text: &str) -> Value {
    let mut all = defaults();
    merge(&mut all, &patch(name, text));
    all
}

/// The names of all values, where a rate is one.
fn names(prefix: &str, value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(inner) if !(inner.len() == 2 && inner.contains_key("start") && inner.contains_key("end")) => {
            for (key, value) in inner {
                names(&format!("{prefix}{}{key}", if prefix.is_empty() { "" } else { "." }), value, found);
            }
        }
        _ => assert!(found.insert(prefix.to_owned())),
    }
}

#[test]
fn the_table_has_every_setting_once_with_a_meaning_and_a_default_in_its_range() {
    let mut fields = BTreeSet::new();
    names("", &defaults(), &mut fields);
    let listed: BTreeSet<String> = all_settings().map(|setting| setting.name.to_owned()).collect();
    assert_eq!(listed, fields);
    assert_eq!(listed.len(), all_settings().count(), "a setting is listed twice");
    let mut meanings = BTreeSet::new();
    for setting in all_settings() {
        assert!(setting.meaning.len() > 20 && setting.meaning.ends_with('.'), "{}", setting.name);
        assert!(meanings.insert(setting.meaning), "{} means what another does", setting.name);
        assert!(setting.range.contains(&default_of(setting)), "{}: {}", setting.name, default_of(setting));
    }
    assert_eq!(Config::default().check(), Ok(()));
}

#[test]
fn the_words_of_the_table_are_those_that_are_read() {
    for setting in all_settings() {
        let Range::Word(words) = setting.range else { continue };
        let fault = serde_json::from_value::<Config>(with(setting.name, "\"nothing\"")).unwrap_err().to_string();
        let quoted: Vec<&str> = fault.split('`').skip(3).step_by(2).collect();
        assert!(words.len() > 1 && quoted == words, "{}: {fault}", setting.name);
        for word in words {
            let config: Config = serde_json::from_value(with(setting.name, &format!("\"{word}\""))).unwrap();
            assert_eq!(config.check(), Ok(()));
        }
    }
}

#[test]
fn settings_out_of_range_are_told_with_what_was_found_and_expected() {
    for (name, value, expected) in [
        ("density.growth", "-5.0", "a number from 0 to 1"),
        ("density.stop", "-1.0", "a number from 0 to 1"),
        ("density.every", "0", "a whole number, 1 or more"),
        ("init_points", "0", "a whole number from 1 to 50000000"),
        ("max_gaussians", "0", "a whole number from 1 to 4294967295"),
        ("background", "[9.0,9.0,9.0]", "three numbers from 0 to 1"),
        ("sh_degree", "4", "a whole number from 0 to 3"),
        ("moment_bits", "31", "16 or 32"),
        ("resolution.reduction", "0", "a whole number from 1 to 8"),
        ("loss.depth", "-1.0", "a number, 0 or more"),
        ("required.grids_at", "1.0", "a number of at least 0 and below 1"),
        ("frame.t_cut", "0.5", "a number of at least 0 and below 0.5"),
        ("lr.scale", "-1.0", "a number above 0"),
        ("lr.scale", "{\"end\":0.0,\"start\":1.0}", "both above 0"),
    ] {
        let all = with(name, value);
        let config: Config = serde_json::from_value(all.clone()).unwrap();
        for fault in [config.check().unwrap_err(), check_settings(&all).unwrap_err()] {
            assert!(fault.starts_with(&format!("{name} is ")) && fault.contains(expected), "{fault}");
        }
        assert!(check_settings(&all).unwrap_err().contains(&format!("is {value};")), "{name}");
        assert!(check_settings(&patch(name, value)).is_err(), "{name} alone");
    }
    let mut config = Config { average: f64::NAN, ..Config::default() };
    assert_eq!(config.check().unwrap_err(), "average is not a finite number; expected a number from 0 to 1");
    config = Config { epochs: 0, ..Config::default() };
    assert!(config.check().unwrap_err().contains("epochs and steps"));
    (config.epochs, config.frame.t_cut) = (1, -0.01);
    assert!(config.check().unwrap_err().contains("is -0.01;"), "32 bits are shown as they were written");
}

#[test]
fn what_set_cannot_take_is_told_before_the_capture_is_opened() {
    let long = format!("{}=1", "a.".repeat(50_000));
    for (set, told) in [
        ("density.grwoth=1", "there is no setting density.grwoth; did you mean density.growth?"),
        ("growth=1", "did you mean density.growth?"),
        ("zzzzzz=1", "there is no setting zzzzzz (`ivv train --list-settings` lists all)"),
        ("density=1", "density is a group of settings"),
        ("density.growth.x=1", "there is no setting density.growth.x"),
        ("preset=fast", "there is no setting preset"),
        ("init=foo", "init is \"foo\"; expected auto, flow, any_view, concat, points, hull, frustum or random"),
        ("lr.scale=nan", "lr.scale is \"nan\"; expected a number above 0"),
        ("lr.scale.start=nan", "lr.scale is {"),
        ("epochs=2.5", "epochs is 2.5; expected a whole number"),
        ("offsets=1", "offsets is 1; expected true or false"),
        ("grids=true", "grids is true; expected bilateral, affine or none"),
        (&long, "there is no setting a."),
        ("density", "expected KEY=VALUE"),
    ] {
        let fault = fails(&["train", "/no/capture", "-o", "/no/run", "--set", set], 2);
        assert!(fault.contains(told), "{set}: {fault}");
    }
    let fault = fails(&["train", "/no/capture", "-o", "/no/run", "--sh-degree", "7"], 2);
    assert!(fault.contains("sh_degree is 7; expected a whole number from 0 to 3"), "{fault}");
    let misspelt = Preset::parse(Path::new("my.json"), "my", r#"{"about": "", "settings": {"sh_degre": 1}}"#);
    assert!(misspelt.unwrap_err().to_string().contains("did you mean sh_degree?"));
    for (name, text) in PRESETS {
        Preset::parse(Path::new(name), name, text).unwrap();
    }
}

#[test]
fn a_run_from_more_points_than_it_may_have_gaussians_keeps_to_them() {
    let tiny = Tiny::new("most");
    assert!(tiny.capture.points.len() > 100);
    let run = tiny.folder.join("run");
    for init in ["flow", "concat", "points", "frustum", "random"] {
        let init = format!("init={init}");
        let train = ["train", tiny.folder.to_str().unwrap(), "-o", run.to_str().unwrap(), "--overwrite"];
        let settings = ["--steps", "30", "--max-gaussians", "60", "--eval-every", "0", "--set", &init];
        let told = tells(&[&train[..], &settings].concat());
        assert!(told.contains("evenly chosen from ") && told.contains("to keep max_gaussians"), "{init}: {told}");
        let log = std::fs::read_to_string(run.join("train.jsonl")).unwrap();
        let lines = log.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        let counts: Vec<u64> = lines.filter_map(|line| line["gaussians"].as_u64()).collect();
        assert!(counts.len() > 10 && counts.iter().all(|n| (1..=60).contains(n)), "{init}: {counts:?}");
    }
}

#[test]
fn settings_are_listed_with_default_unit_range_meaning_and_presets() {
    let all: Vec<Value> = serde_json::from_str(&works(&["train", "--list-settings", "--json"])).unwrap();
    assert_eq!(all.len(), all_settings().count());
    let moments = all.iter().find(|line| line["name"] == "moment_bits").unwrap();
    assert_eq!(moments["presets"], json!({ "balanced": 16, "exact": 32, "fast": 16, "small": 32 }));
    assert_eq!((&moments["default"], &moments["unit"]), (&json!(16), &json!("bits")));
    assert_eq!(moments["range"], "16 or 32");
    let text = works(&["train", "--list-settings", "density"]);
    let listed = all_settings().filter(|setting| setting.name.starts_with("density."));
    assert!(listed.clone().all(|setting| text.contains(&format!("{} = ", setting.name))), "{text}");
    assert!(text.contains("density.growth = 0.05 (of the Gaussians)\n"), "{text}");
    assert!(text.contains("    Expected: a number from 0 to 1.\n") && !text.contains("lr."), "{text}");
    assert_eq!(text.lines().last().unwrap().split(' ').next().unwrap(), listed.count().to_string());
    assert!(works(&["train", "--list-settings", "frame.t_cut"]).contains("    Presets: fast 0.001.\n"));
    assert!(fails(&["train", "--list-settings", "densty.growth"], 2).contains("did you mean density.growth?"));
}
