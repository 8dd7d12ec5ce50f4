//! What several test folders share.

pub mod device;
pub mod folder;
pub mod frames;
pub mod golden;
pub mod notes;
pub mod prelude;
pub mod program;
pub mod references;
pub mod running;
pub mod same;
pub mod stages;

use flate2::{Compression, write::DeflateEncoder};
use rawzip::{CompressionMethod, ZipArchiveWriter};
use std::io::Write;

pub fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = ZipArchiveWriter::new(Vec::new());
    for (name, bytes) in files {
        let builder = archive.new_file(name).compression_method(CompressionMethod::DEFLATE);
        let (mut entry, config) = builder.start().unwrap();
        let mut writer = config.wrap(DeflateEncoder::new(&mut entry, Compression::fast()));
        writer.write_all(bytes).unwrap();
        let (encoder, descriptor) = writer.finish().unwrap();
        encoder.finish().unwrap();
        entry.finish(descriptor).unwrap();
    }
    archive.finish().unwrap()
}

/// A `.npy` of a shape and a kind of numbers, as Python spells them.
pub fn npy(shape: &str, kind: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    header.insert_str(header.len() - 1, &" ".repeat((64 - (header.len() + 10) % 64) % 64));
    [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
}

/// A `.npy` of rows of f64.
pub fn npy_rows(rows: usize, values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    npy(&format!("({rows}, {})", values.len() / rows), "<f8", &data)
}

/// A Python that has `module`: `python3`, or that of `tools/setup.sh player`. Where neither has it, a skip is noted.
#[track_caller]
pub fn python_with(module: &str) -> Option<std::path::PathBuf> {
    let home = || std::env::var_os("HOME").map(|home| std::path::PathBuf::from(home).join(".cache"));
    let cache = std::env::var_os("XDG_CACHE_HOME").map(std::path::PathBuf::from).or_else(home);
    let own = cache.map(|cache| cache.join("ivv/player/python/bin/python"));
    let found = [Some("python3".into()), own].into_iter().flatten().find(|python| {
        let output = std::process::Command::new(python).args(["-c", &format!("import {module}")]).output();
        output.is_ok_and(|output| output.status.success())
    });
    if found.is_none() {
        notes::skip(format!("no python3 has the package {module}; tools/setup.sh player installs it"));
    }
    found
}

pub use ivv_conformance::{one, random};

/// Settings of the preset `exact`, as if they were nobody's: references leave nothing out either.
pub fn exact() -> ivv::train::Config {
    ivv::train::Config { preset: None, ..ivv::train::Config::default().with_preset("exact").unwrap() }
}
