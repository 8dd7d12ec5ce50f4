//! The measured tables of speed against accuracy: table and picture are those of the record. That kernels or presets have
//! changed since is a note, which `tools/test.sh` prints: it takes an hour to measure a capture anew.

use super::{root, text};
use crate::common::notes::stale;
use ivv::gpu::{shaders_hash, spirv_hashes};
use ivv::study::{Circumstances, Trade, TradeArm, TradeKind};
use ivv::train::Preset;
use serde_json::Value;
use std::collections::BTreeMap;

/// Names of the measurements: those of `ivv curves` lie beside them.
fn names() -> Vec<String> {
    let files = std::fs::read_dir(root().join("assets/trade")).unwrap().map(|file| file.unwrap().path());
    let records = files.filter(|file| file.extension().is_some_and(|end| end == "json"));
    let stems = records.map(|file| file.file_stem().unwrap().to_str().unwrap().to_owned());
    let names: Vec<String> = stems.filter(|name| !name.starts_with("curves")).collect();
    assert!(!names.is_empty());
    names
}

fn record(name: &str) -> Trade {
    let mut record: Value = serde_json::from_str(&text(&format!("assets/trade/{name}.json"))).unwrap();
    let mut take = |key: &str| record[key].take();
    Trade {
        at: serde_json::from_value(take("at")).unwrap(),
        arms: serde_json::from_value(take("arms")).unwrap(),
        runs: serde_json::from_value(take("runs")).unwrap(),
        kernel_errors: serde_json::from_value(take("kernel_errors")).unwrap(),
    }
}

/// What has changed since a measurement: kernels whose SPIR-V is another, new or gone, and presets with other settings.
fn changes(at: &Circumstances, arms: &[TradeArm], kernels: &BTreeMap<String, String>) -> Option<String> {
    let other = kernels.iter().filter(|(name, spirv)| at.kernels.get(*name) != Some(spirv)).map(|(name, _)| name);
    let gone = at.kernels.keys().filter(|name| !kernels.contains_key(*name));
    let changed: Vec<&str> = other.chain(gone).map(String::as_str).collect();
    let is_other = |arm: &&TradeArm| !Preset::find(&arm.name).is_ok_and(|preset| preset.settings == arm.settings);
    let presets = arms.iter().filter(|arm| arm.kind == TradeKind::Preset).filter(is_other).map(|arm| arm.name.as_str());
    let presets: Vec<&str> = presets.collect();
    let mut told = Vec::new();
    if !changed.is_empty() {
        let more = if changed.len() > 5 { format!(" and {} more", changed.len() - 5) } else { String::new() };
        told.push(format!("kernels that have changed since: {}{more}", changed[..changed.len().min(5)].join(", ")));
    }
    if !presets.is_empty() {
        told.push(format!("presets that have changed since: {}", presets.join(", ")));
    }
    (!told.is_empty()).then(|| told.join("; "))
}

#[test]
fn table_and_picture_of_the_trade_are_those_of_its_record() {
    for name in names() {
        let trade = record(&name);
        let at = &trade.at;
        for told in [&at.device, &at.driver, &at.date, &at.capture] {
            assert!(!told.is_empty(), "{name}: {at:?}");
        }
        assert!(trade.arms.iter().filter(|arm| arm.kind == TradeKind::Preset).count() >= 4, "{name}");
        for (kind, made) in [("md", trade.markdown()), ("svg", trade.svg())] {
            let file = format!("assets/trade/{name}.{kind}");
            if text(&file) != made {
                let mend = "mend it with: IVV_BLESS=1 cargo test --test it repo::trade";
                assert!(std::env::var_os("IVV_BLESS").is_some(), "{file} is not of its record: {mend}");
                std::fs::write(root().join(&file), made).unwrap();
            }
        }
        assert!(text(&format!("assets/trade/{name}.md")).contains(&format!("shaders {}.", at.shaders)), "{name}");
        let changes = changes(at, &trade.arms, &spirv_hashes());
        assert!(changes.is_some() || at.shaders == shaders_hash(), "{name}: the hash is not that of its kernels");
        if let Some(changes) = changes {
            stale(format!("assets/trade/{name}.md: {changes}; measure it anew with tools/quality.sh --trade"));
        }
    }
}

#[test]
fn what_has_changed_since_a_measurement_is_told_by_name() {
    let trade = record(&names()[0]);
    let kernels = trade.at.kernels.clone();
    let mut other = kernels.clone();
    let first = kernels.keys().next().unwrap().clone();
    other.insert(first.clone(), "0".into());
    other.remove("emit");
    other.insert("made_of_late".into(), "0".into());
    let told = changes(&trade.at, &[], &other).unwrap();
    for name in [first.as_str(), "emit", "made_of_late"] {
        assert!(told.contains(name), "{told}");
    }
    assert_eq!(changes(&trade.at, &[], &kernels), None);
    let arm = TradeArm { name: "fast".into(), kind: TradeKind::Preset, settings: serde_json::json!({"seed": 7}) };
    assert_eq!(changes(&trade.at, &[arm], &kernels).unwrap(), "presets that have changed since: fast");
}

#[test]
fn the_hash_of_the_kernels_is_of_what_runs_and_of_no_source() {
    let hashes = spirv_hashes();
    assert!(hashes.len() > 100 && !hashes.contains_key("show") && !hashes.contains_key("probe_copy"));
    let manifest = text("shaders-glsl/spv/MANIFEST");
    for (name, spirv) in &hashes {
        assert!(manifest.lines().any(|line| line.starts_with(&format!("{name} ")) && line.ends_with(spirv)), "{name}");
    }
    // A line is a kernel, its source's hash and its SPIR-V's.
    let sources: Vec<&str> = manifest.lines().filter_map(|line| line.split(' ').nth(1)).collect();
    assert!(hashes.values().all(|hash| hash.len() == 16 && !sources.contains(&hash.as_str())));
}
