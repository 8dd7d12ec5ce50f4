//! The results of the probes.

/// The sum of the eight chains of `probe_fma` after `steps` steps with both factors 1, in thread `local` of its workgroup.
pub fn fma_sum(local: u32, steps: u32) -> f32 {
    (0..8).map(|chain| (chain + local + steps) as f32).sum()
}

/// The x that solves x = 2^-x.
pub fn exp2_solution() -> f64 {
    (0..100).fold(0.5, |x: f64, _| (-x).exp2())
}

/// The lane, of a subgroup of `size`, whose value lane `lane` holds after `steps` turns.
pub fn turned_lane(lane: u32, steps: u32, size: u32) -> u32 {
    (lane + steps) % size
}

/// The rows that thread `i` of `probe_gather` takes of `mask + 1`, or those that it adds to in `probe_atomic`: `n` of them.
pub fn scattered_rows(i: u32, n: u32, mask: u32) -> impl Iterator<Item = u32> {
    (0..n).map(move |k| n.wrapping_mul(i).wrapping_add(k).wrapping_mul(2_654_435_761) & mask)
}
