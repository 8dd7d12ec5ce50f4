//! Random numbers that are the same on every machine: SplitMix64 (Steele, Lea and Flood 2014), by number or in a row.

/// 2^64 over the golden ratio, by which the generator steps.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

pub fn hash(parts: &[u64]) -> u64 {
    parts.iter().fold(0, |state: u64, part| mix(state.wrapping_add(STEP) ^ mix(*part)))
}

/// The upper 53 bits as a number in [0, 1).
pub fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Random numbers, each a function of its key and number alone, whatever the order of evaluation.
#[derive(Clone, Copy, Debug)]
pub struct Keyed(u64);

impl Keyed {
    /// The numbers of `key`, a list such as seed, step and purpose.
    pub fn new(key: &[u64]) -> Self {
        Keyed(hash(key))
    }

    pub fn bits(&self, i: u64) -> u64 {
        mix(self.0.wrapping_add(i.wrapping_add(1).wrapping_mul(STEP)))
    }

    /// Number `i`, uniform in [0, 1).
    pub fn uniform(&self, i: u64) -> f64 {
        unit(self.bits(i))
    }

    /// Number `i`, standard normal (Box and Muller); of the uniform numbers 2i and 2i + 1.
    pub fn normal(&self, i: u64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(2 * i)).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform(2 * i + 1)).cos()
    }
}

/// The indices `0..n` in the random order of `key` (Fisher and Yates).
pub fn permutation(n: usize, key: &[u64]) -> Vec<usize> {
    let random = Keyed::new(key);
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, (random.bits(i as u64) % (i as u64 + 1)) as usize);
    }
    order
}

#[derive(Clone, Debug)]
pub struct Random {
    numbers: Keyed,
    drawn: u64,
}

impl Random {
    pub fn new(seed: u64) -> Self {
        Random { numbers: Keyed(seed), drawn: 0 }
    }

    pub fn of_key(key: &[u64]) -> Self {
        Random::new(hash(key))
    }

    pub fn bits(&mut self) -> u64 {
        self.drawn += 1;
        self.numbers.bits(self.drawn - 1)
    }

    /// Uniform in `[low, high)`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * unit(self.bits())
    }

    /// Numbers, each uniform in `[low, high)`.
    pub fn vector<const N: usize>(&mut self, low: f64, high: f64) -> [f32; N] {
        std::array::from_fn(|_| self.uniform(low, high) as f32)
    }

    /// One of `choices`, of which there is at least one.
    pub fn pick(&mut self, choices: &[f64]) -> f64 {
        choices[(self.bits() % choices.len() as u64) as usize]
    }

    /// Nearly normal, mean 0 and deviation 1: four uniform numbers summed, never beyond [`NORMAL_BOUND`], without a function that
    /// machines round differently.
    pub fn nearly_normal(&mut self) -> f64 {
        let bits = self.bits();
        let sum: u64 = (0..4).map(|i| bits >> (16 * i) & 0xffff).sum();
        // Each of the four has the variance 1/12 of its range.
        (sum as f64 / 65_536.0 - 2.0) * NORMAL_BOUND / 2.0
    }
}

/// Largest magnitude of [`Random::nearly_normal`], 2 sqrt 3.
pub const NORMAL_BOUND: f64 = 3.464_101_615_137_755;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_splitmix64_by_number_and_in_a_row() {
        // Vigna's reference implementation with the seed 1234567.
        let reference = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        let mut random = Random::new(1_234_567);
        assert_eq!(reference, [(); 5].map(|()| random.bits()));
        let (keyed, mut drawn) = (Keyed::new(&[3, 4]), Random::of_key(&[3, 4]));
        assert!((0..9).all(|i| keyed.bits(i) == drawn.bits()));
        assert_ne!(keyed.bits(0), Keyed::new(&[4, 3]).bits(0));
    }

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
        let (keyed, mut drawn) = (Keyed::new(&[7]), Random::new(7));
        let n = 100_000;
        let check = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, squares) = values.fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
            assert!((sum / n as f64).abs() < 0.02 && (squares / n as f64 - 1.0).abs() < 0.02);
        };
        check(&mut (0..n).map(|i| keyed.normal(i)));
        check(&mut (0..n).map(|_| drawn.nearly_normal()).inspect(|x| assert!(x.abs() <= NORMAL_BOUND)));
    }
}
