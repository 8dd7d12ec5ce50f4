//! Operations over all lanes of a subgroup: ballots, sums, maxima.

use super::{Emulation, id};
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{GroupOperation, Op, Word};

impl Emulation {
    pub(super) fn vote(&mut self, yes: Word) -> [Word; 2] {
        let zero = self.constant(0);
        let bit = self.emit(Op::Select, self.uint, &[yes, self.thread.bit, zero]);
        self.atomic(Op::AtomicOr, self.shared.votes, self.thread.word, bit);
        self.turn();
        let words = self.bits(self.shared.votes);
        self.turn();
        self.atomic(Op::AtomicAnd, self.shared.votes, self.thread.word, self.thread.not_bit);
        words
    }

    pub(super) fn bits(&mut self, of: Word) -> [Word; 2] {
        let low = self.read(of, self.thread.words);
        if self.width == 32 {
            return [low, self.constant(0)];
        }
        let one = self.constant(1);
        let second = self.word(Op::IAdd, self.thread.words, one);
        [low, self.read(of, second)]
    }

    /// A sum or maximum over the active lanes, or over those before this one.
    pub(super) fn fold(&mut self, instruction: &Instruction) {
        let (of, result) = (instruction.result_type.unwrap_or(0), instruction.result_id.unwrap_or(0));
        assert_eq!(of, self.uint, "folds of u32");
        let is_scan = match instruction.operands[1] {
            Operand::GroupOperation(GroupOperation::Reduce) => false,
            Operand::GroupOperation(GroupOperation::ExclusiveScan) => true,
            ref other => panic!("{other:?} is not emulated"),
        };
        self.write(self.shared.folded, self.thread.index, id(instruction, 2));
        self.atomic(Op::AtomicOr, self.shared.live, self.thread.word, self.thread.bit);
        self.turn();
        let live = self.bits(self.shared.live);
        let zero = self.constant(0);
        let mut total = zero;
        for lane in 0..self.width {
            let [mask, number] = [1 << (lane % 32), lane].map(|value| self.constant(value));
            let bit = self.word(Op::BitwiseAnd, live[lane as usize / 32], mask);
            let mut counts = self.emit(Op::INotEqual, self.boolean, &[bit, zero]);
            if is_scan {
                let before = self.emit(Op::ULessThan, self.boolean, &[number, self.thread.lane]);
                counts = self.emit(Op::LogicalAnd, self.boolean, &[counts, before]);
            }
            let at = self.word(Op::IAdd, self.thread.first, number);
            let held = self.read(self.shared.folded, at);
            let value = self.emit(Op::Select, self.uint, &[counts, held, zero]);
            total = match instruction.class.opcode {
                Op::GroupNonUniformIAdd => self.word(Op::IAdd, total, value),
                _ => {
                    let above = self.emit(Op::ULessThan, self.boolean, &[total, value]);
                    self.emit(Op::Select, self.uint, &[above, value, total])
                }
            };
        }
        self.define(Op::CopyObject, self.uint, result, &[total]);
        self.turn();
        self.atomic(Op::AtomicAnd, self.shared.live, self.thread.word, self.thread.not_bit);
    }
}
