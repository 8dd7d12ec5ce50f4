//! How `ivv` ends: the message of an error, as text or JSON, and the exit code.

use crate::ui::interrupt;
use crate::ui::screen::{self, alert, out};
use crate::ui::stderr;
use clap::error::ErrorKind;
use ivv::internals::words::count;
use serde_json::{Value, json};

/// The error of a capture with faults that are printed already.
#[derive(Debug)]
pub struct FaultyCapture {
    n_faults: u64,
}

impl FaultyCapture {
    pub fn of(n_faults: u64) -> Option<anyhow::Error> {
        (n_faults > 0).then(|| FaultyCapture { n_faults }.into())
    }
}

impl std::fmt::Display for FaultyCapture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the capture has {}", count(self.n_faults, "fault"))
    }
}

impl std::error::Error for FaultyCapture {}

/// Reports a wrong command line, or prints the help; returns the exit code.
pub fn usage(error: &clap::Error) -> u8 {
    let text = error.render();
    if !error.use_stderr() {
        out!("{}", text.to_string().trim_end());
        return end(0);
    }
    // The options are not parsed, so search them for --json.
    if std::env::args_os().any(|argument| argument == "--json") {
        let text = text.to_string();
        let message = text.trim().strip_prefix("error: ").unwrap_or(text.trim());
        out!("{}", json!({ "error": { "kind": "usage", "exit_code": 2, "message": message } }));
    }
    match screen::has_colours() && error.kind() != ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        true => alert!("{}", text.ansi().to_string().trim_end()),
        false => alert!("{}", text.to_string().trim_end()),
    }
    end(2)
}

/// Reports how the verb ended, and returns the exit code.
pub fn exit(done: anyhow::Result<()>, as_json: bool) -> u8 {
    let Err(error) = done else { return end(0) };
    // Results that were written contain the error.
    if as_json && !screen::has_results() {
        out!("{}", json!({ "error": error_json(&error) }));
    }
    screen::leave_bar();
    alert!("ivv: {error:#}");
    end(kind(&error).1)
}

/// The exit code of a verb whose own is `code`, once its output has ended.
fn end(code: u8) -> u8 {
    match screen::finish() {
        Err(fault) if code == 0 => {
            alert!("ivv: {fault}");
            stderr::finish();
            fault.exit_code()
        }
        _ => code,
    }
}

/// Writes a verb's results as JSON, with the fault that it will end with.
pub fn results(of: &impl serde::Serialize, fault: Option<&anyhow::Error>) -> anyhow::Result<()> {
    let mut value = serde_json::to_value(of)?;
    if let Some(fault) = fault {
        value["error"] = error_json(fault);
    }
    screen::print_json(&value)
}

fn error_json(error: &anyhow::Error) -> Value {
    let (kind, exit_code) = kind(error);
    let mut object = json!({ "kind": kind, "exit_code": exit_code, "message": format!("{error:#}") });
    if let Some(ivv::Error::Data { file, place, reason, remedy }) = error.downcast_ref() {
        object["file"] = file.to_string_lossy().into();
        object["place"] = place.as_str().into();
        object["reason"] = reason.as_str().into();
        object["remedy"] = remedy.as_str().into();
    }
    object
}

/// The kind of an error, and its exit code. An error without a kind of its own is one of usage.
fn kind(error: &anyhow::Error) -> (&'static str, u8) {
    if error.downcast_ref::<interrupt::Interrupted>().is_some() {
        return ("interrupted", interrupt::Interrupted::EXIT_CODE);
    }
    if error.downcast_ref::<FaultyCapture>().is_some() {
        return ("data", 3);
    }
    let Some(error) = error.downcast_ref::<ivv::Error>() else { return ("usage", 2) };
    let kind = match error {
        ivv::Error::Data { .. } => "data",
        ivv::Error::NoDevice { .. } => "no_device",
        ivv::Error::OutOfMemory { .. } | ivv::Error::DriverOutOfMemory { .. } => "out_of_memory",
        ivv::Error::DeviceLost { .. } => "device_lost",
        ivv::Error::RanksLost { .. } => "ranks_lost",
        ivv::Error::Vulkan { .. } => "vulkan",
        ivv::Error::NonFinite { .. } => "non_finite",
    };
    (kind, error.exit_code())
}
