//! A1, A9, A10: the quadratic programs on the states of a log.

use crate::experiment::bench::{Bench, Spec, count, mean};
use crate::experiment::impedance;
use crate::experiment::states::{Led, States};
use crate::experiment::table::Row;
use crate::progress::Progress;
use crate::robot::RobotFiles;
use analysis::figures::Curves;
use analysis::stats::Distribution;
use controller::params::Params;
use controller::quadruped::robot::Robot;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox, Probe, Stage};
use std::time::Instant;

/// How often each stack goes through the log: of each tick the fastest pass counts, so that what else the machine does counts less.
const PASSES: usize = 3;

/// Time to build and solve, both stacks on the states of one log.
pub fn solve_time(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(Spec::of("flat_trot"))?;
    let states = States::read(&sample.log)?;
    let (mut rows, mut means) = (Vec::new(), Vec::new());
    for (stack, formula, published) in [("S1", S1, 830.0), ("S3", S3, 1180.0)] {
        let bar = Progress::new(format!("{stack}, {PASSES} passes"));
        let mut fastest: Vec<[f64; 2]> = vec![[f64::INFINITY; 2]; states.ticks.len()];
        for pass in 0..PASSES {
            let mut controller = states.controller(&[("stack.formula", &format!("{formula:?}"))])?;
            let (mut out, mut clock) = (Outbox::new(), Clock::new());
            for (i, (input, _)) in states.ticks.iter().enumerate() {
                clock.begin();
                controller.step_probed(input, &mut out, &mut clock);
                fastest[i][0] = fastest[i][0].min(clock.programs_us());
                fastest[i][1] = fastest[i][1].min(clock.tick_us());
                if i % 1000 == 0 {
                    bar.set((count(pass) + count(i) / count(states.ticks.len())) / count(PASSES));
                }
            }
        }
        drop(bar);
        let of = |k: usize| Distribution::of(fastest.iter().map(|us| us[k]));
        let (Some(programs), Some(tick)) = (of(0), of(1)) else { continue };
        let noted = |what: &str, value| Row::noted(format!("{stack}: {what}"), value, "us");
        rows.push(noted("build and solve, mean", programs.mean).published(published).at_most(published));
        rows.push(noted("build and solve, std", programs.std));
        let tail = noted("build and solve, p99.9", programs.p999);
        rows.push(if stack == "S1" { tail.at_most(1000.0) } else { tail });
        rows.push(noted("whole tick, median", tick.p50));
        rows.push(noted("whole tick, p99.9", tick.p999));
        means.push(programs.mean);
    }
    if let [s1, s3] = means[..] {
        rows.push(Row::noted("S3 / S1", s3 / s1, "").published(1180.0 / 830.0));
    }
    bench.note(format!("{} ticks, of each the fastest of {PASSES} passes", states.ticks.len()));
    Ok(rows)
}

/// Reads the wall clock at the ends of the stages.
struct Clock {
    begin: Instant,
    last: Instant,
    us: [f64; Stage::ALL.len()],
}

impl Clock {
    fn new() -> Self {
        let now = Instant::now();
        Clock { begin: now, last: now, us: [0.0; Stage::ALL.len()] }
    }

    fn begin(&mut self) {
        *self = Clock::new();
    }

    fn programs_us(&self) -> f64 {
        self.us[Stage::Tasks as usize] + self.us[Stage::Qp as usize]
    }

    fn tick_us(&self) -> f64 {
        (self.last - self.begin).as_secs_f64() * 1e6
    }
}

impl Probe for Clock {
    fn stage_done(&mut self, stage: Stage) {
        let now = Instant::now();
        self.us[stage as usize] = (now - self.last).as_secs_f64() * 1e6;
        self.last = now;
    }
}

/// Distance of the torques of S1 from those of S3, over the norm of the latter, mean over the ticks.
pub fn weights(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(Spec::of("flat_trot").named("states").with("duration_s", "6.0"))?;
    let states = States::read(&sample.log)?;
    let decades: Vec<f64> = (0..=10).map(|k| 0.5 * f64::from(k)).collect();
    let (_, constraints) = S1.split_once("<<").unwrap_or((S1, ""));
    let formula = |decade: f64| {
        let ratio = 10.0_f64.powf(decade);
        format!("\"{:e} contact + {ratio:e} trunk + posture <<{constraints}\"", ratio * ratio)
    };
    let leader = |formula: &str| states.controller(&[("stack.formula", formula)]).map(Led::new);
    let mut hard = leader(&format!("{S3:?}"))?;
    let mut soft = decades.iter().map(|&decade| leader(&formula(decade))).collect::<anyhow::Result<Vec<_>>>()?;
    let mut distances = vec![Vec::new(); decades.len()];
    let bar = Progress::new("weight ratios");
    for (i, (input, _)) in states.ticks.iter().enumerate() {
        let reference = hard.torques(input)?.map(<[f64]>::to_vec);
        for (soft, distances) in soft.iter_mut().zip(&mut distances) {
            let torques = soft.torques(input)?;
            if let (Some(reference), Some(torques)) = (&reference, torques) {
                let norm = |of: &mut dyn Iterator<Item = f64>| of.map(|x| x * x).sum::<f64>().sqrt();
                let distance = norm(&mut torques.iter().zip(reference).map(|(soft, hard)| soft - hard));
                distances.push(distance / norm(&mut reference.iter().copied()));
            }
        }
        bar.set(count(i) / count(states.ticks.len()));
    }
    drop(bar);
    let points: Vec<(f64, f64)> = decades.iter().copied().zip(distances.into_iter().map(mean)).collect();
    let mut rows = Vec::new();
    for (decade, distance) in &points {
        let row = Row::noted(format!("ratio 1e{decade}: distance over norm, mean"), 100.0 * distance, "%");
        rows.push(if *decade == 3.0 { row.at_most(5.0) } else { row });
    }
    let rises = points.windows(2).filter(|pair| pair[1].1 > pair[0].1).count();
    rows.push(Row::noted("rises along the sweep", count(rises), "").exactly(0.0));
    let curves = Curves {
        x: "ratio of neighbouring weights, power of ten".to_owned(),
        y: "|\u{3c4} S1 \u{2212} \u{3c4} S3| / |\u{3c4} S3|".to_owned(),
        logarithmic: true,
        series: vec![("mean over 6 s of trot".to_owned(), points)],
        limit: Some(("5 %".to_owned(), 0.05)),
    };
    bench.write(&curves.figure("weights"))?;
    Ok(rows)
}

/// Relative errors over random configurations.
pub fn equivalences(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let (files, params) = RobotFiles::find_with_params(bench.robot())?;
    let robot = Robot::new(&files.urdf, &Params::from_toml(&params, bench.robot())?.robot)?;
    let errors = impedance::errors(&robot, 50, 10)?;
    let noted = |what: &str, value| Row::noted(format!("{what}, largest relative error"), value, "").at_most(1e-8);
    Ok(vec![
        noted("A(4), joint impedance", errors.joint),
        noted("A(10), Cartesian impedance", errors.cartesian),
        noted("A(17), task over posture", errors.null_space),
    ])
}
