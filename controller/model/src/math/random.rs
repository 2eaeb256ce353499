//! Seeded random numbers with the same bits on every machine: SplitMix64 and `libm`. For terrain, sensor noise, experiments and
//! benches; no controller uses it.

use std::f64::consts::TAU;

/// A stream of random numbers. Streams of one seed with different names are independent, so that a larger terrain does not change
/// the noise of a sensor.
#[derive(Clone, Debug)]
pub struct Rng {
    state: u64,
}

impl Rng {
    /// The stream `name` of `seed`.
    pub fn new(seed: i64, name: &str) -> Self {
        let mut rng = Rng { state: seed.cast_unsigned() };
        for byte in name.bytes() {
            rng.state ^= u64::from(byte);
            rng.state = rng.next_u64();
        }
        rng
    }

    /// A stream with this state.
    pub fn from_state(state: u64) -> Self {
        Rng { state }
    }

    /// 64 random bits. Source: G. Steele, D. Lea, C. Flood, *Fast splittable pseudorandom number generators* (2014), Fig. 17.
    pub fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "an f64 holds 53 bits")]
        let unit = (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Normal with mean 0 and standard deviation 1 (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform(0.0, 1.0)));
        radius * libm::cos(self.uniform(0.0, TAU))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First outputs of Vigna's C program `splitmix64.c` for state 1234567.
    #[test]
    fn outputs_are_those_of_splitmix64() {
        let mut rng = Rng { state: 1_234_567 };
        assert_eq!([rng.next_u64(), rng.next_u64()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }

    #[test]
    fn streams_of_one_seed_differ() {
        assert_ne!(Rng::new(1, "terrain").next_u64(), Rng::new(1, "noise").next_u64());
        assert_ne!(Rng::new(1, "terrain").next_u64(), Rng::new(2, "terrain").next_u64());
        assert_eq!(Rng::new(1, "terrain").next_u64(), Rng::new(1, "terrain").next_u64());
    }

    #[test]
    fn normal_has_unit_variance() {
        let mut rng = Rng::new(3, "test");
        let n = 20_000;
        let samples: Vec<f64> = (0..n).map(|_| rng.normal()).collect();
        let mean = samples.iter().sum::<f64>() / f64::from(n);
        let variance = samples.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / f64::from(n);
        // Four standard errors of each estimate.
        assert!(mean.abs() < 4.0 / f64::from(n).sqrt(), "mean {mean}");
        assert!((variance - 1.0).abs() < 4.0 * (2.0 / f64::from(n)).sqrt(), "variance {variance}");
    }
}
