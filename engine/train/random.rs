//! Counter-based random numbers: each is a function of its key, so that no order of evaluation and no resumed run
//! changes any.

/// Random numbers of one purpose.
#[derive(Clone, Copy, Debug)]
pub struct Random(u64);

/// SplitMix64's finaliser (Steele, Lea and Flood 2014).
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Random {
    /// The numbers of `key`, a list such as seed, step and purpose.
    pub fn new(key: &[u64]) -> Self {
        Random(key.iter().fold(0, |state, part| mix(state.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ mix(*part))))
    }

    /// Bits of number `i`.
    pub fn bits(&self, i: u64) -> u64 {
        mix(self.0.wrapping_add(i.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Number `i`, uniform in [0, 1).
    pub fn uniform(&self, i: u64) -> f64 {
        (self.bits(i) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Number `i`, standard normal (Box and Muller).
    pub fn normal(&self, i: u64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(2 * i)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(2 * i + 1)).cos()
    }
}

/// The indices `0..n` in the random order of `key` (Fisher and Yates).
pub fn permutation(n: usize, key: &[u64]) -> Vec<usize> {
    let random = Random::new(key);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, (random.bits(i as u64) % (i as u64 + 1)) as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_has_every_index_once_and_differs_from_key_to_key() {
        let mut a = permutation(100, &[1, 2]);
        assert_ne!(a, permutation(100, &[1, 3]));
        assert_eq!(a, permutation(100, &[1, 2]));
        a.sort_unstable();
        assert!(a.into_iter().eq(0..100));
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let random = Random::new(&[7]);
        let n = 100_000;
        let (sum, squares) = (0..n).map(|i| random.normal(i)).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
        assert!((sum / n as f64).abs() < 0.02 && (squares / n as f64 - 1.0).abs() < 0.02);
    }
}
