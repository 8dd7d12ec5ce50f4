//! Estimates for cards that are not here.

use super::Folder;
use crate::common::device::gpu;
use crate::common::notes::stale;
use crate::common::program::{ivv, json, told, works};
use ivv::gpu::generated::gather;
use ivv::gpu::{Grid, Recording, shaders_hash};
use ivv::profile::{Budgets, Card, Estimate, Figure};
use ivv::stage::Counters;
use serde_json::Value;
use std::path::Path;

const PAGE: &str = "assets/gpu/estimate.md";
/// Makes the page's tables anew; the page says so.
const MEND: &str = "IVV_BLESS=1 cargo test --locked --test it -- profile::estimate";

/// One thread a number, 12 bytes each, 100 instructions a subgroup, after one another.
#[test]
fn a_pass_takes_its_longest_resource_and_its_barrier() {
    let gpu = gpu();
    let n = 6400u32;
    let [index, table, between, last] =
        ["index", "table", "between", "last"].map(|name| gpu.alloc(name, 6400).unwrap());
    let count = &gpu.upload("count", &[n]).unwrap();
    let mut rec = Recording::new();
    rec.section("first");
    rec.fill(table.slice(), 0);
    rec.pass(gather::Args { count, index: &index, table: &table, gathered: &between }, (), Grid::Threads(n));
    rec.section("second");
    rec.pass(gather::Args { count, index: &index, table: &between, gathered: &last }, (), Grid::Threads(n));
    let mut counters = Counters::default();
    counters.active = f64::from(n);
    let text = "# driver\tGA100/32\tsome driver\nkernel\tchip\tregisters\tspills\tscratch\twaves\tinstructions\tlatency\n\
                gather\tGA100/32\t9\t-\t0\t64\t100\t-\n";
    let compiled = Budgets::parse(Path::new("table"), text).unwrap();
    let figure = |value| Figure { value, source: "the test" };
    let h200 = *Card::named("H200").unwrap();
    let card = Card { bytes: figure(1e9), issue: figure(1e9), barrier_ns: figure(500.0), ..h200 };
    let estimate = Estimate::new(&card, &rec, &counters, &compiled);
    let [first, second] = estimate.parts.as_slice() else { panic!("{:?}", estimate.parts) };
    assert_eq!((first.name.as_str(), first.passes, first.barriers), ("first", 2, 2));
    assert_eq!((second.passes, second.barriers), (1, 1));
    // 4 bytes a number of the fill, 12 of the kernel; 200 subgroups of 32.
    assert_eq!((first.bytes, second.bytes), (6400.0 * 16.0, 6400.0 * 12.0));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    near(second.instructions, 200.0 * 100.0);
    near(second.alone_us[0], 76.8);
    near(second.alone_us[2], 20.0);
    near(second.us, 76.8 + 0.5);
    near(estimate.total.us, 25.6 + 2.0 * 76.8 + 3.0 * 0.5);
    assert_eq!((estimate.compiler.as_str(), estimate.uncompiled.len()), ("some driver", 0));
    // As many instructions bind where they are issued ten times as slowly, and where nobody compiled they are guessed, and told.
    let slow = Estimate::new(&Card { issue: figure(1e8), ..card }, &rec, &counters, &compiled);
    near(slow.parts[1].us, 200.0 + 0.5);
    let blind = Estimate::new(&card, &rec, &counters, &Budgets::default());
    assert!(blind.uncompiled == ["gather"] && blind.parts[1].instructions > 0.0, "{blind:?}");
    assert!(blind.assumptions().iter().any(|told| told.contains("Not compiled") && told.contains("gather")));
}

#[test]
fn a_step_is_estimated_for_each_card_from_its_own_recording() {
    let small = ["--gaussians", "2000", "--size", "128x96", "--json"];
    let told = |cards: &[&str], pairs: &str| -> Vec<Value> {
        let all = [&["profile", "--estimate"], cards, &["--pairs", pairs], &small[..]].concat();
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
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/profile/profile.json");
    let text = works(&["profile", "--estimate", "RTX4090", "--work", shipped.to_str().unwrap()]);
    for holds in ["RTX4090", "3495 of 20000 Gaussians", "blend bwd", "sum", "white paper"] {
        assert!(text.contains(holds), "{holds}: {text}");
    }
    let folder = Folder::new("estimate");
    let mut profile: Value = json(&shipped);
    profile["counters"]["gaussians"] = 1e18.into();
    let vast = folder.file("profile.json");
    std::fs::write(&vast, profile.to_string()).unwrap();
    let empty = folder.file("empty");
    std::fs::create_dir_all(&empty).unwrap();
    let [vast, empty] = [&vast, &empty].map(|path| path.to_str().unwrap());
    for (arguments, says) in [
        (vec!["--estimate", "GTX480"], "H200, RTX4090, RX7900XTX, A770"),
        (vec!["--estimate", "H200", "--size", "0x5"], "WIDTHxHEIGHT"),
        (vec!["--estimate", "H200", "--gaussians", "0"], "gaussians"),
        (vec!["--estimate", "H200", "--work", vast], "expected 1 to 4000000 Gaussians"),
        (vec!["--estimate", "H200", "--compiled", empty], "tools/gpu/statistics.sh"),
        (vec!["--work", vast], "--estimate"),
    ] {
        let refused = ivv(&[&["profile"], &arguments[..]].concat());
        let fault = told(&refused);
        assert!(!refused.status.success() && fault.contains(says), "{arguments:?}: {fault}");
    }
}

/// The tables are not compared with a step that is recorded here: kernels change often, and the page says of which it is.
#[test]
fn the_page_of_estimates_says_how_it_is_made_and_of_which_kernels_it_is() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    if std::env::var_os("IVV_BLESS").is_some() {
        let text = std::fs::read_to_string(&file).unwrap();
        let (begin, end) = ("<!-- estimate -->\n", "<!-- end -->");
        let (before, rest) = text.split_once(begin).expect("the marker");
        let (_, after) = rest.split_once(end).expect("the end");
        let made = works(&["profile", "--estimate", "all", "--markdown"]);
        std::fs::write(&file, format!("{before}{begin}{made}{end}{after}")).unwrap();
    }
    let text = std::fs::read_to_string(&file).unwrap();
    for holds in [
        MEND,
        "| section | H200 | RTX4090 | RX7900XTX | A770 |",
        "| sum |",
        "VkSplat",
        "gsplat",
        "Faster-GS",
        "LichtFeld",
    ] {
        assert!(text.contains(holds), "{holds}");
    }
    if !text.contains(&format!("Kernels: {}.", shaders_hash())) {
        stale(format!("{PAGE}: kernels have changed since; make it anew: {MEND}"));
    }
}
