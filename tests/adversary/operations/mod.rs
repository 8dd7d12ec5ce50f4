//! Each operation of an emulated subgroup against its definition, in kernels with one operation. The same kernels run as they are,
//! with the device's own subgroups, which shows that the definitions are right.

mod kernel;

use super::lanes::{LANES_32, LANES_64, emulated, is_possible};
use super::module::{assembled, load};
use crate::common::device::{gpu, rewritten};
use crate::common::random::Random;
use ivv::gpu::generated::probe_copy;
use ivv::gpu::{Gpu, Grid, KernelInfo, Recording, Rewrite};
use kernel::spirv;
use rspirv::spirv::Op;

/// Threads of a workgroup.
const LOCAL: usize = 128;
/// Workgroups: they follow each other in the same shared memory.
const GROUPS: usize = 4;
/// What a thread leaves that stores nothing.
const UNTOUCHED: u32 = 0xDEAD_BEEF;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    Shuffle,
    /// Of two floats.
    ShuffleVector,
    ShuffleXor,
    /// Three shuffles, of which each needs the one before.
    Shuffles,
    Ballot,
    Any,
    Sum,
    /// The sum over the lanes before.
    Before,
    Largest,
    /// The first lane's value, of one that is the same in all.
    First,
    /// A barrier of the subgroup, between a store to shared memory and a load of the next lane's.
    Barrier,
    BuiltIns,
}

const OPERATIONS: [Operation; 12] = [
    Operation::Shuffle,
    Operation::ShuffleVector,
    Operation::ShuffleXor,
    Operation::Shuffles,
    Operation::Ballot,
    Operation::Any,
    Operation::Sum,
    Operation::Before,
    Operation::Largest,
    Operation::First,
    Operation::Barrier,
    Operation::BuiltIns,
];

/// Where the operation is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// In a selection that only some lanes take.
    Selection,
    /// In a loop with as many laps as [`laps`] says for the subgroup. Then the workgroup meets and each thread takes another's.
    Loop,
    /// In a loop of which each thread takes a number of its own, which the emulation does not know to do.
    LoopAlone,
}

/// A thread with this bit is active.
const ACTIVE: u32 = 1;
/// The thread whose result thread `i` takes after a loop.
const TAKEN: usize = 37;

fn laps(subgroup: u32) -> u32 {
    3 * subgroup + 1
}

/// The lane that a value names.
fn named(x: u32) -> usize {
    (x >> 8 & 63) as usize
}

/// What a lane must find in a subgroup whose active lanes hold these values; none where that is undefined.
fn truth(operation: Operation, subgroup: usize, lane: usize, held: &[Option<u32>]) -> Option<u32> {
    let width = held.len();
    let shuffled = |lane: usize| *held.get(named(held[lane]?))?;
    let across = |lane: usize| lane ^ (width / 2 + 1);
    let active = || held.iter().flatten();
    Some(match operation {
        Operation::Shuffle | Operation::ShuffleVector => shuffled(lane)?,
        Operation::ShuffleXor => held[across(lane)]?,
        Operation::Shuffles => {
            let from = named(held[lane]?);
            shuffled(across(from))?.wrapping_add((*held.get(from)?)?)
        }
        Operation::Ballot => (0..width).fold(0u32, |word, lane| {
            let bit = held[lane].map_or(0, |x| x >> 16 & 1);
            word.wrapping_add((bit << (lane % 32)).wrapping_mul([1, 3][lane / 32]))
        }),
        Operation::Any => u32::from(active().any(|x| x >> 16 & 63 == 0)),
        Operation::Sum => active().fold(0, |sum, x| sum.wrapping_add(*x)),
        Operation::Before => held[..lane].iter().flatten().fold(0, |sum, x| sum.wrapping_add(*x)),
        Operation::Largest => active().copied().max()?,
        Operation::First => (LOCAL / width) as u32,
        Operation::Barrier => {
            let all: Option<Vec<u32>> = held.iter().copied().collect();
            all?[(lane + 1) % width]
        }
        Operation::BuiltIns => (width | lane << 8 | subgroup << 16 | (LOCAL / width) << 24) as u32,
    })
}

/// What the threads of a workgroup must leave.
fn truths(operation: Operation, place: Place, width: usize, values: &[u32]) -> Vec<Option<u32>> {
    let held = |subgroup: usize, lap: u32| -> Vec<Option<u32>> {
        let values = &values[subgroup * width..][..width];
        let counts = |x: u32| place == Place::Loop || x & ACTIVE != 0;
        values.iter().map(|x| counts(*x).then_some(x.wrapping_add(lap << 16))).collect()
    };
    let of = |i: usize| {
        let (subgroup, lane) = (i / width, i % width);
        let found = |lap| truth(operation, subgroup, lane, &held(subgroup, lap));
        match place {
            Place::Loop => (0..laps(subgroup as u32))
                .try_fold(0u32, |sum, lap| Some(sum.wrapping_mul(31).wrapping_add(found(lap)?))),
            _ if values[i] & ACTIVE == 0 => Some(UNTOUCHED),
            _ => found(0),
        }
    };
    match place {
        Place::Loop => (0..LOCAL).map(|i| of((i + TAKEN) % LOCAL)).collect(),
        _ => (0..LOCAL).map(of).collect(),
    }
}

/// A workgroup's values: a subgroup without an active lane, runs without one, runs with some, runs with all.
fn values(random: &mut Random, width: usize) -> Vec<u32> {
    let mut values = Vec::new();
    let mut below = |n: usize| random.bits() as usize % n;
    for subgroup in 0..LOCAL / width {
        let often: Vec<usize> = (0..width.div_ceil(4)).map(|_| [0, 0, 3, 10, 10][below(5)]).collect();
        let is_active = |lane: usize, chance: usize| match subgroup {
            0 => true,
            1 => false,
            _ => chance < often[lane / 4],
        };
        let active: Vec<bool> = (0..width).map(|lane| is_active(lane, below(10))).collect();
        let lanes: Vec<usize> = (0..width).filter(|lane| active[*lane]).collect();
        for is_active in active {
            let named = if lanes.is_empty() { below(width) } else { lanes[below(lanes.len())] };
            values.push(((below(1 << 16) << 16) | named << 8) as u32 | u32::from(is_active));
        }
    }
    values
}

/// How many numbers of a device are defined for subgroups of `width`, and how many of them are wrong.
fn compare(gpu: &Gpu, operation: Operation, place: Place, width: usize) -> [usize; 2] {
    let kernel: &'static KernelInfo = Box::leak(Box::new(KernelInfo {
        name: format!("{operation:?} in {place:?}").leak(),
        local: LOCAL as u32,
        subgroups: true,
        push_bytes: 0,
        spirv: spirv(operation, place).leak(),
        ..*probe_copy::INFO
    }));
    let mut random = Random::new(width as u64);
    let groups: Vec<Vec<u32>> = (0..GROUPS).map(|_| values(&mut random, width)).collect();
    let source = gpu.upload("source", &groups.concat()).unwrap();
    let target = gpu.upload("target", &[UNTOUCHED; GROUPS * LOCAL]).unwrap();
    let mut rec = Recording::new();
    rec.pass_untyped(kernel, vec![source.slice(), target.slice()], Vec::new(), Grid::Groups(GROUPS as u32));
    gpu.run(&rec).unwrap();
    let found = gpu.read(&target).unwrap();
    let truths = groups.iter().flat_map(|values| truths(operation, place, width, values));
    let defined: Vec<(u32, u32)> =
        found.into_iter().zip(truths).filter_map(|(found, truth)| Some((found, truth?))).collect();
    [defined.len(), defined.iter().filter(|(found, truth)| found != truth).count()]
}

#[test]
fn each_operation_is_what_its_definition_says() {
    let own = gpu().caps().subgroup_size;
    let emulated = if is_possible() { vec![LANES_32, LANES_64] } else { Vec::new() };
    for rewrite in [None].into_iter().chain(emulated.into_iter().map(Some)) {
        let gpu = rewrite.map_or_else(gpu, rewritten);
        let width = gpu.caps().subgroup_size;
        assert_eq!(width, rewrite.and_then(|rewrite| rewrite.subgroup_size).unwrap_or(own));
        for operation in OPERATIONS {
            // lavapipe of Mesa 25 gets barriers wrong that some subgroups meet and others do not. No kernel has such.
            if rewrite.is_none() && operation == Operation::Barrier {
                continue;
            }
            for place in [Place::Selection, Place::Loop] {
                let [defined, wrong] = compare(&gpu, operation, place, width as usize);
                assert!(4 * defined >= GROUPS * LOCAL, "{operation:?} in {place:?}: {defined} defined");
                assert_eq!(wrong, 0, "{operation:?} in {place:?} of subgroups of {width}, of {defined}");
            }
        }
    }
}

#[test]
fn subgroups_of_another_width_are_noticed() {
    if !is_possible() {
        return;
    }
    for (rewrite, other) in [(LANES_32, 64), (LANES_64, 32)] {
        let gpu = rewritten(rewrite);
        for operation in OPERATIONS {
            let [_, wrong] = compare(&gpu, operation, Place::Loop, other);
            assert!(wrong > 0, "{operation:?} by {:?} passes for one by {other}", rewrite.subgroup_size);
        }
    }
}

/// The emulation at 32 without the turns of its operations.
const HASTY: Rewrite = Rewrite {
    subgroup_size: Some(32),
    spirv: |kernel| {
        let mut module = load(&emulated(kernel.spirv, 32));
        let kernel = module.functions.last_mut().expect("the kernel, after what the emulation adds");
        kernel.blocks.iter_mut().for_each(|block| block.instructions.retain(|i| i.class.opcode != Op::ControlBarrier));
        assembled(&module)
    },
};

#[test]
fn an_emulation_whose_vectors_do_not_wait_is_noticed() {
    if !is_possible() {
        return;
    }
    let gpu = rewritten(HASTY);
    for operation in OPERATIONS {
        let [_, wrong] = compare(&gpu, operation, Place::Selection, 32);
        let waits = ![Operation::First, Operation::BuiltIns].contains(&operation);
        assert_eq!(wrong > 0, waits, "{operation:?}: {wrong} wrong");
    }
}

#[test]
#[should_panic(expected = "lanes of a subgroup leave a loop with subgroup operations one by one")]
fn a_loop_that_lanes_leave_one_by_one_is_refused() {
    emulated(&spirv(Operation::Sum, Place::LoopAlone), 32);
}
