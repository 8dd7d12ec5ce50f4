//! Stable radix sort: the exact reference of the sort kernels.

use super::scan::exclusive_scan;

/// Values of one digit (8 bits).
pub const DIGITS: usize = 256;

/// A key that orders as the number does: for all finite `x < y`, `float_key(x) < float_key(y)`. Negative zero comes
/// just before zero.
pub fn float_key(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// How often each digit occurs in each block of `block` keys (the last may be short), `[digit][block]`: digit-major,
/// so that the exclusive scan of the whole gives the place of each block's first key of each digit.
pub fn block_histograms(keys: &[u32], shift: u32, block: usize) -> Vec<u32> {
    let n_blocks = keys.len().div_ceil(block);
    let mut counts = vec![0; DIGITS * n_blocks];
    for (i, &key) in keys.iter().enumerate() {
        counts[digit(key, shift) * n_blocks + i / block] += 1;
    }
    counts
}

/// Sorts (key, value) pairs by the lowest `n_bits` bits of the key, least significant digit first, in blocks of `block`
/// keys. Stable: equal keys keep their order. The result does not depend on `block`, nor on how bits are cut into digits.
pub fn radix_sort(keys: &[u32], values: &[u32], n_bits: u32, block: usize) -> (Vec<u32>, Vec<u32>) {
    let (mut keys, mut values) = (keys.to_vec(), values.to_vec());
    let low_bits = u32::MAX.checked_shr(u32::BITS - n_bits).unwrap_or(0);
    for shift in (0..n_bits).step_by(8) {
        (keys, values) = sort_pass(&keys, &values, low_bits, shift, block);
    }
    (keys, values)
}

/// Histogram, scan, scatter for one digit of the keys' `low_bits`.
fn sort_pass(keys: &[u32], values: &[u32], low_bits: u32, shift: u32, block: usize) -> (Vec<u32>, Vec<u32>) {
    let n_blocks = keys.len().div_ceil(block);
    let low: Vec<u32> = keys.iter().map(|key| key & low_bits).collect();
    let mut place = exclusive_scan(&block_histograms(&low, shift, block)).offsets;
    let (mut keys_out, mut values_out) = (vec![0; keys.len()], vec![0; keys.len()]);
    for (i, (&key, &value)) in keys.iter().zip(values).enumerate() {
        let next = &mut place[digit(low[i], shift) * n_blocks + i / block];
        keys_out[*next as usize] = key;
        values_out[*next as usize] = value;
        *next += 1;
    }
    (keys_out, values_out)
}

/// The digit of `key` that starts at bit `shift`.
fn digit(key: u32, shift: u32) -> usize {
    (key >> shift) as usize % DIGITS
}
