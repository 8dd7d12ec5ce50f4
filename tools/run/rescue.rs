//! The message after a training that failed: what it kept, and how to continue.

use ivv::internals::train::Checkpoint;
use std::path::Path;

/// Adds to `error`, which ended the run `output` after `step`, the newest checkpoint and how to continue.
pub fn describe(error: anyhow::Error, step: u64, checkpoints: &Path, output: &Path) -> anyhow::Error {
    let stopped = format!("training stopped after step {step}");
    let again = format!("continue with `ivv train --resume -o {}`", output.display());
    let kept = match Checkpoint::newest(checkpoints) {
        Ok(Some(checkpoint)) => {
            let file = Checkpoint::file(checkpoints, checkpoint.step);
            let file = if file.is_file() { &file } else { checkpoints };
            format!("{} holds step {}; {again}", file.display(), checkpoint.step)
        }
        Ok(None) => "there is no checkpoint; start again with --overwrite".to_owned(),
        Err(fault) => format!("the checkpoints cannot be read: {fault}; mend that, then {again}"),
    };
    error.context(format!("{stopped}; {kept}; the reason"))
}

#[cfg(test)]
mod tests {
    use super::describe;
    use std::path::Path;

    #[test]
    fn without_a_checkpoint_the_advice_is_to_start_again() {
        let of = |checkpoints: &Path| {
            format!("{:#}", describe(anyhow::anyhow!("it broke"), 3, checkpoints, Path::new("run")))
        };
        let folder = std::env::temp_dir().join(format!("ivv-kept-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let none = of(&folder);
        assert!(none.contains("--overwrite") && none.ends_with("the reason: it broke"), "{none}");
        std::fs::write(folder.join("00000003.ckpt"), "no checkpoint").unwrap();
        let unreadable = of(&folder);
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(unreadable.contains("00000003.ckpt: is no checkpoint of this version"), "{unreadable}");
        assert!(unreadable.contains("--resume -o run") && !unreadable.contains("--overwrite"), "{unreadable}");
    }
}
