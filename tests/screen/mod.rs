//! What `ivv` writes where nobody reads it, where there is no room, and on terminals.

mod device;
mod lost;
mod manual;
mod options;
#[cfg(unix)]
mod terminal;
mod trace;
mod width;

use crate::common::prelude::*;
use crate::common::program::command as ivv;

impl Folder {
    fn capture(&self) -> String {
        let options = ivv::internals::synth::Options { frames: 2, ..ivv::internals::synth::Preset::Tiny.options(7) };
        ivv::internals::synth::write_capture(&self.0.join("capture"), &options, 2, &mut |_, _| {}).unwrap();
        self.path("capture")
    }
}
