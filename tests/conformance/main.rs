//! `ivv-conformance`: runs numerical extremes on a device and reports, row by row, whether it passes.

use anyhow::{Context, bail, ensure};
use clap::Parser;
use ivv::internals::files::write_atomic;
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::vk::{Caps, DeviceChoice};
use ivv::internals::words::count;
use ivv_conformance::{Bench, ROWS, Row, Tally};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

const REVISION: &str = match option_env!("IVV_REVISION") {
    Some(revision) => revision,
    None => "of an unknown revision",
};

/// Runs numerical extremes on a device and reports, row by row, whether it passes.
#[derive(Parser)]
#[command(name = "ivv-conformance", version)]
struct Args {
    /// The device: an index or part of a name from `ivv devices`.
    #[arg(long)]
    device: Option<String>,
    /// Runs only these rows, by name: n03,n24.
    #[arg(long, value_delimiter = ',')]
    rows: Vec<String>,
    /// Also runs the cases that take minutes on a CPU.
    #[arg(long)]
    slow: bool,
    /// Runs under Vulkan's validation layer; a message fails its row.
    #[arg(long)]
    validation: bool,
    /// Also writes the report to this Markdown file.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

struct Done {
    row: Row,
    tally: Tally,
    seconds: f64,
}

fn main() -> ExitCode {
    let (fault, code) = match run(&Args::parse()) {
        Ok(None) => return ExitCode::SUCCESS,
        // The device or its driver is not fit.
        Ok(Some(failed)) => (failed, 4),
        Err(error) => (format!("{error:#}"), error.downcast_ref().map_or(2, ivv::Error::exit_code)),
    };
    eprintln!("ivv-conformance: {fault}");
    ExitCode::from(code)
}

/// Where Vulkan keeps compiled kernels: `$XDG_CACHE_HOME/ivv` or `~/.cache/ivv`.
fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"))).map(|cache| cache.join("ivv"))
}

fn out(line: &str) -> anyhow::Result<()> {
    writeln!(std::io::stdout(), "{line}").context("standard output cannot be written")
}

/// Says what failed, where rows did.
fn run(args: &Args) -> anyhow::Result<Option<String>> {
    let is_markdown = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "md");
    ensure!(args.output.as_ref().is_none_or(is_markdown), "unsupported report type; use .md");
    if let Some(name) = args.rows.iter().find(|name| !ROWS.iter().any(|row| row.name == name.as_str())) {
        bail!("unknown row `{name}`; choose from n01 to n{}", ROWS.len());
    }
    let choice = DeviceChoice {
        device: args.device.clone(),
        validation: args.validation,
        pipeline_cache: cache_folder(),
        ..DeviceChoice::default()
    };
    // New buffers are filled with a pattern, so that what was never written shows.
    let open = || Gpu::open(&Options { device: choice.clone(), poison: true, ..Options::default() }).map(Arc::new);
    let mut gpu = open()?;
    let caps = gpu.caps().clone();
    head(&caps, args).iter().try_for_each(|line| out(line))?;
    let mut all = Vec::new();
    for row in ROWS.iter().filter(|row| args.rows.is_empty() || args.rows.iter().any(|name| name == row.name)) {
        let begun = Instant::now();
        let tally = row.run(&Bench { lend: &|| Box::new(&gpu), slow: args.slow });
        let done = Done { row: *row, tally, seconds: begun.elapsed().as_secs_f64() };
        done.print()?;
        // What a row did to the device is not the next one's affair.
        if !done.tally.faults.is_empty() {
            let told =
                || format!("the device does not reopen after row {} failed; run the others with --rows", row.name);
            gpu = open().with_context(told)?;
        }
        all.push(done);
    }
    out(&format!("\n{}", total(&all)))?;
    if let Some(path) = &args.output {
        let report = markdown(&head(&caps, args), &all);
        write_atomic(path, |to| to.write_all(report.as_bytes()))?;
    }
    let n_failed = n_of(&all, "FAILED");
    Ok((n_failed > 0).then(|| {
        let rows = count(n_failed, "row");
        format!("{rows} failed on this device: report it with the output above, or choose another device with --device")
    }))
}

fn n_of(all: &[Done], verdict: &str) -> usize {
    all.iter().filter(|done| done.tally.verdict() == verdict).count()
}

impl Done {
    /// The error that is nearest to its bound, and the bound.
    fn worst(&self) -> String {
        self.tally.worst.as_ref().map_or("-".into(), |worst| format!("{:.1e} of {:.1e}", worst.error, worst.allowed))
    }

    fn notes(&self) -> impl Iterator<Item = String> {
        let faults = self.tally.faults.iter().map(|fault| format!("failed: {fault}"));
        faults.chain(self.tally.not_run.iter().map(|reason| format!("not run: {reason}")))
    }

    fn print(&self) -> anyhow::Result<()> {
        let (cases, verdict, worst) = (self.tally.cases, self.tally.verdict(), self.worst());
        out(&format!(
            "{}  {verdict:7} {cases:5} cases  {worst:20} {:6.1} s  {}",
            self.row.name, self.seconds, self.row.what
        ))?;
        self.notes().try_for_each(|note| out(&format!("       {note}")))
    }
}

fn total(all: &[Done]) -> String {
    let cases: usize = all.iter().map(|done| done.tally.cases).sum();
    let [passed, failed, not_run] = ["passed", "FAILED", "not run"].map(|verdict| n_of(all, verdict));
    format!("{} passed, {failed} failed, {not_run} did not run; {}", count(passed, "row"), count(cases, "case"))
}

fn head(caps: &Caps, args: &Args) -> Vec<String> {
    let yes = |b: bool| if b { "yes" } else { "no" };
    let pinned = if caps.subgroup_pinned { "pinned" } else { "fixed" };
    vec![
        format!("device: {} ({:?}), Vulkan {}", caps.name, caps.kind, caps.api),
        format!("driver: {}", caps.driver.trim()),
        format!("subgroups: {} lanes ({} to {}, {pinned})", caps.subgroup_size, caps.subgroup_min, caps.subgroup_max),
        format!(
            "features: push descriptors {}, 64-bit atomics {}, half precision {}; bindings of {} MiB",
            yes(caps.push_descriptors),
            yes(caps.int64_atomics),
            yes(caps.float16),
            caps.max_binding_bytes >> 20,
        ),
        format!(
            "engine: ivv {} {REVISION}, validation {}, slow cases {}",
            env!("CARGO_PKG_VERSION"),
            yes(args.validation),
            yes(args.slow)
        ),
    ]
}

const COLUMNS: [&str; 7] =
    ["row", "what takes extreme values", "what must hold", "bound", "cases", "worst of its bound", "result"];

fn markdown(head: &[String], all: &[Done]) -> String {
    let mut lines = vec!["# Numerical extremes".to_owned(), String::new()];
    lines.extend(head.iter().map(|line| format!("- {line}")));
    lines.extend([String::new(), format!("**{}**", total(all)), String::new()]);
    lines.push(format!("| {} |", COLUMNS.join(" | ")));
    lines.push(format!("|{}", " --- |".repeat(COLUMNS.len())));
    for done in all {
        let Row { name, what, expected, bound, .. } = done.row;
        let cells = format!("{name} | {what} | {expected} | {bound} | {} | {}", done.tally.cases, done.worst());
        lines.push(format!("| {cells} | {} |", done.tally.verdict()));
    }
    let notes = all.iter().flat_map(|done| done.notes().map(move |note| format!("- {}: {note}", done.row.name)));
    let notes: Vec<String> = notes.collect();
    if !notes.is_empty() {
        lines.push(String::new());
        lines.extend(notes);
    }
    lines.join("\n") + "\n"
}
