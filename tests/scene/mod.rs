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

use crate::common::prelude::*;
use ivv::Error;

pub(crate) use crate::common::folder::Folder;

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
