//! Radix sort of the device against the twin.

use crate::common::device::gpu;
use crate::common::random::Random;
use crate::common::twins::tested;
use ivv::gpu::{Grid, Recording};
use ivv::stage::Sort;
use ivv::twin::radix_sort;

tested! {
    "sort/sort_count.comp" by radix_sort in the_sort_of_any_length_is_the_twins_and_stable;
    "sort/sort_places.comp" by radix_sort in the_sort_of_any_length_is_the_twins_and_stable;
    "sort/sort_scatter.comp" by radix_sort in the_sort_of_any_length_is_the_twins_and_stable;
}

fn sort_on_device(keys: &[u32], values: &[u32], n_passes: u32) -> (Vec<u32>, Vec<u32>) {
    let gpu = gpu();
    let n_blocks = keys.len().div_ceil(2048) as u32;
    let sort = Sort::new(&gpu, keys.len()).unwrap();
    let count = gpu.upload("count", &[keys.len() as u32]).unwrap();
    let pairs = (gpu.upload("keys", keys).unwrap(), gpu.upload("values", values).unwrap());
    let mut rec = Recording::new();
    let (keys_out, values_out) = sort.record(&mut rec, &count, (&pairs.0, &pairs.1), n_passes, &Grid::Groups(n_blocks));
    gpu.run(&rec).unwrap();
    let read = |buffer| {
        let mut found: Vec<u32> = gpu.read(buffer).unwrap();
        found.truncate(keys.len());
        found
    };
    (read(&keys_out), read(&values_out))
}

#[test]
fn the_sort_of_any_length_is_the_twins_and_stable() {
    for (n, n_passes) in [(1, 4), (63, 4), (2047, 1), (2048, 2), (2049, 3), (70_000, 4), (50_001, 1), (600_000, 2)] {
        let mut random = Random::new(n as u64);
        // Few distinct keys, so that stability shows.
        let keys: Vec<u32> = (0..n).map(|_| (random.bits() as u32) & 0x0F03_0F0F).collect();
        let values: Vec<u32> = (0..n as u32).collect();
        let found = sort_on_device(&keys, &values, n_passes);
        assert!(found == radix_sort(&keys, &values, n_passes, 2048), "{n} keys, {n_passes} passes");
    }
}

#[test]
fn equal_keys_keep_their_order_through_every_pass() {
    let values: Vec<u32> = (0..10_000).rev().collect();
    let (_, found) = sort_on_device(&vec![7; values.len()], &values, 4);
    assert_eq!(found, values);
}
