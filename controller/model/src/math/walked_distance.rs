//! Distance walked by the base of a robot.

/// Time between two positions that are connected by a straight line, ns.
const SAMPLE_NS: i64 = 1_000_000_000;

/// Distance walked: the horizontal length of the path of the base, from the first position to the last.
///
/// The path is sampled once per second: a curve counts with its length, the sway of the body within a stride does not.
/// Every tool that prints a distance walked uses this type.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WalkedDistance {
    /// Time of the next sample; `None` before the first position.
    next_ns: Option<i64>,
    sample: [f64; 2],
    latest: [f64; 2],
    sum_m: f64,
}

impl WalkedDistance {
    /// Takes the position of the base in W, m, at a time. Times must not decrease.
    #[inline]
    pub fn add(&mut self, t_ns: i64, p_WB: [f64; 3]) {
        self.latest = [p_WB[0], p_WB[1]];
        match self.next_ns {
            None => (self.next_ns, self.sample) = (Some(t_ns.saturating_add(SAMPLE_NS)), self.latest),
            Some(next) if t_ns >= next => {
                self.sum_m += length(self.sample, self.latest);
                self.sample = self.latest;
                // After a gap, sampling continues on the same grid.
                let late = t_ns.saturating_sub(next) / SAMPLE_NS;
                self.next_ns = Some(next.saturating_add(late.saturating_add(1).saturating_mul(SAMPLE_NS)));
            }
            Some(_) => {}
        }
    }

    /// The distance so far, m; `None` before the first position.
    #[inline]
    pub fn get(&self) -> Option<f64> {
        self.next_ns.map(|_| self.sum_m + length(self.sample, self.latest))
    }
}

fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (x, y) = (b[0] - a[0], b[1] - a[1]);
    (x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_counts_with_its_length_and_sway_within_a_second_does_not() {
        let mut walked = WalkedDistance::default();
        assert_eq!(walked.get(), None);
        // 2 s forward at 1 m/s with sway of 0.1 m to the side, then 1 s back.
        for (t_ms, x, y) in [(0, 0.0, 0.0), (500, 0.5, 0.1), (1000, 1.0, 0.0), (1500, 1.5, -0.1), (2000, 2.0, 0.0)] {
            walked.add(t_ms * 1_000_000, [x, y, 0.5]);
        }
        assert_eq!(walked.get(), Some(2.0));
        walked.add(2_500_000_000, [1.5, 0.0, 0.4]);
        assert_eq!(walked.get(), Some(2.5));
        walked.add(3_000_000_000, [1.0, 0.0, 0.4]);
        assert_eq!(walked.get(), Some(3.0));
    }

    #[test]
    fn extreme_times_overflow_nothing() {
        for (first, second) in [(i64::MIN, i64::MAX), (i64::MIN, 0), (0, i64::MAX), (i64::MAX, i64::MAX)] {
            let mut walked = WalkedDistance::default();
            walked.add(first, [0.0; 3]);
            walked.add(second, [3.0, 4.0, 0.0]);
            walked.add(second, [3.0, 4.0, 0.0]);
            assert_eq!(walked.get(), Some(5.0));
        }
    }

    #[test]
    fn a_gap_keeps_the_grid_of_samples() {
        let mut walked = WalkedDistance::default();
        for (t_ms, x) in [(5_000, 0.0), (8_700, 1.0), (8_900, 0.5), (9_000, 2.0)] {
            walked.add(t_ms * 1_000_000, [x, 0.0, 0.0]);
        }
        // Samples at 5.0 s, 8.7 s and 9.0 s.
        assert_eq!(walked.get(), Some(2.0));
    }
}
