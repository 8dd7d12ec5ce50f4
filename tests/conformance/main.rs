//! `ivv-conformance`: runs numerical extremes on a device and reports, row by row, whether it passes.

use anyhow::{Context, bail, ensure};
use clap::Parser;
use ivv::internals::files::write_atomic;
use ivv::internals::gpu::{Gpu, Options};
use ivv::internals::vk::{Caps, DeviceChoice};
use ivv::internals::words::count;
use ivv_conformance::{Bench, ROWS, Row, Tally, Verdict};
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Of the engine.
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
    /// Also writes the report to this file, .md or .html.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes results, and errors too, as JSON on standard output.
    #[arg(long)]
    json: bool,
}

/// Rows failed: the device or its driver is not fit, which is exit code 4.
#[derive(Debug)]
struct Failed(usize);

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} failed on this device: report it with the output above, or choose another device with --device",
            count(self.0, "row")
        )
    }
}

impl std::error::Error for Failed {}

/// A row and what came of it.
#[derive(serde::Serialize)]
struct Done {
    row: &'static str,
    what: &'static str,
    expected: &'static str,
    bound: &'static str,
    verdict: Verdict,
    seconds: f64,
    #[serde(flatten)]
    tally: Tally,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let Err(error) = run(&args) else { return ExitCode::SUCCESS };
    eprintln!("ivv-conformance: {error:#}");
    let failed = error.downcast_ref::<Failed>().map(|_| 4);
    ExitCode::from(error.downcast_ref().map(ivv::Error::exit_code).or(failed).unwrap_or(2))
}

/// Where Vulkan keeps compiled kernels: `$XDG_CACHE_HOME/ivv` or `~/.cache/ivv`.
fn cache_folder() -> Option<PathBuf> {
    let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    cache.or_else(|| Some(PathBuf::from(std::env::var_os("HOME")?).join(".cache"))).map(|cache| cache.join("ivv"))
}

/// A line of results.
fn out(line: &str) -> anyhow::Result<()> {
    writeln!(std::io::stdout(), "{line}").context("standard output cannot be written")
}

fn run(args: &Args) -> anyhow::Result<()> {
    let format = args.output.as_ref().map(|path| path.extension().and_then(|e| e.to_str()).unwrap_or_default());
    ensure!(matches!(format, None | Some("md" | "html")), "unsupported report type; use .md or .html");
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
    if !args.json {
        head(&caps, args).iter().try_for_each(|line| out(line))?;
    }
    let mut all = Vec::new();
    for row in ROWS.iter().filter(|row| args.rows.is_empty() || args.rows.iter().any(|name| name == row.name)) {
        let begun = Instant::now();
        let tally = row.run(&Bench { lend: &|| Box::new(&gpu), slow: args.slow });
        let done = Done::new(row, tally, begun.elapsed().as_secs_f64());
        if !args.json {
            done.print()?;
        }
        // What a row did to the device is not the next one's affair.
        if done.verdict == Verdict::Failed {
            let told =
                || format!("the device does not reopen after row {} failed; run the others with --rows", row.name);
            gpu = open().with_context(told)?;
        }
        all.push(done);
    }
    let n_failed = all.iter().filter(|done| done.verdict == Verdict::Failed).count();
    let failed = (n_failed > 0).then(|| anyhow::Error::from(Failed(n_failed)));
    if args.json {
        let mut report = serde_json::json!({ "revision": REVISION, "device": caps, "slow": args.slow, "rows": all });
        if let Some(fault) = &failed {
            report["error"] = serde_json::json!({ "kind": "failed_row", "exit_code": 4, "message": fault.to_string() });
        }
        out(&serde_json::to_string_pretty(&report)?)?;
    } else {
        out(&format!("\n{}", total(&all)))?;
    }
    if let Some(path) = &args.output {
        let lines = head(&caps, args);
        let report = if format == Some("html") { page(&lines, &all) } else { markdown(&lines, &all) };
        write_atomic(path, |to| to.write_all(report.as_bytes()))?;
    }
    failed.map_or(Ok(()), Err)
}

impl Done {
    fn new(row: &Row, tally: Tally, seconds: f64) -> Done {
        let Row { name, what, expected, bound, .. } = *row;
        Done { row: name, what, expected, bound, verdict: tally.verdict(), seconds, tally }
    }

    fn verdict(&self) -> &'static str {
        match self.verdict {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::NotRun => "not run",
        }
    }

    /// The error that is nearest to its bound, and the bound.
    fn worst(&self) -> String {
        self.tally.worst.as_ref().map_or("-".into(), |worst| format!("{:.1e} of {:.1e}", worst.error, worst.bound))
    }

    /// What failed and what was left out.
    fn notes(&self) -> impl Iterator<Item = String> {
        let faults = self.tally.faults.iter().map(|fault| format!("failed: {fault}"));
        faults.chain(self.tally.not_run.iter().map(|reason| format!("not run: {reason}")))
    }

    fn print(&self) -> anyhow::Result<()> {
        let (cases, verdict, worst) = (self.tally.cases, self.verdict(), self.worst());
        out(&format!("{}  {verdict:7} {cases:5} cases  {worst:20} {:6.1} s  {}", self.row, self.seconds, self.what))?;
        self.notes().try_for_each(|note| out(&format!("       {note}")))
    }
}

fn total(all: &[Done]) -> String {
    let n_of = |verdict| all.iter().filter(|done| done.verdict == verdict).count();
    let cases: usize = all.iter().map(|done| done.tally.cases).sum();
    let [passed, failed, not_run] = [Verdict::Passed, Verdict::Failed, Verdict::NotRun].map(n_of);
    format!("{} passed, {failed} failed, {not_run} did not run; {}", count(passed, "row"), count(cases, "case"))
}

/// The device, and how it was asked.
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
        let Done { row, what, expected, bound, tally, .. } = done;
        let cells = format!("{row} | {what} | {expected} | {bound} | {} | {}", tally.cases, done.worst());
        lines.push(format!("| {cells} | {} |", done.verdict()));
    }
    let notes = all.iter().flat_map(|done| done.notes().map(move |note| format!("- {}: {note}", done.row)));
    let notes: Vec<String> = notes.collect();
    if !notes.is_empty() {
        lines.push(String::new());
        lines.extend(notes);
    }
    lines.join("\n") + "\n"
}

fn page(head: &[String], all: &[Done]) -> String {
    let text = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let row = |done: &Done| {
        let Done { row, what, expected, bound, tally, .. } = done;
        let notes: String = done.notes().map(|note| format!("<p>{}</p>", text(&note))).collect();
        let (verdict, worst) = (done.verdict(), done.worst());
        let what = format!("{}{notes}", text(what));
        let cells = [row.to_owned().into(), what, text(expected), text(bound), tally.cases.to_string(), worst];
        let cells: String = cells.iter().map(|cell: &String| format!("<td>{cell}</td>")).collect();
        format!("<tr>{cells}<td class=\"{}\">{verdict}</td></tr>\n", verdict.replace(' ', "-").to_lowercase())
    };
    let rows: String = all.iter().map(row).collect();
    let head: String = head.iter().map(|line| format!("<li>{}</li>", text(line))).collect();
    let names: String = COLUMNS.iter().map(|name| format!("<th>{name}</th>")).collect();
    format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Numerical extremes</title>\n<style>{STYLE}</style>\n\
         <h1>Numerical extremes</h1>\n<ul>{head}</ul>\n<p><b>{}</b></p>\n<table><tr>{names}</tr>\n{rows}</table>\n</html>\n",
        total(all)
    )
}

const STYLE: &str = ":root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;max-width:80rem;margin:auto;padding:1rem}\
table{border-collapse:collapse}td,th{padding:.25rem .5rem;text-align:left;vertical-align:top;border-bottom:1px solid #8884}\
td p{margin:.25rem 0;font-size:.85em;opacity:.75}.failed{color:#d22;font-weight:700}.not-run{opacity:.6}";
