//! A1: time to build and solve the quadratic programs, for both stacks on the states of one log.

use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::states::States;
use analysis::stats::Distribution;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox, Probe, Stage};
use std::time::Instant;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A1",
    title: "time per tick with the weighted stack S1 and the hierarchical stack S3, on the same states",
    published: "S1 830 us, S3 1180 us, with qpOASES on an i5 of 3.1 GHz",
    robot: "hyq",
    seeds: 1,
    minutes: 2.0,
    run,
};

/// Passes of each stack through the log. The fastest pass counts for each tick, which reduces the effect of other load on the machine.
const PASSES: usize = 3;

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(RunSpec::of("flat_trot"))?;
    let states = States::read(&sample.log)?;
    let (mut rows, mut means) = (Vec::new(), Vec::new());
    for (stack, formula, published) in [("S1", S1, 830.0), ("S3", S3, 1180.0)] {
        let (programs, tick) = time(bench, &states, stack, formula)?;
        let (_, unlimited) =
            time(bench, &states, &format!("{stack} without torque limits"), &formula.replace(" << torque_limits", ""))?;
        let row = |what: &str, of: &Option<Distribution>, value: fn(&Distribution) -> f64| {
            Row::info(format!("{stack}: {what}"), of.as_ref().map_or(f64::NAN, value), "us")
        };
        let mean = row("build and solve, mean", &programs, |d| d.mean);
        means.push(mean.measured);
        rows.push(mean.published(published).at_most(published));
        rows.push(row("build and solve, std", &programs, |d| d.std));
        let tail = row("build and solve, p99.9", &programs, |d| d.p999);
        rows.push(if stack == "S1" { tail.at_most(1000.0) } else { tail });
        rows.push(row("whole tick, median", &tick, |d| d.p50));
        rows.push(row("whole tick, p99.9", &tick, |d| d.p999));
        let median = |of: &Option<Distribution>| of.as_ref().map_or(f64::NAN, |d| d.p50);
        let ratio = median(&tick) / median(&unlimited);
        rows.push(
            Row::info(format!("{stack}: whole tick with torque limits / without, median"), ratio, "").at_most(1.18),
        );
    }
    if let [s1, s3] = means[..] {
        rows.push(Row::info("S3 / S1", s3 / s1, "").published(1180.0 / 830.0));
    }
    bench.note(format!("{} ticks, the fastest of {PASSES} passes for each", states.ticks.len()));
    Ok(rows)
}

/// Times of every tick with a formula, us: of building and solving the programs, and of the whole tick.
fn time(
    bench: &Bench,
    states: &States,
    title: &str,
    formula: &str,
) -> anyhow::Result<(Option<Distribution>, Option<Distribution>)> {
    let bar = bench.bar(format!("{title}, {PASSES} passes"));
    let mut fastest: Vec<[f64; 2]> = vec![[f64::INFINITY; 2]; states.ticks.len()];
    for pass in 0..PASSES {
        let mut controller = states.controller(&[("stack.formula", &format!("{formula:?}"))])?;
        let (mut out, mut clock) = (Outbox::new(), Clock::new());
        for (i, (input, _)) in states.ticks.iter().enumerate() {
            clock.start();
            controller.step_probed(input, &mut out, &mut clock);
            fastest[i][0] = fastest[i][0].min(clock.programs_us());
            fastest[i][1] = fastest[i][1].min(clock.tick_us());
            if i % 1000 == 0 {
                bar((count(pass) + count(i) / count(states.ticks.len())) / count(PASSES));
            }
        }
    }
    let of = |k: usize| Distribution::of(fastest.iter().map(|us| us[k]));
    Ok((of(0), of(1)))
}

/// Reads the wall clock at the end of each stage.
struct Clock {
    start: Instant,
    last: Instant,
    us: [f64; Stage::ALL.len()],
}

impl Clock {
    fn new() -> Self {
        let now = Instant::now();
        Clock { start: now, last: now, us: [0.0; Stage::ALL.len()] }
    }

    fn start(&mut self) {
        *self = Clock::new();
    }

    fn programs_us(&self) -> f64 {
        self.us[Stage::Tasks as usize] + self.us[Stage::Qp as usize]
    }

    fn tick_us(&self) -> f64 {
        (self.last - self.start).as_secs_f64() * 1e6
    }
}

impl Probe for Clock {
    fn stage_done(&mut self, stage: Stage) {
        let now = Instant::now();
        self.us[stage as usize] = (now - self.last).as_secs_f64() * 1e6;
        self.last = now;
    }
}
