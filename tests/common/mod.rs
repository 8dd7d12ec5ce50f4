//! What several test folders share.

pub mod device;
pub mod frames;
pub mod golden;
pub mod notes;
pub mod running;
pub mod stages;
pub mod twins;

use flate2::{Compression, write::DeflateEncoder};
use rawzip::{CompressionMethod, ZipArchiveWriter};
use std::io::Write;

/// A zip archive of deflated files.
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

/// Where tests that write thousands of files do so: in memory, where there is such a place.
pub fn quick_folder() -> std::path::PathBuf {
    let memory = std::path::PathBuf::from("/dev/shm");
    if memory.is_dir() { memory } else { std::env::temp_dir() }
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
