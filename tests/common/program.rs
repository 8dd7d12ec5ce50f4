//! The program `ivv`, run by tests.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// Verbs that open a device, and arguments with which they do not.
const ON_DEVICE: [&str; 6] = ["bench", "devices", "eval", "profile", "render", "train"];
const WITHOUT: [&str; 2] = ["--disassemble", "--list"];

/// `ivv` with these arguments, on the device of this lane.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ivv"));
    command.args(arguments);
    let verb = arguments.iter().find(|argument| !argument.starts_with('-'));
    let opens = verb.is_some_and(|verb| ON_DEVICE.contains(verb)) && !arguments.iter().any(|a| WITHOUT.contains(a));
    if let (Ok(device), true) = (std::env::var("IVV_TEST_DEVICE"), opens) {
        command.args(["--device", &device]);
    }
    command
}

pub fn ivv(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

pub fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The standard output of a run, which must succeed.
#[track_caller]
pub fn works(arguments: &[&str]) -> String {
    done(&mut command(arguments))
}

/// The standard error of a run, which must succeed.
#[track_caller]
pub fn tells(arguments: &[&str]) -> String {
    fails(arguments, 0)
}

/// As [`works`], of a command.
#[track_caller]
pub fn done(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", told(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// The standard error of a run, which must end with `code`.
#[track_caller]
pub fn fails(arguments: &[&str], code: i32) -> String {
    let output = ivv(arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", told(&output));
    told(&output)
}

#[track_caller]
pub fn json(file: &Path) -> Value {
    let bytes = std::fs::read(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    serde_json::from_slice(&bytes).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// A path as the command line takes it.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
