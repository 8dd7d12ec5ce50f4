//! Buffers that a frame counts or adds up in from zero: parts of one buffer, so that one fill clears them all.

use crate::error::Result;
use crate::gpu::{Buf, Gpu, Recording};

/// Words from one part to the next: a binding may begin there on every device, 256 bytes.
pub(super) const APART: usize = 64;

/// The buffer, and how much of it is taken.
pub struct Zeros {
    words: Buf<u32>,
    n_taken: usize,
}

impl Zeros {
    /// Room for parts of so many words each.
    ///
    /// # Errors
    /// `OutOfMemory` where it does not fit.
    pub fn new(gpu: &Gpu, parts: &[usize]) -> Result<Self> {
        let n = parts.iter().map(|n| n.next_multiple_of(APART)).sum();
        Ok(Zeros { words: gpu.alloc("frame sums", n)?, n_taken: 0 })
    }

    /// The next part, of `n` words.
    pub fn take(&mut self, n: usize) -> Buf<u32> {
        let part = self.words.range(self.n_taken, n);
        self.n_taken += n.next_multiple_of(APART);
        part
    }

    /// Appends the fill of all parts but the first `kept` words.
    pub fn record(&self, rec: &mut Recording, kept: usize) {
        rec.fill(self.words.range(kept, self.words.len() - kept).slice(), 0);
    }
}
