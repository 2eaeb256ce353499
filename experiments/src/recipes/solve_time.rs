//! A1: time to build and solve the quadratic programs, for both stacks on the states of one log; the Hessian's share of it, and the trunk's damping.

use super::sensor_noise::orientation_errors;
use super::shared::falls;
use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::states::States;
use analysis::stats::{Distribution, ErrorStats};
use controller::quadruped::tasks::trunk_damping;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox, Probe, Stage};
use nalgebra::Matrix3;
use std::time::Instant;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A1",
    title: "time per tick with the weighted stack S1 and the hierarchical stack S3, on the same states",
    published: "S1 830 us, S3 1180 us, with qpOASES on an i5 of 3.1 GHz; most of it for the Hessian; trunk damping at most 400 N m s/rad on the real robot",
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
        let Times { programs, tick, hessian } = time(bench, &states, stack, formula, &[])?;
        let unlimited = formula.replace(" << torque_limits", "");
        let Times { tick: unlimited, .. } =
            time(bench, &states, &format!("{stack} without torque limits"), &unlimited, &[])?;
        let row = |what: &str, of: &Option<Distribution>, value: fn(&Distribution) -> f64| {
            Row::info(format!("{stack}: {what}"), of.as_ref().map_or(f64::NAN, value), "us")
        };
        let mean = row("build and solve, mean", &programs, |d| d.mean);
        means.push(mean.measured);
        rows.push(mean.published(published).at_most(published));
        rows.push(row("build and solve, std", &programs, |d| d.std));
        let mean_of = |of: &Option<Distribution>| of.as_ref().map_or(f64::NAN, |d| d.mean);
        let share = 100.0 * mean_of(&hessian) / mean_of(&programs);
        rows.push(Row::info(format!("{stack}: share of the first level's Hessian, mean"), share, "%").at_most(50.0));
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
    rows.extend(damping(bench, &states)?);
    bench.note(format!("{} ticks, the fastest of {PASSES} passes for each", states.ticks.len()));
    Ok(rows)
}

/// Largest damping of the trunk as a torque on the real robot, N m s/rad. Source: Raiola et al. 2020, section 4.4.
const LARGEST_DAMPING: f64 = 400.0;

/// The damping of the trunk as a torque: the damping of its task times its inertia, level; and the walk of A5 with the limit of the paper.
fn damping(bench: &Bench, states: &States) -> anyhow::Result<Vec<Row>> {
    let controller = states.controller(&[])?;
    let (robot, params) = (controller.robot(), controller.params());
    let kd = trunk_damping(robot, params, &Matrix3::identity());
    let row = |k: usize, axis| {
        let torque = kd[k] * robot.trunk_inertia[(k, k)];
        let row = Row::info(format!("damping of the trunk about {axis}"), torque, "N m s/rad");
        row.published(LARGEST_DAMPING).at_most(LARGEST_DAMPING)
    };
    let mut rows: Vec<Row> = ["x", "y", "z"].into_iter().enumerate().map(|(k, axis)| row(k, axis)).collect();
    // Strides at 2 Hz, as in A5.
    let spec = RunSpec::of("noisy_trot").named("damping").set("gait.trot.swing_frequency", "4.444");
    let spec = spec.set("trunk.max_damping", format!("{LARGEST_DAMPING:.1}"));
    let sample = bench.one_with(spec, orientation_errors)?;
    let of = "A5 with trunk.max_damping = 400: ";
    rows.push(falls(of, std::slice::from_ref(&sample)));
    let error = |what, value, limit| {
        Row::info(format!("{of}orientation error, {what}"), value, "rad").published(limit).at_most(limit)
    };
    let found = |value: fn(&ErrorStats) -> f64| sample.measured.as_ref().map_or(f64::NAN, value);
    rows.push(error("mean", found(|e| e.mean), 0.0101));
    rows.push(error("std", found(|e| e.std), 0.0102));
    Ok(rows)
}

/// Times of every tick, us.
pub(super) struct Times {
    /// Building and solving the programs.
    pub programs: Option<Distribution>,
    /// The whole tick.
    pub tick: Option<Distribution>,
    /// Computing the Hessian and the gradient of the first level, which is part of building.
    pub hessian: Option<Distribution>,
}

/// Times of every tick with a formula.
///
/// - `set`: further parameters, keys and values.
pub(super) fn time(
    bench: &Bench,
    states: &States,
    title: &str,
    formula: &str,
    set: &[(&str, &str)],
) -> anyhow::Result<Times> {
    let bar = bench.bar(format!("{title}, {PASSES} passes"));
    let mut fastest: Vec<[f64; 3]> = vec![[f64::INFINITY; 3]; states.ticks.len()];
    for pass in 0..PASSES {
        let formula = format!("{formula:?}");
        let mut controller = states.controller(&[set, &[("stack.formula", &formula)]].concat())?;
        let (mut out, mut clock) = (Outbox::new(), Clock::new());
        let mut program = controller.wbc().program(0);
        for (i, (input, _)) in states.ticks.iter().enumerate() {
            clock.start();
            controller.step_probed(input, &mut out, &mut clock);
            fastest[i][0] = fastest[i][0].min(clock.programs_us());
            fastest[i][1] = fastest[i][1].min(clock.tick_us());
            let wbc = controller.wbc();
            let start = Instant::now();
            wbc.stack.cost(0, &wbc.tasks.rows, &mut program);
            fastest[i][2] = fastest[i][2].min(start.elapsed().as_secs_f64() * 1e6);
            if i % 1000 == 0 {
                bar((count(pass) + count(i) / count(states.ticks.len())) / count(PASSES));
            }
        }
    }
    let of = |k: usize| Distribution::of(fastest.iter().map(|us| us[k]));
    Ok(Times { programs: of(0), tick: of(1), hessian: of(2) })
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
    fn stage_done(&mut self, stage: usize) {
        let now = Instant::now();
        self.us[stage] = (now - self.last).as_secs_f64() * 1e6;
        self.last = now;
    }
}
