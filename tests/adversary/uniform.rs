//! Whether the lanes of a subgroup stay together: a loop with subgroup operations must be left by all of them at once.

use super::module::{built_ins, id, ids};
use crate::common::prelude::*;
use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{BuiltIn, GroupOperation, Op, StorageClass, Word};
use std::collections::HashSet;

/// Values of a kernel that may differ between the active lanes of a subgroup.
pub struct Uniform<'a> {
    blocks: Vec<&'a Block>,
    numbers: HashMap<Word, usize>,
    differs: HashSet<Word>,
}

/// A loop or selection: its header, and where its lanes meet again. glslang writes the blocks of a construct between the two.
struct Construct {
    header: usize,
    merge: usize,
    is_loop: bool,
}

impl<'a> Uniform<'a> {
    pub fn of(module: &'a Module) -> Self {
        let blocks: Vec<&Block> = module.functions.iter().flat_map(|function| &function.blocks).collect();
        let numbers =
            blocks.iter().enumerate().filter_map(|(n, block)| Some((block.label.as_ref()?.result_id?, n))).collect();
        let mut differs = HashSet::new();
        for (variable, built_in) in built_ins(module) {
            use BuiltIn::{NumSubgroups, NumWorkgroups, SubgroupId, SubgroupSize, WorkgroupId, WorkgroupSize};
            if ![NumSubgroups, NumWorkgroups, SubgroupId, SubgroupSize, WorkgroupId, WorkgroupSize].contains(&built_in)
            {
                differs.insert(variable);
            }
        }
        let is_own = |i: &&Instruction| {
            let owned = [StorageClass::Function, StorageClass::Private].map(Operand::StorageClass);
            i.class.opcode == Op::Variable && owned.contains(&i.operands[0])
        };
        let in_functions = blocks.iter().flat_map(|block| &block.instructions);
        let variables = module.types_global_values.iter().chain(in_functions);
        differs.extend(variables.filter(is_own).filter_map(|i| i.result_id));
        let mut uniform = Uniform { blocks, numbers, differs };
        while uniform.spread() {}
        uniform
    }

    /// # Panics
    /// Where a loop with operations of the subgroup is left by some of its lanes before others, or where such a loop is inside
    /// a selection that only some lanes take and that operations follow. Where lanes differ in what they ask the first lane for.
    pub fn check(&self) {
        let firsts = self.blocks.iter().flat_map(|block| &block.instructions);
        for first in firsts.filter(|i| i.class.opcode == Op::GroupNonUniformBroadcastFirst) {
            assert!(
                !self.differs.contains(&id(first, 1)),
                "the first lane's value is taken as every lane's, which it is not"
            );
        }
        let constructs = self.constructs();
        let operates = |construct: &Construct| (construct.header..construct.merge).any(|n| self.operates(n));
        for lap in constructs.iter().filter(|construct| construct.is_loop && operates(construct)) {
            assert!(!self.parts(lap), "lanes of a subgroup leave a loop with subgroup operations one by one");
            let around = |c: &&Construct| !c.is_loop && c.header < lap.header && lap.merge <= c.merge && self.parts(c);
            for selection in constructs.iter().filter(around) {
                let is_last = (selection.merge..self.blocks.len()).all(|n| !self.operates(n));
                assert!(
                    is_last,
                    "some lanes of a subgroup take a loop with subgroup operations, and all take others after it"
                );
            }
        }
    }

    fn operates(&self, block: usize) -> bool {
        self.blocks[block].instructions.iter().any(|i| {
            let op = i.class.opcode;
            op == Op::ControlBarrier
                || (i.class.opname.starts_with("GroupNonUniform") && op != Op::GroupNonUniformBroadcastFirst)
        })
    }

    fn constructs(&self) -> Vec<Construct> {
        let mut found = Vec::new();
        for (header, block) in self.blocks.iter().enumerate() {
            for i in &block.instructions {
                let is_loop = i.class.opcode == Op::LoopMerge;
                if is_loop || i.class.opcode == Op::SelectionMerge {
                    found.push(Construct { header, merge: self.numbers[&id(i, 0)], is_loop });
                }
            }
        }
        found
    }

    /// Whether lanes part there: of a selection by its branch, of a loop by any branch that leaves it.
    fn parts(&self, construct: &Construct) -> bool {
        let differs = |n: &usize| {
            let last = self.blocks[*n].instructions.last().expect("an end");
            let branches = matches!(last.class.opcode, Op::BranchConditional | Op::Switch);
            branches
                && self.differs.contains(&id(last, 0))
                && (!construct.is_loop || ids(last).skip(1).any(|to| self.leaves(construct, to)))
        };
        match construct.is_loop {
            true => (construct.header..construct.merge).any(|n| differs(&n) || self.breaks_apart(construct, n)),
            false => differs(&construct.header),
        }
    }

    fn leaves(&self, construct: &Construct, to: Word) -> bool {
        self.numbers.get(&to).is_some_and(|n| *n >= construct.merge)
    }

    /// Whether a block leaves a loop under a selection inside it that parts lanes.
    fn breaks_apart(&self, lap: &Construct, block: usize) -> bool {
        let last = self.blocks[block].instructions.last().expect("an end");
        let leaves = last.class.opcode == Op::Return || ids(last).any(|to| self.leaves(lap, to));
        leaves
            && self.constructs().iter().any(|c| {
                let inside = !c.is_loop && c.header >= lap.header && c.header < block && block < c.merge;
                inside && self.parts(c)
            })
    }

    /// Marks what differs because of what is known to; whether there was any.
    fn spread(&mut self) -> bool {
        let before = self.differs.len();
        for n in 0..self.blocks.len() {
            for i in &self.blocks[n].instructions {
                if let Some(result) = i.result_id
                    && self.follows(i)
                {
                    self.differs.insert(result);
                }
            }
        }
        for construct in self.constructs() {
            if !self.parts(&construct) {
                continue;
            }
            // Lanes come here by different ways, or with values of different laps.
            let phis = self.blocks[construct.merge].instructions.iter().filter(|i| i.class.opcode == Op::Phi);
            self.differs.extend(phis.filter_map(|i| i.result_id));
            if construct.is_loop {
                let laps = self.blocks[construct.header..construct.merge].iter();
                self.differs.extend(laps.flat_map(|block| &block.instructions).filter_map(|i| i.result_id));
            }
        }
        self.differs.len() > before
    }

    fn follows(&self, i: &Instruction) -> bool {
        match i.class.opcode {
            Op::GroupNonUniformBallot | Op::GroupNonUniformAny | Op::GroupNonUniformBroadcastFirst => false,
            Op::GroupNonUniformIAdd | Op::GroupNonUniformUMax => {
                i.operands[1] != Operand::GroupOperation(GroupOperation::Reduce)
            }
            Op::GroupNonUniformShuffle => self.differs.contains(&id(i, 2)),
            _ if i.class.opname.starts_with("Atomic") => true,
            _ => ids(i).any(|operand| self.differs.contains(&operand)),
        }
    }
}
