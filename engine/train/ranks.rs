//! Processes that train one scene together: each sees some of the images of a step, and all take the same step.

use crate::error::Result;

/// The exchange between processes: all make each call, in the same order, and each waits for the others. It fails with
/// [`crate::Error::RanksLost`] where another process does not answer.
pub trait Ranks: Send + Sync {
    fn rank(&self) -> usize;

    fn size(&self) -> usize;

    /// Makes each word the bitwise or over all processes.
    fn or(&self, words: &mut [u32]) -> Result<()>;

    /// Makes each number the sum over all processes, in two's complement.
    fn sum(&self, numbers: &mut [i64]) -> Result<()>;

    /// The bytes of all processes one after the other, those of rank 0 first; as many of each.
    fn gather(&self, own: &[u8]) -> Result<Vec<u8>>;

    /// Waits without limit until all have called it.
    fn meet(&self) {}

    /// Leaves the others after the last exchange, and waits for them to do so.
    fn finish(&self) {}
}

/// True if `own` is true in any of the processes.
pub fn any(ranks: Option<&dyn Ranks>, own: bool) -> Result<bool> {
    let mut words = [u32::from(own)];
    ranks.map_or(Ok(()), |ranks| ranks.or(&mut words))?;
    Ok(words[0] != 0)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Shared {
    pub ranks: u64,
    pub steps: u64,
    /// Gaussians in view of an image of a step, summed over the steps.
    pub rows: u64,
    /// Bytes of sums of gradients that this process gave to the others; it received as many.
    pub bytes: u64,
    pub compute_s: f64,
    /// Seconds until the slowest process was there.
    pub wait_s: f64,
    /// Seconds of the exchange itself, with the copies from and to the device.
    pub exchange_s: f64,
}
