//! Culling and compaction against the truth and against a model of bits.

use crate::common::prelude::*;
use crate::common::random::view;
use crate::common::stages::Fixture;
use ivv::internals::gpu::generated::compact;
use ivv::internals::reference::{exclusive_scan, project, tiles_truth, visible};
use ivv::internals::stage::Among;

tested! {
    "cull/bound.comp" by tiles_truth in no_gaussian_that_contributes_to_a_pixel_is_culled;
    "cull/cull.comp" by tiles_truth in no_gaussian_that_contributes_to_a_pixel_is_culled;
    "cull/live_blocks.comp" by visible in blocks_are_listed_that_have_someone_alive_and_no_others;
    "cull/compact.comp" by exclusive_scan in compaction_works_around_the_limit_of_65535_workgroups;
    "cull/prepare_active.comp" by exclusive_scan in the_active_list_of_any_mix_of_sizes_is_the_list_of_the_marked_ones_in_order;
}

/// `Status::failed` when the active list overflows, `FAILED_ACTIVE` of the shaders.
const FAILED_ACTIVE: u32 = 1;
/// Gaussians per group of the flat index, `CULL_BLOCK` of the engine.
const BLOCK: u32 = 128;
const GUARD: u32 = 0xDEAD_BEEF;

/// A Gaussian in plain sight of a camera at the origin, or one behind it, or one whose time is not now.
fn clear(random: &mut Random, dynamic: bool, seen: bool) -> One {
    let out_of_time = dynamic && random.bits().is_multiple_of(2);
    let z = if seen || out_of_time { 4.0 } else { -4.0 };
    let [x, y] = random.vector(-0.5, 0.5);
    let t_center = if seen || !out_of_time { 0.5 } else { 40.0 };
    let motion = Motion { velocity: [0.5, 0.0, 0.0], t_center, t_scale: 0.0 };
    One { motion: dynamic.then_some(motion), ..ball([x, y, z], 0.05, 0.5, [0.5; 3]) }
}

/// `n` Gaussians of a population, and which of them are seen.
fn population(random: &mut Random, n: usize, dynamic: bool) -> (Vec<One>, Vec<bool>) {
    let seen: Vec<bool> = (0..n).map(|_| !random.bits().is_multiple_of(3)).collect();
    (seen.iter().map(|seen| clear(random, dynamic, *seen)).collect(), seen)
}

fn folded(n: u32) -> [u32; 4] {
    [n.min(65_535), n.div_ceil(65_535), 1, n]
}

#[test]
fn no_gaussian_that_contributes_to_a_pixel_is_culled() {
    let view = view();
    let rules = Rules::<f64>::new(&Constants::default());
    let camera = Camera::<f64>::new(&view);
    for seed in 0..3 {
        let splats = wild_scene(seed, 500);
        let fixture = Fixture::new(&splats, &view);
        let (_, ids) = fixture.cull();
        assert!(ids.is_sorted_by(|a, b| a < b), "seed {seed}: not ascending");
        let active: Vec<usize> = ids.iter().map(|id| fixture.index_of(*id)).collect();
        let params = Params::<f64>::new(&splats, &view);
        let time = camera.shifted_time(params.time_offset);
        let mut n_seen = 0;
        for i in 0..splats.len() {
            let Some(p) = project(&params.gaussian(i), &camera, time, &rules) else { continue };
            if !tiles_truth(&p, &rules, [view.intrinsics.width, view.intrinsics.height]).is_empty() {
                assert!(active.contains(&i), "seed {seed}: Gaussian {i} is culled but seen: {p:?}");
                n_seen += 1;
            }
        }
        assert!(n_seen > 60, "seed {seed}: only {n_seen} are seen");
        assert!(active.len() < splats.len() / 2, "seed {seed}: {} are kept for {n_seen}", active.len());
    }
}

#[test]
fn the_active_list_of_any_mix_of_sizes_is_the_list_of_the_marked_ones_in_order() {
    let sizes = [0, 1, 31, 32, 33, 127, 128, 129, 1000];
    let mixes = sizes.iter().flat_map(|n| [(*n, 0), (0, *n), (*n, 129), (33, *n)]);
    for (n_static, n_dynamic) in mixes.filter(|(a, b)| a + b > 0) {
        let mut random = Random::new((1000 * n_static + n_dynamic) as u64);
        let (mut all, seen_static) = population(&mut random, n_static, false);
        let (moving, seen_dynamic) = population(&mut random, n_dynamic, true);
        all.extend(moving);
        let view = camera(64, 48);
        let mut fixture = Fixture::new(&scene_of(&all), &view);
        // Guard words behind the room for every Gaussian.
        let n = all.len();
        fixture.cull.active_id = fixture.gpu.upload("guarded ids", &vec![GUARD; n + 4]).unwrap();

        let mut expected = Vec::new();
        let mut first = 0;
        let groups: Vec<Vec<bool>> = [seen_static, seen_dynamic].into_iter().filter(|seen| !seen.is_empty()).collect();
        for seen in &groups {
            expected.extend((0u32..).zip(seen).filter(|(_, seen)| **seen).map(|(i, _)| first + i));
            first += (seen.len() as u32).next_multiple_of(BLOCK);
        }
        let counts: Vec<u32> = groups.iter().map(|seen| seen.iter().filter(|seen| **seen).count() as u32).collect();
        let ranges: Vec<[u32; 2]> =
            exclusive_scan(&counts).offsets.iter().zip(&counts).map(|(begin, n)| [*begin, begin + n]).collect();
        let (status, ids) = fixture.cull();
        let what = format!("{n_static} static, {n_dynamic} dynamic");
        assert_same(&what, &ids, &expected);
        assert_eq!((status.failed, status.n_active), (0, expected.len() as u32), "{what}");
        assert_same(format_args!("{what}: ranges"), &fixture.gpu.read(&fixture.cull.ranges).unwrap(), &ranges);
        let kept = fixture.gpu.read(&fixture.cull.active_id).unwrap();
        assert!(kept[expected.len()..].iter().all(|word| *word == GUARD), "{what}: written past the list");

        let n_active = expected.len() as u32;
        let grids = [n_active.div_ceil(64), n_active.div_ceil(1024).max(1), n_active.div_ceil(2048)];
        let groups = ranges.iter().map(|[first, last]| (last - first).div_ceil(64));
        let blocks = [n_static, n_dynamic].into_iter().filter(|n| *n > 0).map(|n| (n as u32).next_multiple_of(BLOCK));
        let idle = blocks.zip(&ranges).map(|(n, [first, last])| (n - (last - first)).div_ceil(64));
        let args: Vec<[u32; 4]> = grids.into_iter().chain(groups).chain(idle).map(folded).collect();
        assert_same(format_args!("{what}: arguments"), &fixture.gpu.read(&fixture.cull.args).unwrap(), &args);
    }
}

#[test]
fn many_groups_share_one_list() {
    let gpu = gpu();
    let mut random = Random::new(5);
    let (mut groups, mut expected, mut ranges, mut first, mut n) = (Vec::new(), Vec::new(), Vec::new(), 0, 0);
    for (size, dynamic) in [(1, false), (129, false), (64, true), (128, false), (300, true)] {
        let (all, seen) = population(&mut random, size, dynamic);
        let mut part = SceneBuffers::upload(&gpu, &scene_of(&all), &Constants::default(), Purpose::Picture).unwrap();
        assert_eq!((part.groups.len(), part.n_bad), (1, 0));
        part.groups[0].first = first;
        let begin = expected.len() as u32;
        expected.extend((0u32..).zip(seen).filter(|(_, seen)| *seen).map(|(i, _)| first + i));
        ranges.push([begin, expected.len() as u32]);
        first += part.n_flat;
        n += part.n;
        groups.append(&mut part.groups);
    }
    let starts: Vec<u32> = groups.iter().map(|group| group.first / BLOCK).collect();
    let group_first = gpu.upload("group starts", &starts).unwrap();
    let scene = SceneBuffers {
        groups,
        n_flat: first,
        n,
        group_first,
        group_limit: 384,
        sh_degree: 0,
        origin: [0.0; 3],
        n_bad: 0,
        holds_static: false,
    };
    let fixture = Fixture::with(gpu, scene, &camera(64, 48), n);
    let (status, ids) = fixture.cull();
    assert!(ids.len() > 300);
    assert_same("active", &ids, &expected);
    assert_eq!(status.failed, 0);
    assert_same("ranges", &fixture.gpu.read(&fixture.cull.ranges).unwrap(), &ranges);
    // The groups keep their order and their parameters in what follows.
    let active = fixture.project();
    assert!(active.splats.iter().all(|s| s[1][3] == 4.0), "every Gaussian in sight has camera depth 4");
}

#[test]
fn an_active_list_that_overflows_says_so_and_leaves_everything_else_empty() {
    let mut random = Random::new(9);
    let all: Vec<One> = (0..300).map(|i| clear(&mut random, i % 2 == 1, true)).collect();
    let splats = scene_of(&all);
    let view = camera(64, 48);
    for capacity in [1, 128, 299] {
        let gpu = gpu();
        let scene = SceneBuffers::upload(&gpu, &splats, &Constants::default(), Purpose::Picture).unwrap();
        let mut fixture = Fixture::with(gpu, scene, &view, capacity);
        fixture.cull.active_id = fixture.gpu.upload("guarded ids", &vec![GUARD; capacity as usize + 64]).unwrap();
        let (status, ids) = fixture.cull();
        let numbers = (status.failed, status.n_active, status.capacity_active);
        assert_eq!(numbers, (FAILED_ACTIVE, 300, capacity));
        assert!(ids.is_empty(), "{} active ones of a list that does not fit", ids.len());
        // But for the scan's one workgroup, which writes that it found nothing.
        let args = fixture.gpu.read(&fixture.cull.args).unwrap();
        assert!(args.iter().enumerate().all(|(at, grid)| *grid == folded(u32::from(at == 1))), "{args:?}");
        assert!(fixture.gpu.read(&fixture.cull.ranges).unwrap().iter().all(|range| *range == [0, 0]));
        let words = fixture.gpu.read(&fixture.cull.active_id).unwrap();
        assert!(words[capacity as usize..].iter().all(|word| *word == GUARD), "capacity {capacity}: guards touched");
        assert!(words[..capacity as usize].iter().all(|word| *word < 512), "capacity {capacity}: a hole");
    }
    let fixture = Fixture::new(&splats, &view);
    assert_eq!((fixture.cull().0.failed, fixture.cull().1.len()), (0, 300), "exactly the capacity fits");
}

#[test]
fn compaction_works_around_the_limit_of_65535_workgroups() {
    let gpu = gpu();
    let full = 65_535 * BLOCK;
    for n in [full - 1, full, full + 1] {
        let n_words = n.div_ceil(BLOCK) as usize * 4;
        let mut random = Random::new(u64::from(n));
        let mut bits = vec![0u32; n_words];
        let mut marked: Vec<u32> = (0..50).map(|_| random.bits() as u32 % n).chain([0, full - 2, n - 1]).collect();
        marked.sort_unstable();
        marked.dedup();
        for i in &marked {
            bits[*i as usize / 32] |= 1 << (i % 32);
        }
        let counts: Vec<u32> = bits.chunks(4).map(|words| words.iter().map(|word| word.count_ones()).sum()).collect();
        let offsets = exclusive_scan(&counts).offsets;
        let ids = gpu.upload("ids", &vec![GUARD; marked.len() + 4]).unwrap();
        let (bits, offsets) = (gpu.upload("bits", &bits).unwrap(), gpu.upload("offsets", &offsets).unwrap());
        let others = gpu.upload("others", &vec![GUARD; n as usize - marked.len() + 4]).unwrap();
        let args = compact::Args {
            bits: &bits,
            offsets: &offsets,
            active_id: &ids,
            idle_id: &others,
            live: &offsets,
            live_args: &offsets,
        };
        let push = compact::Push { n, first: 0, capacity: marked.len() as u32 + 4, is_listed: 0, wants_idle: 1 };
        let mut rec = Recording::new();
        rec.pass(args, push, Grid::Threads(n));
        gpu.run(&rec).unwrap();
        let found = gpu.read(&ids).unwrap();
        assert_eq!((&found[..marked.len()], &found[marked.len()..]), (&marked[..], &[GUARD; 4][..]), "{n} places");
        let others = gpu.read(&others).unwrap();
        let expected = (0..n).filter(|i| marked.binary_search(i).is_err()).chain([GUARD; 4]);
        assert!(others.into_iter().eq(expected), "the others of {n} places");
    }
}

/// What `bound.comp` makes of the half-width of a life, in double precision.
fn half_width(one: &One) -> f64 {
    let level = (1.0 / (1.0 + (-f64::from(one.opacity)).exp()) * 255.0).ln();
    f64::from(one.motion.unwrap().t_scale).exp() * level.sqrt()
}

#[test]
fn blocks_are_listed_that_have_someone_alive_and_no_others() {
    let lasting = |t_scale: f32, t_center: f32| Motion { velocity: [0.5, 0.0, 0.0], t_center, t_scale };
    let mut random = Random::new(11);
    let lasts = [f32::INFINITY, 0.01f32.ln(), f32::NAN, 80.0];
    for (n, lasts) in
        [(1usize, &lasts[..]), (127, &lasts), (128, &lasts), (129, &lasts), (1000, &lasts), (20_000, &lasts[..1])]
    {
        // In order of time; whatever the last one is.
        for &last in lasts {
            let moving = |i: usize| {
                let t_scale = if i + 1 == n { last } else { random.uniform(-6.0, -4.5) as f32 };
                let at = random.vector::<2>(-0.5, 0.5);
                One {
                    motion: Some(lasting(t_scale, i as f32 / n as f32)),
                    ..ball([at[0], at[1], 4.0], 0.05, 0.5, [0.5; 3])
                }
            };
            let mut all: Vec<One> = (0..n).map(moving).collect();
            // Never seen: not finite, and too faint.
            all[n / 2].position[0] = f32::NAN;
            all[n / 3].opacity = -9.0;
            for time in [0.0, 0.25, 0.999, -3.0, 40.0] {
                let what = format!("{n} Gaussians, the last of t_scale {last}, at {time}");
                let view = View { time, time_offset: 0.0, ..camera(64, 48) };
                let splats = scene_of(&all);
                let fixture = Fixture::new(&splats, &view);
                let (gpu, group) = (&fixture.gpu, &fixture.scene.groups[0]);
                gpu.write(&fixture.cull.bits, &vec![GUARD; fixture.cull.bits.len()]).unwrap();
                gpu.write(&fixture.cull.offsets, &vec![GUARD; fixture.cull.offsets.len()]).unwrap();
                let (_, ids) = fixture.cull();
                let [x, y, z, n_live] = gpu.read(&group.live.args).unwrap()[0];
                assert_eq!([x, y, z, n_live], if n_live == 0 { [0; 4] } else { folded(n_live) }, "{what}");
                let mut live = gpu.read(&group.live.blocks).unwrap();
                live.truncate(n_live as usize);
                live.sort_unstable();

                let params = Params::<f64>::new(&splats, &view);
                let (camera, rules) = (Camera::<f64>::new(&view), Rules::<f64>::new(&Constants::default()));
                let seen = |i: &usize| visible(&params.gaussian(*i), &camera, time, [0.0, 48.0], &rules);
                let expected: Vec<u32> = (0..n).filter(|i| *i != n / 2 && seen(i)).map(|i| i as u32).collect();
                assert_same(&what, &ids, &expected);
                // Lives of f32 end within a hundredth of their length.
                let alive = |i: usize, wider: f64| {
                    let motion = all[i].motion.unwrap();
                    let is_drawn = i != n / 2 && i != n / 3 && !motion.t_scale.is_nan();
                    is_drawn && (time - f64::from(motion.t_center)).abs() <= wider * half_width(&all[i])
                };
                for block in 0..n.div_ceil(128) {
                    let members = || 128 * block..n.min(128 * block + 128);
                    let (must, may) = (members().any(|i| alive(i, 0.99)), members().any(|i| alive(i, 1.01)));
                    let first = members().map(|i| all[i].motion.unwrap()).map(|m| f64::from(m.t_center));
                    // A block may live between its members' lives.
                    let within = first.clone().any(|t| t <= time) && first.clone().any(|t| t >= time);
                    let listed = live.binary_search(&(block as u32)).is_ok();
                    assert!(listed >= must && (listed <= may || within), "{what}: block {block} {listed}");
                    let words = &gpu.read(&fixture.cull.bits).unwrap()[4 * block..4 * block + 4];
                    let marked = members().filter(|i| words[i % 128 / 32] >> (i % 32) & 1 == 1).map(|i| i as u32);
                    assert!(marked.eq(expected.iter().copied().filter(|i| *i as usize / 128 == block)), "{what}");
                }
            }
        }
    }
}

#[test]
fn a_block_lives_anew_when_its_gaussians_do() {
    let one = |t_center: f32| One {
        motion: Some(Motion { velocity: [0.0; 3], t_center, t_scale: -5.0 }),
        ..ball([0.0, 0.0, 4.0], 0.05, 0.5, [0.5; 3])
    };
    let all: Vec<One> = (0..384).map(|i| one(if i < 128 { 0.1 } else { 0.9 })).collect();
    let fixture = Fixture::new(&scene_of(&all), &View { time: 0.1, time_offset: 0.0, ..camera(64, 48) });
    assert_eq!(fixture.cull().1.len(), 128);
    // Two move, one of a block that lives and one of a block that does not: the listed blocks alone are looked at.
    let motion = fixture.scene.groups[0].params.motion.as_ref().unwrap();
    let mut moved = fixture.gpu.read(motion).unwrap();
    (moved[5][3], moved[200][3]) = (0.5, 0.1);
    fixture.gpu.write(motion, &moved).unwrap();
    let bound = |among| {
        let mut rec = Recording::new();
        let n_bad = fixture.gpu.upload("bad", &[0u32]).unwrap();
        fixture.scene.record_bounds(&mut rec, &Constants::default(), &n_bad, among);
        fixture.gpu.run(&rec).unwrap();
        fixture.cull().1.len()
    };
    assert_eq!([bound(Among::Live), bound(Among::All)], [127, 128]);
}
