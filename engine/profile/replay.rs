//! Runs a dumped dispatch again: variants of its kernel side by side, with their times and their differences.

use crate::error::{Error, Result};
use crate::gpu::{Dispatch, Gpu, Grid, KernelInfo, Recording, Slice};
use crate::report::statistics::{Ratio, mad, median, paired_ratio};
use serde::Serialize;

/// Difference of two outputs, over all that a kernel writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Difference {
    pub words: u64,
    pub max_abs: f64,
    /// The same over the largest magnitude in the buffer it is in.
    pub max_rel: f64,
}

impl Difference {
    fn add(&mut self, bytes: &[u8], reference: &[u8], is_float: bool) {
        let number = |word: &[u8; 4]| {
            if is_float { f64::from(f32::from_le_bytes(*word)) } else { f64::from(u32::from_le_bytes(*word)) }
        };
        let (mut largest, mut apart) = (0f64, 0f64);
        for (word, other) in bytes.as_chunks().0.iter().zip(reference.as_chunks().0) {
            let (a, b) = (number(word), number(other));
            largest = largest.max(b.abs());
            if word != other {
                self.words += 1;
                // Of two values of which one is no number, nothing is near.
                apart = apart.max(if (a - b).is_nan() { f64::INFINITY } else { (a - b).abs() });
            }
        }
        self.max_abs = self.max_abs.max(apart);
        self.max_rel = self.max_rel.max(if apart > 0.0 { apart / largest } else { 0.0 });
    }
}

#[derive(Clone, Debug, Serialize)]
pub struct Replayed {
    pub kernel: String,
    pub median_ns: f64,
    /// Median absolute deviation, nanoseconds.
    pub mad_ns: f64,
    /// Time over that of the first kernel, run by run.
    pub ratio: Ratio,
    pub from_first: Difference,
    pub from_dumped: Difference,
}

pub struct Replay<'a> {
    gpu: &'a Gpu,
    dispatch: &'a Dispatch,
    /// The bindings, and the former content of those that are written.
    slices: Vec<Slice>,
    pristine: Vec<Option<Slice>>,
}

impl<'a> Replay<'a> {
    pub fn new(gpu: &'a Gpu, dispatch: &'a Dispatch) -> Result<Self> {
        let (mut slices, mut pristine): (Vec<Slice>, Vec<Option<Slice>>) = (Vec::new(), Vec::new());
        for bound in &dispatch.bindings {
            let (slice, before) = match bound.same_as.and_then(|earlier| slices.get(earlier).cloned()) {
                Some(slice) => (slice, None),
                None => {
                    let slice = gpu.upload(&bound.name, &bound.before)?.slice();
                    let is_written = bound.after.is_some();
                    (slice, if is_written { Some(gpu.upload("before", &bound.before)?.slice()) } else { None })
                }
            };
            slices.push(slice);
            pristine.push(before);
        }
        Ok(Replay { gpu, dispatch, slices, pristine })
    }

    /// Runs each of `kernels`, variants of the dumped one, `n` times in turns, each on what was there before the dispatch.
    pub fn run(&self, kernels: &[&'static KernelInfo], n: usize) -> Result<Vec<Replayed>> {
        let recordings = kernels.iter().map(|kernel| self.record(kernel)).collect::<Result<Vec<_>>>()?;
        let mut times = vec![Vec::with_capacity(n); kernels.len()];
        let mut outputs = Vec::new();
        // The first run compiles.
        for recording in &recordings {
            self.time(recording)?;
            outputs.push(self.outputs()?);
        }
        for run in 0..n {
            for turn in 0..kernels.len() {
                let which = (run + turn) % kernels.len();
                times[which].push(self.time(&recordings[which])?);
            }
        }
        let dumped: Vec<&[u8]> = self.dispatch.bindings.iter().filter_map(|bound| bound.after.as_deref()).collect();
        let floats = kernels.iter().fold(0, |mask, kernel| mask | kernel.floats);
        let difference = |of: &[Vec<u8>], from: &[&[u8]]| {
            let mut sum = Difference::default();
            for ((place, bytes), reference) in self.written().zip(of).zip(from) {
                sum.add(bytes, reference, floats >> place & 1 == 1);
            }
            sum
        };
        let first: Vec<&[u8]> = outputs.first().into_iter().flatten().map(Vec::as_slice).collect();
        let lines = kernels.iter().zip(&times).zip(&outputs).map(|((kernel, ns), output)| Replayed {
            kernel: kernel.name.to_owned(),
            median_ns: median(ns),
            mad_ns: mad(ns),
            ratio: paired_ratio(ns, &times[0]),
            from_first: difference(output, &first),
            from_dumped: difference(output, &dumped),
        });
        Ok(lines.collect())
    }

    fn written(&self) -> impl Iterator<Item = usize> {
        self.pristine.iter().enumerate().filter(|(_, before)| before.is_some()).map(|(place, _)| place)
    }

    fn outputs(&self) -> Result<Vec<Vec<u8>>> {
        self.written().map(|place| self.gpu.read(&self.slices[place].bytes())).collect()
    }

    fn time(&self, recording: &Recording) -> Result<f64> {
        let times = self.gpu.run_timed(recording)?;
        times.last().map(|pass| pass.ns).ok_or_else(super::probe::no_timestamps)
    }

    fn record(&self, kernel: &'static KernelInfo) -> Result<Recording> {
        self.check(kernel)?;
        let mut rec = Recording::new();
        rec.section("replay");
        for (slice, before) in self.slices.iter().zip(&self.pristine) {
            if let Some(before) = before {
                rec.copy(before.clone(), slice.clone());
            }
        }
        let args = self.gpu.upload("replay args", &self.dispatch.groups)?;
        rec.pass_untyped(kernel, self.slices.clone(), self.dispatch.push.clone(), Grid::Indirect(args.slice()));
        Ok(rec)
    }

    /// Refuses a kernel with other bindings than the dumped one.
    fn check(&self, kernel: &KernelInfo) -> Result<()> {
        let Dispatch { push, kernel: dumped, bindings, .. } = self.dispatch;
        if kernel.bindings.iter().map(|b| b.name).eq(bindings.iter().map(|b| b.name.as_str()))
            && kernel.push_bytes as usize == push.len()
        {
            return Ok(());
        }
        let what = format!("`{}` for a dispatch of `{dumped}`", kernel.name);
        let remedy = "name kernels of the same shader, see shaders-glsl/README.md";
        Err(Error::data(what.as_ref(), "", "has other bindings", remedy))
    }
}
