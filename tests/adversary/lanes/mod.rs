//! Subgroups of 32 and 64 lanes on a device whose own are narrower: each subgroup operation becomes stores to shared memory, a
//! barrier, and loads.
//!
//! What it leans on, all of it lavapipe's of Mesa 22: a workgroup's vectors are coroutines that take turns, and a barrier ends a
//! turn and counts nothing. So the vectors of a subgroup that meet the same barriers stay in step, while those of other subgroups
//! may meet other ones. Both sides of an `if` run, masked, so that a vector without active lanes meets its barriers too; Mesa 25
//! skips a side that no lane takes. Once one vector has ended, the others get one more turn, hence all wait for each other at the
//! end. A loop that some lanes of a subgroup leave before others would put their vectors out of step: [`Uniform`] refuses it.

mod emit;
mod rendezvous;
mod votes;

use super::module::{assembled, built_ins, id, ids, load};
use super::uniform::Uniform;
use crate::common::prelude::*;
use ivv::internals::gpu::kernel_named;
use rspirv::dr::{Block, Builder, Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, Capability, Decoration, ExecutionMode, LoopControl, Op};
use rspirv::spirv::{Scope, StorageClass, Word};
use std::collections::HashSet;

pub const LANES_32: Rewrite = Rewrite { subgroup_size: Some(32), spirv: |kernel| emulated(kernel.spirv, 32) };
pub const LANES_64: Rewrite = Rewrite { subgroup_size: Some(64), spirv: |kernel| emulated(kernel.spirv, 64) };

/// Most words of a thread that one exchange hands around.
const BATCH: u32 = 16;

/// The module with subgroups of `width` lanes; one without subgroup operations stays as it is.
pub fn emulated(spirv: &[u8], width: u32) -> Vec<u8> {
    let module = load(spirv);
    let has_subgroups = |i: &Instruction| i.operands[0] == Operand::Capability(Capability::GroupNonUniform);
    if !module.capabilities.iter().any(has_subgroups) {
        return spirv.to_vec();
    }
    Uniform::of(&module).check();
    assembled(&Emulation::new(module, width).rewrite())
}

/// Values that the operations need, computed at the beginning of the kernel.
struct Thread {
    index: Word,
    lane: Word,
    subgroup: Word,
    /// Index of the subgroup's first thread.
    first: Word,
    /// Index of the first of the subgroup's two words of bits.
    words: Word,
    /// Index of the word with this lane's bit.
    word: Word,
    bit: Word,
    not_bit: Word,
}

/// Arrays of words in shared memory.
struct Shared {
    /// Bits of the lanes that are active.
    live: Word,
    /// Bits of the lanes that vote yes.
    votes: Word,
    /// A value of each thread that is folded.
    folded: Word,
    /// Values that are exchanged: two places for each word of a batch, in turn.
    exchanged: Word,
    /// Of a rendezvous: threads that came, threads that know that all came, whether to go on.
    met: Word,
}

struct Emulation {
    b: Builder,
    width: u32,
    local: u32,
    uint: Word,
    boolean: Word,
    pointer: Word,
    shared: Shared,
    built_ins: HashMap<Word, BuiltIn>,
    index_variable: Word,
    types: HashMap<Word, Instruction>,
    constants: HashMap<u32, Word>,
    rendezvous: Word,
    thread: Thread,
    batch: u32,
    code: Vec<Instruction>,
}

impl Emulation {
    fn new(module: Module, width: u32) -> Self {
        let is_size = |i: &&Instruction| i.operands[1] == Operand::ExecutionMode(ExecutionMode::LocalSize);
        let size = module.execution_modes.iter().find(is_size).expect("a workgroup size");
        let local = size.operands[2..].iter().map(Operand::unwrap_literal_bit32).product();
        let replaced = |built_in: &BuiltIn| {
            use BuiltIn::{NumSubgroups, SubgroupId, SubgroupLocalInvocationId, SubgroupSize};
            [NumSubgroups, SubgroupId, SubgroupLocalInvocationId, SubgroupSize].contains(built_in)
        };
        let known = built_ins(&module).find(|(_, built_in)| *built_in == BuiltIn::LocalInvocationIndex);
        let built_ins = built_ins(&module).filter(|(_, built_in)| replaced(built_in)).collect();
        let mut b = Builder::new_from_module(module);
        let (uint, boolean) = (b.type_int(32, 0), b.type_bool());
        let pointer = b.type_pointer(None, StorageClass::Workgroup, uint);
        let index_variable = known.map(|(variable, _)| variable).unwrap_or_else(|| {
            let input = b.type_pointer(None, StorageClass::Input, uint);
            let variable = b.variable(input, None, StorageClass::Input, None);
            b.decorate(variable, Decoration::BuiltIn, [Operand::BuiltIn(BuiltIn::LocalInvocationIndex)]);
            b.module_mut().entry_points[0].operands.push(Operand::IdRef(variable));
            variable
        });
        let shared = Shared { live: b.id(), votes: b.id(), folded: b.id(), exchanged: b.id(), met: b.id() };
        let rendezvous = b.id();
        let thread = Thread {
            index: b.id(),
            lane: b.id(),
            subgroup: b.id(),
            first: b.id(),
            words: b.id(),
            word: b.id(),
            bit: b.id(),
            not_bit: b.id(),
        };
        let types = b.module_ref().types_global_values.iter().filter_map(|i| Some((i.result_id?, i.clone()))).collect();
        Emulation {
            b,
            width,
            local,
            uint,
            boolean,
            pointer,
            shared,
            built_ins,
            index_variable,
            types,
            constants: HashMap::new(),
            rendezvous,
            thread,
            batch: 1,
            code: Vec::new(),
        }
    }

    fn rewrite(mut self) -> Module {
        let mut bodies = std::mem::take(&mut self.b.module_mut().functions);
        assert_eq!(bodies.len(), 1, "one function, in which all others are inlined");
        for block in &mut bodies[0].blocks {
            self.block(block);
        }
        self.begin(&mut bodies[0].blocks[0]);
        let entry = self.entry(bodies[0].def.as_ref().and_then(|def| def.result_id).expect("a kernel"));
        self.write_rendezvous();
        let bits = 2 * self.local.div_ceil(self.width);
        let Shared { live, votes, folded, exchanged, met } = self.shared;
        let exchanges = 2 * self.batch * self.local;
        for (variable, words) in [(live, bits), (votes, bits), (folded, self.local), (exchanged, exchanges), (met, 3)] {
            let length = self.constant(words);
            let array = self.b.type_array(self.uint, length);
            let pointer = self.b.type_pointer(None, StorageClass::Workgroup, array);
            let of = vec![Operand::StorageClass(StorageClass::Workgroup)];
            let made = Instruction::new(Op::Variable, Some(pointer), Some(variable), of);
            self.b.module_mut().types_global_values.push(made);
        }
        let mut module = self.b.module();
        module.functions.append(&mut bodies);
        let gone = |operand: &Operand| operand.id_ref_any().is_some_and(|id| self.built_ins.contains_key(&id));
        module.annotations.retain(|a| !gone(&a.operands[0]));
        module.types_global_values.retain(|i| !i.result_id.is_some_and(|id| self.built_ins.contains_key(&id)));
        let point = &mut module.entry_points[0].operands;
        point.retain(|operand| !gone(operand));
        point[1] = Operand::IdRef(entry);
        module.execution_modes.iter_mut().for_each(|mode| mode.operands[0] = Operand::IdRef(entry));
        module.capabilities.retain(|i| !format!("{:?}", i.operands[0]).contains("GroupNonUniform"));
        module
    }

    /// Computes what the operations need where the kernel begins.
    fn begin(&mut self, block: &mut Block) {
        let Thread { index, lane, subgroup, first, words, word, bit, not_bit } = self.thread;
        let [width, last, one, five, low] = [self.width, self.width - 1, 1, 5, 31].map(|value| self.constant(value));
        self.define(Op::Load, self.uint, index, &[self.index_variable]);
        self.define(Op::BitwiseAnd, self.uint, lane, &[index, last]);
        self.define(Op::UDiv, self.uint, subgroup, &[index, width]);
        self.define(Op::ISub, self.uint, first, &[index, lane]);
        self.define(Op::ShiftLeftLogical, self.uint, words, &[subgroup, one]);
        let upper = self.word(Op::ShiftRightLogical, lane, five);
        self.define(Op::IAdd, self.uint, word, &[words, upper]);
        let place = self.word(Op::BitwiseAnd, lane, low);
        self.define(Op::ShiftLeftLogical, self.uint, bit, &[one, place]);
        self.define(Op::Not, self.uint, not_bit, &[bit]);
        let at = block.instructions.iter().position(|i| i.class.opcode != Op::Variable).unwrap_or(0);
        block.instructions.splice(at..at, std::mem::take(&mut self.code));
    }

    /// Replaces the operations of a block. Exchanges whose values are known when the first of them is due are one.
    fn block(&mut self, block: &mut Block) {
        let mut open = Batch::default();
        let mut place = 0;
        for instruction in std::mem::take(&mut block.instructions) {
            let op = instruction.class.opcode;
            let is_ready = ids(&instruction).all(|id| !open.later.contains(&id));
            let is_exchange = matches!(op, Op::GroupNonUniformShuffle | Op::GroupNonUniformShuffleXor);
            let is_group =
                instruction.class.opname.starts_with("GroupNonUniform") && op != Op::GroupNonUniformBroadcastFirst;
            let ends = ENDS.contains(&op);
            if is_exchange {
                let words = self.words_of(&instruction);
                if !is_ready || open.words + words > BATCH {
                    self.exchange(&mut open, &mut place);
                }
                open.words += words;
                open.later.extend(instruction.result_id);
                open.members.push(instruction);
                continue;
            }
            if ends || is_group || op == Op::ControlBarrier {
                self.exchange(&mut open, &mut place);
            }
            if ends && place != 0 {
                // The next block begins with the first place, which its readers have left now.
                self.turn();
            }
            if ends || is_group || op == Op::ControlBarrier {
                place = 0;
                self.replace(unrolled(instruction));
            } else if open.members.is_empty() || (op == Op::CompositeExtract && is_ready) {
                self.replace(instruction);
            } else {
                open.later.extend(instruction.result_id);
                open.after.push(instruction);
            }
        }
        block.instructions = std::mem::take(&mut self.code);
    }

    /// Emits an exchange and what waited for it.
    fn exchange(&mut self, open: &mut Batch, place: &mut u32) {
        let Batch { members, after, words, .. } = std::mem::take(open);
        if members.is_empty() {
            return;
        }
        self.batch = self.batch.max(words);
        let mut next = *place;
        let mut read = Vec::new();
        for member in &members {
            let (value, result_type) = (id(member, 1), member.result_type.expect("a type"));
            let (scalar, n) = self.shape(result_type);
            let mut places = Vec::new();
            for k in 0..n {
                let part = match n {
                    1 => value,
                    _ => {
                        let result = self.b.id();
                        let operands = vec![Operand::IdRef(value), Operand::LiteralBit32(k)];
                        self.code.push(Instruction::new(Op::CompositeExtract, Some(scalar), Some(result), operands));
                        result
                    }
                };
                let word = if scalar == self.uint { part } else { self.emit(Op::Bitcast, self.uint, &[part]) };
                let offset = self.constant(next * self.local);
                let at = self.word(Op::IAdd, self.thread.index, offset);
                self.write(self.shared.exchanged, at, word);
                places.push(offset);
                next += 2;
            }
            read.push((member, scalar, places));
        }
        self.turn();
        for (member, scalar, places) in read {
            let last = self.constant(self.width - 1);
            let from = match member.class.opcode {
                Op::GroupNonUniformShuffleXor => self.word(Op::BitwiseXor, self.thread.lane, id(member, 2)),
                _ => id(member, 2),
            };
            let lane = self.word(Op::BitwiseAnd, from, last);
            let thread = self.word(Op::IAdd, self.thread.first, lane);
            let (of, result) = (member.result_type.expect("a type"), member.result_id.expect("a result"));
            let is_vector = places.len() > 1;
            let mut parts = Vec::new();
            for offset in places {
                let at = self.word(Op::IAdd, thread, offset);
                let word = self.read(self.shared.exchanged, at);
                let is_word = scalar == self.uint;
                let op = if is_word { Op::CopyObject } else { Op::Bitcast };
                let part = if is_vector { self.b.id() } else { result };
                self.define(op, scalar, part, &[word]);
                parts.push(part);
            }
            if is_vector {
                self.define(Op::CompositeConstruct, of, result, &parts);
            }
        }
        *place ^= 1;
        for instruction in after {
            self.replace(instruction);
        }
    }

    fn shape(&self, of: Word) -> (Word, u32) {
        let made = &self.types[&of];
        match made.class.opcode {
            Op::TypeInt | Op::TypeFloat => (of, 1),
            Op::TypeVector => (id(made, 0), made.operands[1].unwrap_literal_bit32()),
            other => panic!("values of {other:?} are not exchanged"),
        }
    }

    fn words_of(&self, exchange: &Instruction) -> u32 {
        self.shape(exchange.result_type.expect("a type")).1
    }

    /// Emits an instruction, or what stands for it.
    fn replace(&mut self, instruction: Instruction) {
        let (of, result) = (instruction.result_type.unwrap_or(0), instruction.result_id.unwrap_or(0));
        match instruction.class.opcode {
            Op::Load if self.built_ins.contains_key(&id(&instruction, 0)) => {
                let value = match self.built_ins[&id(&instruction, 0)] {
                    BuiltIn::SubgroupSize => self.constant(self.width),
                    BuiltIn::NumSubgroups => self.constant(self.local.div_ceil(self.width)),
                    BuiltIn::SubgroupId => self.thread.subgroup,
                    _ => self.thread.lane,
                };
                self.define(Op::CopyObject, of, result, &[value]);
            }
            // Only `unfolded` says it, of what is uniform anyway: here too it must look computed to lavapipe.
            Op::GroupNonUniformBroadcastFirst => {
                let shift = self.constant(31);
                let zero = self.word(Op::ShiftRightLogical, self.thread.index, shift);
                self.define(Op::BitwiseOr, of, result, &[id(&instruction, 1), zero]);
            }
            Op::GroupNonUniformBallot => {
                let [low, high] = self.vote(id(&instruction, 1));
                let zero = self.constant(0);
                self.define(Op::CompositeConstruct, of, result, &[low, high, zero, zero]);
            }
            Op::GroupNonUniformAny => {
                let [low, high] = self.vote(id(&instruction, 1));
                let both = self.word(Op::BitwiseOr, low, high);
                let zero = self.constant(0);
                self.define(Op::INotEqual, of, result, &[both, zero]);
            }
            Op::GroupNonUniformIAdd | Op::GroupNonUniformUMax => self.fold(&instruction),
            Op::ControlBarrier => match self.scope(id(&instruction, 0)) {
                scope if scope == Scope::Subgroup as u32 => self.turn(),
                _ => self.meet(),
            },
            op => {
                let is_group = instruction.class.opname.starts_with("GroupNonUniform");
                assert!(!is_group, "{op:?} is not emulated");
                self.code.push(instruction);
            }
        }
    }

    fn scope(&self, constant: Word) -> u32 {
        self.types[&constant].operands[0].unwrap_literal_bit32()
    }
}

/// A loop whose laps are known is written out, as it is without the emulation, which makes it long: for lavapipe counts laps,
/// see `rendezvous`.
fn unrolled(mut instruction: Instruction) -> Instruction {
    if instruction.class.opcode == Op::LoopMerge {
        instruction.operands[2] = Operand::LoopControl(LoopControl::UNROLL);
    }
    instruction
}

/// Exchanges that share their turns.
#[derive(Default)]
struct Batch {
    members: Vec<Instruction>,
    words: u32,
    /// What came between them and runs after them.
    after: Vec<Instruction>,
    /// Results of both.
    later: HashSet<Word>,
}

const ENDS: [Op; 7] =
    [Op::SelectionMerge, Op::LoopMerge, Op::Branch, Op::BranchConditional, Op::Switch, Op::Return, Op::Unreachable];

#[test]
fn every_kernel_with_subgroup_operations_can_be_emulated() {
    let kernels = KERNELS.iter().filter_map(|row| kernel_named(&row.name)).filter(|kernel| kernel.subgroups);
    let mut n_kernels = 0;
    for kernel in kernels {
        for width in [32, 64] {
            let module = load(&emulated(kernel.spirv, width));
            let left = module.all_inst_iter().find(|i| i.class.opname.starts_with("GroupNonUniform"));
            assert!(left.is_none(), "{} at {width}: {left:?}", kernel.name);
        }
        n_kernels += 1;
    }
    assert!(n_kernels > 100, "only {n_kernels} kernels have subgroup operations");
}
