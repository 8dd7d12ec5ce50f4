//! The projection for two eyes against one projection for each.

use crate::adversary::rounds_otherwise;
use crate::common::device::gpu;
use crate::common::random::{self, Random, poison, scene, wild_scene};
use ivv::gpu::generated::{Status, ViewParams};
use ivv::gpu::{Buf, Recording};
use ivv::scene::{FlowModel, Splats, View};
use ivv::stage::{Cull, Eye, Projected, Purpose, SceneBuffers, Strip, view_params};
use ivv::{Constants, Knobs, TileBound};

/// All that a projection leaves, as words: also past the end of what is active, where nothing may be written.
#[derive(PartialEq)]
struct Left {
    status: Status,
    splats: Vec<u32>,
    tile_counts: Vec<u32>,
    depth_keys: Vec<u32>,
}

/// Culls `splats` for the first of `views`, and projects what is active for both, in one dispatch and in one for each.
fn project(splats: &Splats, views: [&View; 2], constants: &Constants) -> [[Left; 2]; 2] {
    let gpu = gpu();
    let scene = SceneBuffers::upload(&gpu, splats, constants, Purpose::Picture).unwrap();
    let params = views.map(|view| view_params(view, constants, scene.origin, Strip::whole(view)));
    let views: [Buf<ViewParams>; 2] = params.map(|params| gpu.upload("view", &[params]).unwrap());
    let cull = Cull::new(&gpu, &scene, splats.len() as u32, false).unwrap();
    let leave = |together: bool| {
        let statuses = [0, 1].map(|_| gpu.upload("status", &[Status::default()]).unwrap());
        let first = Projected::new(&gpu, splats.len() as u32).unwrap();
        let second = if together { first.beside(&gpu) } else { Projected::new(&gpu, splats.len() as u32) }.unwrap();
        let mut rec = Recording::new();
        cull.record(&mut rec, &scene, &views[0], &statuses[0]);
        rec.copy(statuses[0].slice(), statuses[1].slice());
        let places = [&first, &second];
        if together {
            let eye = |k: usize| Eye { view: &views[k], status: &statuses[k], projected: places[k] };
            Projected::record_both(&mut rec, &scene, &cull, [eye(0), eye(1)]);
        } else {
            (0..2).for_each(|k| places[k].record(&mut rec, &scene, &cull, &views[k], &statuses[k]));
        }
        gpu.run(&rec).unwrap();
        [0, 1].map(|k| Left {
            status: gpu.read(&statuses[k]).unwrap()[0],
            splats: gpu.read(&places[k].splats.cast()).unwrap(),
            tile_counts: gpu.read(&places[k].tile_counts).unwrap(),
            depth_keys: gpu.read(&places[k].depth_keys).unwrap(),
        })
    };
    [leave(true), leave(false)]
}

/// Projects both ways and compares every bit; gives what each eye counted.
fn compare(what: &str, splats: &Splats, views: [&View; 2], constants: &Constants) -> [Status; 2] {
    let [together, apart] = project(splats, views, constants);
    assert!(together[0] == apart[0], "{what}: the first eye, {:?} and {:?}", together[0].status, apart[0].status);
    let (found, expected) = (&together[1], &apart[1]);
    assert_eq!(found.status, expected.status, "{what}");
    assert!(found.splats == expected.splats, "{what}: splats of the second eye");
    assert!(found.tile_counts == expected.tile_counts, "{what}: tile counts of the second eye");
    assert!(found.depth_keys == together[0].depth_keys, "{what}: its order");
    assert!(found.splats != together[0].splats, "{what}: the eyes see the same");
    together.map(|left| left.status)
}

/// A view whose time does not depend on the frame ahead.
fn view() -> View {
    View { time_offset: 0.0, ..random::view() }
}

/// `view` from `right` of it, with another middle, background and frame ahead.
fn beside(view: &View, right: f64) -> View {
    let mut other = View { background: [0.7, 0.2, 0.0], flow_dt: 0.07, ..view.clone() };
    other.intrinsics.cx += 3.5;
    other.pose.translation.x -= right;
    other
}

#[test]
fn every_kernel_for_two_eyes_leaves_the_bits_of_one_for_each() {
    if rounds_otherwise("two kernels have the same bits") {
        return;
    }
    let mut ahead = view();
    ahead.pose.translation.y += 0.03;
    let next = Some(ahead.pose);
    let displaced = View { flow_model: FlowModel::Displacement, next_pose: next, ..view() };
    for sh_degree in 0..=3 {
        for sh_bits in [32, 16] {
            let constants = Knobs { sh_bits, ..Knobs::default() }.on(Constants::default());
            for view in [view(), displaced.clone()] {
                // Static and dynamic ones are half of them each; edges of a workgroup, and several.
                for n in [1, 2, 126, 130, 600] {
                    let splats = scene(7 * u64::from(sh_degree) + n as u64, n, sh_degree);
                    let what = format!("degree {sh_degree}, {sh_bits} bits, {n}, {:?}", view.flow_model);
                    let [first, second] = compare(&what, &splats, [&view, &beside(&view, 0.3)], &constants);
                    assert!(n < 100 || (first.n_visible > 0 && second.n_visible > 0), "{what}");
                    assert_eq!(first.n_active, second.n_active, "{what}");
                }
            }
        }
    }
}

#[test]
fn two_eyes_count_what_is_not_finite_and_follow_the_knobs() {
    if rounds_otherwise("two kernels have the same bits") {
        return;
    }
    let mut random = Random::new(8);
    let mut splats = wild_scene(6, 800);
    poison(&mut splats, &mut random, 2e-3);
    // An eye whose own numbers are out of range counts for itself.
    let mut blind = beside(&view(), 0.3);
    blind.intrinsics.fx = 1e38;
    let [first, second] = compare("blind", &splats, [&view(), &blind], &Constants::default());
    assert!(second.n_bad > first.n_bad && second.n_visible != first.n_visible, "{first:?}, {second:?}");
    for tile_bound in [TileBound::Ellipse, TileBound::Rectangle, TileBound::Square] {
        for (time_cull, depth_bits) in [(true, 32), (false, 16)] {
            let knobs = Knobs { tile_bound, time_cull, depth_bits, ..Knobs::default() };
            let what = format!("{knobs:?}");
            compare(&what, &splats, [&view(), &beside(&view(), 0.2)], &knobs.on(Constants::default()));
        }
    }
}
