//! SPIR-V modules as data.

use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, Word};

pub fn load(spirv: &[u8]) -> Module {
    rspirv::dr::load_bytes(spirv).unwrap_or_else(|fault| panic!("no SPIR-V: {fault}"))
}

pub fn assembled(module: &Module) -> Vec<u8> {
    bytemuck::cast_slice(&module.assemble()).to_vec()
}

pub fn id(instruction: &Instruction, at: usize) -> Word {
    instruction.operands[at].id_ref_any().unwrap_or_else(|| panic!("operand {at} of {instruction:?} is no id"))
}

pub fn ids(instruction: &Instruction) -> impl Iterator<Item = Word> + '_ {
    instruction.operands.iter().filter_map(Operand::id_ref_any)
}

pub fn built_ins(module: &Module) -> impl Iterator<Item = (Word, rspirv::spirv::BuiltIn)> + '_ {
    let is_built_in =
        |a: &&Instruction| a.class.opcode == Op::Decorate && a.operands[1] == Operand::Decoration(Decoration::BuiltIn);
    module.annotations.iter().filter(is_built_in).map(|a| (id(a, 0), a.operands[2].unwrap_built_in()))
}
