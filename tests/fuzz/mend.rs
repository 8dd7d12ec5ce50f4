//! Makes files of changed parts so that a reader gets past what guards them: compression, checksums, hashes.

use super::engine::Files;
use crate::common::prelude::*;
use std::io::Write;

/// The parts as files; the checksums of PNG are made right.
pub fn pictures(parts: &Files) -> Files {
    let mended = |(name, bytes): (&String, &Vec<u8>)| {
        let bytes = if name.ends_with(".png") { png(bytes) } else { bytes.clone() };
        (name.clone(), bytes)
    };
    parts.iter().map(mended).collect()
}

fn png(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let end = at + 8 + length.iter().fold(0usize, |n, byte| n << 8 | usize::from(*byte));
        let Some(content) = bytes.get(at + 4..end) else { break };
        let mut crc = flate2::Crc::new();
        crc.update(content);
        bytes.iter_mut().skip(end).zip(crc.sum().to_be_bytes()).for_each(|(byte, new)| *byte = new);
        at = end + 4;
    }
    bytes
}

/// The parts as [`pictures`]; those called `ARCHIVE.npz/NAME` or `ARCHIVE.sog/NAME` as files of that archive, with the sizes and
/// checksums of what they became.
pub fn archives(parts: &Files) -> Files {
    let mut files = Files::new();
    let mut packed: BTreeMap<String, Vec<(String, Vec<u8>)>> = BTreeMap::new();
    for (name, bytes) in pictures(parts) {
        match [".npz/", ".sog/"].iter().find_map(|ending| name.find(ending)) {
            Some(at) => packed.entry(name[..at + 4].to_owned()).or_default().push((name[at + 5..].to_owned(), bytes)),
            None => drop(files.insert(name, bytes)),
        }
    }
    files.extend(packed.into_iter().map(|(archive, inside)| (archive, zip(&inside))));
    files
}

pub fn gzip(parts: &Files) -> Files {
    let packed = |bytes: &Vec<u8>| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap()
    };
    parts.iter().map(|(name, bytes)| (name.clone(), packed(bytes))).collect()
}

/// An SPZ of version 4 out of its header and streams, each in a zstd frame of one block that is not compressed.
pub fn spz4(parts: &Files) -> Files {
    let frame = |stream: &[u8]| {
        let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0xa0];
        frame.extend((stream.len() as u32).to_le_bytes());
        frame.extend(&(1 | (stream.len() as u32) << 3).to_le_bytes()[..3]);
        frame.extend(stream);
        frame
    };
    let streams: Vec<&Vec<u8>> = parts.iter().filter(|(name, _)| *name != "header").map(|(_, bytes)| bytes).collect();
    let mut file = parts["header"].clone();
    file.resize(32, 0);
    for stream in &streams {
        file.extend((frame(stream).len() as u64).to_le_bytes());
        file.extend((stream.len() as u64).to_le_bytes());
    }
    streams.iter().for_each(|stream| file.extend(frame(stream)));
    [("scene.spz".to_owned(), file)].into()
}

/// The parts as `.4dgs` with the checksums of their streams, which are stored and not compressed, and of their index made right.
pub fn four_dgs(parts: &Files) -> Files {
    parts.iter().map(|(name, bytes)| (name.clone(), four_dgs_of(bytes))).collect()
}

fn four_dgs_of(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let number = |bytes: &[u8], at: usize, n: usize| {
        let word = bytes.get(at..at + n)?.iter().rev().fold(0usize, |word, byte| word << 8 | usize::from(*byte));
        Some(word).filter(|word| *word <= 1 << 30)
    };
    let mut at = 8;
    while let Some(length) = number(&bytes, at + 1, 8) {
        let (opcode, content) = (bytes[at], at + 9);
        match opcode {
            // A chunk: interval, level, count, name of the codec of it all, size, then its streams.
            5 => {
                let streams = number(&bytes, content + 24, 4).map(|name| content + 28 + name + 16);
                mend_streams(&mut bytes, streams.unwrap_or(usize::MAX), content.saturating_add(length));
            }
            7 => mend_streams(&mut bytes, content + 1, content.saturating_add(length)),
            2 => {
                let start = number(&bytes, content, 8).unwrap_or(at);
                let mut crc = flate2::Crc::new();
                crc.update(bytes.get(start..at).unwrap_or_default());
                bytes.iter_mut().skip(content + 16).zip(crc.sum().to_le_bytes()).for_each(|(byte, new)| *byte = new);
            }
            _ => {}
        }
        at = content.saturating_add(length);
    }
    bytes
}

/// Makes the checksums right of streams that lie end to end: a header of 17 bytes, then zlib of stored blocks.
fn mend_streams(bytes: &mut [u8], mut at: usize, end: usize) {
    while let Some(length) = at.checked_add(17).filter(|start| *start < end).and_then(|_| bytes.get(at + 9..at + 17)) {
        let length = length.iter().rev().fold(0usize, |word, byte| (word << 8 | usize::from(*byte)) & 0xffff_ffff);
        let (from, to) = (at + 17, (at + 17).saturating_add(length));
        let Some(stream) = bytes.get_mut(from..to).filter(|stream| stream.len() > 11) else { return };
        // One block: two bytes of zlib, five of the block.
        let (body, sum) = stream.split_at_mut(length - 4);
        let (a, b) = body[7..].iter().fold((1u32, 0u32), |(a, b), byte| {
            let a = (a + u32::from(*byte)) % 65_521;
            (a, (b + a) % 65_521)
        });
        sum.copy_from_slice(&(b << 16 | a).to_be_bytes());
        at = to;
    }
}

/// FNV-1a over 32-bit words, as checkpoints have it.
fn hash(words: impl Iterator<Item = u32>) -> u64 {
    words.fold(0xcbf2_9ce4_8422_2325, |h, word| (h ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3))
}

/// A checkpoint out of its header and its sections, with their hashes.
pub fn checkpoint(parts: &Files) -> Files {
    let (mut header, body) = (parts["header"].clone(), &parts["body"]);
    if let Ok(mut value) = serde_json::from_slice::<Value>(&header) {
        let mut at = 0usize;
        for section in value.get_mut("sections").and_then(Value::as_array_mut).into_iter().flatten() {
            let length =
                section.get("len").and_then(Value::as_u64).and_then(|n| usize::try_from(n).ok()?.checked_mul(4));
            let Some(data) = length.and_then(|n| body.get(at..at.checked_add(n)?)) else { break };
            at += data.len();
            if let Some(section) = section.as_object_mut() {
                let words = data.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
                section.insert("hash".to_owned(), hash(words).into());
            }
        }
        header = value.to_string().into_bytes();
    }
    let mut file = b"IVVCKPT4".to_vec();
    file.extend((header.len() as u64).to_le_bytes());
    file.extend(hash(header.iter().map(|byte| u32::from(*byte))).to_le_bytes());
    file.extend(&header);
    file.extend(body);
    [("a.ckpt".to_owned(), file)].into()
}
