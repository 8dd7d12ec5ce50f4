//! Every reader on damaged files of its format: seeds of the project's own making, a few changes to each, what guards the
//! content mended. No panic (overflow checks are on), no hang, no large allocation.
//!
//! The default suite runs always the same cases, about a second a format. With `IVV_FUZZ_SECONDS` all formats together take
//! that long (`tools/test.sh --fuzz`); `IVV_FUZZ_REPLAY` runs the one case that a failure names.

mod change;
mod engine;
mod mend;
mod scenes;
mod sofa;
mod sounds;
mod sources;
mod trainings;

use crate::common::prelude::*;
use engine::{Files, fuzz};

/// Formats: name of the test, cases in the default suite, seeds.
macro_rules! formats {
    ($($name:ident, $cases:expr, $seeds:expr;)+) => {
        const FORMATS: &[&str] = &[$(stringify!($name)),+];

        $(
            #[test]
            fn $name() {
                fuzz(stringify!($name), $cases, FORMATS.len(), $seeds);
            }
        )+
    };
}

formats! {
    ply, 1800, scenes::ply();
    compressed_ply, 1800, scenes::compressed_ply();
    spz, 1800, scenes::spz();
    spz_4, 1800, scenes::spz_4();
    splat, 3000, scenes::splat();
    sog, 600, scenes::sog();
    four_dgs, 600, scenes::four_dgs();
    cameras, 1400, scenes::cameras();
    tensors, 1800, scenes::tensors();
    depth, 1800, scenes::depth();
    flow, 1800, scenes::flow();
    capture_folder, 60, sources::capture_folder();
    colmap_text, 400, sources::colmap_text();
    colmap_binary, 400, sources::colmap_binary();
    transforms, 400, sources::transforms();
    dynamic_3d_gaussians, 400, sources::dynamic();
    jpeg, 400, sources::jpeg();
    npz, 400, sources::npz();
    caliscope, 60, sources::caliscope();
    qualisys, 60, sources::qualisys();
    pose2sim, 60, sources::pose2sim();
    easymocap, 60, sources::easymocap();
    immersive, 60, sources::immersive();
    llff, 60, sources::llff();
    colmap_rig, 60, sources::colmap_rig();
    rig, 400, sources::rig();
    keypoints, 60, sounds::keypoints();
    wav, 1400, sounds::wav();
    responses, 40, sounds::responses();
    sofa, 400, sofa::sofa();
    tracks, 1400, sounds::tracks();
    sound_scene, 600, sounds::sound_scene();
    paths, 1000, sounds::paths();
    config, 600, trainings::config();
    checkpoint, 600, trainings::checkpoint();
    run, 600, trainings::run();
    dispatch, 600, trainings::dispatch();
}

fn files_of(folder: &Path) -> Files {
    let mut all = Files::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                all.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    all
}

/// The one file that `write` writes in a folder of its own.
fn file(name: &str, write: impl FnOnce(&Path) -> ivv::Result<()>) -> Vec<u8> {
    let folder = Folder::new("fuzz-seed");
    write(&folder.file(name)).unwrap();
    std::fs::read(folder.file(name)).unwrap()
}
