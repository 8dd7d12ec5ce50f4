//! Stable radix sort of (key, value) pairs by digits of up to 8 bits.

use crate::error::Result;
use crate::gpu::generated::{self, constants, sort_count};
use crate::gpu::{Buf, Gpu, Grid, Recording};
use bytemuck::bytes_of;

pub const SORT_BLOCK: usize = constants::args::SORT_BLOCK as usize;

/// Values of the widest digit.
const DIGITS: usize = constants::sort::DIGITS as usize;
const DIGIT_BITS: u32 = DIGITS.ilog2();

pub struct Unsorted<'a> {
    pub count: &'a Buf<u32>,
    pub keys: &'a Buf<u32>,
    pub carried: Carried<'a>,
    pub n_bits: u32,
    /// A workgroup per `SORT_BLOCK` keys.
    pub blocks: &'a Grid,
}

#[derive(Clone, Copy)]
pub enum Carried<'a> {
    /// A value each, which is overwritten.
    Values(&'a Buf<u32>),
    /// The place of each key before the sort, in this room.
    Places(&'a Buf<u32>),
}

/// Scratch of a sort: counts of digits, and the second half of the ping-pong.
pub struct Sort {
    block_counts: Buf<u32>,
    // Of ranges of blocks, by round: zero before a sort.
    range_counts: Buf<u32>,
    round_counters: usize,
    keys: Buf<u32>,
    values: Buf<u32>,
    is_wide: bool,
}

fn n_rounds(n_bits: u32) -> u32 {
    n_bits.div_ceil(DIGIT_BITS).max(1)
}

/// Where the digit of each round begins, and its bits: as even as can be.
fn digits(n_bits: u32) -> impl Iterator<Item = (u32, u32)> {
    let n_rounds = n_rounds(n_bits);
    (0..n_rounds).scan(0, move |next, round| {
        let (shift, width) = (*next, (n_bits + n_rounds - 1 - round) / n_rounds);
        *next += width;
        Some((shift, width))
    })
}

impl Sort {
    /// Scratch for up to `capacity` pairs and keys of up to `n_bits` bits.
    pub fn new(gpu: &Gpu, capacity: usize, n_bits: u32) -> Result<Self> {
        let range_counts = gpu.alloc("sort ranges", Self::n_counters(capacity, n_bits))?;
        Self::counting_in(gpu, capacity, range_counts)
    }

    /// Numbers that must be zero before a sort of up to `capacity` pairs by up to `n_bits` bits.
    pub(crate) fn n_counters(capacity: usize, n_bits: u32) -> usize {
        n_rounds(n_bits) as usize * Self::round_counters(capacity)
    }

    /// As [`Sort::new`], with those numbers in `range_counts`.
    pub(crate) fn counting_in(gpu: &Gpu, capacity: usize, range_counts: Buf<u32>) -> Result<Self> {
        Ok(Sort {
            block_counts: gpu.alloc("sort counts", DIGITS * capacity.div_ceil(SORT_BLOCK))?,
            range_counts,
            round_counters: Self::round_counters(capacity),
            keys: gpu.alloc("sort keys", capacity)?,
            values: gpu.alloc("sort values", capacity)?,
            is_wide: gpu.caps().subgroup_size >= 32,
        })
    }

    /// Counters of a round: of every range that `range_blocks` in `include/sort.glsl` makes of so many blocks.
    fn round_counters(capacity: usize) -> usize {
        let n_blocks = capacity.div_ceil(SORT_BLOCK);
        let width = usize::BITS - n_blocks.saturating_sub(1).leading_zeros();
        DIGITS << (width / 2)
    }

    pub fn record_clear(&self, rec: &mut Recording) {
        rec.fill(self.range_counts.slice(), 0);
    }

    /// Sorts by the low bits of the keys; equal ones keep their order. The counters must be zero. Returns the buffers that hold keys
    /// and what goes with them: the given ones after an even number of rounds, else the scratch.
    pub fn record(&self, rec: &mut Recording, unsorted: Unsorted) -> (Buf<u32>, Buf<u32>) {
        let Unsorted { count, keys, carried, n_bits, blocks } = unsorted;
        let (Carried::Values(values) | Carried::Places(values)) = carried;
        let mut from = (keys.clone(), values.clone());
        let mut to = (self.keys.clone(), self.values.clone());
        let block_counts = &self.block_counts;
        for (round, (shift, width)) in digits(n_bits).enumerate() {
            let range_counts = &self.range_counts.range(round * self.round_counters, self.round_counters);
            let push = sort_count::Push { shift, mask: (1 << width) - 1 };
            rec.pass(sort_count::Args { count, keys: &from.0, block_counts, range_counts }, push, blocks.clone());

            let is_indexed = round == 0 && matches!(carried, Carried::Places(_));
            let pick = if self.is_wide { generated::sort_exchange } else { generated::sort_scatter };
            // In the order of `include/sort_round.glsl`.
            let ends = [count, block_counts, range_counts, &from.0, &to.0, &to.1];
            let bound = ends.into_iter().chain((!is_indexed).then_some(&from.1)).map(Buf::slice).collect();
            rec.pass_untyped(pick(is_indexed), bound, bytes_of(&push).to_vec(), blocks.clone());
            std::mem::swap(&mut from, &mut to);
        }
        from
    }
}
