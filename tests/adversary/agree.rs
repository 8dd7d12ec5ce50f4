//! What the numeric change does to single operations, and what it must not do to the engine.

use super::edit::{Edit, id_of};
use super::numeric::REWRITE;
use crate::common::device::rewritten;
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use crate::common::stages::Fixture;
use ivv::internals::gpu::generated::gather;
use ivv::internals::reference::{project, tiles_truth};
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{Decoration, GlslStd450Op as GLOp, Op, Word};

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
    if gpu().caps().kind != DeviceKind::Cpu {
        return skip("what the functions of a GPU err by themselves comes on top");
    }
    // Without a function, the reciprocal.
    type Case = (&'static str, Option<GLOp>, fn(f64) -> f64, fn(f64, f64) -> f64);
    let cases: [Case; 7] = [
        ("division", None, |x| 1.0 / x, |_, y| 2.5 * ulp(y)),
        ("exp", Some(GLOp::Exp), f64::exp, |x, y| (3.0 + 2.0 * x.abs()) * ulp(y)),
        ("exp2", Some(GLOp::Exp2), f64::exp2, |x, y| (3.0 + 2.0 * x.abs()) * ulp(y)),
        ("log", Some(GLOp::Log), f64::ln, |x, y| if (0.5..=2.0).contains(&x) { 2f64.powi(-21) } else { 3.0 * ulp(y) }),
        (
            "log2",
            Some(GLOp::Log2),
            f64::log2,
            |x, y| if (0.5..=2.0).contains(&x) { 2f64.powi(-21) } else { 3.0 * ulp(y) },
        ),
        ("sqrt", Some(GLOp::Sqrt), f64::sqrt, |_, y| 4.5 * ulp(y)),
        ("inversesqrt", Some(GLOp::InverseSqrt), |x| 1.0 / x.sqrt(), |_, y| 2.0 * ulp(y)),
    ];
    let mut random = Random::new(1);
    let xs: Vec<f32> = (0..4096).map(|_| random.uniform(0.01, 20.0) as f32).collect();
    for (name, function, truth, bound) in cases {
        let found = applied(name, &xs, |edit, to, x| {
            let (float, one) = (edit.float(1), edit.float_constant(1, 1.0));
            match function {
                Some(function) => edit.put_glsl(to, function, float, &[x]),
                None => edit.put(to, Op::FDiv, float, &[one, x]),
            }
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
fn products_fuse_unless_they_are_precise_and_denormals_vanish() {
    // x^2 - 1 = 2 k 2^-12 + k^2 2^-24 for x = 1 + k 2^-12: a rounded square loses the last term.
    let xs: Vec<f32> = (1..64).map(|k| 1.0 + k as f32 * 2f32.powi(-12)).collect();
    let fused: Vec<f32> = xs.iter().map(|x| (f64::from(*x).powi(2) - 1.0) as f32).collect();
    let rounded: Vec<f32> = xs.iter().map(|x| x * x - 1.0).collect();
    assert_ne!(fused, rounded);
    for (name, is_precise, truth) in [("fused", false, fused), ("precise", true, rounded)] {
        let found = applied(name, &xs, |edit, to, x| {
            let (float, one) = (edit.float(1), edit.float_constant(1, 1.0));
            let square = edit.put(to, Op::FMul, float, &[x, x]);
            let difference = edit.put(to, Op::FSub, float, &[square, one]);
            if is_precise {
                [square, difference].into_iter().for_each(|value| edit.make_exact(value));
            }
            difference
        });
        assert_same(name, &found, &truth);
    }
    let halves = applied("halved", &[f32::MIN_POSITIVE, 3e-38, 1.0, 0.0], |edit, to, x| {
        let (float, half) = (edit.float(1), edit.float_constant(1, 0.5));
        edit.put(to, Op::FMul, float, &[x, half])
    });
    assert_eq!(halves, [0.0, 1.5e-38, 0.5, 0.0]);
}

#[test]
fn a_quotient_by_what_is_out_of_range_is_one_by_infinity_or_zero() {
    let xs = [1e38, -1e38, 8.5e37, 3e38, 1e-38, -1e-45, 0.0];
    let found = applied("quotient", &xs, |edit, to, x| {
        let (float, one) = (edit.float(1), edit.float_constant(1, 1.0));
        edit.put(to, Op::FDiv, float, &[one, x])
    });
    let expected = [0.0f32, 0.0, 1.0 / 8.5e37, 0.0, f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY];
    for ((x, found), expected) in xs.iter().zip(found).zip(expected) {
        let near = found == expected || (found / expected - 1.0).abs() < 1e-6;
        assert!(near, "1 / {x:e} is {found:e}, not {expected:e}");
    }
}

/// Gaussians whose topmost row lies within a few units in the last place of where a row of tiles begins, on a device whose kernels are
/// `rewrite`'s: moved there by what projection tells of them.
fn at_the_edges(rewrite: Rewrite, seed: u64, n: usize) -> Splats {
    let view = view();
    let mut splats = scene(seed, n, 0);
    for _ in 0..4 {
        let fixture = fixture(rewrite, &splats);
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

fn fixture(rewrite: Rewrite, splats: &Splats) -> Fixture {
    let gpu = rewritten(rewrite);
    let scene = SceneBuffers::upload(&gpu, splats, &Constants::default(), Purpose::Picture).unwrap();
    Fixture::with(gpu, scene, &view(), splats.len() as u32)
}

/// Of the pairs of a Gaussian and a tile that it shows in, those that are not listed, and how many there are.
fn lost(rewrite: Rewrite, seed: u64) -> (Vec<(u32, u32)>, usize) {
    let view = view();
    let (camera, rules) = (Camera::<f64>::new(&view), Rules::<f64>::new(&Constants::default()));
    let splats = at_the_edges(rewrite, seed, 600);
    let fixture = fixture(rewrite, &splats);
    let (active, lists) = fixture.bin(&view);
    let params = Params::<f64>::new(&splats, &view);
    let time = camera.shifted_time(params.time_offset);
    let (mut lost, mut needed) = (Vec::new(), 0);
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
    (lost, needed)
}

/// The kernel as it was before counting and listing agreed: nothing `precise`, and the margin of the one that lists is the other's.
/// Rounded in one of many ways.
fn careless<const WAY: u32>(kernel: &KernelInfo) -> Vec<u8> {
    let mut edit = Edit::of(kernel.spirv);
    edit.module.annotations.retain(|i| i.operands.get(1) != Some(&Operand::Decoration(Decoration::NoContraction)));
    for factor in [1.0 - 2.5e-6f32, 1.0 + 4e-6f32] {
        for constant in &mut edit.module.types_global_values {
            if constant.operands == [Operand::LiteralBit32(factor.to_bits())] {
                constant.operands = vec![Operand::LiteralBit32(1f32.to_bits())];
            }
        }
    }
    // The roundings follow from the name.
    let name = format!("{}, way {WAY}", kernel.name).leak();
    (REWRITE.spirv)(&KernelInfo { name, spirv: edit.bytes().leak(), ..*kernel })
}

#[test]
fn no_tile_is_lost_where_counting_and_listing_round_differently() {
    for seed in 0..2 {
        let (lost, needed) = lost(REWRITE, seed);
        assert_eq!(lost, [], "seed {seed}: Gaussians and tiles that lost each other");
        assert!(needed > 500, "only {needed} pairs are needed");
    }
    let ways = [careless::<0>, careless::<1>, careless::<2>, careless::<3>, careless::<4>, careless::<5>];
    let shows = |spirv| !lost(Rewrite { subgroup_size: None, spirv }, 0).0.is_empty();
    assert!(ways.into_iter().any(shows), "the fault that this looks for does not show");
}
