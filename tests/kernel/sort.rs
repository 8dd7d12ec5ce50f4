//! Radix sort of the device against the reference.

use crate::common::prelude::*;
use ivv::internals::reference::radix_sort;
use ivv::internals::stage::{Carried, Sort, Unsorted};

tested! {
    "sort/sort_count.comp" by radix_sort in the_sort_of_any_length_is_the_references_and_stable;
    "sort/sort_scatter.comp" by radix_sort in the_sort_of_any_length_is_the_references_and_stable;
    "sort/sort_exchange.comp" by radix_sort in the_sort_of_any_length_is_the_references_and_stable;
}

const GUARD: u32 = 0xDEAD_BEEF;

fn sort_on_device(keys: &[u32], values: Option<&[u32]>, n_bits: u32) -> (Vec<u32>, Vec<u32>) {
    let gpu = gpu();
    let n = keys.len();
    let guarded = |words: &[u32]| [words, &[GUARD]].concat();
    let upload = |name, words: &[u32]| gpu.upload(name, &guarded(words)).unwrap();
    let sort = Sort::new(&gpu, n, n_bits).unwrap();
    let count = gpu.upload("count", &[n as u32]).unwrap();
    let room = upload("values", values.unwrap_or(&vec![0; n]));
    let keys = upload("keys", keys);
    let carried = if values.is_some() { Carried::Values(&room) } else { Carried::Places(&room) };
    // Workgroups without keys, as a folded grid has.
    let blocks = &Grid::Groups(n.div_ceil(2048) as u32 + 2);
    let unsorted = Unsorted { count: &count, keys: &keys, carried, n_bits, blocks };
    let mut rec = Recording::new();
    sort.record_clear(&mut rec);
    let (keys_out, values_out) = sort.record(&mut rec, unsorted);
    gpu.run(&rec).unwrap();
    for given in [&keys, &room] {
        assert_eq!(gpu.read(given).unwrap()[n], GUARD, "the word past the end was overwritten");
    }
    let read = |buffer| {
        let mut found: Vec<u32> = gpu.read(buffer).unwrap();
        found.truncate(n);
        found
    };
    (read(&keys_out), read(&values_out))
}

#[test]
fn the_sort_of_any_length_is_the_references_and_stable() {
    // Around blocks of 2,048 keys, and around ranges of 1, 2, 4, 8 and 16 of them.
    let sizes = [(1, 32), (63, 32), (2047, 8), (2048, 16), (2049, 24), (4097, 7), (8200, 9), (33_000, 13), (50_001, 1)];
    for (n, n_bits) in sizes.into_iter().chain([(70_000, 32), (131_072, 3), (600_000, 13)]) {
        let mut random = Random::new(n as u64);
        // Few distinct keys, so that stability shows.
        let keys: Vec<u32> = (0..n).map(|_| (random.bits() as u32) & 0x0F03_0F0F).collect();
        let places: Vec<u32> = (0..n as u32).collect();
        let values: Vec<u32> = places.iter().map(|place| place ^ 0x55).collect();
        let assert_sorted = |what: &str, found: (Vec<u32>, Vec<u32>), truth: (Vec<u32>, Vec<u32>)| {
            let what = format!("{n} {what} by {n_bits} bits");
            assert_same(format_args!("{what}: keys"), &found.0, &truth.0);
            assert_same(what, &found.1, &truth.1);
        };
        let found = sort_on_device(&keys, Some(&values), n_bits);
        assert_sorted("values", found, radix_sort(&keys, &values, n_bits, 2048));
        let found = sort_on_device(&keys, None, n_bits);
        assert_sorted("places", found, radix_sort(&keys, &places, n_bits, 2048));
    }
}

#[test]
fn equal_keys_keep_their_order_through_every_pass() {
    let values: Vec<u32> = (0..10_000).rev().collect();
    // The largest key too, which what lies past the end is taken for.
    for key in [0, 7, u32::MAX] {
        let keys = vec![key; values.len()];
        assert_same(format_args!("values of {key}"), &sort_on_device(&keys, Some(&values), 32).1, &values);
        assert_same(format_args!("places of {key}"), &sort_on_device(&keys, None, 32).1, &Vec::from_iter(0..10_000));
    }
}
