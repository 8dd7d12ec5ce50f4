//! Work in another order: workgroups renumbered, so that a device which runs them by their numbers runs them otherwise, and (by
//! `Options::reversed`) passes that no barrier parts last to first. What claims the same bits in every run must not notice.

use super::edit::{Edit, hash, id_of};
use crate::common::device::{opened, options};
use crate::common::prelude::*;
use crate::common::random::{scene, view};
use ivv::internals::gpu::generated::gather;
use ivv::internals::gpu::kernel::{Access, BindingInfo};
use ivv::internals::gpu::{Buf, Options};
use ivv::internals::synth::Options as Synthesis;
use ivv::internals::train::Priors;
use ivv_conformance::adjoint::cotangents;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{BuiltIn, Op, StorageClass, Word};

pub const REWRITE: Rewrite = Rewrite { subgroup_size: None, spirv: |kernel| renumbered(kernel) };

/// What becomes of the order of workgroups.
#[derive(Clone, Copy, Debug)]
enum Order {
    Reversed,
    EvenFirst,
    Halved,
}

impl Order {
    fn of(kernel: &KernelInfo) -> Order {
        [Order::Reversed, Order::EvenFirst, Order::Halved][hash(kernel.name) as usize % 3]
    }

    /// The new number of workgroup `i` of `n`.
    fn number(self, i: u32, n: u32) -> u32 {
        let half = n.div_ceil(2);
        match self {
            Order::Reversed => n - 1 - i,
            Order::EvenFirst if i < half => 2 * i,
            Order::EvenFirst => 2 * (i - half) + 1,
            Order::Halved => (i + half) % n,
        }
    }

    /// As [`Order::number`], on the device.
    fn put(self, edit: &mut Edit, to: &mut Vec<Instruction>, [i, n]: [Word; 2]) -> Word {
        let (uint, boolean, one) = (edit.uint(1), edit.boolean(1), edit.uint_constant(1, 1));
        let more = edit.put(to, Op::IAdd, uint, &[n, one]);
        let half = edit.put(to, Op::ShiftRightLogical, uint, &[more, one]);
        match self {
            Order::Reversed => {
                let last = edit.put(to, Op::ISub, uint, &[n, one]);
                edit.put(to, Op::ISub, uint, &[last, i])
            }
            Order::EvenFirst => {
                let even = edit.put(to, Op::ShiftLeftLogical, uint, &[i, one]);
                let above = edit.put(to, Op::ISub, uint, &[i, half]);
                let odd = edit.put(to, Op::ShiftLeftLogical, uint, &[above, one]);
                let odd = edit.put(to, Op::IAdd, uint, &[odd, one]);
                let is_even = edit.put(to, Op::ULessThan, boolean, &[i, half]);
                edit.put(to, Op::Select, uint, &[is_even, even, odd])
            }
            Order::Halved => {
                let sum = edit.put(to, Op::IAdd, uint, &[i, half]);
                edit.put(to, Op::UMod, uint, &[sum, n])
            }
        }
    }
}

/// The kernel's SPIR-V with other numbers for its workgroups; as it is where it asks for none.
fn renumbered(kernel: &KernelInfo) -> Vec<u8> {
    let mut edit = Edit::of(kernel.spirv);
    let Some(given) = edit.built_in(BuiltIn::WorkgroupId) else { return kernel.spirv.to_vec() };
    let counts = edit.built_in(BuiltIn::NumWorkgroups).expect("include/grid.glsl uses both");
    let (uint, vector) = (edit.uint(1), edit.uint(3));
    let (renumbered, part) = (edit.private(vector), edit.pointer(StorageClass::Private, uint));
    edit.rewrite(|_, mut instruction, to| {
        if instruction.operands.first() == Some(&Operand::IdRef(given)) {
            instruction.operands[0] = Operand::IdRef(renumbered);
            if instruction.class.opcode == Op::AccessChain {
                instruction.result_type = Some(part);
            }
        }
        to.push(instruction);
    });
    let mut to = Vec::new();
    let [given, counts] = [given, counts].map(|variable| edit.put(&mut to, Op::Load, vector, &[variable]));
    let mut component = |edit: &mut Edit, of, k| {
        edit.put_raw(&mut to, Op::CompositeExtract, uint, vec![Operand::IdRef(of), Operand::LiteralBit32(k)])
    };
    let [x, y, z] = [0, 1, 2].map(|k| component(&mut edit, given, k));
    let [width, height] = [0, 1].map(|k| component(&mut edit, counts, k));
    let n = edit.put(&mut to, Op::IMul, uint, &[width, height]);
    let row = edit.put(&mut to, Op::IMul, uint, &[y, width]);
    let i = edit.put(&mut to, Op::IAdd, uint, &[row, x]);
    let number = Order::of(kernel).put(&mut edit, &mut to, [i, n]);
    let [x, y] = [Op::UMod, Op::UDiv].map(|op| edit.put(&mut to, op, uint, &[number, width]));
    let moved = edit.put(&mut to, Op::CompositeConstruct, vector, &[x, y, z]);
    let operands = [renumbered, moved].map(Operand::IdRef).to_vec();
    to.push(Instruction::new(Op::Store, None, None, operands));
    edit.begin_with(to);
    edit.bytes()
}

fn reordered() -> Watched {
    opened(&Options { rewrite: Some(REWRITE), reversed: true, ..options() })
}

/// A device that does everything in the usual order, in this lane too.
fn ordered() -> Watched {
    opened(&Options { rewrite: None, reversed: false, ..options() })
}

#[test]
fn workgroups_have_each_number_once_and_most_another() {
    for order in [Order::Reversed, Order::EvenFirst, Order::Halved] {
        for n in 1..200 {
            let mut numbers: Vec<u32> = (0..n).map(|i| order.number(i, n)).collect();
            let kept = (0..n).filter(|i| numbers[*i as usize] == *i).count();
            assert!(n < 4 || 2 * kept <= n as usize, "{order:?} keeps {kept} of {n} in their places");
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..n), "{order:?} of {n}");
        }
    }
}

/// `gather` under another name, which stores the number that the device gave the workgroup, and stores it where the number that the
/// workgroup takes itself for says.
fn telling(name: &'static str) -> Vec<u8> {
    let renumbered = renumbered(&KernelInfo { name, ..*gather::INFO });
    let mut edit = Edit::of(&renumbered);
    let given = edit.built_in(BuiltIn::WorkgroupId).expect("gather has many workgroups");
    let counts = edit.built_in(BuiltIn::NumWorkgroups).expect("gather has many workgroups");
    let (uint, vector) = (edit.uint(1), edit.uint(3));
    edit.rewrite(|edit, mut instruction, to| {
        let is_result = |edit: &Edit| edit.type_of(id_of(&instruction, 1)) == uint;
        if instruction.class.opcode == Op::Store && is_result(edit) {
            let [given, counts] = [given, counts].map(|variable| edit.put(to, Op::Load, vector, &[variable]));
            let mut component = |of, k| {
                let operands = vec![Operand::IdRef(of), Operand::LiteralBit32(k)];
                edit.put_raw(to, Op::CompositeExtract, uint, operands)
            };
            let [x, y, width] = [component(given, 0), component(given, 1), component(counts, 0)];
            let row = edit.put(to, Op::IMul, uint, &[y, width]);
            let i = edit.put(to, Op::IAdd, uint, &[row, x]);
            instruction.operands[1] = Operand::IdRef(i);
        }
        to.push(instruction);
    });
    edit.bytes()
}

#[test]
fn the_device_renumbers_as_the_host_does_in_two_dimensions_too() {
    // Three names with an order each.
    for name in ["one", "two", "six"] {
        let kernel: &'static KernelInfo =
            Box::leak(Box::new(KernelInfo { name, spirv: telling(name).leak(), ..*gather::INFO }));
        let gpu = ordered();
        for groups in [1, 7, 70_000] {
            let n = 64 * groups;
            let count = gpu.upload("count", &[n]).unwrap();
            let zeros = gpu.upload("zeros", &vec![0u32; n as usize]).unwrap();
            let told = gpu.alloc::<u32>("told", n as usize).unwrap();
            let mut rec = Recording::new();
            let slices = [&count, &zeros, &zeros, &told].map(Buf::slice).to_vec();
            rec.pass_untyped(kernel, slices, Vec::new(), Grid::Groups(groups));
            gpu.run(&rec).unwrap();
            // Past the limit the grid has padding in its last row.
            let all = if groups > 65_535 { 2 * 65_535 } else { groups };
            let told = gpu.read(&told).unwrap();
            for given in 0..all {
                let number = Order::of(kernel).number(given, all);
                if number < groups {
                    assert_eq!(told[64 * number as usize], given, "{name}, {groups} workgroups");
                }
            }
        }
    }
}

#[test]
fn a_barrier_that_is_missing_shows() {
    if options().device.sync_validation {
        return skip("the layer would speak of the barrier that is missing");
    }
    // It says that it reads what it writes.
    let read_only = |binding: &BindingInfo| BindingInfo { access: Access::Read, ..*binding };
    let bindings: Vec<BindingInfo> = gather::INFO.bindings.iter().map(read_only).collect();
    let liar: &'static KernelInfo = Box::leak(Box::new(KernelInfo { bindings: bindings.leak(), ..*gather::INFO }));
    let sum = |gpu: &Watched, kernel: &'static KernelInfo| {
        let [count, index, table] =
            [vec![3u32], vec![2, 0, 1], vec![10, 20, 30]].map(|words| gpu.upload("words", &words).unwrap());
        let [once, twice] = ["once", "twice"].map(|name| gpu.upload(name, &[0u32, 0, 0]).unwrap());
        let mut rec = Recording::new();
        for (from, to) in [(&table, &once), (&once, &twice)] {
            let slices = [&count, &index, from, to].map(Buf::slice).to_vec();
            rec.pass_untyped(kernel, slices, Vec::new(), Grid::Threads(3));
        }
        gpu.run(&rec).unwrap();
        gpu.read(&twice).unwrap()
    };
    assert_eq!(sum(&reordered(), gather::INFO), [20, 30, 10]);
    assert_eq!(sum(&reordered(), liar), [0, 0, 0]);
}

fn gradient(gpu: &Watched, mode: Sums) -> (Frame, Gradients) {
    let (splats, view) = (scene(9, 2000, 1), view());
    let mut renderer = Renderer::new((*gpu).clone(), &splats, Constants::default()).unwrap();
    renderer.accumulate(mode).unwrap();
    let (frame, _) = renderer.render(&view, Outputs::All).unwrap();
    let (found, report) = renderer.vjp(&view, &cotangents(3, &view, |_| false)).unwrap();
    assert!(report.intersections > 2000);
    (frame, found)
}

#[test]
fn pictures_and_gradients_have_the_same_bits_in_another_order_where_they_claim_so() {
    for mode in Sums::ALL.into_iter().filter(|mode| mode.check(ordered().caps()).is_ok()) {
        let [usual, other] = [ordered, reordered].map(|device| gradient(&device(), mode));
        assert_same_frame(format_args!("{mode:?}"), &other.0, &usual.0);
        assert_same_gradients(format_args!("{mode:?}"), &other.1, &usual.1);
    }
}

#[test]
fn training_has_the_same_bits_in_another_order() {
    let folder = Folder::new("order");
    write_capture(&folder.0, &Synthesis { frames: 4, ..Preset::Tiny.options(7) }, 2, &mut |_, _| {}).unwrap();
    let capture = Capture::open(&folder.0).unwrap();
    let train = |device: Watched| {
        let config = Config { sh_degree: 1, init_points: 300, ..exact() };
        let options = SessionOptions {
            total: Some(24),
            world: Some(Similarity::default()),
            priors: Some(Priors::default()),
            ..SessionOptions::default()
        };
        let mut session = Session::begin((*device).clone(), &capture, config, options).unwrap();
        while session.step().unwrap() {}
        session.finish().unwrap()
    };
    let [usual, other] = [ordered, reordered].map(|device| train(device()));
    assert!(usual.len() > 300, "none were added");
    assert_same_splats("training", &other, &usual);
}
