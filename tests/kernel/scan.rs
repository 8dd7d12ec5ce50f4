//! Prefix sums of the device against the reference.

use crate::common::prelude::*;
use ivv::internals::gpu::generated::Status;
use ivv::internals::reference::exclusive_scan;
use ivv::internals::stage::{PairGrids, Scan};

tested! {
    "scan/scan_reduce.comp" by exclusive_scan in the_prefix_sum_of_any_length_is_the_references;
    "scan/scan_downsweep.comp" by exclusive_scan in the_prefix_sum_of_any_length_is_the_references;
}

/// Lengths around the block (1,024), the step over the blocks before (128) and one.
const SIZES: [usize; 11] = [0, 1, 7, 127, 1023, 1024, 1025, 4096, 131_071, 131_072, 131_073];

fn scan_on_device(values: &[u32], index: Option<&[u32]>) -> (Vec<u32>, u32) {
    let gpu = gpu();
    let n = index.map_or(values.len(), <[u32]>::len);
    let scan = Scan::new(&gpu, n).unwrap();
    let count = gpu.upload("count", &[n as u32]).unwrap();
    // One guard word past the end must survive.
    let guarded: Vec<u32> = values.iter().copied().chain([0xDEAD_BEEF]).collect();
    let table = gpu.upload("values", &guarded).unwrap();
    let total = gpu.alloc("total", 1).unwrap();
    let blocks = Grid::Groups((n.div_ceil(1024) as u32).max(1));
    let mut rec = Recording::new();
    let sums = match index {
        None => {
            scan.record(&mut rec, &count, &table, &total, blocks);
            table
        }
        Some(index) => {
            let sums = gpu.upload("sums", &vec![0xDEAD_BEEF; n + 1]).unwrap();
            let index = gpu.upload("index", index).unwrap();
            let args = &gpu.upload("args", &[[7, 1, 1, 7]; 3]).unwrap();
            let emit_args = &gpu.alloc("emit args", 1).unwrap();
            let frame_status = &gpu.upload("status", &[Status::default()]).unwrap();
            let grids = PairGrids { blocks, args, emit_args, frame_status, capacity: u32::MAX };
            scan.record_gathered(&mut rec, &count, [&index, &table], &sums, &total, grids);
            sums
        }
    };
    gpu.run(&rec).unwrap();
    let mut found = gpu.read(&sums).unwrap();
    assert_eq!(found.pop(), Some(0xDEAD_BEEF), "the word past the end was overwritten");
    (found, gpu.read(&total).unwrap()[0])
}

#[test]
fn the_prefix_sum_of_any_length_is_the_references() {
    for n in SIZES {
        let mut random = Random::new(n as u64);
        let values: Vec<u32> = (0..n).map(|_| random.bits() as u32 % 1000).collect();
        let reference = exclusive_scan(&values);
        assert!(n < 2 || reference.total > 0);
        let (offsets, total) = scan_on_device(&values, None);
        assert_same(format_args!("{n} values"), &offsets, &reference.offsets);
        assert_eq!(total, reference.total, "{n} values");

        // Half as many, each from anywhere.
        let index: Vec<u32> = (0..n / 2).map(|_| (random.bits() % n as u64) as u32).collect();
        let named: Vec<u32> = index.iter().map(|i| values[*i as usize]).collect();
        let reference = exclusive_scan(&named);
        let (offsets, total) = scan_on_device(&values, Some(&index));
        assert_same(format_args!("{} of {n} values", n / 2), &offsets, &reference.offsets);
        assert_eq!(total, reference.total, "{} of {n} values", n / 2);
    }
}
