//! Which bytes are written, and where.

use super::{files, folder, make, options, rgb, shared};
use crate::common::prelude::*;
use ivv::Error;
use ivv::internals::synth::Options;

#[test]
fn equal_options_give_equal_bytes_with_one_thread_and_with_two() {
    let (two, one) = (files(shared()), files(&make("one-thread", &options(), 1)));
    // Per picture: image, dynamic mask, depth and truth; flow for all frames but the last; of the test camera co-visibility.
    assert_eq!(two.len(), 24 * 4 + 20 + 6 + 6 + 3 + 4 + 4 + 4, "{:?}", two.keys());
    for (path, bytes) in &two {
        assert!(!bytes.is_empty(), "{} is empty", path.display());
        assert_eq!(Some(bytes), one.get(path), "{} differs", path.display());
    }
    assert_eq!(two.len(), one.len());
}

#[test]
fn another_seed_gives_another_capture() {
    let few = Options { frames: 2, samples: 1, cameras: 3, test_cameras: 1, ..options() };
    let (a, b) = (make("seed-a", &few, 2), make("seed-b", &Options { seed: 8, ..few }, 2));
    let (a, b) = (files(&a), files(&b));
    let mut same = Vec::new();
    for (path, bytes) in &a {
        if b[path] == *bytes {
            same.push(path.display().to_string());
        }
    }
    assert_eq!(same, ["capture.toml"], "these do not depend on the seed");
}

fn hash(mut state: u64, bytes: &[u8]) -> u64 {
    for byte in bytes {
        state = (state ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    }
    state
}

#[test]
fn the_capture_is_the_same_on_every_machine() {
    let mut state = 0xcbf2_9ce4_8422_2325;
    // Of pictures the pixels: their compression is another project's.
    for (path, bytes) in files(shared()) {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("png") => state = hash(state, &rgb(&shared().join(&path))),
            Some("exr") => {}
            _ => state = hash(state, &bytes),
        }
    }
    assert_eq!(state, CAPTURE, "the capture changed: look at it, then note its new hash {state:#x}");
}

const CAPTURE: u64 = 0x343b_dd16_3652_8599;

fn refusal(path: &Path, options: &Options) -> String {
    match write_capture(path, options, 1, &mut |_, _| {}) {
        Err(error @ Error::Data { .. }) => {
            assert_eq!(error.exit_code(), 3);
            error.to_string()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_folder_that_holds_something_else_is_refused_and_left_alone() {
    let folder = folder("foreign");
    fs::create_dir_all(folder.join("images")).unwrap();
    fs::write(folder.join("images/mine.png"), "mine").unwrap();
    let said = refusal(&folder, &options());
    assert!(said.contains("not empty") && said.contains("synth.json"), "{said}");
    assert_eq!(files(&folder).len(), 1);
}

#[test]
fn a_capture_of_the_same_tool_is_replaced() {
    let few = Options { frames: 2, samples: 1, cameras: 3, test_cameras: 0, masks: true, ..options() };
    let path = make("replaced", &few, 2);
    assert!(path.join("images/cam00/00001.png").exists() && path.join("masks/cam01").is_dir());
    make("replaced", &Options { frames: 1, masks: false, ..few }, 2);
    assert!(path.join("images/cam00/00000.png").exists());
    assert!(!path.join("images/cam00/00001.png").exists() && !path.join("masks").exists(), "a part of the old is left");
}

#[test]
fn options_out_of_range_are_refused_before_anything_is_written() {
    let path = folder("refused");
    let good = options();
    for (bad, name) in [
        (Options { cameras: 2, test_cameras: 0, ..good.clone() }, "`cameras`"),
        (Options { test_cameras: 3, ..good.clone() }, "`test_cameras`"),
        (Options { width: 0, ..good.clone() }, "`width`"),
        (Options { frames: 0, ..good.clone() }, "`frames`"),
        (Options { fps: 0, ..good.clone() }, "`fps`"),
        (Options { samples: 0, ..good }, "`samples`"),
    ] {
        let said = refusal(&path, &bad);
        assert!(said.contains(name), "{said}");
    }
    assert!(!path.exists());
}

#[test]
fn presets_are_within_range_and_grow() {
    let mut pixels = 0;
    for preset in [Preset::Tiny, Preset::Small, Preset::Room] {
        let o = preset.options(1);
        let n = u64::from(o.width * o.height) * u64::from(o.cameras * o.frames);
        assert!(n > pixels && !o.offsets && !o.colors, "{preset:?}");
        pixels = n;
    }
    let hard = Preset::Hard.options(1);
    assert!(hard.offsets && hard.colors && hard.masks);
    let study = Preset::Study.options(1);
    assert!(study.offsets && !study.colors && study.frames == 40);
}
