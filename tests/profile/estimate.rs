//! Estimates for cards that are not here.

use crate::common::notes::stale;
use crate::common::prelude::*;
use ivv::internals::gpu::generated::gather;
use ivv::internals::gpu::shaders_hash;
use ivv::internals::profile::{Card, Figure};
use ivv::internals::stage::Counters;
use ivv_gpu_model::{Budgets, Estimate};

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

/// The tables are not compared with a step that is recorded here: kernels change often, and the page says of which it is.
#[test]
fn the_page_of_estimates_says_how_it_is_made_and_of_which_kernels_it_is() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    if std::env::var_os("IVV_BLESS").is_some() {
        let text = std::fs::read_to_string(&file).unwrap();
        let (begin, end) = ("<!-- estimate -->\n", "<!-- end -->");
        let (before, rest) = text.split_once(begin).expect("the marker");
        let (_, after) = rest.split_once(end).expect("the end");
        let mut model = Command::new(env!("CARGO"));
        model.args(["run", "--quiet", "--locked", "--package", "ivv-gpu-model", "--"]);
        let output = model.args(["estimate", "all", "--markdown"]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let made = String::from_utf8(output.stdout).unwrap();
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
