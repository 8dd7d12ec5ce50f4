//! Long lists in chunks, as GPUs walk them, whatever the device: pictures and gradients against the truth.

use super::adjoint::layers;
use super::check::{flat, smooth_cotangents};
use crate::adversary::{needs_roundings, rounds_otherwise, slack};
use crate::common::device::as_gpu;
use crate::common::frames::{Tolerance, compare, pixels};
use crate::common::prelude::*;
use ivv::Knobs;
use ivv::internals::gpu::generated::constants::chunk::CHUNK;
use ivv_conformance::adjoint::group_error;

tested! {
    "blend/chunk_list.comp" by render_f64 in pictures_of_long_lists_are_those_of_float64;
    "blend/chunk_light.comp" by render_f64 in pictures_of_long_lists_are_those_of_float64;
    "blend/blend_merge.comp" by render_f64 in pictures_of_long_lists_are_those_of_float64;
}

/// From thin, where no pixel is finished, to dense, where all are before the list's end.
const OPACITIES: [[f64; 2]; 3] = [[1.1 / 255.0, 1.5 / 255.0], [0.05, 0.5], [0.5, 0.999]];

fn render(splats: &Splats, constants: Constants, outputs: Outputs) -> (Frame, FrameReport) {
    let gpu = as_gpu();
    Renderer::new(gpu.clone(), splats, constants).unwrap().render(&camera(16, 16), outputs).unwrap()
}

#[test]
fn pictures_of_long_lists_are_those_of_float64() {
    let view = camera(16, 16);
    let chunk = u64::from(CHUNK);
    let lengths = [chunk - 1, chunk, chunk + 1, 2 * chunk, 2 * chunk + 1, 6000];
    let mut walked = BTreeSet::new();
    let otherwise = rounds_otherwise("two kernels are compared to the bit");
    let [mut finished, mut open] = [0, 0];
    for (n, [low, high]) in lengths.into_iter().flat_map(|n| OPACITIES.map(|range| (n, range))) {
        let splats = layers(n, low, high);
        let (frame, report) = render(&splats, Constants::default(), Outputs::All);
        assert!(report.replays == 0, "{report:?}");
        walked.insert(report.max_tile_list);
        let color = render(&splats, Constants::default(), Outputs::Color).0.color;
        assert!(otherwise || color == frame.color, "{n}, {low}: the colour depends on the other outputs");
        let truth = render_f64(&splats, &view, &Constants::default());
        // In the band each device decides by its own exp2 whether an alpha of 1/255 counts; a pixel has some 10 of the thin ones.
        let tolerance =
            Tolerance { n_band: 0.9, away: slack(2.0) * 2e-5, band: slack(4.0) * Tolerance::default().band };
        compare(&frame, &truth, &tolerance).unwrap_or_else(|fault| panic!("{n}, {low}: {fault}"));
        let n_finished = truth.alpha.iter().filter(|alpha| **alpha > 0.9998).count();
        finished += n_finished;
        open += truth.alpha.len() - n_finished;
    }
    assert!(lengths[..5].iter().all(|n| walked.contains(n)), "lists of {walked:?} entries");
    assert!(finished > 500 && open > 500, "{finished} pixels are finished and {open} are not");
}

#[test]
fn gradients_of_long_lists_are_those_of_the_truth_in_all_ways_and_the_same_bits_in_every_run() {
    let view = camera(16, 16);
    for (n, [low, high]) in [(2100, OPACITIES[0]), (3500, OPACITIES[1])] {
        let splats = layers(n, low, high);
        let cotangents = smooth_cotangents(6, &splats, &view);
        for sums in Sums::ALL {
            let gpu = as_gpu();
            let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
            if let Err(reason) = renderer.accumulate(sums) {
                crate::common::notes::skip(reason);
                continue;
            }
            let (found, report) = renderer.vjp(&view, &cotangents).unwrap();
            assert!(report.max_tile_list > 2 * u64::from(CHUNK) && found.n_bad == 0, "{report:?}");
            for name in ["position", "rotation", "scale", "opacity", "sh"] {
                let error = group_error(&found, name, &splats, &view, &cotangents).expect("a gradient");
                assert!(error <= slack(4.0) * 1e-5, "{n}, {sums:?}: {name} is off by {error:e}");
            }
            assert!(flat(&found, "opacity").iter().filter(|x| **x != 0.0).count() > 500);
            let again = renderer.vjp(&view, &cotangents).unwrap().0;
            assert_same_gradients(format_args!("{n}, {sums:?}: another run"), &again, &found);
        }
    }
}

#[test]
fn a_transmittance_that_finishes_pixels_finishes_them_in_chunks_as_in_rounds() {
    needs_roundings!("two kernels agree where a pixel is finished");
    let usual = Constants::default();
    let constants = Constants { knobs: Knobs { t_cut: 0.05, ..usual.knobs }, ..usual };
    let splats = layers(6000, 0.05, 0.5);
    let rounds = crate::common::frames::render_with(&splats, &camera(16, 16), constants).0;
    let chunks = render(&splats, constants, Outputs::All).0;
    let errors = pixels(&rounds)
        .into_iter()
        .zip(pixels(&chunks))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max));
    let worst = errors.fold(0.0, f32::max);
    assert!(worst <= 2e-5, "an error of {worst}");
    let n_cut = rounds.alpha.iter().filter(|alpha| (0.95..0.999).contains(*alpha)).count();
    assert!(n_cut > 100, "{n_cut} pixels are finished early");
}

#[test]
fn a_picture_of_short_lists_has_the_bits_that_it_has_in_rounds() {
    // What lies in one chunk is walked as in a round.
    let splats = layers(900, 0.05, 0.5);
    let view = camera(16, 16);
    let in_rounds = crate::common::frames::render(&splats, &view).0;
    needs_roundings!("two kernels are compared to the bit");
    assert!(pixels(&render(&splats, Constants::default(), Outputs::All).0) == pixels(&in_rounds));
}
