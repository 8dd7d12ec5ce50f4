//! The kernel around the given one, at whose end all threads of a workgroup wait for each other.

use super::Emulation;
use rspirv::dr::{Block, Function, Instruction, Operand};
use rspirv::spirv::{FunctionControl, LoopControl, Op, Word};

/// Turns that a thread waits between two looks at the others: lavapipe ends an invocation's loops after 65,535 iterations in
/// all, and another subgroup may take more turns.
const TURNS: u32 = 16;

impl Emulation {
    pub(super) fn meet(&mut self) {
        let nothing = self.b.type_void();
        self.emit(Op::FunctionCall, nothing, &[self.rendezvous]);
    }

    /// Appends a function without arguments, of blocks with their labels.
    pub(super) fn function(&mut self, result: Word, blocks: Vec<(Word, Vec<Instruction>)>) {
        let nothing = self.b.type_void();
        let of = self.b.type_function(nothing, []);
        let kind = vec![Operand::FunctionControl(FunctionControl::NONE), Operand::IdRef(of)];
        let label = |id| Instruction::new(Op::Label, None, Some(id), Vec::new());
        let block = |(id, instructions)| Block { label: Some(label(id)), instructions };
        self.b.module_mut().functions.push(Function {
            def: Some(Instruction::new(Op::Function, Some(nothing), Some(result), kind)),
            end: Some(Instruction::new(Op::FunctionEnd, None, None, Vec::new())),
            parameters: Vec::new(),
            blocks: blocks.into_iter().map(block).collect(),
        });
    }

    /// The kernel around the given one: clears the bits before it, and lets all threads end at once.
    pub(super) fn entry(&mut self, kernel: Word) -> Word {
        let zero = self.constant(0);
        let [bits, met] = [2 * self.local.div_ceil(self.width), 3].map(|value| self.constant(value));
        let index = self.emit(Op::Load, self.uint, &[self.index_variable]);
        let at = self.word(Op::UMod, index, bits);
        self.write(self.shared.live, at, zero);
        self.write(self.shared.votes, at, zero);
        let at = self.word(Op::UMod, index, met);
        self.write(self.shared.met, at, zero);
        self.turn();
        let nothing = self.b.type_void();
        self.emit(Op::FunctionCall, nothing, &[kernel]);
        self.meet();
        self.leave();
        let [entry, label] = [self.b.id(), self.b.id()];
        let code = std::mem::take(&mut self.code);
        self.function(entry, vec![(label, code)]);
        entry
    }

    pub(super) fn leave(&mut self) {
        self.code.push(Instruction::new(Op::Return, None, None, Vec::new()));
    }

    /// The meeting of all threads, whatever turns they took before: after it they are in step. First they wait, some turns at
    /// a time, until all came; then until the first, which begins each round of turns, has seen that all know.
    pub(super) fn write_rendezvous(&mut self) {
        let mut blocks = Vec::new();
        let [came, know, go, all] = [0, 1, 2, self.local].map(|value| self.constant(value));
        let labels: [Word; 7] = std::array::from_fn(|_| self.b.id());
        let [start, head, wait, between, second_head, second_wait, end] = labels;
        let branch = |to| Instruction::new(Op::Branch, None, None, vec![Operand::IdRef(to)]);
        let merge = |after, next| {
            let control = Operand::LoopControl(LoopControl::NONE);
            Instruction::new(Op::LoopMerge, None, None, vec![Operand::IdRef(after), Operand::IdRef(next), control])
        };
        let choose = |on, yes, no| {
            let operands = [on, yes, no].map(Operand::IdRef).to_vec();
            Instruction::new(Op::BranchConditional, None, None, operands)
        };
        let one = self.constant(1);
        let index = self.emit(Op::Load, self.uint, &[self.index_variable]);
        self.atomic(Op::AtomicIAdd, self.shared.met, came, one);
        self.code.push(branch(head));
        blocks.push((start, std::mem::take(&mut self.code)));
        blocks.push((head, vec![merge(between, wait), branch(wait)]));
        (0..TURNS).for_each(|_| self.turn());
        let n = self.read(self.shared.met, came);
        let done = self.emit(Op::UGreaterThanEqual, self.boolean, &[n, all]);
        self.code.push(choose(done, between, head));
        blocks.push((wait, std::mem::take(&mut self.code)));
        self.atomic(Op::AtomicIAdd, self.shared.met, know, one);
        self.code.push(branch(second_head));
        blocks.push((between, std::mem::take(&mut self.code)));
        blocks.push((second_head, vec![merge(end, second_wait), branch(second_wait)]));
        self.turn();
        let n = self.read(self.shared.met, know);
        let is_first = self.emit(Op::IEqual, self.boolean, &[index, came]);
        let done = self.emit(Op::UGreaterThanEqual, self.boolean, &[n, all]);
        let says = self.emit(Op::LogicalAnd, self.boolean, &[is_first, done]);
        let word = self.emit(Op::Select, self.uint, &[says, one, came]);
        self.atomic(Op::AtomicUMax, self.shared.met, go, word);
        let goes = self.read(self.shared.met, go);
        let goes = self.emit(Op::INotEqual, self.boolean, &[goes, came]);
        self.code.push(choose(goes, end, second_head));
        blocks.push((second_wait, std::mem::take(&mut self.code)));
        self.turn();
        [came, know, go].into_iter().for_each(|counter| self.write(self.shared.met, counter, came));
        self.turn();
        self.leave();
        blocks.push((end, std::mem::take(&mut self.code)));
        self.function(self.rendezvous, blocks);
    }
}
