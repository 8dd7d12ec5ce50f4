//! Scan, sort, keys and ranges against the standard library.

use crate::common::prelude::*;
use ivv::internals::reference::{DIGITS, block_histograms, exclusive_scan, float_key, radix_sort, ranges};

const SIZES: [usize; 9] = [0, 1, 2, 255, 256, 257, 1023, 1024, 3001];

#[test]
fn the_scan_gives_the_sum_of_everything_before() {
    let mut random = Random::new(1);
    for n in SIZES {
        let counts: Vec<u32> = (0..n).map(|_| (random.bits() % 1000) as u32).collect();
        let scan = exclusive_scan(&counts);
        assert_eq!(scan.offsets.len(), n);
        for i in 0..n {
            assert_eq!(scan.offsets[i], counts[..i].iter().sum::<u32>());
        }
        assert_eq!(scan.total, counts.iter().sum::<u32>());
        assert!(!scan.overflow);
    }
}

#[test]
fn the_scan_saturates_and_says_so_only_when_the_total_does_not_fit() {
    let fits = exclusive_scan(&[u32::MAX - 3, 1, 2]);
    assert_eq!((fits.total, fits.overflow), (u32::MAX, false));
    let over = exclusive_scan(&[u32::MAX - 3, 1, 3, 5, 0]);
    assert_eq!(over.offsets, [0, u32::MAX - 3, u32::MAX - 2, u32::MAX, u32::MAX]);
    assert_eq!((over.total, over.overflow), (u32::MAX, true));
}

#[test]
fn the_radix_sort_is_the_stable_sort_at_every_size_and_block() {
    let mut random = Random::new(2);
    for n in SIZES {
        // With bits above those that it is sorted by, and without.
        for (mask, n_bits) in [(u32::MAX, 32), (u32::MAX, 13), (0x00ff_ffff, 24), (0x3ff, 10), (0x7, 2), (0, 1)] {
            let keys: Vec<u32> = (0..n).map(|_| random.bits() as u32 & mask).collect();
            let values: Vec<u32> = (0..n as u32).collect();
            let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
            expected.sort_by_key(|pair| u64::from(pair.0) % (1 << n_bits));
            for block in [64, 256, 4096] {
                let (keys, values) = radix_sort(&keys, &values, n_bits, block);
                assert_eq!(keys.into_iter().zip(values).collect::<Vec<_>>(), expected, "{n} keys, {n_bits} bits");
            }
        }
    }
}

#[test]
fn histograms_count_every_digit_of_every_block() {
    let mut random = Random::new(3);
    for n in SIZES {
        let keys: Vec<u32> = (0..n).map(|_| random.bits() as u32).collect();
        for shift in [0, 8, 24] {
            let counts = block_histograms(&keys, shift, 256);
            let blocks: Vec<&[u32]> = keys.chunks(256).collect();
            assert_eq!(counts.len(), DIGITS * blocks.len());
            for (b, block) in blocks.iter().enumerate() {
                for digit in 0..DIGITS {
                    let expected = block.iter().filter(|key| (**key >> shift) as usize % DIGITS == digit).count();
                    assert_eq!(counts[digit * blocks.len() + b] as usize, expected);
                }
            }
        }
    }
}

#[test]
fn float_keys_order_as_the_numbers_do() {
    let mut numbers = vec![f32::MIN, -1e10, -1.0, -f32::MIN_POSITIVE, -1e-45, -0.0, 0.0, 1e-45, f32::MIN_POSITIVE];
    numbers.extend([0.01, 0.01f32.next_up(), 1.0, 1.0f32.next_up(), 1e10, f32::MAX, f32::INFINITY]);
    for pair in numbers.windows(2) {
        assert!(float_key(pair[0]) < float_key(pair[1]), "{pair:?}");
    }
}

#[test]
fn ranges_enclose_each_tiles_run() {
    assert_eq!(ranges(&[], 3), [[0, 0]; 3]);
    assert_eq!(ranges(&[0, 0, 2, 2, 2, 4], 6), [[0, 2], [0, 0], [2, 5], [0, 0], [5, 6], [0, 0]]);
    assert_eq!(ranges(&[1], 2), [[0, 0], [0, 1]]);
}
