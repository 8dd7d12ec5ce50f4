//! The cases of `../shared/cases/numerics` that bring files; skipped where the folder is absent.

use crate::common::prelude::*;
use crate::common::program::json;

#[test]
fn among_equals_those_that_rest_are_in_front() {
    let Some(folder) = shared("cases/numerics/tie") else { return };
    let splats = read_ply(&folder.join("s.ply")).unwrap();
    let view = &read_views(&folder.join("c.json")).unwrap()[0];
    // The red one comes first in the file and moves.
    let [red, green, _] = render(&splats, view).0.color[4 * 9 + 4];
    assert!(splats.n_static == 1 && green > 2.0 * red, "{red} {green}");
}

#[test]
#[ignore = "slow: a training of 400 steps"]
fn removing_floaters_costs_no_picture() {
    let Some(capture) = shared("cases/numerics/veil/capture") else { return };
    let run = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cases-veil");
    let [from, to] = [&capture, &run].map(|path| path.to_str().unwrap());
    let options = ["--steps", "400", "--max-gaussians", "3000", "--seed", "2", "--eval-every", "0", "--overwrite"];
    works(&[&["train", from, "-o", to][..], &options].concat());
    let psnr = json(&run.join("eval.json"))["psnr"].as_f64().unwrap();
    // 16.3 dB when walls went with the floaters, 18.7 without any removal.
    assert!(psnr > 18.2, "{psnr} dB");
}
