//! Scenes, cameras and pictures: what is written is read back, and no damaged file gets past the readers.

mod cameras;
mod clips;
mod demo;
mod export;
mod foreign;
pub mod formats;
mod four_dgs;
mod four_dgs_losses;
mod navigator;
mod orbit;
mod pictures;
mod ply;
mod points;
pub mod sog;
mod summary;
mod views;

use std::fs;
use std::path::{Path, PathBuf};

use ivv::Error;
use ivv::scene::{Motion, Splats};

/// A folder of its own for one test, removed when it is dropped.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("ivv-scene-{test}-{}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.file(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The (place, reason, remedy) of a data error that names `path`, all of them told.
pub(crate) fn fault<T: std::fmt::Debug>(outcome: ivv::Result<T>, path: &Path) -> String {
    match outcome {
        Err(Error::Data { file, place, reason, remedy }) => {
            assert_eq!(file, path, "the error names another file");
            assert!(!reason.is_empty() && !remedy.is_empty(), "an error without reason or remedy: {reason}; {remedy}");
            format!("{place}: {reason}; {remedy}")
        }
        Err(other) => panic!("not a data error: {other}"),
        Ok(value) => panic!("accepted: {value:?}"),
    }
}

/// A scene of `n_static + n_dynamic` Gaussians, every value different, the populations interleaved in the file.
fn sample(sh_degree: u32, n_static: usize, n_dynamic: usize) -> Splats {
    let n = n_static + n_dynamic;
    let mut next = 0.0_f32;
    let mut number = || {
        next += 0.37;
        (next % 5.0) - 2.5
    };
    let mut splats = Splats::new(sh_degree);
    splats.n_static = n_static;
    for i in 0..n {
        splats.position.push([number(), number(), number()]);
        splats.rotation.push([number(), number(), number(), number()]);
        splats.scale.push([number(), number(), number()]);
        splats.opacity.push(number());
        splats.sh.extend((0..(sh_degree + 1).pow(2)).map(|_| [number(), number(), number()]));
        if i >= n_static {
            splats.motion.push(Motion { velocity: [number(), 0.0, number()], t_center: number(), t_scale: number() });
        }
    }
    // Even rows to the dynamic ones as long as there are any, so that reading has to separate them.
    let (mut dynamic, mut still): (Vec<u32>, Vec<u32>) = (0..n as u32).partition(|row| row % 2 == 0);
    while dynamic.len() > n_dynamic {
        still.extend(dynamic.pop());
    }
    while dynamic.len() < n_dynamic {
        dynamic.extend(still.pop());
    }
    still.sort_unstable();
    dynamic.sort_unstable();
    splats.source_row = still.into_iter().chain(dynamic).collect();
    splats.check().unwrap();
    splats
}
