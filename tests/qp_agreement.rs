//! The active-set solver and Clarabel give the same solution for every program of the golden logs.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::params::apply_overrides;
use controller::qp::{Backend, Qp, QpStatus};
use controller::quadruped::Quadruped;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox};
use lcmtypes::channels::{CONTROLLER_INPUT, RUN_INFO};
use lcmtypes::{ControllerInput, Message, RunInfo, TickInput};
use nalgebra::DVector;
use replay::log::LogReader;
use std::path::PathBuf;

/// Largest allowed difference, relative to the solution's norm; entries are accelerations in SI units and forces in 100 N.
const ALLOWED: f64 = 1e-6;
/// Tolerances of Clarabel, tried in this order until the solutions agree. If only the regularization determines the forces, Clarabel stops up to 1e-2
/// away at tolerance 1e-8 and 1e-4 away at 1e-11. At 1e-14 it rarely reports success; its point is usually good, but sometimes it stopped early.
/// The active set's solutions differ by 1e-14 from known exact ones (`controller/tests/qp_solutions.rs`).
const TOLERANCES: [f64; 7] = [1e-12, 1e-13, 1e-14, 1e-11, 3e-13, 3e-14, 1e-15];
const MAX_ITERATIONS: u32 = 200;
/// Allowed violation of a row or bound by rounding, in its unit.
const VIOLATION: f64 = 1e-9;

/// Description and inputs of a golden log.
fn golden(name: &str) -> (RunInfo, Vec<TickInput>) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("logs/golden").join(name);
    let (mut info, mut inputs) = (None, Vec::<ControllerInput>::new());
    for event in LogReader::open(&path).unwrap().events() {
        let event = event.unwrap();
        match &*event.channel {
            RUN_INFO => info = Some(RunInfo::decode(&event.data).unwrap()),
            CONTROLLER_INPUT => inputs.push(ControllerInput::decode(&event.data).unwrap()),
            _ => {}
        }
    }
    (info.unwrap(), controller::Unpacked::all(&inputs))
}

/// Largest difference of the two solvers on the programs of a log under a stack, and the number of programs with rows at their limits.
fn largest_difference(name: &str, formula: &str) -> (f64, usize) {
    let (info, inputs) = golden(name);
    let params = apply_overrides(info.params(), &[("stack.formula".to_owned(), formula.to_owned())]).unwrap();
    let build = || Quadruped::new(&info.urdf, &params).unwrap();
    let patterns = patterns(&mut build(), &inputs);
    let reference = |qp: &Qp| TOLERANCES.map(|tolerance| Backend::Clarabel.build(qp, MAX_ITERATIONS, tolerance));
    let mut references: Vec<_> = patterns.iter().map(reference).collect();
    let (mut controller, mut out) = (build(), Outbox::new());
    let (mut largest, mut at_limits, mut flat) = (0.0_f64, 0, 0);
    for input in &inputs {
        controller.step(input, &mut out);
        let levels = &controller.wbc().stack.levels;
        for (k, (level, references)) in levels.iter().zip(&mut references).enumerate() {
            let info = level.info.unwrap();
            let here = format!("{name}, tick {}, level {k}", input.tick);
            assert_eq!(info.status, QpStatus::Solved, "{here}");
            let qp = controller.wbc().program(k);
            let violation = qp.violation(&level.x);
            assert!(violation < VIOLATION, "{here}: a row is violated by {violation:e}");
            let cost = |x: &DVector<f64>| 0.5 * x.dot(&(&qp.H * x)) + qp.g.dot(x);
            let (mut off, mut cheapest) = (f64::INFINITY, f64::INFINITY);
            for reference in references {
                let mut x = level.x.clone();
                reference.solve(&qp, &mut x);
                (off, cheapest) = (off.min((&level.x - &x).norm() / x.norm()), cheapest.min(cost(&x)));
                if off < ALLOWED {
                    break;
                }
            }
            // If a program is so flat that no tolerance brings Clarabel closer, the cost decides which point is better.
            let better = cost(&level.x) < cheapest;
            assert!(off < ALLOWED || better, "{here}: {off:e} of the norm apart");
            flat += usize::from(off >= ALLOWED);
            largest = largest.max(if off < ALLOWED { off } else { 0.0 });
            at_limits += usize::from(info.n_active > 0);
        }
    }
    assert!(flat <= 2, "{name}: Clarabel is off on {flat} programs");
    (largest, at_limits)
}

/// For each level, a program with a non-zero entry wherever a program of the run has one.
fn patterns(controller: &mut Quadruped, inputs: &[TickInput]) -> Vec<Qp> {
    let (mut patterns, mut out) = (Vec::new(), Outbox::new());
    for input in inputs {
        controller.step(input, &mut out);
        let programs = (0..controller.wbc().stack.levels.len()).map(|k| controller.wbc().program(k));
        if patterns.is_empty() {
            patterns = programs.collect();
            continue;
        }
        for (pattern, qp) in patterns.iter_mut().zip(programs) {
            for (pattern, of_tick) in [(&mut pattern.H, &qp.H), (&mut pattern.A, &qp.A), (&mut pattern.C, &qp.C)] {
                pattern.iter_mut().zip(of_tick).filter(|(_, x)| **x != 0.0).for_each(|(seen, x)| *seen = *x);
            }
        }
    }
    patterns
}

#[test]
fn on_every_program_of_the_golden_logs_the_weighted_stack_agrees() {
    for name in ["flat_trot.mcap", "rough_trot.mcap"] {
        let (largest, at_limits) = largest_difference(name, S1);
        println!("{name}: {largest:e}, {at_limits} with rows at their limits");
        assert!(at_limits > 100, "{at_limits} programs with rows at their limits");
    }
}

#[test]
fn on_every_program_of_the_golden_logs_the_hierarchy_agrees() {
    for name in ["flat_trot.mcap", "rough_trot.mcap"] {
        let (largest, at_limits) = largest_difference(name, S3);
        println!("{name}: {largest:e}, {at_limits} with rows at their limits");
        assert!(at_limits > 1000, "{at_limits} programs with rows at their limits");
    }
}
