//! N26: frames that need more room than there is, and counts up to the last of 32 bits.

use super::prelude::*;
use anyhow::anyhow;
use ivv::internals::gpu::generated::Status;
use ivv::internals::gpu::{Grid, Recording};
use ivv::internals::reference::exclusive_scan;
use ivv::internals::stage::{Outputs, PairGrids, Renderer, Scan};

pub(super) fn counts(bench: &Bench, tally: &mut Tally) -> Result<()> {
    let splats = scene(51, 300, 1);
    let (expected, roomy) = bench.render(&splats, &view())?;
    let n = roomy.intersections as u32;
    ensure!(n > 500 && roomy.replays == 0, "{roomy:?}");
    for (capacity, replays) in [(0, 1), (1, 1), (n - 1, 1), (n, 0), (n + 1, 0)] {
        tally.case(format!("room for {capacity} of {n} intersections"), |_| {
            let gpu = bench.gpu();
            let mut renderer = Renderer::new(Arc::clone(&gpu), &splats, Constants::default())?;
            renderer.limit_intersections(capacity);
            let (frame, report) = renderer.render(&view(), Outputs::All)?;
            ensure!((report.replays, report.intersections) == (replays, u64::from(n)), "{report:?}");
            ensure!(bits(&frame) == bits(&expected), "other bits");
            let (frame, report) = renderer.render(&view(), Outputs::All)?;
            ensure!(report.replays == 0 && bits(&frame) == bits(&expected), "the second frame: {report:?}");
            Ok(())
        });
    }
    let capacity = 1234;
    for n in [0, capacity - 1, capacity, capacity + 1, 1 << 31, u32::MAX - 1, u32::MAX] {
        tally.case(format!("a count of {n} with room for {capacity}"), |_| decided(bench, n, capacity, 0));
    }
    tally.case("a count that fits, in a frame that has failed before", |_| decided(bench, 10, capacity, 1));
    for (each, total) in [(1 << 20, u32::MAX), ((1 << 20) - 1, u32::MAX), (838_860, 4_294_963_200), (419_430, 1 << 31)]
    {
        tally.case(format!("5120 counts of {each}, and the rest of {total}"), |_| {
            // Up to the total, where that is below 2^32 - 1; past it the sum has to stay there.
            let mut values = vec![each; 5120];
            let sum: u64 = values.iter().map(|x| u64::from(*x)).sum();
            values.push(u64::from(total).saturating_sub(sum) as u32);
            let (found, exact) = (summed(bench, &values)?, exclusive_scan(&values).total);
            ensure!(found == total && exact == total, "a sum of {found}, of {exact} in the reference");
            Ok(())
        });
    }
    Ok(())
}

/// The kernel that decides whether `n` intersections fit, here of one Gaussian: more than `capacity`, or in a frame that has
/// failed, leave none and empty every grid.
fn decided(bench: &Bench, n: u32, capacity: u32, failed: u32) -> Result<()> {
    let gpu = bench.gpu();
    let args = gpu.upload("args", &[[7, 1, 1, 7]; 3])?;
    let emit_args = gpu.alloc("emit args", 1)?;
    let frame_status = gpu.upload("status", &[Status { failed, ..Status::default() }])?;
    let [count, index, table] = [1, 0, n].map(|word| gpu.upload("word", &[word]));
    let (sums, total) = (gpu.alloc("sums", 1)?, gpu.alloc("n", 1)?);
    let blocks = Grid::Groups(1);
    let grids = PairGrids { blocks, args: &args, emit_args: &emit_args, frame_status: &frame_status, capacity };
    let mut rec = Recording::new();
    Scan::new(&gpu, 1)?.record_gathered(&mut rec, &count?, [&index?, &table?], &sums, &total, grids);
    gpu.run(&rec)?;
    let (left, status) = (gpu.read(&total)?[0], gpu.read(&frame_status)?[0]);
    // Of threads, of a scan, which is over, and of a sort.
    let [threads, _, sort]: [[u32; 4]; 3] = gpu.read(&args)?.try_into().map_err(|_| anyhow!("three grids"))?;
    let grids = [threads, sort, gpu.read(&emit_args)?[0]];
    let fits = n <= capacity && failed == 0;
    ensure!((status.failed != 0) != fits, "failed: {}", status.failed);
    ensure!(n <= capacity || status.failed & 2 != 0, "failed: {}, not for want of room", status.failed);
    ensure!(status.n_intersections == n && status.capacity_intersections == capacity, "{status:?}");
    ensure!(left == if fits { n } else { 0 }, "{left} left");
    ensure!(fits || grids.iter().all(|grid| grid[0] == 0 && grid[3] == 0), "grids of {grids:?}");
    ensure!(n == 0 || !fits || grids.iter().all(|grid| grid[0] > 0), "grids of {grids:?}");
    Ok(())
}

fn summed(bench: &Bench, values: &[u32]) -> Result<u32> {
    let gpu = bench.gpu();
    let scan = Scan::new(&gpu, values.len())?;
    let count = gpu.upload("count", &[values.len() as u32])?;
    let buffer = gpu.upload("values", values)?;
    let total = gpu.alloc("total", 1)?;
    let mut rec = Recording::new();
    scan.record(&mut rec, &count, &buffer, &total, Grid::Groups(values.len().div_ceil(1024) as u32));
    gpu.run(&rec)?;
    Ok(gpu.read(&total)?[0])
}
