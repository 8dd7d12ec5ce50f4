//! The measured table of speed against accuracy: it is of the kernels and the presets that there are.

use super::text;
use ivv::gpu::shaders_hash;
use ivv::train::Preset;
use serde_json::Value;

#[test]
fn the_trade_was_measured_with_these_kernels_and_presets() {
    ["trade", "presets"].into_iter().for_each(check);
}

fn check(name: &str) {
    let of_kind = |kind: &str| text(&format!("assets/trade/{name}.{kind}"));
    let record: Value = serde_json::from_str(&of_kind("json")).unwrap();
    let renew = "assets/trade is of other kernels or presets: measure it anew with tools/trade.sh";
    assert_eq!(record["at"]["shaders"], shaders_hash(), "{renew}");
    for key in ["device", "driver", "date", "capture"] {
        assert!(record["at"][key].as_str().is_some_and(|told| !told.is_empty()), "{key}");
    }
    let arms: Vec<&Value> = record["arms"].as_array().unwrap().iter().filter(|arm| arm["kind"] == "preset").collect();
    assert!(arms.len() >= 5);
    for arm in arms {
        let preset = Preset::find(arm["name"].as_str().unwrap()).unwrap();
        assert_eq!(arm["settings"], preset.settings, "{renew}");
    }
    let (table, picture) = (of_kind("md"), of_kind("svg"));
    assert!(table.contains(&shaders_hash()), "{renew}");
    for arm in record["arms"].as_array().unwrap() {
        let name = arm["name"].as_str().unwrap();
        assert!(table.contains(&format!("| {name} |")) && picture.contains(&format!("<title>{name}: ")), "{name}");
    }
}
