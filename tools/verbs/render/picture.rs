//! Pictures of views: their formats, and the check that they are finite.

use ivv::internals::scene::{Frame, View};
use std::path::Path;

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    Png,
    Exr,
    Safetensors,
}

impl Format {
    /// Writes `frame` into `folder`, named after `view`.
    pub fn write(self, frame: &Frame, folder: &Path, view: &View) -> ivv::Result<()> {
        match self {
            Format::Png => frame.write_png(folder.join(format!("{}.png", view.name))),
            Format::Exr => frame.write_exr(&folder.join(format!("{}.exr", view.name))),
            Format::Safetensors => frame.write_safetensors(&folder.join(format!("{}.safetensors", view.name))),
        }
    }
}

pub fn check_finite(frame: &Frame, view: &View) -> ivv::Result<()> {
    let values = frame.color.as_flattened().iter().chain(&frame.alpha).chain(&frame.depth);
    let values = values.chain(&frame.inverse_depth).chain(frame.flow.as_flattened());
    let count = values.filter(|v| !v.is_finite()).count() as u64;
    if count > 0 {
        let remedy = "run `ivv inspect` on the scene, which shows how large its numbers are";
        return Err(ivv::Error::NonFinite { what: format!("view `{}`", view.name), count, remedy });
    }
    Ok(())
}
