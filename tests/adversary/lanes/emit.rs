//! Instructions that the emulation emits.

use super::Emulation;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{Op, Scope, Word};

/// Of a barrier: acquire, release, workgroup memory.
const SEMANTICS: u32 = 0x108;

impl Emulation {
    pub(super) fn constant(&mut self, value: u32) -> Word {
        let (b, uint) = (&mut self.b, self.uint);
        *self.constants.entry(value).or_insert_with(|| b.constant_bit32(uint, value))
    }

    /// Emits an instruction with a result that has its id already.
    pub(super) fn define(&mut self, op: Op, of: Word, result: Word, operands: &[Word]) {
        let operands = operands.iter().map(|id| Operand::IdRef(*id)).collect();
        self.code.push(Instruction::new(op, Some(of), Some(result), operands));
    }

    pub(super) fn emit(&mut self, op: Op, of: Word, operands: &[Word]) -> Word {
        let result = self.b.id();
        self.define(op, of, result, operands);
        result
    }

    pub(super) fn word(&mut self, op: Op, a: Word, b: Word) -> Word {
        self.emit(op, self.uint, &[a, b])
    }

    pub(super) fn at(&mut self, array: Word, index: Word) -> Word {
        self.emit(Op::AccessChain, self.pointer, &[array, index])
    }

    pub(super) fn read(&mut self, array: Word, index: Word) -> Word {
        let pointer = self.at(array, index);
        self.emit(Op::Load, self.uint, &[pointer])
    }

    pub(super) fn write(&mut self, array: Word, index: Word, value: Word) {
        let pointer = self.at(array, index);
        self.code.push(Instruction::new(Op::Store, None, None, vec![Operand::IdRef(pointer), Operand::IdRef(value)]));
    }

    pub(super) fn atomic(&mut self, op: Op, array: Word, index: Word, value: Word) {
        let pointer = self.at(array, index);
        let [scope, semantics] = [Scope::Workgroup as u32, 0].map(|value| self.constant(value));
        let operands = [pointer, scope, semantics, value];
        self.emit(op, self.uint, &operands);
    }

    pub(super) fn turn(&mut self) {
        let scope = self.constant(Scope::Workgroup as u32);
        let semantics = self.constant(SEMANTICS);
        let operands = vec![Operand::IdScope(scope), Operand::IdScope(scope), Operand::IdMemorySemantics(semantics)];
        self.code.push(Instruction::new(Op::ControlBarrier, None, None, operands));
    }
}
