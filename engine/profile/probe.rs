//! What the device itself can do: small kernels that each saturate one resource.

use crate::error::{Error, Result};
use crate::gpu::generated::{
    probe_atomic, probe_copy, probe_dispatch, probe_exp2, probe_fma, probe_gather, probe_shuffle,
};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use crate::report::statistics::median;
use crate::vk::DeviceKind;
use serde::Serialize;
use std::time::Instant;

/// Seconds for which [`WarmUp`] keeps a device busy before the first of what is timed, and before each other.
const HEATED: [f64; 2] = [1.0, 0.05];

/// Threads of a workgroup, steps of a round, and chains of the kernels in `shaders-glsl/probe`.
const LOCAL: u32 = 64;
const STEPS: u32 = 16;
const CHAINS: u32 = 8;
const SHUFFLE_CHAINS: u32 = 4;
const PARTS: u32 = 8;
const ROWS: u32 = 4;
const TERMS: u32 = 8;
const WORD: u32 = 0x1234_5678;
/// A run that takes as long, nanoseconds, is long enough to tell a rate.
const LONG_ENOUGH: f64 = 1e7;
/// Runs of that length; the fastest counts.
const RUNS: usize = 10;
/// Dispatches of which the median counts.
const DISPATCHES: u32 = 200;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Probe {
    /// Bytes of a streaming copy, read and written.
    Copy,
    Transfer,
    Fill,
    Gather,
    Fma,
    Exp2,
    Shuffle,
    Atomic,
}

impl Probe {
    pub const ALL: [Probe; 8] = {
        use Probe::*;
        [Copy, Transfer, Fill, Gather, Fma, Exp2, Shuffle, Atomic]
    };

    pub fn name(self) -> &'static str {
        match self {
            Probe::Copy => "bytes moved by a kernel",
            Probe::Transfer => "copy command",
            Probe::Fill => "fill command",
            Probe::Gather => "gather of 64-byte rows",
            Probe::Fma => "multiply-add",
            Probe::Exp2 => "exp2",
            Probe::Shuffle => "shuffle",
            Probe::Atomic => "atomic add",
        }
    }

    pub fn unit(self) -> &'static str {
        match self {
            Probe::Copy | Probe::Transfer | Probe::Fill => "B/s",
            Probe::Gather => "rows/s",
            Probe::Fma => "flop/s",
            _ => "/s",
        }
    }

    /// One run of size `size`, from 0; each size is twice the one before, up to the probe's largest.
    pub fn prepare(self, gpu: &Gpu, size: u32) -> Result<Prepared> {
        let mut recording = Recording::new();
        recording.section("probe");
        let (amount, output) = match self {
            Probe::Copy => record_copy(gpu, &mut recording, size),
            Probe::Transfer | Probe::Fill => self.record_command(gpu, &mut recording, size),
            Probe::Gather | Probe::Atomic => self.record_scattered(gpu, &mut recording, size),
            Probe::Fma | Probe::Exp2 | Probe::Shuffle => self.record_chains(gpu, &mut recording, size),
        }?;
        Ok(Prepared { recording, amount, output })
    }

    /// A copy or a fill command. As its siblings below it gives amount and output, see [`Prepared`].
    fn record_command(self, gpu: &Gpu, rec: &mut Recording, size: u32) -> Result<(f64, Buf<u32>)> {
        let n = 1usize << (18 + size.min(if is_cpu(gpu) { 4 } else { 7 }));
        let target: Buf<u32> = gpu.alloc("probe target", n)?;
        let bytes = 4.0 * n as f64;
        if self == Probe::Fill {
            rec.fill(target.slice(), WORD);
            return Ok((bytes, target));
        }
        rec.copy(gpu.upload("probe source", &vec![WORD; n])?.slice(), target.slice());
        Ok((2.0 * bytes, target))
    }

    fn record_scattered(self, gpu: &Gpu, rec: &mut Recording, size: u32) -> Result<(f64, Buf<u32>)> {
        // The rows stay within a cache, as the splats of neighbouring tiles do: scattered, and as fast as can be.
        let (n_rows, n) =
            if is_cpu(gpu) { (1u32 << 14, 1u32 << (12 + size.min(6))) } else { (1 << 18, 1 << (12 + size.min(12))) };
        let (mask, grid) = (n_rows - 1, Grid::Threads(n));
        if self == Probe::Gather {
            let items: Vec<[f32; 4]> =
                (0..4 * n_rows).map(|i| [(i / 4 % 1024) as f32, (i % 4) as f32, 1.0, 0.0]).collect();
            let (rows, sums) = (&gpu.upload("probe rows", &items)?, &gpu.alloc("probe sums", n as usize)?);
            rec.pass(probe_gather::Args { rows, sums }, probe_gather::Push { n, mask }, grid);
            return Ok((f64::from(n * ROWS), sums.cast()));
        }
        let words: Buf<u32> = gpu.alloc("probe words", 16 * n_rows as usize)?;
        rec.fill(words.slice(), 0);
        let term = &gpu.upload("probe term", &[1u32])?;
        rec.pass(probe_atomic::Args { term, words: &words }, probe_atomic::Push { n, mask }, grid);
        Ok((f64::from(n) * f64::from(TERMS), words))
    }

    /// Chains of arithmetic or shuffles: enough workgroups to fill the device, more rounds with each size; below 2^24 their
    /// sums are exact.
    fn record_chains(self, gpu: &Gpu, rec: &mut Recording, size: u32) -> Result<(f64, Buf<u32>)> {
        let groups = if is_cpu(gpu) { 64 } else { 8192 };
        let n_threads = groups * LOCAL;
        let rounds = 4 << size.min(8);
        let grid = Grid::Groups(groups);
        let steps = f64::from(rounds * STEPS) * f64::from(n_threads);
        Ok(match self {
            Probe::Fma => {
                let factors = &gpu.upload("probe factors", &[[1f32; 4]])?;
                let sums = &gpu.alloc("probe sums", n_threads as usize)?;
                rec.pass(probe_fma::Args { factors, sums }, probe_fma::Push { rounds }, grid);
                (2.0 * f64::from(CHAINS) * steps, sums.cast())
            }
            Probe::Exp2 => {
                let starts = &gpu.upload("probe starts", &[[0.0f32, 0.25, 0.5, 0.75], [1.0, 1.25, 1.5, 1.75]])?;
                let means = &gpu.alloc("probe means", n_threads as usize)?;
                rec.pass(probe_exp2::Args { starts, means }, probe_exp2::Push { rounds }, grid);
                (f64::from(CHAINS) * steps, means.cast())
            }
            _ => {
                let items: Vec<[u32; 4]> = (0..LOCAL).map(|i| [4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3]).collect();
                let (starts, turned) =
                    (&gpu.upload("probe starts", &items)?, &gpu.alloc("probe turned", n_threads as usize)?);
                rec.pass(probe_shuffle::Args { starts, turned }, probe_shuffle::Push { rounds }, grid);
                (f64::from(SHUFFLE_CHAINS) * steps, turned.cast())
            }
        })
    }

    pub fn rate(self, gpu: &Gpu) -> Result<f64> {
        let run = |prepared: &Prepared| -> Result<f64> {
            let times = gpu.run_timed(&prepared.recording)?;
            times.last().map(|pass| pass.ns).ok_or_else(no_timestamps)
        };
        // Kernels are compiled at their first run.
        run(&self.prepare(gpu, 0)?)?;
        let (mut size, mut amount) = (0, 0.0);
        loop {
            let prepared = self.prepare(gpu, size)?;
            let ns = run(&prepared)?;
            if ns >= LONG_ENOUGH || prepared.amount <= amount {
                let runs = (0..RUNS).map(|_| run(&prepared)).collect::<Result<Vec<_>>>()?;
                return Ok(prepared.amount / runs.into_iter().fold(ns, f64::min) * 1e9);
            }
            (size, amount) = (size + 1, prepared.amount);
        }
    }
}

fn record_copy(gpu: &Gpu, rec: &mut Recording, size: u32) -> Result<(f64, Buf<u32>)> {
    // The largest is far beyond a GPU's caches.
    let n = (1u32 << (16 + size.min(if is_cpu(gpu) { 4 } else { 8 }))).min((gpu.caps().max_binding_bytes / 16) as u32);
    let items: Vec<[f32; 4]> = (0..n).map(|i| [i as f32, 1.0, 2.0, 3.0]).collect();
    let (source, target) = (&gpu.upload("probe source", &items)?, &gpu.alloc("probe target", n as usize)?);
    rec.pass(probe_copy::Args { source, target }, probe_copy::Push { n }, Grid::Groups(n.div_ceil(LOCAL * PARTS)));
    Ok((32.0 * f64::from(n), target.cast()))
}

/// Keeps a GPU busy before what is timed, so that its clock is that of a long run: one that waits for the host lowers it (an H200
/// from 1980 to 345 MHz) and takes a while to raise it again.
pub struct WarmUp {
    work: Option<Prepared>,
    is_hot: bool,
}

impl WarmUp {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let largest = 8;
        let work = if is_cpu(gpu) { None } else { Some(Probe::Fma.prepare(gpu, largest)?) };
        Ok(WarmUp { work, is_hot: false })
    }

    pub fn before(&mut self, gpu: &Gpu) -> Result<()> {
        let Some(work) = &self.work else { return Ok(()) };
        let (begun, seconds) = (Instant::now(), HEATED[usize::from(self.is_hot)]);
        self.is_hot = true;
        while begun.elapsed().as_secs_f64() < seconds {
            gpu.run(&work.recording)?;
        }
        Ok(())
    }
}

fn is_cpu(gpu: &Gpu) -> bool {
    gpu.caps().kind == DeviceKind::Cpu
}

pub struct Prepared {
    /// Its passes; the last is the probe.
    pub recording: Recording,
    /// Its work, in the unit of [`Probe::unit`] without the time.
    pub amount: f64,
    /// Its result, as words.
    pub output: Buf<u32>,
}

pub(super) fn no_timestamps() -> Error {
    Error::NoDevice {
        reason: "it has no timestamps, so nothing can be measured".to_owned(),
        remedy: "choose another with --device".to_owned(),
    }
}

/// `n` dispatches that each add one to the word that is given back, and wait for one another.
pub fn dispatches(gpu: &Gpu, n: u32) -> Result<(Recording, Buf<u32>)> {
    let (steps, count) = (&gpu.upload("probe steps", &[1u32])?, gpu.upload("probe count", &[0u32])?);
    let mut rec = Recording::new();
    rec.section("probe");
    for _ in 0..n {
        rec.pass(probe_dispatch::Args { steps, count: &count }, (), Grid::Groups(1));
    }
    Ok((rec, count))
}

/// Nanoseconds of a dispatch that does next to nothing: between its timestamps, and in all with its barrier and label.
pub fn dispatch_ns(gpu: &Gpu) -> Result<[f64; 2]> {
    let (rec, _count) = dispatches(gpu, DISPATCHES)?;
    gpu.run(&rec)?;
    let times = gpu.run_timed(&rec)?;
    let (Some(first), Some(last)) = (times.first(), times.last()) else { return Err(no_timestamps()) };
    let between: Vec<f64> = times.iter().map(|pass| pass.ns).collect();
    Ok([median(&between), (last.begin_ns - first.begin_ns) / f64::from(DISPATCHES - 1)])
}
