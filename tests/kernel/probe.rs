//! The probes leave what their references say: what they time is the work that they count.

use crate::common::prelude::*;
use ivv::internals::profile::{Peaks, Prepared, Probe, dispatch_ns, dispatches};
use ivv::internals::reference::{exp2_solution, fma_sum, scattered_rows, turned_lane};

tested! {
    "probe/probe_fma.comp" by fma_sum in chains_of_multiply_adds_take_every_step;
    "probe/probe_exp2.comp" by exp2_solution in chains_of_exp2_converge;
    "probe/probe_shuffle.comp" by turned_lane in shuffles_turn_every_lane_every_step;
    "probe/probe_gather.comp" by scattered_rows in gathered_rows_are_all_different_and_summed;
    "probe/probe_atomic.comp" by scattered_rows in every_atomic_addition_arrives;
}

/// Words that a probe leaves at a size, and the amount that it counts.
fn words(probe: Probe, size: u32) -> (Vec<u32>, f64) {
    let gpu = gpu();
    let Prepared { recording, amount, output } = probe.prepare(&gpu, size).unwrap();
    gpu.run(&recording).unwrap();
    (gpu.read(&output).unwrap(), amount)
}

/// Steps of a chain in a thread at a size: 16 in each of 4 rounds, twice as many with each size.
fn steps(size: u32) -> u32 {
    16 * (4 << size)
}

fn floats(words: &[u32]) -> impl Iterator<Item = f32> {
    words.iter().map(|word| f32::from_bits(*word))
}

#[test]
fn a_copy_copies_all_of_what_it_counts() {
    let (words, amount) = words(Probe::Copy, 0);
    assert_eq!(amount, 2.0 * 4.0 * words.len() as f64);
    assert!(words.len() >= 4 << 16);
    for (i, vec4) in floats(&words).collect::<Vec<_>>().chunks(4).enumerate() {
        assert_eq!(vec4, [i as f32, 1.0, 2.0, 3.0]);
    }
}

#[test]
fn commands_write_all_of_what_they_count() {
    for (probe, bytes_a_word) in [(Probe::Transfer, 8.0), (Probe::Fill, 4.0)] {
        let (words, amount) = words(probe, 0);
        assert_eq!(amount, bytes_a_word * words.len() as f64);
        assert!(words.len() >= 1 << 18 && words.iter().all(|word| *word == 0x1234_5678), "{probe:?}");
    }
}

#[test]
fn chains_of_multiply_adds_take_every_step() {
    for size in [0, 1] {
        let (words, amount) = words(Probe::Fma, size);
        assert_eq!(amount, 2.0 * 8.0 * f64::from(steps(size)) * words.len() as f64);
        for (i, sum) in floats(&words).enumerate() {
            assert_eq!(sum, fma_sum(i as u32 % 64, steps(size)), "thread {i}");
        }
    }
}

#[test]
fn chains_of_exp2_converge() {
    let (words, amount) = words(Probe::Exp2, 0);
    assert_eq!(amount, 8.0 * f64::from(steps(0)) * words.len() as f64);
    assert!(floats(&words).all(|mean| (f64::from(mean) - exp2_solution()).abs() < 1e-6));
}

#[test]
fn shuffles_turn_every_lane_every_step() {
    let lanes = gpu().caps().subgroup_size;
    let (words, amount) = words(Probe::Shuffle, 0);
    let n_threads = words.len() / 4;
    assert_eq!(amount, 4.0 * f64::from(steps(0)) * n_threads as f64);
    for (i, turned) in words.chunks(4).enumerate() {
        let (first, lane) = (i as u32 % 64 / lanes * lanes, i as u32 % lanes);
        let from = 4 * (first + turned_lane(lane, steps(0), lanes));
        assert_eq!(turned, [from, from + 1, from + 2, from + 3], "thread {i}");
    }
}

#[test]
fn gathered_rows_are_all_different_and_summed() {
    let (words, amount) = words(Probe::Gather, 0);
    let n_threads = words.len() / 4;
    assert_eq!(amount, 4.0 * n_threads as f64);
    let mut seen = std::collections::BTreeSet::new();
    let sums: Vec<f32> = floats(&words).collect();
    // The table has at least as many rows as are taken at this size.
    let mask = if gpu().caps().kind == ivv::internals::vk::DeviceKind::Cpu { (1 << 14) - 1 } else { (1 << 18) - 1 };
    for (i, sum) in sums.chunks(4).enumerate() {
        let rows: Vec<u32> = scattered_rows(i as u32, 4, mask).collect();
        let expected: u32 = rows.iter().map(|row| 4 * (row % 1024)).sum();
        assert_eq!(sum, [expected as f32, 24.0, 16.0, 0.0], "thread {i}");
        seen.extend(rows);
    }
    assert_eq!(seen.len(), 4 * n_threads);
}

#[test]
fn every_atomic_addition_arrives() {
    let (counts, amount) = words(Probe::Atomic, 0);
    let mut expected = vec![0; counts.len()];
    for i in 0..(amount / 8.0) as u32 {
        for row in scattered_rows(i >> 4, 8, counts.len() as u32 / 16 - 1) {
            expected[(16 * row + (i & 15)) as usize] += 1;
        }
    }
    assert!(counts == expected && f64::from(counts.iter().sum::<u32>()) == amount);
}

#[test]
fn dispatches_that_wait_for_one_another_count_up() {
    let gpu = gpu();
    let (recording, count) = dispatches(&gpu, 50).unwrap();
    assert_eq!(recording.windows().len(), 50);
    gpu.run(&recording).unwrap();
    assert_eq!(gpu.read(&count).unwrap(), [50]);
}

#[test]
fn a_device_with_timestamps_has_peaks() {
    let Some(gpu) = timed() else { return };
    let [between, whole] = dispatch_ns(&gpu).unwrap();
    assert!(between >= 0.0 && whole > 0.0);
    let rate = Probe::Fma.rate(&gpu).unwrap();
    assert!(rate.is_finite() && rate > 1e6, "{rate} flop/s");
    let peaks = Peaks { flops: rate, bytes: 1e9, dispatch_ns: 10.0, ..Peaks::default() };
    assert_eq!(peaks.of(Probe::Fma), rate);
}
