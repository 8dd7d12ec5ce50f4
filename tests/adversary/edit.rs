//! SPIR-V of a kernel, taken apart to be changed: types and constants on demand, instructions put before others.

use super::module::{assembled, load};
use crate::common::prelude::*;
use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, Decoration, GlslStd450Op as GLOp, Op, StorageClass, Word};

pub struct Edit {
    pub module: Module,
    types: HashMap<Word, Word>,
    constants: HashMap<(Word, Vec<Word>), Word>,
    glsl: Word,
}

impl Edit {
    /// Takes `spirv` apart. Kernels import GLSL's functions, or are made to.
    pub fn of(spirv: &[u8]) -> Edit {
        let module = load(spirv);
        let typed = |i: &Instruction| Some((i.result_id?, i.result_type?));
        let types = module.all_inst_iter().filter_map(typed).collect();
        let glsl = module.ext_inst_imports.first().and_then(|import| import.result_id);
        let mut edit = Edit { module, types, constants: HashMap::new(), glsl: glsl.unwrap_or(0) };
        if glsl.is_none() {
            edit.glsl = edit.id();
            let name = vec![Operand::LiteralString("GLSL.std.450".to_owned())];
            edit.module.ext_inst_imports.push(Instruction::new(Op::ExtInstImport, None, Some(edit.glsl), name));
        }
        edit
    }

    pub fn bytes(&self) -> Vec<u8> {
        assembled(&self.module)
    }

    pub fn id(&mut self) -> Word {
        let header = self.module.header.as_mut().expect("a header");
        header.bound += 1;
        header.bound - 1
    }

    pub fn type_of(&self, value: Word) -> Word {
        self.types[&value]
    }

    /// Components of a type of 32-bit floats: 1 of a scalar; none of another type.
    pub fn floats(&self, of_type: Word) -> Option<u32> {
        let find = |id| self.module.types_global_values.iter().find(|i| i.result_id == Some(id));
        let found = find(of_type)?;
        match (found.class.opcode, &*found.operands) {
            (Op::TypeFloat, [Operand::LiteralBit32(32), ..]) => Some(1),
            (Op::TypeVector, [Operand::IdRef(of), Operand::LiteralBit32(n)]) => self.floats(*of).map(|_| *n),
            _ => None,
        }
    }

    fn global(&mut self, op: Op, result_type: Option<Word>, operands: Vec<Operand>) -> Word {
        let is_type = result_type.is_none();
        let same = |i: &&Instruction| is_type && i.class.opcode == op && i.operands == operands;
        if let Some(found) = self.module.types_global_values.iter().find(same) {
            return found.result_id.expect("the id of a type");
        }
        let id = self.id();
        self.module.types_global_values.push(Instruction::new(op, result_type, Some(id), operands));
        if let Some(result_type) = result_type {
            self.types.insert(id, result_type);
        }
        id
    }

    fn vector(&mut self, scalar: Word, n: u32) -> Word {
        if n == 1 {
            return scalar;
        }
        self.global(Op::TypeVector, None, vec![Operand::IdRef(scalar), Operand::LiteralBit32(n)])
    }

    pub fn float(&mut self, n: u32) -> Word {
        let scalar = self.global(Op::TypeFloat, None, vec![Operand::LiteralBit32(32)]);
        self.vector(scalar, n)
    }

    pub fn uint(&mut self, n: u32) -> Word {
        let scalar = self.global(Op::TypeInt, None, vec![Operand::LiteralBit32(32), Operand::LiteralBit32(0)]);
        self.vector(scalar, n)
    }

    pub fn boolean(&mut self, n: u32) -> Word {
        let scalar = self.global(Op::TypeBool, None, Vec::new());
        self.vector(scalar, n)
    }

    pub fn pointer(&mut self, class: StorageClass, of_type: Word) -> Word {
        self.global(Op::TypePointer, None, vec![Operand::StorageClass(class), Operand::IdRef(of_type)])
    }

    /// A variable that each invocation has to itself, of a value of `of_type`.
    pub fn private(&mut self, of_type: Word) -> Word {
        let pointer = self.pointer(StorageClass::Private, of_type);
        self.global(Op::Variable, Some(pointer), vec![Operand::StorageClass(StorageClass::Private)])
    }

    /// The variable of what the device tells an invocation.
    pub fn built_in(&self, which: BuiltIn) -> Option<Word> {
        let is_it = |i: &&Instruction| i.operands.get(2) == Some(&Operand::BuiltIn(which));
        self.module.annotations.iter().find(is_it).map(|i| id_of(i, 0))
    }

    fn constant(&mut self, scalar: Word, n: u32, bits: u32) -> Word {
        let (of_type, words, op) = match n {
            1 => (scalar, vec![bits], Op::Constant),
            _ => {
                let one = self.constant(scalar, 1, bits);
                (self.vector(scalar, n), vec![one; n as usize], Op::ConstantComposite)
            }
        };
        let key = (of_type, words.clone());
        if let Some(found) = self.constants.get(&key) {
            return *found;
        }
        let operand = |word| if n == 1 { Operand::LiteralBit32(word) } else { Operand::IdRef(word) };
        let id = self.global(op, Some(of_type), words.into_iter().map(operand).collect());
        self.constants.insert(key, id);
        id
    }

    /// `value` in each of `n` components.
    pub fn float_constant(&mut self, n: u32, value: f32) -> Word {
        let scalar = self.float(1);
        self.constant(scalar, n, value.to_bits())
    }

    /// `value` in each of `n` components.
    pub fn uint_constant(&mut self, n: u32, value: u32) -> Word {
        let scalar = self.uint(1);
        self.constant(scalar, n, value)
    }

    pub fn put(&mut self, to: &mut Vec<Instruction>, op: Op, of_type: Word, operands: &[Word]) -> Word {
        self.put_raw(to, op, of_type, operands.iter().map(|id| Operand::IdRef(*id)).collect())
    }

    /// Appends `op`, whose operands may be literals, to `to`.
    pub fn put_raw(&mut self, to: &mut Vec<Instruction>, op: Op, of_type: Word, operands: Vec<Operand>) -> Word {
        let id = self.id();
        to.push(Instruction::new(op, Some(of_type), Some(id), operands));
        self.types.insert(id, of_type);
        id
    }

    /// Appends a function of GLSL to `to`.
    pub fn put_glsl(&mut self, to: &mut Vec<Instruction>, op: GLOp, of_type: Word, operands: &[Word]) -> Word {
        let function = [Operand::IdRef(self.glsl), Operand::LiteralExtInstInteger(op as u32)];
        let operands = function.into_iter().chain(operands.iter().map(|id| Operand::IdRef(*id))).collect();
        self.put_raw(to, Op::ExtInst, of_type, operands)
    }

    pub fn is_exact(&self, value: Word) -> bool {
        let decoration = [Operand::IdRef(value), Operand::Decoration(Decoration::NoContraction)];
        self.module.annotations.iter().any(|i| i.class.opcode == Op::Decorate && i.operands == decoration)
    }

    /// Makes `value` `precise`: no driver contracts it.
    pub fn make_exact(&mut self, value: Word) {
        let decoration = vec![Operand::IdRef(value), Operand::Decoration(Decoration::NoContraction)];
        self.module.annotations.push(Instruction::new(Op::Decorate, None, None, decoration));
    }

    pub fn begin_with(&mut self, instructions: Vec<Instruction>) {
        let main = id_of(&self.module.entry_points[0], 1);
        let function =
            self.module.functions.iter_mut().find(|f| f.def.as_ref().is_some_and(|i| i.result_id == Some(main)));
        let block = &mut function.expect("the kernel's function").blocks[0].instructions;
        let at = block.iter().take_while(|i| i.class.opcode == Op::Variable).count();
        block.splice(at..at, instructions);
    }

    /// Runs `change` over every instruction in the order of the blocks. It appends what shall stand in its place.
    pub fn rewrite(&mut self, mut change: impl FnMut(&mut Edit, Instruction, &mut Vec<Instruction>)) {
        let mut functions = std::mem::take(&mut self.module.functions);
        for Block { instructions, .. } in functions.iter_mut().flat_map(|function| &mut function.blocks) {
            let mut to = Vec::with_capacity(instructions.len());
            for instruction in instructions.drain(..) {
                change(self, instruction, &mut to);
            }
            *instructions = to;
        }
        self.module.functions = functions;
    }
}

pub fn id_of(instruction: &Instruction, k: usize) -> Word {
    match instruction.operands[k] {
        Operand::IdRef(id) => id,
        ref other => panic!("{other:?} is no id"),
    }
}

pub fn glsl_of(instruction: &Instruction) -> Option<GLOp> {
    match instruction.operands.get(1) {
        Some(Operand::LiteralExtInstInteger(function)) if instruction.class.opcode == Op::ExtInst => {
            GLOp::from_u32(*function)
        }
        _ => None,
    }
}

pub fn hash(text: &str) -> u32 {
    text.bytes().fold(0x811c_9dc5, |h, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

/// `x` with its bits mixed well (Wellons' lowbias32).
pub fn mixed(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
