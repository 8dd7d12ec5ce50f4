//! Compiled pipelines, kept between runs: a file for each device and driver, with a hash at its end.

use crate::error::Result;
use crate::files::{read_file, write_atomic};
use ash::vk;
use sha2::{Digest, Sha256};
use std::path::Path;

const HASH_BYTES: usize = 32;

/// The file of a device and driver, so that two never overwrite each other's.
pub(super) fn name(uuid: [u8; vk::UUID_SIZE]) -> String {
    let digits: String = uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("pipelines-{digits}.bin")
}

/// The pipelines in `file`; none where it cannot be read or is damaged, since drivers check little more than the header.
pub(super) fn read(file: &Path) -> Vec<u8> {
    let mut bytes = read_file(file).unwrap_or_default();
    let split = bytes.split_last_chunk::<HASH_BYTES>();
    let whole = split.filter(|(data, hash)| Sha256::digest(data)[..] == hash[..]).map_or(0, |(data, _)| data.len());
    bytes.truncate(whole);
    bytes
}

/// Other processes may write it at once: each has a file of its own until it is whole.
pub(super) fn write(file: &Path, data: &[u8]) -> Result<()> {
    if let Some(folder) = file.parent() {
        // Where it cannot be made, the file cannot be written, which is told.
        let _ = std::fs::create_dir_all(folder);
    }
    write_atomic(file, |to| {
        to.write_all(data)?;
        to.write_all(&Sha256::digest(data))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipelines_are_read_as_they_were_written_and_a_damaged_file_has_none() {
        let folder = std::env::temp_dir().join(format!("ivv-pipelines-{}", std::process::id()));
        let file = folder.join(name([7; vk::UUID_SIZE]));
        assert!(read(&file).is_empty(), "there is none yet");
        let data: Vec<u8> = (0..200).collect();
        write(&file, &data).unwrap();
        assert_eq!(read(&file), data);

        let whole = std::fs::read(&file).unwrap();
        let mut flipped = whole.clone();
        flipped[50] ^= 1;
        let shorter = &whole[..whole.len() / 2];
        for (what, bytes) in [("cut", shorter), ("a bit", &flipped[..]), ("no hash", &data[..]), ("short", &data[..9])]
        {
            std::fs::write(&file, bytes).unwrap();
            assert!(read(&file).is_empty(), "{what}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
