//! Random numbers by address: the same seed, stream and index give the same number, in whatever order they are drawn.

use std::f64::consts::TAU;

/// Mixes all bits (the finaliser of SplitMix64).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A stream of random numbers addressed by index.
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    key: u64,
}

impl Stream {
    /// The stream of a seed and a purpose; different purposes are independent.
    pub fn new(seed: u64, purpose: u64) -> Self {
        Self { key: mix(mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15)) ^ purpose.wrapping_mul(0xd134_2543_de82_ef95)) }
    }

    /// 64 random bits.
    pub fn bits(&self, index: u64) -> u64 {
        mix(mix(index.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ self.key).wrapping_add(self.key))
    }

    /// Uniform in (0, 1).
    pub fn uniform(&self, index: u64) -> f64 {
        ((self.bits(index) >> 11) as f64 + 0.5) * (1.0 / (1u64 << 53) as f64)
    }

    /// Normal with mean 0 and standard deviation 1 (Box and Muller).
    pub fn normal(&self, index: u64) -> f64 {
        let radius = (-2.0 * self.uniform(2 * index).ln()).sqrt();
        radius * (TAU * self.uniform(2 * index + 1)).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_normal_law() {
        let (n, stream) = (400_000, Stream::new(7, 3));
        let moment = |k: i32| (0..n).map(|i| stream.normal(i).powi(k)).sum::<f64>() / n as f64;
        for (k, expected, std) in [(1, 0.0, 1.0), (2, 1.0, 1.5), (3, 0.0, 3.9), (4, 3.0, 9.8)] {
            assert!((moment(k) - expected).abs() < 4.0 * std / (n as f64).sqrt(), "moment {k}: {}", moment(k));
        }
    }

    #[test]
    fn neighbouring_seeds_purposes_and_indices_are_uncorrelated() {
        let n = 100_000u64;
        let pairs: [fn(u64) -> (f64, f64); 3] = [
            |i| (Stream::new(1, 1).normal(i), Stream::new(2, 1).normal(i)),
            |i| (Stream::new(1, 1).normal(i), Stream::new(1, 2).normal(i)),
            |i| (Stream::new(1, 1).normal(i), Stream::new(1, 1).normal(i + 1)),
        ];
        for pair in pairs {
            let correlation = (0..n).map(pair).map(|(a, b)| a * b).sum::<f64>() / n as f64;
            assert!(correlation.abs() < 4.0 / (n as f64).sqrt(), "{correlation}");
        }
    }
}
