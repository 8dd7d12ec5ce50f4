//! What a training that failed has kept.

use ivv::train::Checkpoint;
use std::path::Path;

/// `error`, which ended the run `output` after so many steps, with what `checkpoints` holds of it and how to go on.
pub fn told(error: anyhow::Error, step: u64, checkpoints: &Path, output: &Path) -> anyhow::Error {
    let stopped = format!("training stopped after step {step}");
    let kept = match Checkpoint::newest(checkpoints) {
        Ok(Some(checkpoint)) => {
            let file = Checkpoint::file(checkpoints, checkpoint.step);
            let file = if file.is_file() { &file } else { checkpoints };
            let (file, output) = (file.display(), output.display());
            format!("{file} holds step {}; continue with `ivv train --resume -o {output}`", checkpoint.step)
        }
        Ok(None) | Err(_) => "no checkpoint can be read; begin again with --overwrite".to_owned(),
    };
    error.context(format!("{stopped}; {kept}; the reason"))
}
