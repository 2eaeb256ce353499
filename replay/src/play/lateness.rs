//! Statistics of the lateness of played events.

use std::time::Duration;

/// Steps within each doubling: quantiles are exact to 1 part in 64.
const STEPS: u64 = 64;
const BITS: u32 = STEPS.trailing_zeros();

/// Histogram of lateness in bounded memory.
#[derive(Debug, Clone)]
pub struct Lateness {
    counts: Vec<u64>,
    count: u64,
    max_ns: u64,
}

/// Quantiles of the lateness.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize)]
pub struct LatenessSummary {
    /// Number of events with a due time.
    pub events: u64,
    /// Median, us.
    pub p50_us: f64,
    /// 99 % quantile, us.
    pub p99_us: f64,
    /// 99.9 % quantile, us.
    pub p999_us: f64,
    /// Maximum, us.
    pub max_us: f64,
}

impl Default for Lateness {
    fn default() -> Self {
        Lateness { counts: vec![0; (64 - BITS as usize + 1) * STEPS as usize], count: 0, max_ns: 0 }
    }
}

impl Lateness {
    /// Adds an event.
    pub fn add(&mut self, late: Duration) {
        let ns = u64::try_from(late.as_nanos()).unwrap_or(u64::MAX);
        self.counts[bin(ns)] += 1;
        self.count += 1;
        self.max_ns = self.max_ns.max(ns);
    }

    /// Upper edge of the bin of quantile `q`, at most the maximum; 0 without events.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
    fn quantile_ns(&self, q: f64) -> u64 {
        let rank = ((q * self.count as f64).ceil() as u64).max(1);
        let mut below = 0;
        let at = self.counts.iter().position(|count| {
            below += count;
            below >= rank
        });
        at.map_or(0, |at| upper_edge(at).min(self.max_ns))
    }

    /// Quantiles and maximum.
    #[expect(clippy::cast_precision_loss, reason = "microseconds for display")]
    pub fn summary(&self) -> LatenessSummary {
        let us = |ns: u64| ns as f64 * 1e-3;
        let quantile = |q| us(self.quantile_ns(q));
        LatenessSummary {
            events: self.count,
            p50_us: quantile(0.5),
            p99_us: quantile(0.99),
            p999_us: quantile(0.999),
            max_us: us(self.max_ns),
        }
    }
}

/// Bin of a value: one per value below `STEPS`, above it `STEPS` per doubling.
fn bin(ns: u64) -> usize {
    if ns < STEPS {
        return ns as usize;
    }
    let doubling = ns.ilog2() - BITS;
    ((u64::from(doubling) + 1) * STEPS + (ns >> doubling) - STEPS) as usize
}

fn upper_edge(bin: usize) -> u64 {
    let bin = bin as u64;
    if bin < STEPS {
        return bin;
    }
    let doubling = bin / STEPS - 1;
    let first = (STEPS + bin % STEPS) << doubling;
    first + ((1u64 << doubling) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_have_a_relative_width_of_at_most_one_64th() {
        for ns in (0..100_000).chain([u64::MAX / 3, u64::MAX - 1, u64::MAX]) {
            let (at, above) = (bin(ns), upper_edge(bin(ns)));
            assert!(above >= ns && above - ns <= ns / STEPS, "{ns} in bin {at}, up to {above}");
        }
    }

    #[test]
    fn quantiles_of_known_values() {
        let mut lateness = Lateness::default();
        assert_eq!(lateness.summary(), LatenessSummary::default());
        for us in 1..=1000 {
            lateness.add(Duration::from_micros(us));
        }
        let LatenessSummary { events, p50_us, p99_us, p999_us, max_us } = lateness.summary();
        assert_eq!((events, max_us), (1000, 1000.0));
        for (found, exact) in [(p50_us, 500.0), (p99_us, 990.0), (p999_us, 999.0)] {
            assert!((exact..=exact * (1.0 + 1.0 / 64.0)).contains(&found), "{found}, expected {exact}");
        }
    }
}
