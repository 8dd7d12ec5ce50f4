//! What a step would take on a card that is not here: from its recording, the kernels' own costs, what a compiler made of them,
//! and the card's figures. Nothing waits and nothing is idle, so most passes take longer.

use super::budget::Budgets;
use super::loops::Loops;
use ivv::internals::gpu::generated::constants::types::TILE;
use ivv::internals::gpu::table::{self, Cost, Spec};
use ivv::internals::gpu::{KernelInfo, Pass, Recording};
use ivv::internals::profile::Card;
use ivv::internals::report::Table;
use ivv::internals::report::statistics::median;
use ivv::internals::stage::Counters;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Bytes that an atomic addition moves in the shared cache.
const ATOMIC_BYTES: f64 = 8.0;
/// Bytes of a scattered row, which the shared cache serves.
const ROW_BYTES: f64 = 64.0;
/// Instructions a compiler is taken to make of one of SPIR-V where it compiled no kernel.
const PLAIN: f64 = 1.0;

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Part {
    pub name: String,
    pub passes: usize,
    /// Windows between barriers that begin with one of them.
    pub barriers: usize,
    pub bytes: f64,
    /// Bytes that the shared cache serves.
    pub cached: f64,
    pub instructions: f64,
    pub flops: f64,
    /// Microseconds that each of these takes alone: memory, shared cache, issue, arithmetic.
    pub alone_us: [f64; 4],
    /// Microseconds of the dispatches behind barriers.
    pub barriers_us: f64,
    /// Microseconds in all: of each pass the longest of `alone_us`, and the dispatches.
    pub us: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    pub card: Card,
    pub counters: Counters,
    /// By section, in the order of the step.
    pub parts: Vec<Part>,
    pub total: Part,
    pub compiler: String,
    pub block: usize,
    /// Kernels that nobody compiled for the chip: their instructions are counted in SPIR-V and multiplied by what the others became.
    pub uncompiled: Vec<String>,
}

impl Estimate {
    /// Of `recording` for the work of `counters`, with the instructions that `compiled` has for the card's chip.
    pub fn new(card: &Card, recording: &Recording, counters: &Counters, compiled: &Budgets) -> Self {
        let mut model = Model::new(card, counters, compiled, recording);
        let first: BTreeSet<usize> =
            recording.windows().iter().filter_map(|window| window.iter().min().copied()).collect();
        let mut parts: Vec<Part> = Vec::new();
        for (at, pass) in recording.passes().iter().enumerate() {
            let name = pass.label.split('/').next().unwrap_or_default();
            let found = parts.iter().position(|part| part.name == name).unwrap_or_else(|| {
                parts.push(Part { name: name.to_owned(), ..Part::default() });
                parts.len() - 1
            });
            parts[found].add(&model.pass(pass, usize::from(first.contains(&at))));
        }
        let mut total = Part { name: "sum".to_owned(), ..Part::default() };
        parts.iter().for_each(|part| total.add(part));
        let pixels =
            recording.passes().iter().filter_map(|pass| Some(table::kernel(pass.kernel()?.name)?.value("PIXELS")));
        let block = card.lanes as usize * pixels.max().unwrap_or(0);
        let compiler = compiled.driver(card.compiled.0).unwrap_or("nobody").to_owned();
        let uncompiled = model.uncompiled.into_iter().map(str::to_owned).collect();
        Estimate { card: *card, counters: counters.clone(), parts, total, compiler, block, uncompiled }
    }

    pub fn table(&self) -> Table {
        #[rustfmt::skip]
        let heads = ["section", "passes", "barriers", "MB", "MB cached", "M instr.", "Gflop", "memory, us", "cache", "issue",
            "arithmetic", "barriers, us", "sum, us"];
        let row = |part: &Part| {
            let mut cells = vec![part.name.clone(), part.passes.to_string(), part.barriers.to_string()];
            let counted = [(part.bytes, 1e6), (part.cached, 1e6), (part.instructions, 1e6), (part.flops, 1e9)];
            cells.extend(counted.map(|(value, unit)| short(value / unit)));
            cells.extend(part.alone_us.into_iter().chain([part.barriers_us, part.us]).map(short));
            cells
        };
        Table::new(&heads, self.parts.iter().chain([&self.total]).map(row))
    }

    /// The assumptions, a sentence each.
    pub fn assumptions(&self) -> Vec<String> {
        let Estimate { card, counters, compiler, .. } = self;
        let mut told = vec![
            "Each pass takes the longest of four times: bytes over bandwidth, bytes of the shared cache over its bandwidth, \
             instructions over the issue rate, float operations over their rate. Nothing waits for memory, no lane is idle, no \
             processor runs out of work, so most passes take longer. One may take less where the card's own compiler needs fewer \
             instructions. Passes without a barrier between them are added up."
                .to_owned(),
            "Bytes and float operations are those of the table of kernels: what must be moved and done at least. Scattered rows, \
             and 8 bytes of an atomic addition, come from the shared cache."
                .to_owned(),
            format!(
                "Instructions are those that {compiler} made of each kernel for {}: {}. A loop goes round as often as its program \
                 says; else a lane takes one unit of the kernel's work a round. The blends go round once for each batch of a list \
                 and once for each Gaussian that hits a block of pixels.",
                card.compiled.0, card.compiled.1
            ),
            format!("A hit is {} pairs of a pixel and a Gaussian: no pixel of a block is finished before the others.", self.block),
            format!("A barrier costs {} us, whatever is in front of it or behind it.", card.barrier_ns.value / 1e3),
            format!(
                "{:.0} of {:.0} Gaussians are in view, {:.0} touch a tile; {:.0} pairs with tiles; {:.0} pixels; {:.0} pairs of a pixel \
                 and a Gaussian are evaluated, {:.0} of them add to their pixel.",
                counters.active,
                counters.gaussians,
                counters.visible,
                counters.intersections,
                counters.pixels,
                counters.evaluated,
                counters.added
            ),
            "The feed of images and the host are not in it; neither are density control and evaluation.".to_owned(),
        ];
        if !self.uncompiled.is_empty() {
            told.push(format!(
                "Not compiled for that chip, and taken to become as many instructions for one of SPIR-V as the others: {}.",
                self.uncompiled.join(", ")
            ));
        }
        told
    }

    pub fn terminal(&self) -> String {
        format!("{}\n{}\n{}", self.figures(self.card.name).plain(), self.table().plain(), self.listed())
    }

    pub fn markdown(&self) -> String {
        let (table, figures) = (self.table().markdown(), self.figures("figure").markdown());
        format!("### {}\n\n{table}\n{figures}\n{}", self.card.name, self.listed())
    }

    fn figures(&self, head: &str) -> Table {
        let row = |(name, value, source): (&str, String, &str)| vec![name.to_owned(), value, source.to_owned()];
        let value = if head == "figure" { "value" } else { "" };
        Table::new(&[head, value, "source"], self.card.figures().map(row)).with_text(3)
    }

    fn listed(&self) -> String {
        self.assumptions().iter().map(|line| format!("- {line}\n")).collect()
    }
}

/// Microseconds of each section, by card.
pub fn side_by_side(estimates: &[Estimate]) -> String {
    let heads: Vec<&str> = ["section"].into_iter().chain(estimates.iter().map(|one| one.card.name)).collect();
    let row = |part: &Part| {
        let cell = |one: &Estimate| {
            let found = one.parts.iter().chain([&one.total]).find(|other| other.name == part.name);
            found.map_or_else(|| "-".to_owned(), |part| short(part.us))
        };
        [part.name.clone()].into_iter().chain(estimates.iter().map(cell)).collect()
    };
    let parts = estimates.first().into_iter().flat_map(|one| one.parts.iter().chain([&one.total]));
    Table::new(&heads, parts.map(row)).markdown()
}

impl Part {
    fn add(&mut self, other: &Part) {
        self.passes += other.passes;
        self.barriers += other.barriers;
        self.bytes += other.bytes;
        self.cached += other.cached;
        self.instructions += other.instructions;
        self.flops += other.flops;
        self.alone_us.iter_mut().zip(other.alone_us).for_each(|(sum, us)| *sum += us);
        self.barriers_us += other.barriers_us;
        self.us += other.us;
    }
}

/// A number with three digits.
fn short(value: f64) -> String {
    match value {
        0.0 => "0".to_owned(),
        ..10.0 => format!("{value:.2}"),
        ..100.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

struct Model<'a> {
    card: &'a Card,
    counters: &'a Counters,
    compiled: &'a Budgets,
    loops: BTreeMap<&'static str, Loops>,
    /// Instructions that a compiler makes of one of SPIR-V.
    ratio: f64,
    uncompiled: BTreeSet<&'static str>,
}

impl<'a> Model<'a> {
    fn new(card: &'a Card, counters: &'a Counters, compiled: &'a Budgets, recording: &Recording) -> Self {
        let kernels = recording.passes().iter().filter_map(Pass::kernel);
        let loops: BTreeMap<&str, Loops> = kernels.map(|kernel| (kernel.name, Loops::of(kernel.spirv))).collect();
        let ratio =
            |(name, loops): (&&str, &Loops)| compiled.instructions(name, card.compiled.0).map(|n| n / loops.written());
        let known: Vec<f64> = loops.iter().filter_map(ratio).collect();
        let ratio = if known.is_empty() { PLAIN } else { median(&known) };
        Model { card, counters, compiled, loops, ratio, uncompiled: BTreeSet::new() }
    }

    fn pass(&mut self, pass: &Pass, barriers: usize) -> Part {
        let (units, cost) = self.counters.cost(pass);
        let Card { bytes, cache, issue, flops, exp2, barrier_ns, .. } = self.card;
        let Cost { rows, atomics, .. } = cost;
        let instructions = pass.kernel().map_or(0.0, |kernel| self.instructions(pass, kernel, units));
        let moved = cost.bytes + cost.copied + cost.filled;
        let cached = ROW_BYTES * rows + ATOMIC_BYTES * atomics;
        let us = |amount: f64, rate: f64| 1e6 * amount / rate;
        let arithmetic = us(cost.flops, flops.value).max(us(cost.exp2, exp2.value));
        let alone_us = [us(moved, bytes.value), us(cached, cache.value), us(instructions, issue.value), arithmetic];
        let barriers_us = barriers as f64 * barrier_ns.value / 1e3;
        Part {
            name: String::new(),
            passes: 1,
            barriers,
            bytes: moved,
            cached,
            instructions,
            flops: cost.flops,
            alone_us,
            barriers_us,
            us: alone_us.into_iter().fold(0.0, f64::max) + barriers_us,
        }
    }

    /// Instructions of subgroups that a dispatch issues.
    fn instructions(&mut self, pass: &Pass, kernel: &'static KernelInfo, units: f64) -> f64 {
        let (Some(loops), Some(spec)) = (self.loops.get(kernel.name), table::kernel(kernel.name)) else { return 0.0 };
        let made = self.compiled.instructions(kernel.name, self.card.compiled.0);
        if made.is_none() {
            self.uncompiled.insert(kernel.name);
        }
        let ratio = made.map_or(self.ratio, |made| made / loops.written());
        let lanes = f64::from(self.card.lanes);
        let subgroups = self.counters.workgroups(pass) * (f64::from(kernel.local) / lanes).ceil();
        ratio * loops.run(subgroups, |depth| self.rounds(spec, pass.scale, units, depth) / lanes)
    }

    /// Rounds, of one lane each, of a loop inside `depth` others whose rounds the data decide.
    fn rounds(&self, spec: &Spec, scale: f64, units: f64, depth: usize) -> f64 {
        let Counters { visible, intersections, evaluated, .. } = *self.counters;
        let pixels = spec.value("PIXELS").max(1) as f64;
        match (spec.file, depth) {
            // The blocks of a tile each walk its list in batches.
            ("blend/blend_fwd.comp" | "blend/blend_bwd.comp", 0) => {
                scale * intersections * f64::from(TILE * TILE) / (f64::from(self.card.lanes) * pixels)
            }
            ("blend/blend_fwd.comp" | "blend/blend_bwd.comp", _) => scale * evaluated / pixels,
            // The rows of tiles that a Gaussian touches.
            ("project/project.comp", _) | ("tiles/emit.comp", 0) => (intersections * visible).sqrt(),
            ("project/project_bwd.comp", _) => intersections,
            _ => units,
        }
    }
}
