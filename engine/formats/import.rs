use std::io::Read;
use std::path::Path;

use super::format::{Reader, Start};
use super::scene::Scene;
use crate::error::{Error, Result};
use crate::files::{cannot_read, open_file};

pub(super) fn read(path: &Path, readers: &[Reader]) -> Result<Scene> {
    let mut bytes = Vec::new();
    if !path.is_dir() {
        let opened = open_file(path).and_then(|file| file.take(4).read_to_end(&mut bytes));
        opened.map_err(|fault| cannot_read(path, &fault))?;
    }
    let start = Start { path, bytes: &bytes };
    let Some(reader) = readers.iter().find(|reader| (reader.knows)(&start)) else {
        let supported: Vec<&str> = readers.iter().map(|reader| reader.what).collect();
        let remedy = format!("give {}; splat-transform makes a PLY of many others", supported.join(", or "));
        return Err(Error::data(path, "", "not a recognised scene format", &remedy));
    };
    (reader.read)(path)
}
