//! Each operation of an emulated subgroup against its definition, in kernels with one operation. The same kernels run as they are,
//! with the device's own subgroups, which shows that the definitions are right.

use super::lanes::{LANES_32, LANES_64, emulated, is_possible};
use super::module::{assembled, load};
use crate::common::device::{gpu, rewritten};
use crate::common::random::Random;
use ivv::gpu::generated::probe_copy;
use ivv::gpu::{Gpu, Grid, KernelInfo, Recording, Rewrite};
use rspirv::dr::{Builder, InsertPoint, Instruction, Operand};
use rspirv::spirv::{AddressingModel, BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, FunctionControl};
use rspirv::spirv::{GroupOperation, LoopControl, MemoryModel, Op, Scope, SelectionControl, StorageClass, Word};

/// Threads of a workgroup.
const LOCAL: usize = 128;
/// Workgroups: they follow each other in the same shared memory.
const GROUPS: usize = 4;
/// What a thread leaves that stores nothing.
const UNTOUCHED: u32 = 0xDEAD_BEEF;
/// Of a barrier: acquire, release, workgroup memory.
const SEMANTICS: u32 = 0x108;

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

/// A kernel while it is written.
struct Writer {
    b: Builder,
    uint: Word,
    boolean: Word,
    /// The subgroup, as a scope.
    scope: Word,
}

impl Writer {
    fn put(&mut self, op: Op, of: Option<Word>, operands: Vec<Operand>) -> Word {
        let result = self.b.id();
        let made = Instruction::new(op, of, of.map(|_| result), operands);
        self.b.insert_into_block(InsertPoint::End, made).expect("an open block");
        result
    }

    fn word(&mut self, op: Op, operands: &[Word]) -> Word {
        let (of, operands) = (self.uint, operands.iter().copied().map(Operand::IdRef).collect());
        self.put(op, Some(of), operands)
    }

    fn truth(&mut self, op: Op, operands: &[Word]) -> Word {
        let (of, operands) = (self.boolean, operands.iter().copied().map(Operand::IdRef).collect());
        self.put(op, Some(of), operands)
    }

    /// An operation of the subgroup.
    fn group(&mut self, op: Op, of: Word, fold: Option<GroupOperation>, operands: &[Word]) -> Word {
        let scope = [Operand::IdScope(self.scope)].into_iter();
        let rest = operands.iter().copied().map(Operand::IdRef);
        self.put(op, Some(of), scope.chain(fold.map(Operand::GroupOperation)).chain(rest).collect())
    }

    fn number(&mut self, n: u32) -> Word {
        self.b.constant_bit32(self.uint, n)
    }

    /// `x >> shift & mask`.
    fn bits(&mut self, x: Word, shift: u32, mask: u32) -> Word {
        let [shift, mask] = [shift, mask].map(|n| self.number(n));
        let x = self.word(Op::ShiftRightLogical, &[x, shift]);
        self.word(Op::BitwiseAnd, &[x, mask])
    }

    fn at(&mut self, class: StorageClass, base: Word, indices: &[Word]) -> Word {
        let pointer = self.b.type_pointer(None, class, self.uint);
        let operands = std::iter::once(&base).chain(indices).copied().map(Operand::IdRef).collect();
        self.put(Op::AccessChain, Some(pointer), operands)
    }

    fn store(&mut self, pointer: Word, value: Word) {
        self.b.store(pointer, value, None, []).expect("an open block");
    }

    fn barrier(&mut self, scope: Scope) {
        let [scope, semantics] = [scope as u32, SEMANTICS].map(|n| self.number(n));
        self.b.control_barrier(scope, scope, semantics).expect("an open block");
    }

    fn branch(&mut self, to: Word) {
        self.b.branch(to).expect("an open block");
    }

    fn begin(&mut self, label: Word) {
        self.b.begin_block(Some(label)).expect("no open block");
    }

    fn input(&mut self, built_in: BuiltIn, of: Word) -> Word {
        let pointer = self.b.type_pointer(None, StorageClass::Input, of);
        let variable = self.b.variable(pointer, None, StorageClass::Input, None);
        self.b.decorate(variable, Decoration::BuiltIn, [Operand::BuiltIn(built_in)]);
        variable
    }

    /// A buffer of words.
    fn buffer(&mut self, block: Word, binding: u32) -> Word {
        let pointer = self.b.type_pointer(None, StorageClass::StorageBuffer, block);
        let variable = self.b.variable(pointer, None, StorageClass::StorageBuffer, None);
        for (decoration, n) in [(Decoration::DescriptorSet, 0), (Decoration::Binding, binding)] {
            self.b.decorate(variable, decoration, [Operand::LiteralBit32(n)]);
        }
        variable
    }

    fn operation(&mut self, operation: Operation, seen: &Seen, x: Word) -> Word {
        let (uint, one) = (self.uint, self.number(1));
        match operation {
            Operation::Shuffle => {
                let from = self.bits(x, 8, 63);
                self.group(Op::GroupNonUniformShuffle, uint, None, &[x, from])
            }
            Operation::ShuffleVector => {
                let from = self.bits(x, 8, 63);
                let float = self.b.type_float(32, None);
                let vector = self.b.type_vector(float, 2);
                let halves = [(x, 16), (x, 0)].map(|(x, shift)| {
                    let half = self.bits(x, shift, 0xFFFF);
                    Operand::IdRef(self.put(Op::ConvertUToF, Some(float), vec![Operand::IdRef(half)]))
                });
                let both = self.put(Op::CompositeConstruct, Some(vector), halves.to_vec());
                let both = self.group(Op::GroupNonUniformShuffle, vector, None, &[both, from]);
                let [high, low] = [0, 1].map(|k| {
                    let part = vec![Operand::IdRef(both), Operand::LiteralBit32(k)];
                    let half = self.put(Op::CompositeExtract, Some(float), part);
                    self.word(Op::ConvertFToU, &[half])
                });
                let sixteen = self.number(16);
                let high = self.word(Op::ShiftLeftLogical, &[high, sixteen]);
                self.word(Op::BitwiseOr, &[high, low])
            }
            Operation::ShuffleXor => self.group(Op::GroupNonUniformShuffleXor, uint, None, &[x, seen.across]),
            Operation::Shuffles => {
                let from = self.bits(x, 8, 63);
                let first = self.group(Op::GroupNonUniformShuffle, uint, None, &[x, from]);
                let second = self.group(Op::GroupNonUniformShuffleXor, uint, None, &[first, seen.across]);
                let sum = self.word(Op::IAdd, &[second, x]);
                self.group(Op::GroupNonUniformShuffle, uint, None, &[sum, from])
            }
            Operation::Ballot => {
                let bit = self.bits(x, 16, 1);
                let yes = self.truth(Op::IEqual, &[bit, one]);
                let words = self.b.type_vector(uint, 4);
                let ballot = self.group(Op::GroupNonUniformBallot, words, None, &[yes]);
                let mut sum = self.number(0);
                for (k, weight) in [1, 3, 5, 7].into_iter().enumerate() {
                    let part = vec![Operand::IdRef(ballot), Operand::LiteralBit32(k as u32)];
                    let word = self.put(Op::CompositeExtract, Some(uint), part);
                    let weight = self.number(weight);
                    let word = self.word(Op::IMul, &[word, weight]);
                    sum = self.word(Op::IAdd, &[sum, word]);
                }
                sum
            }
            Operation::Any => {
                let (bits, zero) = (self.bits(x, 16, 63), self.number(0));
                let yes = self.truth(Op::IEqual, &[bits, zero]);
                let any = self.group(Op::GroupNonUniformAny, self.boolean, None, &[yes]);
                self.word(Op::Select, &[any, one, zero])
            }
            Operation::Sum => self.group(Op::GroupNonUniformIAdd, uint, Some(GroupOperation::Reduce), &[x]),
            Operation::Before => self.group(Op::GroupNonUniformIAdd, uint, Some(GroupOperation::ExclusiveScan), &[x]),
            Operation::Largest => self.group(Op::GroupNonUniformUMax, uint, Some(GroupOperation::Reduce), &[x]),
            Operation::First => self.group(Op::GroupNonUniformBroadcastFirst, uint, None, &[seen.subgroups]),
            Operation::Barrier => {
                let own = self.at(StorageClass::Workgroup, seen.shared, &[seen.index]);
                self.store(own, x);
                self.barrier(Scope::Subgroup);
                let first = self.word(Op::ISub, &[seen.index, seen.lane]);
                let next = self.word(Op::IAdd, &[seen.lane, one]);
                let next = self.word(Op::UMod, &[next, seen.size]);
                let next = self.word(Op::IAdd, &[first, next]);
                let next = self.at(StorageClass::Workgroup, seen.shared, &[next]);
                let found = self.word(Op::Load, &[next]);
                self.barrier(Scope::Subgroup);
                found
            }
            Operation::BuiltIns => {
                let parts = [(seen.lane, 8), (seen.subgroup, 16), (seen.subgroups, 24)];
                parts.into_iter().fold(seen.size, |word, (part, shift)| {
                    let shift = self.number(shift);
                    let part = self.word(Op::ShiftLeftLogical, &[part, shift]);
                    self.word(Op::BitwiseOr, &[word, part])
                })
            }
        }
    }
}

/// What a thread of the kernel knows.
struct Seen {
    /// Index in the workgroup.
    index: Word,
    lane: Word,
    subgroup: Word,
    size: Word,
    subgroups: Word,
    /// What a lane's number is combined with to give that across.
    across: Word,
    /// A word of shared memory for each thread.
    shared: Word,
}

/// The kernel with one operation: `source` to `target`, a word for each thread.
fn spirv(operation: Operation, place: Place) -> Vec<u8> {
    let mut b = Builder::new();
    b.set_version(1, 3);
    for capability in [
        Capability::Shader,
        Capability::GroupNonUniform,
        Capability::GroupNonUniformVote,
        Capability::GroupNonUniformBallot,
        Capability::GroupNonUniformShuffle,
        Capability::GroupNonUniformArithmetic,
    ] {
        b.capability(capability);
    }
    b.memory_model(AddressingModel::Logical, MemoryModel::GLSL450);
    let (void, uint, boolean) = (b.type_void(), b.type_int(32, 0), b.type_bool());
    let scope = b.constant_bit32(uint, Scope::Subgroup as u32);
    let mut w = Writer { b, uint, boolean, scope };
    let (zero, local) = (w.number(0), w.number(LOCAL as u32));

    let words = w.b.type_runtime_array(uint);
    w.b.decorate(words, Decoration::ArrayStride, [Operand::LiteralBit32(4)]);
    let block = w.b.type_struct([words]);
    w.b.decorate(block, Decoration::Block, []);
    w.b.member_decorate(block, 0, Decoration::Offset, [Operand::LiteralBit32(0)]);
    let [source, target] = [0, 1].map(|binding| w.buffer(block, binding));
    let array = w.b.type_array(uint, local);
    let pointer = w.b.type_pointer(None, StorageClass::Workgroup, array);
    let shared = w.b.variable(pointer, None, StorageClass::Workgroup, None);
    let triple = w.b.type_vector(uint, 3);
    let group = w.input(BuiltIn::WorkgroupId, triple);
    let inputs = [
        BuiltIn::LocalInvocationIndex,
        BuiltIn::SubgroupLocalInvocationId,
        BuiltIn::SubgroupId,
        BuiltIn::SubgroupSize,
        BuiltIn::NumSubgroups,
    ]
    .map(|built_in| w.input(built_in, uint));

    let kind = w.b.type_function(void, []);
    let main = w.b.begin_function(void, None, FunctionControl::NONE, kind).expect("a function");
    let entry = w.b.id();
    w.begin(entry);
    let [index, lane, subgroup, size, subgroups] = inputs.map(|input| w.word(Op::Load, &[input]));
    let one = w.number(1);
    let half = w.word(Op::ShiftRightLogical, &[size, one]);
    let across = w.word(Op::IAdd, &[half, one]);
    let seen = Seen { index, lane, subgroup, size, subgroups, across, shared };
    let group_index = w.at(StorageClass::Input, group, &[zero]);
    let group_index = w.word(Op::Load, &[group_index]);
    let first = w.word(Op::IMul, &[group_index, local]);
    let i = w.word(Op::IAdd, &[first, index]);
    let from = w.at(StorageClass::StorageBuffer, source, &[zero, i]);
    let x = w.word(Op::Load, &[from]);
    let to = w.at(StorageClass::StorageBuffer, target, &[zero, i]);
    let end = w.b.id();
    if place == Place::Selection {
        let active = w.bits(x, 0, ACTIVE);
        let active = w.truth(Op::IEqual, &[active, one]);
        let then = w.b.id();
        w.b.selection_merge(end, SelectionControl::NONE).expect("an open block");
        w.b.branch_conditional(active, then, end, []).expect("an open block");
        w.begin(then);
        let found = w.operation(operation, &seen, x);
        w.store(to, found);
        w.branch(end);
        w.begin(end);
    } else {
        let three = w.number(3);
        let factor = if place == Place::Loop { subgroup } else { lane };
        let laps = w.word(Op::IMul, &[factor, three]);
        let laps = w.word(Op::IAdd, &[laps, one]);
        let [head, test, body, next, sum, lap, new_sum, new_lap] = std::array::from_fn(|_| w.b.id());
        w.branch(head);
        w.begin(head);
        w.b.phi(uint, Some(sum), [(zero, entry), (new_sum, next)]).expect("an open block");
        w.b.phi(uint, Some(lap), [(zero, entry), (new_lap, next)]).expect("an open block");
        w.b.loop_merge(end, next, LoopControl::NONE, []).expect("an open block");
        w.branch(test);
        w.begin(test);
        let goes_on = w.truth(Op::ULessThan, &[lap, laps]);
        w.b.branch_conditional(goes_on, body, end, []).expect("an open block");
        w.begin(body);
        let [sixteen, weight, taken] = [16, 31, TAKEN as u32].map(|n| w.number(n));
        let step = w.word(Op::ShiftLeftLogical, &[lap, sixteen]);
        let x = w.word(Op::IAdd, &[x, step]);
        let found = w.operation(operation, &seen, x);
        let weighted = w.word(Op::IMul, &[sum, weight]);
        w.b.i_add(uint, Some(new_sum), weighted, found).expect("an open block");
        w.branch(next);
        w.begin(next);
        w.b.i_add(uint, Some(new_lap), lap, one).expect("an open block");
        w.branch(head);
        w.begin(end);
        w.barrier(Scope::Workgroup);
        let own = w.at(StorageClass::Workgroup, shared, &[index]);
        w.store(own, sum);
        w.barrier(Scope::Workgroup);
        let other = w.word(Op::IAdd, &[index, taken]);
        let other = w.word(Op::UMod, &[other, local]);
        let other = w.at(StorageClass::Workgroup, shared, &[other]);
        let found = w.word(Op::Load, &[other]);
        w.store(to, found);
    }
    w.b.ret().expect("an open block");
    w.b.end_function().expect("a function");
    w.b.entry_point(ExecutionModel::GLCompute, main, "main", [&[group], &inputs[..]].concat());
    w.b.execution_mode(main, ExecutionMode::LocalSize, [LOCAL as u32, 1, 1]);
    assembled(&w.b.module())
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
