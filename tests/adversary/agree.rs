//! What the numeric change does to single operations, and what it must not do to the engine.

use super::edit::{Edit, id_of};
use super::numeric::REWRITE;
use crate::common::device::rewritten;
use crate::common::random::{Random, scene, view};
use crate::common::stages::Fixture;
use ivv::Constants;
use ivv::gpu::generated::gather;
use ivv::gpu::{Grid, KernelInfo, Recording};
use ivv::scene::Splats;
use ivv::stage::{Purpose, SceneBuffers};
use ivv::twin::{Camera, Params, Rules, project, tiles_truth};
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{GlslStd450Op as GLOp, Op, Word};

/// Applies `op` to each of `xs` on the device: `gather` with one operation put between its load and its store, then rewritten.
fn applied(name: &'static str, xs: &[f32], op: impl Fn(&mut Edit, &mut Vec<Instruction>, Word) -> Word) -> Vec<f32> {
    let mut edit = Edit::of(gather::INFO.spirv);
    let (float, uint) = (edit.float(1), edit.uint(1));
    edit.rewrite(|edit, mut instruction, to| {
        if instruction.class.opcode == Op::Store {
            let x = edit.put(to, Op::Bitcast, float, &[id_of(&instruction, 1)]);
            let y = op(edit, to, x);
            let y = edit.put(to, Op::Bitcast, uint, &[y]);
            instruction.operands[1] = Operand::IdRef(y);
        }
        to.push(instruction);
    });
    let plain: &'static [u8] = edit.bytes().leak();
    let kernel: &'static KernelInfo = Box::leak(Box::new(KernelInfo { name, spirv: plain, ..*gather::INFO }));
    let gpu = rewritten(REWRITE);
    let bits: Vec<u32> = xs.iter().map(|x| x.to_bits()).collect();
    let index: Vec<u32> = (0..xs.len() as u32).collect();
    let [count, index, table] = [vec![xs.len() as u32], index, bits].map(|words| gpu.upload("words", &words).unwrap());
    let gathered = gpu.alloc::<u32>("gathered", xs.len()).unwrap();
    let mut rec = Recording::new();
    let slices = [&count, &index, &table, &gathered].map(|buffer| buffer.slice()).to_vec();
    rec.pass_untyped(kernel, slices, Vec::new(), Grid::Threads(xs.len() as u32));
    gpu.run(&rec).unwrap();
    gpu.read(&gathered).unwrap().into_iter().map(f32::from_bits).collect()
}

/// The distance between two floats of x's size.
fn ulp(x: f64) -> f64 {
    f64::from((x.abs() as f32).next_up() - x.abs() as f32)
}

#[test]
fn each_function_errs_up_to_its_bound_and_no_further() {
    type Case = (&'static str, GLOp, fn(f64) -> f64, fn(f64, f64) -> f64);
    let cases: [Case; 6] = [
        ("exp", GLOp::Exp, f64::exp, |x, y| (3.0 + 2.0 * x.abs()) * ulp(y)),
        ("exp2", GLOp::Exp2, f64::exp2, |x, y| (3.0 + 2.0 * x.abs()) * ulp(y)),
        ("log", GLOp::Log, f64::ln, |x, y| if (0.5..=2.0).contains(&x) { 2f64.powi(-21) } else { 3.0 * ulp(y) }),
        ("log2", GLOp::Log2, f64::log2, |x, y| if (0.5..=2.0).contains(&x) { 2f64.powi(-21) } else { 3.0 * ulp(y) }),
        ("sqrt", GLOp::Sqrt, f64::sqrt, |_, y| 4.5 * ulp(y)),
        ("inversesqrt", GLOp::InverseSqrt, |x| 1.0 / x.sqrt(), |_, y| 2.0 * ulp(y)),
    ];
    let mut random = Random::new(1);
    let xs: Vec<f32> = (0..4096).map(|_| random.uniform(0.01, 20.0) as f32).collect();
    for (name, function, truth, bound) in cases {
        let found = applied(name, &xs, |edit, to, x| {
            let float = edit.float(1);
            edit.put_glsl(to, function, float, &[x])
        });
        let share = |(x, y): (&f32, &f32)| {
            let (x, y) = (f64::from(*x), f64::from(*y));
            (y - truth(x)) / bound(x, truth(x))
        };
        let shares: Vec<f64> = xs.iter().zip(&found).map(share).collect();
        let [least, most] = [shares.iter().copied().fold(0.0, f64::min), shares.iter().copied().fold(0.0, f64::max)];
        // The driver errs beside: lavapipe's inversesqrt by two thirds of what Vulkan grants.
        assert!(least < -0.5 && most > 0.5, "{name}: from {least} to {most} of the bound");
        assert!(least > -1.5 && most < 1.5, "{name}: from {least} to {most} of the bound");
    }
}

#[test]
fn products_fuse_and_denormals_vanish() {
    // x^2 - 1 = 2 k 2^-12 + k^2 2^-24 for x = 1 + k 2^-12: a rounded square loses the last term.
    let xs: Vec<f32> = (1..64).map(|k| 1.0 + k as f32 * 2f32.powi(-12)).collect();
    let fused = applied("fused", &xs, |edit, to, x| {
        let (float, one) = (edit.float(1), edit.float_constant(1, 1.0));
        let square = edit.put(to, Op::FMul, float, &[x, x]);
        edit.put(to, Op::FSub, float, &[square, one])
    });
    let exact = |x: &f32| (f64::from(*x).powi(2) - 1.0) as f32;
    assert_eq!(fused, xs.iter().map(exact).collect::<Vec<_>>());
    let halves = applied("halved", &[f32::MIN_POSITIVE, 3e-38, 1.0, 0.0], |edit, to, x| {
        let (float, half) = (edit.float(1), edit.float_constant(1, 0.5));
        edit.put(to, Op::FMul, float, &[x, half])
    });
    assert_eq!(halves, [0.0, 1.5e-38, 0.5, 0.0]);
}

/// Gaussians whose topmost row lies within a few units in the last place of where a row of tiles begins, on a device as `fixture`
/// has it: moved there by what projection tells of them.
fn at_the_edges(seed: u64, n: usize) -> Splats {
    let view = view();
    let mut splats = scene(seed, n, 0);
    for _ in 0..4 {
        let fixture = fixture(&splats);
        let active = fixture.project();
        for (id, planes) in active.ids.iter().zip(&active.splats) {
            let [y, z, reach] = [planes[0][1], planes[1][3], planes[3][3]].map(f64::from);
            let top = (y - reach - 1e-3 - 1e-6 * y.abs() - 15.5) / 16.0;
            let down = 16.0 * (top.round() - top);
            let at = fixture.index_of(*id);
            splats.position[at][1] += (down * z / view.intrinsics.fy) as f32;
        }
    }
    splats
}

fn fixture(splats: &Splats) -> Fixture {
    let gpu = rewritten(REWRITE);
    let scene = SceneBuffers::upload(&gpu, splats, &Constants::default(), Purpose::Picture).unwrap();
    Fixture::with(gpu, scene, &view(), splats.len() as u32)
}

#[test]
fn no_tile_is_lost_where_counting_and_listing_round_differently() {
    let view = view();
    let (camera, rules) = (Camera::<f64>::new(&view), Rules::<f64>::new(&Constants::default()));
    let mut needed = 0;
    for seed in 0..3 {
        let splats = at_the_edges(seed, 600);
        let fixture = fixture(&splats);
        let (active, lists) = fixture.bin(&view);
        let params = Params::<f64>::new(&splats, &view);
        let time = camera.shifted_time(params.time_offset);
        let mut lost = Vec::new();
        for (at, id) in (0u32..).zip(&active.ids) {
            let Some(p) = project(&params.gaussian(fixture.index_of(*id)), &camera, time, &rules) else { continue };
            for tile in tiles_truth(&p, &rules, [view.intrinsics.width, view.intrinsics.height]) {
                let [first, last] = lists.ranges[tile as usize];
                if !lists.entries[first as usize..last as usize].contains(&at) {
                    lost.push((*id, tile));
                }
                needed += 1;
            }
        }
        let listed: u32 = lists.ranges.iter().map(|[first, last]| last - first).sum();
        let empty = lists.entries.len() - listed as usize;
        assert_eq!(lost, [], "seed {seed}: Gaussians and tiles that lost each other, {empty} slots without a tile");
    }
    assert!(needed > 2000, "only {needed} pairs are needed");
}
