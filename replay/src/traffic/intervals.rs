//! Statistics of the intervals between messages: rate and jitter.
//!
//! Times are the kernel's receive times, so that neither the redraw rate nor a late reader affects them. Mean, deviation and maximum are
//! exact. Quantiles are those of a random sample if there are more intervals than [`SAMPLE`], so that memory is bounded.

use std::collections::VecDeque;

/// Length of a slice of the sliding window, ns.
const SLICE_NS: i64 = 250_000_000;
/// Slices of the window: two seconds.
const SLICES: i64 = 8;
/// Sample size of a slice for quantiles.
const SLICE_SAMPLE: usize = 256;
/// With fewer intervals in the window, the last ones are used regardless of their age, so that a channel of 0.1 Hz has a rate.
const FEW: usize = 16;
/// A channel is inactive after this many times its largest interval plus this time, ns, without a message.
const INACTIVE: (i64, i64) = (3, SLICE_NS * SLICES);

/// Sample size for quantiles over a whole recording.
pub const SAMPLE: usize = 4096;

/// Statistics of any number of intervals in bounded memory.
#[derive(Debug, Clone)]
pub struct Intervals {
    count: u64,
    /// Bytes of the messages that end the intervals.
    bytes: u64,
    sum_ns: f64,
    mean_ns: f64,
    /// Sum of squared differences from the mean (Welford).
    squares: f64,
    max_ns: i64,
    sample: Vec<i64>,
    capacity: usize,
    random: u64,
}

/// Statistics of intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Count.
    pub count: u64,
    /// Mean, ns.
    pub mean_ns: f64,
    /// Standard deviation, ns; sensitive to outliers.
    pub rms_ns: f64,
    /// Half the range of the middle 68.27 % of the intervals, ns: an outlier-robust standard deviation.
    pub jitter_ns: f64,
    /// Largest interval, ns.
    pub max_ns: i64,
}

impl Intervals {
    /// Empty statistics. `capacity`: sample size for quantiles.
    pub fn new(capacity: usize) -> Self {
        Intervals {
            count: 0,
            bytes: 0,
            sum_ns: 0.0,
            mean_ns: 0.0,
            squares: 0.0,
            max_ns: 0,
            sample: Vec::new(),
            capacity,
            random: 1,
        }
    }

    /// Adds an interval and the bytes of the message at its end.
    pub fn add(&mut self, interval_ns: i64, bytes: usize) {
        self.count += 1;
        self.bytes += bytes as u64;
        let interval = interval_ns as f64;
        self.sum_ns += interval;
        let before = interval - self.mean_ns;
        self.mean_ns += before / self.count as f64;
        self.squares += before * (interval - self.mean_ns);
        self.max_ns = self.max_ns.max(interval_ns);
        if self.sample.len() < self.capacity {
            self.sample.push(interval_ns);
        } else if let Some(kept) = self.sample.get_mut(random(&mut self.random, self.count) as usize) {
            // Vitter's algorithm R: each of `count` intervals is in the sample with the same probability.
            *kept = interval_ns;
        }
    }

    /// The statistics; `None` without intervals.
    pub fn spread(&self) -> Option<Spread> {
        spread([self].into_iter())
    }
}

/// A pseudorandom number from 0 to `below` - 1 (xorshift64).
fn random(state: &mut u64, below: u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state % below
}

/// Statistics of several collections combined.
fn spread<'a>(parts: impl Iterator<Item = &'a Intervals> + Clone) -> Option<Spread> {
    let count: u64 = parts.clone().map(|part| part.count).sum();
    if count == 0 {
        return None;
    }
    let n = count as f64;
    let mean_ns = parts.clone().map(|part| part.sum_ns).sum::<f64>() / n;
    let squares: f64 =
        parts.clone().map(|part| part.squares + part.count as f64 * (part.mean_ns - mean_ns).powi(2)).sum();
    let max_ns = parts.clone().map(|part| part.max_ns).max().unwrap_or(0);
    // Each interval in a slice's sample has the weight: intervals of the slice / size of its sample.
    let mut weighted: Vec<(i64, f64)> = parts
        .flat_map(|part| {
            let weight = part.count as f64 / part.sample.len().max(1) as f64;
            part.sample.iter().map(move |interval| (*interval, weight))
        })
        .collect();
    weighted.sort_unstable_by_key(|(interval, _)| *interval);
    // Quantiles at -1 and +1 standard deviation of a normal distribution.
    let [low, high] = [0.158_655, 0.841_345].map(|part| quantile(&weighted, part * n));
    Some(Spread { count, mean_ns, rms_ns: (squares / n).sqrt(), jitter_ns: (high - low) as f64 / 2.0, max_ns })
}

/// The first interval at which the cumulative weight reaches `weight`.
fn quantile(sorted: &[(i64, f64)], weight: f64) -> i64 {
    let mut sum = 0.0;
    let reached = sorted.iter().find(|(_, one)| {
        sum += one;
        sum >= weight
    });
    reached.or(sorted.last()).map_or(0, |(interval, _)| *interval)
}

/// The last two seconds of a channel, or its last `FEW` intervals if those took longer.
#[derive(Debug, Clone, Default)]
pub struct Window {
    slices: VecDeque<(i64, Intervals)>,
    /// The last few intervals with their bytes, newest last.
    last: VecDeque<(i64, usize)>,
}

/// Rates of a channel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pace {
    /// Messages per second.
    pub rate_hz: f64,
    /// Bytes of messages per second.
    pub bytes_per_s: f64,
    /// Statistics of the intervals; `None` before the second message and for an inactive channel.
    pub spread: Option<Spread>,
}

impl Window {
    /// Adds the interval that ends with a message at `t_ns`, and the bytes of the message.
    pub fn add(&mut self, t_ns: i64, interval_ns: i64, bytes: usize) {
        let slice = t_ns.div_euclid(SLICE_NS);
        self.slices.retain(|(at, _)| (slice - SLICES + 1..=slice).contains(at));
        if self.slices.back().is_none_or(|(at, _)| *at != slice) {
            self.slices.push_back((slice, Intervals::new(SLICE_SAMPLE)));
        }
        if let Some((_, intervals)) = self.slices.back_mut() {
            intervals.add(interval_ns, bytes);
        }
        if self.last.len() == FEW {
            self.last.pop_front();
        }
        self.last.push_back((interval_ns, bytes));
    }

    /// Rates at `now_ns`. `age_ns`: age of the last message.
    pub fn pace(&self, now_ns: i64, age_ns: i64) -> Pace {
        let slice = now_ns.div_euclid(SLICE_NS);
        let in_window = self.slices.iter().filter(|(at, _)| *at > slice - SLICES).map(|(_, intervals)| intervals);
        if in_window.clone().map(|intervals| intervals.count).sum::<u64>() >= FEW as u64 {
            return Pace::of(in_window, age_ns);
        }
        let mut few = Intervals::new(FEW);
        self.last.iter().for_each(|(interval, bytes)| few.add(*interval, *bytes));
        Pace::of([&few].into_iter(), age_ns)
    }
}

impl Pace {
    fn of<'a>(parts: impl Iterator<Item = &'a Intervals> + Clone, age_ns: i64) -> Self {
        let Some(spread) = spread(parts.clone()) else { return Pace::default() };
        if age_ns > spread.max_ns.saturating_mul(INACTIVE.0).saturating_add(INACTIVE.1) {
            return Pace::default();
        }
        let sum_ns: f64 = parts.clone().map(|part| part.sum_ns).sum();
        let bytes: u64 = parts.map(|part| part.bytes).sum();
        // The current interval counts by the time that it exceeds the mean, so that the rate decreases when a channel stops.
        let span_s = (sum_ns + (age_ns as f64 - spread.mean_ns).max(0.0)) * 1e-9;
        if span_s <= 0.0 {
            return Pace { spread: Some(spread), ..Pace::default() };
        }
        Pace { rate_hz: spread.count as f64 / span_s, bytes_per_s: bytes as f64 / span_s, spread: Some(spread) }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn window(intervals: impl IntoIterator<Item = i64>) -> (Window, i64) {
        let (mut window, mut t_ns) = (Window::default(), 0);
        for interval in intervals {
            t_ns += interval;
            window.add(t_ns, interval, 100);
        }
        (window, t_ns)
    }

    #[test]
    fn five_intervals_computed_by_hand() {
        let mut intervals = Intervals::new(SAMPLE);
        // Mean 1 ms, deviations -0.2, -0.1, 0, 0.1, 0.2: squares sum to 0.1, a fifth of it is 0.02.
        [1.0, 0.8, 1.2, 0.9, 1.1].into_iter().for_each(|ms| intervals.add((ms * 1e6) as i64, 0));
        let spread = intervals.spread().unwrap();
        assert_eq!((spread.count, spread.mean_ns, spread.max_ns), (5, 1e6, 1_200_000));
        assert!((spread.rms_ns - 0.02f64.sqrt() * 1e6).abs() < 1e-6);
        // 0.79 and 4.2 of five: the first and the last.
        assert_eq!(spread.jitter_ns, 0.2e6);
        assert_eq!(Intervals::new(8).spread(), None);
    }

    #[test]
    fn one_percent_of_outliers_changes_the_deviation_but_not_the_jitter() {
        let (window, now) = window((0..1000).map(|n| if n % 100 == 50 { 21 * MS } else { MS + n % 2 * 10_000 }));
        let spread = window.pace(now, 0).spread.unwrap();
        assert_eq!(spread.jitter_ns, 5000.0);
        assert!((1.8e6..2.2e6).contains(&spread.rms_ns), "{spread:?}");
        assert_eq!(spread.max_ns, 21 * MS);
    }

    #[test]
    fn rate_and_jitter_are_correct_from_0_1_hz_to_50_khz() {
        for (period, count) in [(10_000 * MS, 30), (MS, 5000), (20_000, 200_000)] {
            // Every other interval is a tenth longer or shorter.
            let (window, now) =
                window((0..count).map(|n| period + if n % 2 == 0 { period / 10 } else { -period / 10 }));
            let pace = window.pace(now, 0);
            let rate = 1e9 / period as f64;
            assert!((pace.rate_hz / rate - 1.0).abs() < 1e-3, "{} of {rate}", pace.rate_hz);
            assert!((pace.bytes_per_s / (100.0 * rate) - 1.0).abs() < 1e-3);
            assert_eq!(pace.spread.unwrap().jitter_ns, period as f64 / 10.0);
        }
    }

    #[test]
    fn quantiles_of_a_sample_approximate_those_of_all_intervals() {
        // Uniform from 0.5 to 1.5 ms, shuffled: the middle 68.27 % have a range of 0.6827 ms.
        let mut intervals = Intervals::new(SAMPLE);
        (0..100_000).for_each(|n| intervals.add(500_000 + n * 7919 % 100_000 * 10, 0));
        assert_eq!(intervals.sample.len(), SAMPLE);
        let jitter = intervals.spread().unwrap().jitter_ns;
        // The standard error of the two quantiles of 4096 is 0.6 % of a millisecond each.
        assert!((jitter - 341_345.0).abs() < 15_000.0, "{jitter}");
    }

    #[test]
    fn slices_are_weighted_by_their_number_of_intervals() {
        // One second at 10 kHz, then one at 500 Hz: 1/20 of all intervals is long, but 1/3 of those in the samples.
        let (window, now) = window((0..10_000).map(|_| 100_000).chain((0..500).map(|_| 2 * MS)));
        let spread = window.pace(now, 0).spread.unwrap();
        assert_eq!((spread.jitter_ns, spread.max_ns), (0.0, 2 * MS));
    }

    #[test]
    fn the_rate_of_a_stopped_channel_decreases_to_zero() {
        let (window, now) = window((0..5000).map(|_| MS));
        let rate = |age: i64| window.pace(now + age, age).rate_hz;
        assert!((rate(0) - 1000.0).abs() < 1e-6 && (rate(MS) - 1000.0).abs() < 1e-6);
        // After a second the window contains three slices of 250 messages and one message of the next: they took 0.751 s, and the next
        // message is 0.999 s overdue.
        assert!((rate(1000 * MS) - 751.0 / 1.75).abs() < 0.5, "{}", rate(1000 * MS));
        assert_eq!(rate(2100 * MS), 0.0);
        assert_eq!(window.pace(now + 9000 * MS, 9000 * MS).spread, None);
    }

    #[test]
    fn messages_with_equal_times_have_rate_zero() {
        let (window, now) = window([0, 0, 0]);
        assert_eq!(window.pace(now, 0).rate_hz, 0.0);
        assert_eq!(Window::default().pace(0, 0), Pace::default());
    }
}
