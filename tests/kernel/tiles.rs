//! Tile lists of the device against every pixel.

use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::common::stages::Fixture;
use ivv::internals::reference::{exclusive_scan, project, ranges, tiles_truth};

tested! {
    "tiles/gather.comp" by exclusive_scan in the_lists_hold_every_needed_pair_and_few_others_in_depth_order;
    "tiles/emit.comp" by tiles_truth in the_lists_hold_every_needed_pair_and_few_others_in_depth_order;
    "tiles/tile_ranges.comp" by ranges in the_lists_hold_every_needed_pair_and_few_others_in_depth_order;
    "tiles/tile_order.comp" by ranges in the_lists_hold_every_needed_pair_and_few_others_in_depth_order;
}

fn check(what: &str, splats: &Splats, view: &View) -> [usize; 2] {
    let fixture = Fixture::new(splats, view);
    let (active, lists) = fixture.bin(view);
    let n_tiles = lists.ranges.len();
    assert_eq!((lists.status.failed, active.status.n_bad), (0, 0), "{what}");
    assert_eq!(lists.entries.len(), exclusive_scan(&active.tile_counts).total as usize, "{what}");

    // The ranges follow one another, as those of a sorted list do.
    let sorted: Vec<u32> = (0u32..)
        .zip(&lists.ranges)
        .flat_map(|(tile, [first, last])| std::iter::repeat_n(tile, (last - first) as usize))
        .collect();
    assert_eq!(sorted.len(), lists.entries.len(), "{what}: a pair without a tile");
    assert_eq!(ranges(&sorted, n_tiles), lists.ranges, "{what}");

    // Front to back, ties by index.
    for [first, last] in &lists.ranges {
        let list = &lists.entries[*first as usize..*last as usize];
        let keys: Vec<(u32, u32)> = list.iter().map(|id| (active.depth_keys[*id as usize], *id)).collect();
        assert!(keys.is_sorted_by(|a, b| a < b), "{what}: a list is out of order");
    }

    // Every tile once, in falling order of its list's bit width.
    let length = |tile: &u32| lists.ranges[*tile as usize][1] - lists.ranges[*tile as usize][0];
    assert!(
        lists.order.iter().is_sorted_by_key(|tile| (length(tile) | 1).leading_zeros()),
        "{what}: light tiles first"
    );
    let mut order = lists.order.clone();
    order.sort_unstable();
    assert_eq!(order, (0..n_tiles as u32).collect::<Vec<u32>>(), "{what}: the tile order is no permutation");
    let longest = (0..n_tiles as u32).map(|tile| length(&tile)).max().unwrap();
    assert_eq!(lists.status.max_tile_list, longest, "{what}");

    let (camera, rules) = (Camera::<f64>::new(view), Rules::<f64>::new(&Constants::default()));
    let params = Params::<f64>::new(splats, view);
    let time = camera.shifted_time(params.time_offset);
    let mut needed = 0;
    for (at, id) in (0u32..).zip(&active.ids) {
        let Some(p) = project(&params.gaussian(fixture.index_of(*id)), &camera, time, &rules) else { continue };
        for tile in tiles_truth(&p, &rules, [view.intrinsics.width, view.intrinsics.height]) {
            let [first, last] = lists.ranges[tile as usize];
            let list = &lists.entries[first as usize..last as usize];
            assert!(list.contains(&at), "{what}: Gaussian {id} is missing from tile {tile}: {p:?}");
            needed += 1;
        }
    }
    [lists.entries.len(), needed]
}

#[test]
fn the_lists_hold_every_needed_pair_and_few_others_in_depth_order() {
    let view = view();
    let mut totals = [0; 2];
    for seed in 0..4 {
        let [found, needed] = check(&format!("seed {seed}"), &scene(seed, 150, 0), &view);
        totals = [totals[0] + found, totals[1] + needed];
    }
    assert!(totals[1] > 1000, "only {} pairs are needed", totals[1]);
    assert!(totals[0] as f64 <= 1.03 * totals[1] as f64, "{} pairs for {}", totals[0], totals[1]);
}

#[test]
fn the_lists_of_wild_scenes_hold_every_needed_pair() {
    for seed in 0..3 {
        let [_, needed] = check(&format!("seed {seed}"), &wild_scene(seed, 400), &view());
        assert!(needed > 200, "only {needed} pairs are needed");
    }
}

#[test]
fn equal_depths_are_listed_by_index() {
    let mut splats = scene(3, 300, 0);
    splats.motion.iter_mut().for_each(|motion| motion.velocity[2] = 0.0);
    for position in &mut splats.position {
        position[2] = 0.25;
    }
    let [found, _] = check("one depth", &splats, &view());
    assert!(found > 600);
}

#[test]
fn gaussians_that_fill_a_large_picture_are_listed_in_each_of_its_tiles() {
    let (width, height) = (3840, 2160);
    let small = view().intrinsics;
    let scale = f64::from(width) / f64::from(small.width);
    let (fx, fy, cx, cy) = (small.fx * scale, small.fy * scale, f64::from(width) / 2.0, f64::from(height) / 2.0);
    let view = View { intrinsics: Intrinsics { width, height, fx, fy, cx, cy }, ..view() };
    // As many as a subgroup has lanes.
    let mut splats = Splats { n_static: 16, motion: Vec::new(), ..scene(5, 16, 0) };
    splats.scale.fill([4.0, 4.0, -3.0]);
    splats.rotation.fill([1.0, 0.0, 0.0, 0.0]);
    let [found, needed] = check("a picture of 4K", &splats, &view);
    assert_eq!([found, needed], [16 * (3840 / 16) * (2160 / 16); 2]);
}

#[test]
fn images_of_odd_sizes_and_their_last_tiles_miss_no_pair() {
    for (width, height) in [(1, 1), (1, 17), (15, 17), (16, 16), (17, 16), (33, 47), (129, 3)] {
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        let view = View { intrinsics: Intrinsics { width, height, cx, cy, ..view().intrinsics }, ..view() };
        let [found, _] = check(&format!("{width} x {height}"), &scene(11, 150, 0), &view);
        assert!(found > 0, "{width} x {height}: nothing was listed");
    }
}
