//! Random numbers: every draw of the program comes from a ChaCha stream that is named after its use.
//!
//! A stream's key is the SHA-256 of the seed and the stream's name, so that one more draw in one place never shifts the
//! draws of another, and the same seed gives the same numbers on every platform.

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// A reproducible source of random numbers for one purpose.
#[derive(Debug, Clone)]
pub struct Stream {
    generator: ChaCha12Rng,
    spare_normal: Option<f64>,
}

impl Stream {
    /// The stream called `name` (such as `"order"` or `"noise/trial/7"`) of `seed`.
    pub fn new(seed: u64, name: &str) -> Self {
        let key = Sha256::new()
            .chain_update(b"ramphold stream 1\0")
            .chain_update(seed.to_le_bytes())
            .chain_update(name.as_bytes())
            .finalize();
        Self { generator: ChaCha12Rng::from_seed(key.into()), spare_normal: None }
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Uniform in [0, 1), with all 53 bits of the mantissa.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in 0..bound, without bias (Lemire's rejection).
    ///
    /// # Panics
    /// If `bound` is zero.
    pub fn below(&mut self, bound: u64) -> u64 {
        assert!(bound > 0, "the bound must be above 0");
        let threshold = bound.wrapping_neg() % bound;
        loop {
            let product = u128::from(self.bits()) * u128::from(bound);
            if product as u64 >= threshold {
                return (product >> 64) as u64;
            }
        }
    }

    /// Standard normal (Marsaglia's polar method).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        loop {
            let (u, v) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let square = u * u + v * v;
            if square > 0.0 && square < 1.0 {
                let factor = libm::sqrt(-2.0 * libm::log(square) / square);
                self.spare_normal = Some(v * factor);
                return u * factor;
            }
        }
    }

    /// A uniformly random order of `items` (Fisher-Yates, from the end).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let chosen = self.below(last as u64 + 1) as usize;
            items.swap(last, chosen);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_the_same_in_every_version() {
        let mut stream = Stream::new(42, "order");
        let bits: Vec<u64> = (0..3).map(|_| stream.bits()).collect();
        insta::assert_debug_snapshot!(bits);
    }

    #[test]
    fn streams_of_other_names_or_seeds_differ() {
        let first = |seed, name| Stream::new(seed, name).bits();
        assert_ne!(first(1, "order"), first(1, "noise"));
        assert_ne!(first(1, "order"), first(2, "order"));
    }

    #[test]
    fn normal_draws_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(7, "normal");
        let draws: Vec<f64> = (0..100_000).map(|_| stream.normal()).collect();
        let mean = draws.iter().sum::<f64>() / 1e5;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.015, "mean {mean}");
        assert!((variance - 1.0).abs() < 0.02, "variance {variance}");
    }

    #[test]
    fn draws_below_a_bound_are_uniform() {
        let mut stream = Stream::new(7, "below");
        let mut counts = [0f64; 7];
        for _ in 0..70_000 {
            counts[stream.below(7) as usize] += 1.0;
        }
        let chi_square: f64 = counts.iter().map(|n| (n - 1e4) * (n - 1e4) / 1e4).sum();
        assert!(chi_square < 22.5, "chi-square {chi_square} with 6 degrees of freedom (p = 0.001 at 22.5)");
    }
}
