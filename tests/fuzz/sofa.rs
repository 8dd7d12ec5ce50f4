//! A small SOFA file, HDF5 without any library: the superblock, the root with its attributes and the fractal heap of its links,
//! and an object for each variable. Checksums are 0: the reader passes over them.

use super::engine::{Files, Seed};
use crate::common::prelude::*;

const NOWHERE: [u8; 8] = [0xff; 8];
/// Where the superblock says how long the file is.
const LENGTH: std::ops::Range<usize> = 28..36;
const TAPS: usize = 16;

/// The names of the parts: what tells where all is, and the numbers behind it.
const STRUCTURE: &str = "0 structure";
const NUMBERS: &str = "1 numbers";

struct Variable {
    name: &'static str,
    dimensions: &'static [u64],
    values: Vec<f32>,
    /// Its attribute `Type`.
    kind: &'static str,
}

fn variables() -> Vec<Variable> {
    let directions = || [0, 45, 90, 135, 180, 225, 270, 315].into_iter().flat_map(|az| [-45, 0, 45].map(|el| (az, el)));
    let places = directions().flat_map(|(az, el)| [az as f32, el as f32, 1.2]).collect();
    let mut responses = Vec::new();
    for (az, el) in directions() {
        let turn = (az as f32).to_radians().sin() * (el as f32).to_radians().cos();
        for (sign, gain) in [(-1.0, 0.5 + 0.3 * turn), (1.0, 0.5 - 0.3 * turn)] {
            let peak = (6.0 + sign * 3.0 * turn).round() as usize;
            responses.extend((0..TAPS).map(|tap| if tap == peak { gain } else { 0.0 }));
        }
    }
    vec![
        Variable { name: "Data.IR", dimensions: &[24, 2, TAPS as u64], values: responses, kind: "" },
        Variable { name: "Data.SamplingRate", dimensions: &[1], values: vec![48_000.0], kind: "" },
        Variable { name: "Data.Delay", dimensions: &[1, 2], values: vec![0.0; 2], kind: "" },
        Variable { name: "SourcePosition", dimensions: &[24, 3], values: places, kind: "spherical" },
        Variable { name: "ListenerView", dimensions: &[1, 3], values: vec![1.0, 0.0, 0.0], kind: "cartesian" },
    ]
}

fn message(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], (body.len() as u16).to_le_bytes().as_slice(), &[0], body].concat()
}

fn object(messages: &[Vec<u8>]) -> Vec<u8> {
    let messages = messages.concat();
    [b"OHDR\x02\x02".as_slice(), &(messages.len() as u32).to_le_bytes(), &messages, &[0; 4]].concat()
}

fn attribute(name: &str, text: &str) -> Vec<u8> {
    let kind = [[0x13, 0, 0, 0].as_slice(), &(text.len() as u32).to_le_bytes()].concat();
    let space = [2, 0, 0, 0];
    let sizes = [name.len() + 1, kind.len(), space.len()].map(|size| (size as u16).to_le_bytes()).concat();
    message(12, &[[3, 0].as_slice(), &sizes, &[0], name.as_bytes(), &[0], &kind, &space, text.as_bytes()].concat())
}

fn variable(variable: &Variable, address: u64) -> Vec<u8> {
    let Variable { dimensions, values, kind, .. } = variable;
    let sides: Vec<u8> = dimensions.iter().flat_map(|side| side.to_le_bytes()).collect();
    let space = [[2, dimensions.len() as u8, 0, 1].as_slice(), &sides].concat();
    // Single precision: exponent of 8 bits from 23, mantissa of 23, bias 127.
    let float = [0x11, 0x20, 0x1f, 0, 4, 0, 0, 0, 0, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0];
    let layout = [[3, 1].as_slice(), &address.to_le_bytes(), &(4 * values.len() as u64).to_le_bytes()].concat();
    object(&[message(1, &space), message(3, &float), message(8, &layout), attribute("Type", kind)])
}

/// The header of a heap whose one block is at `address`.
fn heap(address: u64) -> Vec<u8> {
    let mut heap = b"FRHP\0".to_vec();
    // Length of an id, no filters, no checksums of blocks, the largest object.
    heap.extend([[7, 0, 0, 0, 0].as_slice(), &4096u32.to_le_bytes()].concat());
    // Nothing is huge, tiny or counted.
    heap.extend([0; 12 * 8]);
    heap.extend([[4, 0].as_slice(), &512u64.to_le_bytes(), &65_536u64.to_le_bytes(), &[32, 0, 1, 0]].concat());
    heap.extend([address.to_le_bytes().as_slice(), &[0, 0], &[0; 4]].concat());
    heap
}

/// The one block of a heap, with a link to each object.
fn block(links: &[(&str, u64)]) -> Vec<u8> {
    let mut block = b"FHDB\0".to_vec();
    block.extend([0; 8 + 4]);
    for (name, address) in links {
        let length = 3 + name.len() as u16 + 8;
        let link = [[0; 6].as_slice(), &[name.len() as u8], name.as_bytes(), &address.to_le_bytes()].concat();
        block.extend([[1, 0].as_slice(), &length.to_le_bytes(), &link].concat());
    }
    block.push(0);
    block
}

/// The structure, and the numbers that follow it.
fn parts() -> [Vec<u8>; 2] {
    let variables = variables();
    // Addresses have the same size whatever they are: the second time they are known.
    let (mut numbers_at, mut structure) = (0, Vec::new());
    for _ in 0..2 {
        structure = b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00".to_vec();
        structure.resize(48, 0);
        structure[20..28].copy_from_slice(&NOWHERE);
        let (mut links, mut at) = (Vec::new(), numbers_at);
        for one in &variables {
            links.push((one.name, structure.len() as u64));
            structure.extend(variable(one, at));
            at += 4 * one.values.len() as u64;
        }
        let block_at = structure.len() as u64;
        structure.extend(block(&links));
        let heap_at = structure.len() as u64;
        structure.extend(heap(block_at));
        let root = structure.len() as u64;
        let links = message(2, &[[0, 0].as_slice(), &heap_at.to_le_bytes(), &NOWHERE].concat());
        structure.extend(object(&[
            links,
            attribute("SOFAConventions", "SimpleFreeFieldHRIR"),
            attribute("Title", "made up"),
            attribute("License", "free of all terms"),
        ]));
        structure[36..44].copy_from_slice(&root.to_le_bytes());
        numbers_at = structure.len() as u64;
    }
    [structure, variables.iter().flat_map(|one| &one.values).flat_map(|value| value.to_le_bytes()).collect()]
}

fn build(parts: &Files) -> Files {
    let mut file = [parts[STRUCTURE].as_slice(), &parts[NUMBERS]].concat();
    let length = (file.len() as u64).to_le_bytes();
    file.iter_mut().take(LENGTH.end).skip(LENGTH.start).zip(length).for_each(|(byte, new)| *byte = new);
    [("a.sofa".to_owned(), file)].into()
}

pub fn sofa() -> Vec<Seed> {
    let [structure, numbers] = parts();
    let of = [(STRUCTURE, structure), (NUMBERS, numbers)];
    let seed = Seed { build, ..Seed::of(of, |folder| HrtfSet::open(folder.join("a.sofa")).is_ok()) };
    vec![Seed { only: vec![STRUCTURE], ..seed.clone() }, seed]
}
