//! Exclusive prefix sum with saturation: the exact reference of the scan kernels.

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scan {
    /// `offsets[i]` is the sum of the counts before `i`, or `u32::MAX` when that does not fit.
    pub offsets: Vec<u32>,
    /// The sum of all counts, or `u32::MAX` when it does not fit.
    pub total: u32,
    /// True if the sum of all counts exceeds `u32::MAX`.
    pub overflow: bool,
}

/// Exclusive prefix sum. It saturates instead of wrapping; saturating addition is associative, so a device may sum in
/// blocks and still agree bit for bit.
pub fn exclusive_scan(counts: &[u32]) -> Scan {
    let mut offsets = Vec::with_capacity(counts.len());
    let (mut total, mut overflow) = (0u32, false);
    for &count in counts {
        offsets.push(total);
        overflow |= total.checked_add(count).is_none();
        total = total.saturating_add(count);
    }
    Scan { offsets, total, overflow }
}
