//! The memory plan against what a trainer allocates.

use super::{Tiny, drive, trainer};
use crate::common::prelude::*;
use ivv::internals::stage::Accumulation;
use ivv::internals::train::{BoundBy, Class, Limits, Plan, Workload};

const LIMITS: Limits = Limits { binding_bytes: 128 << 20, memory_bytes: 8 << 30, is_host: false };

fn workload() -> Workload {
    Workload {
        gaussians: 20_000,
        dynamic: 10_000,
        max_gaussians: 300_000,
        intersections_per_gaussian: 8.0,
        pixels: 640 * 360,
        sh_degree: 3,
        moment_bits: 32,
        batch: 1,
        cache_bytes: 256 << 20,
        image_bytes: 3 << 30,
        kept_image_bytes: None,
        data: TermData::NONE,
        dense: true,
        learns_cameras: false,
        grids: 0,
        sums: Sums::Slots,
        height: 360,
        lpips: [[0; 2]; 2],
    }
}

#[test]
fn the_plan_is_what_a_trainer_allocates_buffer_by_buffer() {
    let tiny = Tiny::on_device("plan");
    let gpu = gpu();
    // Pictures of 64 x 48 and thousands of Gaussians: every class counts.
    let cases = [
        (0, true, 16, Accumulation::Slots),
        (1, false, 16, Accumulation::FixedPoint),
        (2, false, 32, Accumulation::FixedPoint),
        (3, true, 32, Accumulation::Auto),
        (3, true, 16, Accumulation::Auto),
    ];
    for (sh_degree, is_dynamic, moment_bits, accumulation) in cases {
        let mut capture = tiny.capture.clone();
        if !is_dynamic {
            capture.n_frames = 1;
            capture.cameras.iter_mut().for_each(|camera| camera.shots.retain(|shot| shot.frame == 0));
        }
        let points: Vec<_> = (0..20).flat_map(|_| capture.points.clone()).collect();
        let required = Required { grids_at: 0.0, ..Required::default() };
        let batch = if (sh_degree, moment_bits) == (3, 16) { 4 } else { 1 };
        let poses = if is_dynamic { PoseKind::Auto } else { PoseKind::Learnt };
        let config = Config { batch, sh_degree, moment_bits, accumulation, required, poses, ..exact() };
        let begin = from_points(&points, &capture, &config);
        let before = gpu.device().memory().0;
        let mut trainer = trainer(&capture, &config, &begin, 1000);
        drive(&mut trainer, &capture, 1, 2);
        let mut used = gpu.device().memory().0;
        for (name, bytes) in before {
            // A recording that is kept may hold buffers of the trainer before until now.
            let used = used.entry(name).or_default();
            *used = used.saturating_sub(bytes);
        }
        let n = begin.len() as u64;
        let pairs = used["tile keys"] / 4;
        let work = Workload {
            gaussians: n,
            dynamic: if is_dynamic { n } else { 0 },
            intersections_per_gaussian: pairs as f64 / n as f64,
            pixels: 64 * 48,
            sh_degree,
            moment_bits,
            batch,
            data: TermData { depth: true, flow: true },
            // Of the static capture, which has one image a camera, the poses alone.
            learns_cameras: true,
            grids: if is_dynamic { 4 } else { 0 },
            sums: accumulation.on(gpu.caps()),
            height: 48,
            ..workload()
        };
        let is_host = gpu.caps().kind == DeviceKind::Cpu;
        let need = Plan::new(&work, &Limits { is_host, ..LIMITS }).begin;
        let mut told: BTreeMap<&str, u64> = BTreeMap::new();
        need.buffers.iter().for_each(|(name, _, bytes)| *told.entry(name).or_default() += bytes);
        let mut faults = Vec::new();
        for (name, bytes) in &used {
            let planned = told.remove(name.as_str()).unwrap_or(0);
            // What the plan leaves out is small; what it names it knows.
            let slack = used.values().sum::<u64>() / 200 + bytes / 20;
            if bytes.abs_diff(planned) > slack {
                faults.push(format!("`{name}`: {bytes} bytes, planned {planned}"));
            }
        }
        faults.extend(told.iter().filter(|(_, b)| **b > 0).map(|(name, b)| format!("`{name}`: none, planned {b}")));
        assert!(faults.is_empty(), "degree {sh_degree}, {moment_bits} bits: mend engine/train/plan.rs: {faults:#?}");
        let (sum, planned) = (used.values().sum::<u64>(), need.bytes());
        assert!(sum.abs_diff(planned) < sum / 10, "{sum} bytes, planned {planned}");
        assert!(Class::ALL.iter().all(|class| (need.class(*class) > 0) != (*class == Class::Cameras && !is_dynamic)));
    }
}

/// Bytes of images that stay on a device that is filled with Gaussians.
fn tight_images(limits: &Limits) -> u64 {
    let work = Workload { max_gaussians: 1 << 40, ..workload() };
    Plan::new(&work, &Limits { binding_bytes: u64::MAX, ..*limits }).image_bytes
}

#[test]
fn the_tightest_bound_is_named_and_holds() {
    let plan = |work: &Workload, limits: &Limits| Plan::new(work, limits);
    let free = plan(&workload(), &LIMITS);
    assert_eq!((free.full.gaussians, &free.bound_by), (300_000, &BoundBy::MaxGaussians));
    // 48 bytes for each of eight pairs.
    let work = Workload { max_gaussians: 1 << 40, ..workload() };
    let bound = plan(&work, &LIMITS);
    assert_eq!(bound.bound_by, BoundBy::Binding("frame sums"));
    assert_eq!(bound.full.gaussians, (128 << 20) / (48 * 8));
    // A picture that no binding sees leaves no room for any Gaussian.
    let wide = plan(&Workload { pixels: 4 << 20, ..work }, &LIMITS);
    assert_eq!((wide.full.gaussians, wide.bound_by), (0, BoundBy::Binding("ssim partials")));
    // The most that fit do fit, and one more does not; a frame cache in the same memory takes its part.
    for is_host in [false, true] {
        let limits = Limits { memory_bytes: 1 << 30, is_host, ..LIMITS };
        let tight = plan(&work, &Limits { binding_bytes: u64::MAX, ..limits });
        assert_eq!(tight.bound_by, BoundBy::Memory);
        let room = limits.memory_bytes - if is_host { work.cache_bytes } else { 0 };
        let each = (tight.full.bytes() - tight.begin.bytes()) / (tight.full.gaussians - work.gaussians);
        let left = room.abs_diff(tight.full.bytes());
        assert!(tight.full.gaussians > 100_000 && left <= 2 * each, "{left} bytes left, {each} each");
    }
    // Images take three quarters of what the run leaves when it has doubled, no more than there are, and what they are given.
    assert_eq!(free.image_bytes, 3 << 30, "all of them");
    let small = plan(&workload(), &Limits { memory_bytes: 2 << 30, ..LIMITS });
    let left = (2 << 30) - 2 * small.full.bytes();
    assert!(small.image_bytes < 3 << 30 && small.image_bytes.abs_diff(left / 4 * 3) < 4, "{}", small.image_bytes);
    assert_eq!(tight_images(&Limits { memory_bytes: 1 << 30, ..LIMITS }), 0, "Gaussians take all memory");
    assert_eq!(plan(&workload(), &Limits { is_host: true, ..LIMITS }).image_bytes, 0, "the cache is there already");
    let given = Workload { kept_image_bytes: Some(5000), ..workload() };
    assert_eq!(plan(&given, &Limits { is_host: true, ..LIMITS }).image_bytes, 5000);
    let text = free.to_string();
    assert!(text.contains("--max-gaussians") && text.contains("moments") && text.lines().count() > 8, "{text}");
}

#[test]
fn a_plan_of_a_training_tells_what_its_files_and_steps_are() {
    let tiny = Tiny::new("outline");
    let ivv = |args: &[&str]| {
        let train = ["train", text(&tiny.folder), "--quiet", "--json"];
        serde_json::from_str::<serde_json::Value>(&works(&[&train[..], args].concat())).unwrap()
    };
    let run = tiny.folder.join("run");
    let output = ["-o", run.to_str().unwrap()];
    let told = ivv(&[&output[..], &["--plan", "--max-gaussians", "900", "--set", "batch=4"]].concat());
    assert!(!run.exists(), "nothing is written");
    let images = tiny.capture.training_frames().len() as u64;
    assert_eq!(told["training_images"], images);
    assert_eq!(told["steps"], (30 * images).div_ceil(4));
    let bytes = |camera: usize, frame: u32| {
        std::fs::metadata(&tiny.capture.cameras[camera].shot(frame).unwrap().image).unwrap().len()
    };
    let of_images: u64 = tiny.capture.training_frames().iter().map(|(camera, frame)| bytes(*camera, *frame)).sum();
    assert!(told["image_file_bytes"].as_u64().unwrap() >= of_images);
    assert_eq!(told["bytes_read"], told["image_file_bytes"], "all of them stay in the cache");
    // As if the clip were ten times as long.
    let long = ivv(&[&output[..], &["--max-gaussians", "900", "--set", "batch=4", "--plan", "40"]].concat());
    assert_eq!(long["training_images"], 10 * images);
    assert_eq!((long["steps"].as_u64(), &long["gaussians"]), (Some(300 * images / 4), &told["gaussians"]));
    // For a card that is not here: its memory, and what a GPU needs in place of what a driver on a CPU does.
    let card = |name: &str| ivv(&[&output[..], &["--max-gaussians", "900", "--plan", "40", "--card", name]].concat());
    let on_card = card("rtx 4090");
    assert_eq!(on_card["gaussians"], 900);
    let kept = on_card["device_image_bytes"].as_u64().unwrap();
    assert!(
        kept > 0 && long["device_image_bytes"] == 0,
        "pictures stay on a card, and not on a driver whose memory is the host's"
    );
    let unknown = ["train", tiny.folder.to_str().unwrap(), "-o", run.to_str().unwrap(), "--plan", "--card", "GTX 480"];
    assert!(fails(&unknown, 2).contains("H200, RTX4090"));
    // The newest checkpoint of a run with as many Gaussians, all of which move in the worst case.
    let ran = ivv(&[
        &output[..],
        &["--max-gaussians", "900", "--steps", "20", "--set", "batch=4", "--set", "grids=none", "--eval-every", "0"],
    ]
    .concat());
    let file = std::fs::metadata(run.join("checkpoints/00000020.ckpt")).unwrap().len();
    let n = ran["gaussians"].as_u64().unwrap();
    let expected = told["checkpoint_bytes"].as_u64().unwrap() * n / told["gaussians"].as_u64().unwrap();
    assert!(file < expected + 1_000_000 && file > expected / 2, "{file} bytes, {expected} told");
}
