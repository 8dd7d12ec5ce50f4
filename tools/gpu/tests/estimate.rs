//! `ivv-gpu-model estimate` as a command.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn model(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv-gpu-model"));
    command.args(arguments);
    if let Ok(device) = std::env::var("IVV_TEST_DEVICE") {
        command.args(["--device", &device]);
    }
    command.output().unwrap()
}

fn works(arguments: &[&str]) -> String {
    let output = model(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_step_is_estimated_for_each_card_from_its_own_recording() {
    let small = ["--gaussians", "2000", "--size", "128x96", "--json"];
    let told = |cards: &[&str], pairs: &str| -> Vec<Value> {
        let all = [&["estimate"], cards, &["--pairs", pairs], &small[..]].concat();
        serde_json::from_str(&works(&all)).unwrap()
    };
    let both = told(&["h200", "a770"], "20000");
    let (fast, slow) = (&both[0], &both[1]);
    assert_eq!((&fast["card"]["name"], &slow["card"]["name"]), (&"H200".into(), &"A770".into()));
    for estimate in &both {
        let parts = estimate["parts"].as_array().unwrap();
        for key in ["us", "bytes", "instructions", "passes", "barriers"] {
            let sum: f64 = parts.iter().map(|part| part[key].as_f64().unwrap()).sum();
            let total = estimate["total"][key].as_f64().unwrap();
            assert!(total > 0.0 && (sum - total).abs() <= 1e-9 * total, "{key}: {sum} {total}");
        }
        for name in ["cull", "depth sort", "tile sort", "blend", "loss", "blend bwd", "project bwd adam", "report"] {
            assert!(parts.iter().any(|part| part["name"] == name), "{name}");
        }
        // All live, so culling reads 16 bytes of each.
        let cull = parts.iter().find(|part| part["name"] == "cull").unwrap();
        assert!(cull["bytes"].as_f64().unwrap() >= 2000.0 * 16.0, "{cull}");
    }
    assert!(slow["total"]["us"].as_f64() > fast["total"]["us"].as_f64());
    // Half as many lanes make at least as many blocks of a tile, and so as many passes where these follow one another.
    assert!(slow["total"]["passes"].as_u64() >= fast["total"]["passes"].as_u64());
    // Ten times the pairs: about ten times the blend.
    let more = told(&["h200"], "200000");
    let blend = |estimate: &Value| {
        let parts = estimate["parts"].as_array().unwrap();
        parts.iter().find(|part| part["name"] == "blend").unwrap()["instructions"].as_f64().unwrap()
    };
    let ratio = blend(&more[0]) / blend(fast);
    assert!((8.0..=10.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_work_may_be_that_of_a_profile_and_what_is_no_work_is_refused() {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/profile/profile.json");
    let text = works(&["estimate", "RTX4090", "--work", shipped.to_str().unwrap()]);
    for holds in ["RTX4090", "3495 of 20000 Gaussians", "blend bwd", "sum", "white paper"] {
        assert!(text.contains(holds), "{holds}: {text}");
    }
    let folder = std::env::temp_dir().join(format!("ivv-gpu-model-{}", std::process::id()));
    let mut profile: Value = serde_json::from_slice(&std::fs::read(&shipped).unwrap()).unwrap();
    profile["counters"]["gaussians"] = 1e18.into();
    let vast = folder.join("profile.json");
    let empty = folder.join("empty");
    std::fs::create_dir_all(&empty).unwrap();
    std::fs::write(&vast, profile.to_string()).unwrap();
    let [vast, empty] = [&vast, &empty].map(|path| path.to_str().unwrap());
    for (arguments, told) in [
        (vec!["estimate", "GTX480"], "H200, RTX4090, RX7900XTX, A770"),
        (vec!["estimate", "H200", "--size", "0x5"], "WIDTHxHEIGHT"),
        (vec!["estimate", "H200", "--gaussians", "0"], "gaussians"),
        (vec!["estimate", "H200", "--work", vast], "expected 1 to 4000000 Gaussians"),
        (vec!["estimate", "H200", "--compiled", empty], "tools/gpu/statistics.sh"),
        (vec!["estimate", "--work", vast], "<CARD>"),
    ] {
        let refused = model(&arguments);
        let fault = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && fault.contains(told), "{arguments:?}: {fault}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
