//! N27: the cameras' time offsets.

use super::fixtures::clocks::on_device;
use super::prelude::*;
use ivv::internals::reference::{Clock, ClockRule};
use ivv::internals::stage::{BETA1, BETA2, OFFSET_BOUND};

pub(super) fn offsets(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let starts = [("all equal", [0.3; 6]), ("one of 1e3", [1e3, 0.0, 0.0, 0.0, 0.0, 0.0])];
    for (name, offsets) in starts {
        steps(bench, tally, name, offsets, 400);
    }
    if bench.slow {
        steps(bench, tally, "a drift of a million steps", [0.0; 6], 1_000_000);
    } else {
        tally.leave_out("a drift of a million steps: minutes on a CPU, `--slow` runs it");
    }
    Ok(())
}

fn steps(bench: &Bench, tally: &mut Tally, name: &str, offsets: [f64; 6], n: usize) {
    tally.case(name, |tally| {
        let rule = ClockRule { rate: 1e-2, regulariser: 1e-4, bound: OFFSET_BOUND };
        let start = offsets.map(|offset| Clock { offset, is_free: true, ..Clock::default() });
        // The gauge comes after the bound, and takes off at most what Adam moves an offset by: its longest step.
        let bound = OFFSET_BOUND + rule.rate * (1.0 - BETA1) / (1.0 - BETA2).sqrt();
        let mut random = Random::new(3);
        // A gradient with a drift common to all cameras: the gauge takes it.
        let steps: Vec<(usize, f32)> = (0..n).map(|i| (i % 6, 1.0 + random.uniform(-2.0, 2.0) as f32)).collect();
        let found = on_device(&bench.gpu(), &start, &steps, &rule, 0.1, |_| false)?;
        for (i, offsets) in found.iter().enumerate() {
            tally.within(&format!("the mean after step {i}"), offsets.iter().sum::<f64>().abs() / 6.0, 1e-6)?;
            ensure!(offsets.iter().all(|x| x.abs() <= bound), "out of bounds after step {i}: {offsets:?}");
        }
        ensure!(found.first() != found.last(), "nothing moved");
        Ok(())
    });
}
