//! A step of several processes, each of which sees some of its images.

use super::report::ImageReport;
use super::{Inputs, Step, Trainer};
use crate::error::Result;
use crate::gpu::Recording;
use crate::internals::train::objective::Report;
use crate::internals::train::{Ranks, Shared, logged};
use std::time::Instant;

impl Trainer {
    /// The images of a step of `n` that this process sees.
    pub(in crate::internals::train) fn own_images(&self, n: usize) -> std::ops::Range<usize> {
        let (rank, size) = self.ranks.as_ref().map_or((0, 1), |ranks| (ranks.rank(), ranks.size()));
        rank * n / size..(rank + 1) * n / size
    }

    pub fn shared(&self) -> Shared {
        self.shared
    }

    /// Submits a step of which other processes see some images, and waits for the images of all.
    pub(super) fn start_shared(&mut self, ranks: &dyn Ranks, inputs: Inputs) -> Result<()> {
        let begun = Instant::now();
        let mut results = loop {
            let (rec, results) = self.record(&inputs)?;
            self.gpu.start(&rec)?.wait()?;
            // The steps before it have ended, too.
            self.end_all()?;
            if self.is_complete(&inputs, &results.reports)? {
                break results;
            }
        };
        self.shared.compute_s += begun.elapsed().as_secs_f64();
        results.known = self.exchange(ranks, &inputs, &results.reports)?;
        let mut rec = Recording::new();
        self.in_workspace(&inputs, |trainer, work| trainer.record_step(&mut rec, work, &inputs))?;
        let running = self.gpu.start(&rec)?;
        self.step = inputs.step;
        self.in_flight.push_back(Step { inputs, running, results });
        Ok(())
    }

    /// Adds up the gradients of all processes; gives the reports of all images.
    fn exchange(&mut self, ranks: &dyn Ranks, inputs: &Inputs, reports: &[Report]) -> Result<Vec<ImageReport>> {
        let Trainer { gpu, scene, objective, batch: Some(batch), .. } = self else { return Ok(Vec::new()) };
        let cameras = &objective.cameras;
        let begun = Instant::now();
        let mut touched = batch.touched(gpu)?;
        ranks.or(&mut touched)?;
        let waited = Instant::now();
        let mut rows = batch.rows(gpu, scene, &touched)?;
        ranks.sum(&mut rows.sums)?;
        batch.put(gpu, scene, &rows, &touched)?;
        // Of each image its report and the gradients of its camera.
        let own = inputs.own();
        let mut bytes = Vec::new();
        for ((truth, report), kept) in inputs.truths().zip(reports).zip(cameras.kept(gpu, own.clone())?) {
            let numbers = ImageReport::new(gpu, objective, truth, report)?.numbers();
            bytes.extend_from_slice(bytemuck::cast_slice(&numbers));
            bytes.extend(kept);
        }
        let all = ranks.gather(&bytes)?;
        let n = inputs.images.len();
        let mut known = Vec::with_capacity(n);
        for (at, of_image) in all.chunks_exact(all.len() / n).enumerate() {
            let (numbers, kept) = of_image.split_at(8 * ImageReport::n_numbers());
            known.push(ImageReport::of_numbers(&bytemuck::pod_collect_to_vec(numbers)));
            if !own.contains(&at) {
                cameras.put_kept(gpu, at, kept)?;
            }
        }
        let ids: usize = rows.ids.iter().map(Vec::len).sum();
        self.shared.ranks = ranks.size() as u64;
        self.shared.steps += 1;
        self.shared.rows += ids as u64;
        self.shared.bytes += size_of_val(rows.sums.as_slice()) as u64;
        self.shared.wait_s += waited.duration_since(begun).as_secs_f64();
        self.shared.exchange_s += waited.elapsed().as_secs_f64();
        Ok(known)
    }
}

impl ImageReport {
    /// The fixed ones, and those that terms log.
    fn n_numbers() -> usize {
        5 + logged().count()
    }

    fn numbers(&self) -> Vec<f64> {
        let counts = [self.active, self.visible, self.intersections, self.bad_gradients].map(f64::from);
        let terms = logged().map(|term| self.terms.get(term.key).copied().unwrap_or(f64::NAN));
        [self.loss].into_iter().chain(counts).chain(terms).collect()
    }

    fn of_numbers(numbers: &[f64]) -> Self {
        let (counts, terms) = numbers.split_at(5);
        let has_value = |(_, value): &(&str, f64)| !value.is_nan();
        ImageReport {
            loss: counts[0],
            active: counts[1] as u32,
            visible: counts[2] as u32,
            intersections: counts[3] as u32,
            bad_gradients: counts[4] as u32,
            terms: logged().map(|term| term.key).zip(terms.iter().copied()).filter(has_value).collect(),
        }
    }
}
