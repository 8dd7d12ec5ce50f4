//! A kernel with one operation.

use super::super::module::assembled;
use super::{ACTIVE, LOCAL, Operation, Place, TAKEN};
use rspirv::dr::{Builder, InsertPoint, Instruction, Operand};
use rspirv::spirv::{AddressingModel, BuiltIn, Capability, Decoration, ExecutionMode, ExecutionModel, FunctionControl};
use rspirv::spirv::{GroupOperation, LoopControl, MemoryModel, Op, Scope, SelectionControl, StorageClass, Word};

/// Of a barrier: acquire, release, workgroup memory.
const SEMANTICS: u32 = 0x108;

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

    /// A shuffle of the two halves of `x` as a vector of floats.
    fn shuffle_vector(&mut self, x: Word) -> Word {
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

    /// A sum of the four words of a ballot on bit 16, each with a weight of its own.
    fn ballot(&mut self, x: Word) -> Word {
        let (uint, one) = (self.uint, self.number(1));
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

    fn operation(&mut self, operation: Operation, seen: &Seen, x: Word) -> Word {
        let (uint, one) = (self.uint, self.number(1));
        match operation {
            Operation::Shuffle => {
                let from = self.bits(x, 8, 63);
                self.group(Op::GroupNonUniformShuffle, uint, None, &[x, from])
            }
            Operation::ShuffleVector => self.shuffle_vector(x),
            Operation::ShuffleXor => self.group(Op::GroupNonUniformShuffleXor, uint, None, &[x, seen.across]),
            Operation::Shuffles => {
                let from = self.bits(x, 8, 63);
                let first = self.group(Op::GroupNonUniformShuffle, uint, None, &[x, from]);
                let second = self.group(Op::GroupNonUniformShuffleXor, uint, None, &[first, seen.across]);
                let sum = self.word(Op::IAdd, &[second, x]);
                self.group(Op::GroupNonUniformShuffle, uint, None, &[sum, from])
            }
            Operation::Ballot => self.ballot(x),
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

    /// The operation under an `if`.
    fn in_selection(&mut self, operation: Operation, seen: &Seen, site: &Site) {
        let (one, end) = (self.number(1), self.b.id());
        let active = self.bits(site.x, 0, ACTIVE);
        let active = self.truth(Op::IEqual, &[active, one]);
        let then = self.b.id();
        self.b.selection_merge(end, SelectionControl::NONE).expect("an open block");
        self.b.branch_conditional(active, then, end, []).expect("an open block");
        self.begin(then);
        let found = self.operation(operation, seen, site.x);
        self.store(site.to, found);
        self.branch(end);
        self.begin(end);
    }

    /// The operation in a loop, whose sum then goes to another thread.
    fn in_loop(&mut self, operation: Operation, seen: &Seen, site: &Site, place: Place) {
        let (uint, one, local, end) = (self.uint, self.number(1), self.number(LOCAL as u32), self.b.id());
        let three = self.number(3);
        let factor = if place == Place::Loop { seen.subgroup } else { seen.lane };
        let laps = self.word(Op::IMul, &[factor, three]);
        let laps = self.word(Op::IAdd, &[laps, one]);
        let [head, test, body, next, sum, lap, new_sum, new_lap] = std::array::from_fn(|_| self.b.id());
        self.branch(head);
        self.begin(head);
        self.b.phi(uint, Some(sum), [(site.zero, site.entry), (new_sum, next)]).expect("an open block");
        self.b.phi(uint, Some(lap), [(site.zero, site.entry), (new_lap, next)]).expect("an open block");
        self.b.loop_merge(end, next, LoopControl::NONE, []).expect("an open block");
        self.branch(test);
        self.begin(test);
        let goes_on = self.truth(Op::ULessThan, &[lap, laps]);
        self.b.branch_conditional(goes_on, body, end, []).expect("an open block");
        self.begin(body);
        let [sixteen, weight, taken] = [16, 31, TAKEN as u32].map(|n| self.number(n));
        let step = self.word(Op::ShiftLeftLogical, &[lap, sixteen]);
        let x = self.word(Op::IAdd, &[site.x, step]);
        let found = self.operation(operation, seen, x);
        let weighted = self.word(Op::IMul, &[sum, weight]);
        self.b.i_add(uint, Some(new_sum), weighted, found).expect("an open block");
        self.branch(next);
        self.begin(next);
        self.b.i_add(uint, Some(new_lap), lap, one).expect("an open block");
        self.branch(head);
        self.begin(end);
        self.barrier(Scope::Workgroup);
        let own = self.at(StorageClass::Workgroup, seen.shared, &[seen.index]);
        self.store(own, sum);
        self.barrier(Scope::Workgroup);
        let other = self.word(Op::IAdd, &[seen.index, taken]);
        let other = self.word(Op::UMod, &[other, local]);
        let other = self.at(StorageClass::Workgroup, seen.shared, &[other]);
        let found = self.word(Op::Load, &[other]);
        self.store(site.to, found);
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

/// Where the operation stands in the kernel.
struct Site {
    /// Label of the first block.
    entry: Word,
    zero: Word,
    /// The thread's word of the source.
    x: Word,
    /// Pointer to its word of the target.
    to: Word,
}

/// The kernel with one operation: `source` to `target`, a word for each thread.
pub(super) fn spirv(operation: Operation, place: Place) -> Vec<u8> {
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
    let site = Site { entry, zero, x, to };
    if place == Place::Selection {
        w.in_selection(operation, &seen, &site);
    } else {
        w.in_loop(operation, &seen, &site, place);
    }
    w.b.ret().expect("an open block");
    w.b.end_function().expect("a function");
    w.b.entry_point(ExecutionModel::GLCompute, main, "main", [&[group], &inputs[..]].concat());
    w.b.execution_mode(main, ExecutionMode::LocalSize, [LOCAL as u32, 1, 1]);
    assembled(&w.b.module())
}
