//! `ivv play` in a program that was built without windows.

use anyhow::bail;

/// Options of `ivv play`.
#[derive(clap::Args)]
pub struct Args {
    /// What the program with windows takes.
    #[arg(value_name = "ARGS", trailing_var_arg = true, allow_hyphen_values = true)]
    rest: Vec<std::ffi::OsString>,
}

pub fn run(_: &Args) -> anyhow::Result<()> {
    bail!(
        "expected a program with windows, found one that was built without; run `tools/setup.sh play` and `cargo build --release \
         --features play`, or use `ivv serve`"
    )
}
