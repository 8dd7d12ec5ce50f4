//! Kernels that count what they read and write past the end of their buffers: nothing else here would notice, since lavapipe clamps
//! every access. Each index into the array of a storage buffer is compared with `OpArrayLength`, which is of the range that is bound,
//! and clamped; a thread adds up the accesses that were out of bounds, and adds them at its end to its kernel's word of a buffer that
//! is bound behind the kernel's own ([`Options::counts`](ivv::internals::gpu::Options)). Every turn with the device ends with a look at that
//! buffer.

use super::edit::{Edit, id_of};
use crate::common::device::{opened, options};
use crate::common::prelude::*;
use ivv::internals::gpu::Options;
use ivv::internals::gpu::generated::{ALL, gather, probe_atomic};
use ivv::internals::reference::scattered_rows;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{Decoration, GlslStd450Op as GLOp, Op, Scope, StorageClass, Word};

pub const REWRITE: Rewrite = Rewrite { subgroup_size: None, spirv: |kernel| counting(kernel) };

fn counting(kernel: &KernelInfo) -> Vec<u8> {
    let mut edit = Edit::of(kernel.spirv);
    assert_eq!(edit.module.functions.len(), 1, "{}: expected one function", kernel.name);
    let counter = counter(&mut edit, kernel);
    let uint = edit.uint(1);
    let (tally, zero) = (edit.private(uint), edit.uint_constant(1, 0));
    // Whether each place in an array is within it.
    let mut within: HashMap<Word, Word> = HashMap::new();
    edit.rewrite(|edit, instruction, to| match instruction.class.opcode {
        Op::AccessChain | Op::InBoundsAccessChain => chain(edit, instruction, &mut within, to),
        Op::Return => {
            let device = edit.uint_constant(1, Scope::Device as u32);
            let total = edit.put(to, Op::Load, uint, &[tally]);
            edit.put(to, Op::AtomicIAdd, uint, &[counter, device, zero, total]);
            to.push(instruction);
        }
        op => {
            let pointers = instruction.operands.iter().filter_map(Operand::id_ref_any).filter_map(|id| within.get(&id));
            let pointers: Vec<Word> = pointers.copied().collect();
            let is_access = matches!(op, Op::Load | Op::Store) || instruction.class.opname.starts_with("Atomic");
            assert!(is_access || pointers.is_empty(), "{}: no rule for a pointer in {instruction:?}", kernel.name);
            if let [inside] = pointers[..] {
                let one = edit.uint_constant(1, 1);
                let outside = edit.put(to, Op::Select, uint, &[inside, zero, one]);
                let before = edit.put(to, Op::Load, uint, &[tally]);
                let after = edit.put(to, Op::IAdd, uint, &[before, outside]);
                store(to, tally, after);
            }
            to.push(instruction);
        }
    });
    let mut first = Vec::new();
    store(&mut first, tally, zero);
    edit.begin_with(first);
    edit.bytes()
}

fn store(to: &mut Vec<Instruction>, variable: Word, value: Word) {
    to.push(Instruction::new(Op::Store, None, None, [variable, value].map(Operand::IdRef).to_vec()));
}

/// A pointer to the kernel's word of the buffer of counts, computed where the kernel begins.
fn counter(edit: &mut Edit, kernel: &KernelInfo) -> Word {
    let uint = edit.uint(1);
    let (array, block) = (edit.id(), edit.id());
    let mut declare = |op, id, operands| {
        edit.module.types_global_values.push(Instruction::new(op, None, Some(id), operands));
    };
    declare(Op::TypeRuntimeArray, array, vec![Operand::IdRef(uint)]);
    declare(Op::TypeStruct, block, vec![Operand::IdRef(array)]);
    let pointer = edit.pointer(StorageClass::StorageBuffer, block);
    let variable = edit.id();
    let class = vec![Operand::StorageClass(StorageClass::StorageBuffer)];
    edit.module.types_global_values.push(Instruction::new(Op::Variable, Some(pointer), Some(variable), class));
    let decorations = [
        (
            Op::Decorate,
            vec![Operand::IdRef(array), Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(4)],
        ),
        (Op::Decorate, vec![Operand::IdRef(block), Operand::Decoration(Decoration::Block)]),
        (
            Op::MemberDecorate,
            vec![
                Operand::IdRef(block),
                Operand::LiteralBit32(0),
                Operand::Decoration(Decoration::Offset),
                Operand::LiteralBit32(0),
            ],
        ),
        (
            Op::Decorate,
            vec![Operand::IdRef(variable), Operand::Decoration(Decoration::DescriptorSet), Operand::LiteralBit32(0)],
        ),
        (
            Op::Decorate,
            vec![
                Operand::IdRef(variable),
                Operand::Decoration(Decoration::Binding),
                Operand::LiteralBit32(kernel.bindings.len() as u32),
            ],
        ),
    ];
    let decorations = decorations.map(|(op, operands)| Instruction::new(op, None, None, operands));
    edit.module.annotations.extend(decorations);
    let number = ALL.iter().position(|one| one.name == kernel.name).unwrap_or(ALL.len());
    let (member, number) = (edit.uint_constant(1, 0), edit.uint_constant(1, number as u32));
    let to_word = edit.pointer(StorageClass::StorageBuffer, uint);
    let mut first = Vec::new();
    let word = edit.put(&mut first, Op::AccessChain, to_word, &[variable, member, number]);
    edit.begin_with(first);
    word
}

/// Appends a place in a buffer, with an index that is within its array, and notes whether it was.
fn chain(edit: &mut Edit, mut instruction: Instruction, within: &mut HashMap<Word, Word>, to: &mut Vec<Instruction>) {
    let place = instruction.result_id.expect("a place");
    let Some(member) = runtime_array(edit, &instruction) else { return to.push(instruction) };
    let (uint, boolean, one) = (edit.uint(1), edit.boolean(1), edit.uint_constant(1, 1));
    let (variable, mut index) = (id_of(&instruction, 0), id_of(&instruction, 2));
    if edit.type_of(index) != uint {
        index = edit.put(to, Op::Bitcast, uint, &[index]);
    }
    let operands = vec![Operand::IdRef(variable), Operand::LiteralBit32(member)];
    let length = edit.put_raw(to, Op::ArrayLength, uint, operands);
    let last = edit.put(to, Op::ISub, uint, &[length, one]);
    let inside = edit.put(to, Op::ULessThan, boolean, &[index, length]);
    instruction.operands[2] = Operand::IdRef(edit.put_glsl(to, GLOp::UMin, uint, &[index, last]));
    within.insert(place, inside);
    to.push(instruction);
}

/// The member of a storage buffer's block that a chain goes into, where that is an array without a length of its own. The word of
/// counts is behind a constant.
fn runtime_array(edit: &Edit, chain: &Instruction) -> Option<u32> {
    let find = |id: Word| edit.module.types_global_values.iter().find(|i| i.result_id == Some(id));
    let variable = find(id_of(chain, 0))?;
    let [Operand::StorageClass(StorageClass::StorageBuffer), ..] = variable.operands[..] else { return None };
    let pointer = find(variable.result_type?)?;
    let block = find(id_of(pointer, 1))?;
    let Operand::LiteralBit32(member) = find(id_of(chain, 1))?.operands[0] else { panic!("{chain:?}: no member") };
    let array = find(id_of(block, member as usize))?;
    (array.class.opcode == Op::TypeRuntimeArray && chain.operands.len() > 2).then_some(member)
}

fn counting_device() -> Watched {
    opened(&Options { rewrite: Some(REWRITE), counts: true, reversed: false, ..options() })
}

fn counted(gpu: &Watched) -> Vec<(&'static str, u32)> {
    gpu.counted().unwrap()
}

#[test]
fn an_access_past_the_end_is_counted_and_does_not_happen() {
    let gpu = counting_device();
    let n = 64usize;
    let index: Vec<u32> = (0..=n as u32).rev().collect();
    let table: Vec<u32> = (0..=n as u32).map(|i| 100 + i).collect();
    // A range of a longer buffer: what counts is what is bound.
    let long = gpu.upload("index", &index).unwrap();
    let (table, gathered) = (gpu.upload("table", &table).unwrap(), gpu.upload("gathered", &[7u32; 65]).unwrap());
    let run = |count: u32, n: usize| {
        let count = &gpu.upload("count", &[count]).unwrap();
        let mut rec = Recording::new();
        let (index, gathered) = (&long.range(0, n), &gathered.range(0, n));
        rec.pass(gather::Args { count, index, table: &table, gathered }, (), Grid::Threads(128));
        gpu.run(&rec).unwrap();
        gpu.read(&gathered.range(n - 1, 1)).unwrap()[0]
    };
    assert_eq!((run(64, 64), counted(&gpu)), (101, vec![]));
    assert_eq!((run(65, 65), counted(&gpu)), (100, vec![]));
    // One entry too many: its index is read, and its result stored, past the end. Both go to the last place.
    run(65, 64);
    assert_eq!(counted(&gpu), [("gather", 2)]);
    assert_eq!(gpu.read(&gathered).unwrap()[64], 100, "what lies behind is as it was");
    // The look has cleared the counts.
    assert_eq!((run(64, 64), counted(&gpu)), (101, vec![]));
    // An index in the list that the table has not.
    gpu.write(&long, &[65u32]).unwrap();
    run(64, 64);
    assert_eq!(counted(&gpu), [("gather", 1)]);
}

/// What fails the tests of the lane.
#[test]
#[should_panic(expected = "past the end")]
fn a_turn_in_which_a_kernel_counted_ends_in_a_panic() {
    let gpu = counting_device();
    let [index, table, gathered] = [(); 3].map(|()| gpu.upload("numbers", &[0u32; 64]).unwrap());
    let count = &gpu.upload("count", &[65u32]).unwrap();
    let mut rec = Recording::new();
    rec.pass(gather::Args { count, index: &index, table: &table, gathered: &gathered }, (), Grid::Threads(128));
    gpu.run(&rec).unwrap();
}

#[test]
fn an_atomic_past_the_end_is_counted() {
    let gpu = counting_device();
    let (n, mask) = (64u32, 3u32);
    let term = &gpu.upload("term", &[1u32]).unwrap();
    let run = |rows: usize| {
        let words = gpu.upload("words", &vec![0u32; 16 * rows]).unwrap();
        let mut rec = Recording::new();
        rec.pass(probe_atomic::Args { term, words: &words }, probe_atomic::Push { n, mask }, Grid::Threads(n));
        gpu.run(&rec).unwrap();
        gpu.read(&words).unwrap().iter().sum::<u32>()
    };
    // Eight additions of each thread; none is lost where they are clamped.
    assert_eq!((run(4), counted(&gpu)), (8 * n, vec![]));
    let outside = (0..n).flat_map(|i| scattered_rows(i / 16, 8, mask)).filter(|row| *row > 0).count();
    assert!(outside > 0);
    assert_eq!((run(1), counted(&gpu)), (8 * n, vec![("probe_atomic", outside as u32)]));
}

/// Every kernel takes the change, and all but those that touch no array have something to count.
#[test]
fn every_kernel_is_changed_and_stays_valid() {
    let validator = crate::common::notes::has_program("spirv-val");
    let file = std::env::temp_dir().join(format!("ivv-bounds-{}.spv", std::process::id()));
    for kernel in ALL {
        let changed = counting(kernel);
        assert!(changed.len() > kernel.spirv.len(), "{}", kernel.name);
        if validator {
            std::fs::write(&file, changed).unwrap();
            let told = std::process::Command::new("spirv-val")
                .args(["--target-env", "vulkan1.2"])
                .arg(&file)
                .output()
                .unwrap();
            assert!(told.status.success(), "{}: {}", kernel.name, String::from_utf8_lossy(&told.stderr));
        }
    }
    let _ = std::fs::remove_file(file);
}
