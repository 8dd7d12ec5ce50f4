//! What a frame does not depend on, to the last bit.

use crate::adversary::needs_roundings;
use crate::common::one::with;
use crate::common::prelude::*;
use crate::common::random::{scene, view};

fn assert_busy(frame: &Frame) {
    let n = frame.alpha.iter().filter(|alpha| **alpha > 0.1).count();
    assert!(4 * n > frame.alpha.len(), "only {n} of {} pixels show anything", frame.alpha.len());
}

#[test]
fn twenty_renders_have_the_same_bits_with_one_renderer_and_with_fresh_ones() {
    let gpu = gpu();
    let (splats, view) = (scene(31, 300, 2), view());
    let mut kept = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let (first, _) = kept.render(&view, Outputs::All).unwrap();
    assert_busy(&first);
    for run in 0..10 {
        let (again, _) = kept.render(&view, Outputs::All).unwrap();
        assert_same_frame(format_args!("render {run} of the same renderer"), &again, &first);
        assert_same_frame(format_args!("fresh renderer {run}"), &render(&splats, &view).0, &first);
    }
}

#[test]
fn a_renderer_that_has_drawn_other_views_draws_the_same_bits() {
    let gpu = gpu();
    let splats = scene(32, 200, 1);
    let small = view();
    let large = with(view(), |of| (of.width, of.height) = (200, 120));
    let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
    let mut frame = |view, outputs| renderer.render(view, outputs).unwrap().0;
    let first = frame(&small, Outputs::All);
    frame(&large, Outputs::All);
    frame(&small, Outputs::Color);
    assert_busy(&first);
    assert_same_frame("after other views", &frame(&small, Outputs::All), &first);
}

#[test]
fn colour_alone_is_the_colour_of_all_outputs_bit_for_bit() {
    needs_roundings!("two kernels have the same bits");
    let gpu = gpu();
    for seed in 0..3 {
        let splats = scene(seed, 200, 1);
        let (all, _) = render(&splats, &view());
        assert_busy(&all);
        let mut renderer = Renderer::new(gpu.clone(), &splats, Constants::default()).unwrap();
        let (color, _) = renderer.render(&view(), Outputs::Color).unwrap();
        assert_same(format_args!("colour of seed {seed}"), &color.color, &all.color);
        assert_same(format_args!("alpha of seed {seed}"), &color.alpha, &all.alpha);
        assert!(color.depth.is_empty() && color.inverse_depth.is_empty() && color.flow.is_empty());
    }
}
