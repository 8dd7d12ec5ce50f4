//! Files out of zip archives: arrays of NumPy's `.npz`, images of PlayCanvas' `.sog`.

use std::io::Read;
use std::path::Path;

use flate2::bufread::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive, ZipSliceArchive};

use super::file::read_bytes;
use crate::error::{self, Error};

/// A zip archive whose files are stored or deflated.
pub(crate) struct Archive(ZipSliceArchive<Vec<u8>>);

impl Archive {
    pub(crate) fn open(path: &Path, remedy: &str) -> error::Result<Self> {
        let archive = ZipArchive::from_slice(read_bytes(path)?);
        let damaged = |cause| Error::data(path, "", format!("not a zip archive that can be read: {cause}"), remedy);
        Ok(Archive(archive.map_err(damaged)?))
    }

    /// The first file `name`, of `most` bytes at most; its size and checksum are checked.
    pub(crate) fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, String> {
        let damaged = |cause| format!("cannot be read: {cause}");
        let mut entries = self.0.entries();
        let entry = loop {
            match entries.next_entry().map_err(damaged)? {
                Some(entry) if entry.file_path().as_bytes() == name.as_bytes() => break entry,
                Some(_) => {}
                None => return Err("is not in the archive".to_owned()),
            }
        };
        if entry.flags().is_encrypted() {
            return Err("is encrypted".to_owned());
        }
        let size = entry.uncompressed_size_hint();
        if size > most {
            return Err(format!("has {size} bytes, at most {most} are allowed"));
        }
        let packed = self.0.get_entry(entry.wayfinder()).map_err(damaged)?;
        let unpacked: Box<dyn Read + '_> = match entry.compression_method() {
            CompressionMethod::STORE => Box::new(packed.data()),
            CompressionMethod::DEFLATE => Box::new(DeflateDecoder::new(packed.data())),
            other => return Err(format!("is compressed by the method {}; only 0 and 8 are read", other.as_u16())),
        };
        let mut content = Vec::new();
        // The size is what the archive says; what comes out of it may be more.
        let read = packed.verifying_reader(unpacked.take(size + 1)).read_to_end(&mut content);
        read.map_err(|fault| format!("does not unpack: {fault}"))?;
        Ok(content)
    }
}
