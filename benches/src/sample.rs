//! Times single calls, and prints one line per case. `benches/peers/peer.hpp` does the same for the peers.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Result of a case, printed as one line of JSON.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Line {
    /// Name of the case.
    pub case: String,
    /// Number of timed calls.
    pub calls: usize,
    /// Shortest call, ns.
    pub min_ns: f64,
    /// Median, ns.
    pub median_ns: f64,
    /// 99th percentile, ns.
    pub p99_ns: f64,
    /// Peers: relative difference of the results from ours.
    #[serde(default)]
    pub off: Option<f64>,
    /// Solvers: number of calls without a solution.
    #[serde(default)]
    pub unsolved: u64,
    /// Ours: largest number of allocations in one call.
    #[serde(default)]
    pub allocations: Option<u64>,
    /// Replays: seconds of the log per second.
    #[serde(default)]
    pub real_time_factor: Option<f64>,
}

/// Times of single calls.
pub struct Samples {
    clock_ns: f64,
    ns: Vec<f64>,
}

impl Samples {
    /// No samples; memory for `calls` samples.
    pub fn new(calls: usize) -> Self {
        Samples { clock_ns: clock_ns(), ns: Vec::with_capacity(calls) }
    }

    /// Times a call.
    pub fn time<R>(&mut self, call: impl FnOnce() -> R) -> R {
        let begin = Instant::now();
        let result = std::hint::black_box(call());
        let end = Instant::now();
        self.add(begin, end);
        result
    }

    /// Adds a sample: the difference of two times minus the time to read the clock.
    pub fn add(&mut self, begin: Instant, end: Instant) {
        self.ns.push(((end - begin).as_nanos() as f64 - self.clock_ns).max(0.0));
    }

    /// The line of a case. At least one call must have been timed.
    pub fn line(mut self, case: &str) -> Line {
        self.ns.sort_by(f64::total_cmp);
        let at = |part: f64| self.ns[(part * (self.ns.len() - 1) as f64) as usize];
        Line {
            case: case.to_owned(),
            calls: self.ns.len(),
            min_ns: self.ns[0],
            median_ns: at(0.5),
            p99_ns: at(0.99),
            off: None,
            unsolved: 0,
            allocations: None,
            real_time_factor: None,
        }
    }
}

impl Line {
    /// Prints the line to standard output.
    pub fn print(&self) -> anyhow::Result<()> {
        println!("{}", serde_json::to_string(self)?);
        Ok(())
    }
}

/// Largest number of allocations in one of the calls.
pub fn most_allocations(calls: usize, mut call: impl FnMut(usize)) -> u64 {
    (0..calls).map(|i| allocation_counter::measure(|| call(i)).count_total).max().unwrap_or(0)
}

/// Times `call(i)` for i in 0..items, in `passes` passes after one untimed pass, and counts allocations.
pub fn time_each(case: &str, items: usize, passes: usize, mut call: impl FnMut(usize)) -> Line {
    (0..items).for_each(&mut call);
    let mut samples = Samples::new(items * passes);
    for _ in 0..passes {
        for i in 0..items {
            samples.time(|| call(i));
        }
    }
    Line { allocations: Some(most_allocations(items, call)), ..samples.line(case) }
}

/// Median time to read the clock twice, ns.
fn clock_ns() -> f64 {
    let mut pauses: Vec<f64> = (0..10_001)
        .map(|_| {
            let begin = Instant::now();
            (Instant::now() - begin).as_nanos() as f64
        })
        .collect();
    pauses.sort_by(f64::total_cmp);
    pauses[5_000]
}
