//! What runs read: settings, checkpoints, run folders, dumped dispatches.

use super::engine::Seed;
use super::{file, mend};
use crate::common::prelude::*;
use crate::common::random;
use ivv::internals::profile::{read_dispatch, write_dispatch};
use ivv::internals::train::{Average, CameraState, DueEvents, Kind, Log, PRESETS, Preset, StepCapacity};

pub fn config() -> Vec<Seed> {
    let config = serde_json::to_string_pretty(&exact()).unwrap();
    let read_config = |folder: &Path| {
        let text = std::fs::read_to_string(folder.join("config.json")).unwrap_or_default();
        serde_json::from_str::<Config>(&text).is_ok_and(|config| config.check().is_ok())
    };
    let read_preset = |folder: &Path| {
        let path = folder.join("preset.json");
        let text = std::fs::read(&path).unwrap();
        Preset::parse(&path, "mine", &String::from_utf8_lossy(&text)).is_ok()
    };
    let presets = PRESETS.map(|(_, text)| Seed::of([("preset.json", text)], read_preset));
    [Seed::of([("config.json", config)], read_config)].into_iter().chain(presets).collect()
}

pub fn checkpoint() -> Vec<Seed> {
    let params = random::scene(3, 6, 1);
    let cameras = CameraState { clocks: vec![[0.5; 4]; 2], learns_offset: vec![true, false], ..CameraState::default() };
    let checkpoint = Checkpoint {
        step: 7,
        total: 20,
        config: exact(),
        world: Similarity::default(),
        origin: [0.0; 3],
        first: params.clone(),
        second: params.clone(),
        state: vec![[1.0; 4]; params.len()],
        average: Average { n: 3, mean: params.clone() },
        params,
        cameras,
        due: DueEvents::default(),
        room: StepCapacity { intersections: 1 << 14, rounds: 2 },
    };
    let folder = Folder::new("fuzz-checkpoint");
    checkpoint.write(&folder.0).unwrap();
    let bytes = std::fs::read(Checkpoint::file(&folder.0, 7)).unwrap();
    let n = bytes[8..16].iter().rev().fold(0usize, |n, byte| n << 8 | usize::from(*byte));
    let (header, body) = bytes[24..].split_at(n);
    let read = |folder: &Path| Checkpoint::read(&folder.join("a.ckpt")).is_ok();
    let seed = Seed { build: mend::checkpoint, ..Seed::of([("header", header), ("body", body)], read) };
    // With and without what guards it.
    vec![seed, Seed::of([("a.ckpt", bytes)], read)]
}

pub fn run() -> Vec<Seed> {
    let folder = Folder::new("fuzz-run");
    crate::capture::dynamic::write(&folder, 2);
    let capture = Capture::open(&folder.0).unwrap();
    let written = Folder::new("fuzz-run-written");
    Run::new(&capture, Constants::default()).unwrap().write(&written.0).unwrap();
    let mut log = Log::open(&written.0, 0);
    for step in [1, 2] {
        log.push(Kind::Step, &serde_json::json!({ "step": step, "loss": 0.5, "seconds": 0.25 })).unwrap();
    }
    log.write().unwrap();
    let read = |folder: &Path| {
        let log = Log::open(folder, u64::MAX);
        let _ = log.series(Kind::Step, "loss");
        Run::read(folder).is_ok_and(|run| {
            let _ = run.open_capture(None);
            true
        })
    };
    vec![Seed::of(super::files_of(&written.0), read)]
}

pub fn dispatch() -> Vec<Seed> {
    let dispatch = crate::profile::dumped();
    let bytes = file("a.dispatch", |path| write_dispatch(path, &dispatch, &gpu()));
    vec![Seed::of([("a.dispatch", bytes)], |folder| read_dispatch(&folder.join("a.dispatch")).is_ok())]
}
