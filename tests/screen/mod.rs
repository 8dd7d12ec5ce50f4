//! What `ivv` writes where nobody reads it, where there is no room, and on terminals.

mod device;
mod lost;
mod manual;
mod options;
#[cfg(unix)]
mod terminal;
mod trace;
mod width;

use std::path::PathBuf;
use std::process::Command;

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("ivv-screen-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir(&folder).unwrap();
        Folder(folder)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// A tiny capture; its path.
    fn capture(&self) -> String {
        let options = ivv::synth::Options { frames: 2, ..ivv::synth::Preset::Tiny.options(7) };
        ivv::synth::write_capture(&self.0.join("capture"), &options, 2, &mut |_, _| {}).unwrap();
        self.path("capture")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// `ivv` on the device of this lane.
fn ivv(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.args(arguments);
    let has_device = ["train", "render", "devices", "eval"].iter().any(|verb| arguments.contains(verb));
    if let (Ok(device), true) = (std::env::var("IVV_TEST_DEVICE"), has_device) {
        command.args(["--device", &device]);
    }
    command
}
