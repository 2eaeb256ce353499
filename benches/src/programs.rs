//! Times the solver back-ends on quadratic programs of a log, in the order of its ticks.

use crate::export::read_programs;
use crate::sample::{Line, Samples, most_allocations};
use anyhow::{Result, ensure};
use controller::qp::{Backend, Qp, QpSolver, QpStatus};
use nalgebra::{DMatrix, DVector};
use std::path::Path;

/// Names of the back-ends in tables, the robot's first.
pub const NAMES: [&str; 2] = ["active set", "Clarabel"];
/// Iteration limit of a back-end.
const MAX_ITERATIONS: u32 = 100;
/// Tolerance of Clarabel: the default of the controller.
const TOLERANCE: f64 = 1e-8;

/// Times every back-end on every program.
pub fn time(path: &Path, passes: usize) -> Result<()> {
    let programs = read_programs(path)?;
    ensure!(!programs.is_empty(), "{}: no program in it", path.display());
    let pattern = pattern(&programs);
    for (name, backend) in NAMES.into_iter().zip([Backend::ActiveSet, Backend::Clarabel]) {
        let mut solver = backend.build(&pattern, MAX_ITERATIONS, TOLERANCE);
        time_solver(name, solver.as_mut(), &programs, passes).print()?;
    }
    Ok(())
}

fn time_solver(name: &str, solver: &mut dyn QpSolver, programs: &[(Qp, DVector<f64>)], passes: usize) -> Line {
    let (mut qp, mut x) = programs[0].clone();
    let (mut off, mut unsolved) = (0.0_f64, 0);
    let mut samples = Samples::new(programs.len() * passes);
    for pass in 0..=passes {
        for (program, expected) in programs {
            // A tick finds its program where it has just written it, not somewhere in memory.
            qp.clone_from(program);
            let info = if pass == 0 { solver.solve(&qp, &mut x) } else { samples.time(|| solver.solve(&qp, &mut x)) };
            match info.status {
                QpStatus::Solved | QpStatus::AlmostSolved => off = off.max((&x - expected).norm() / expected.norm()),
                QpStatus::Infeasible | QpStatus::Failed => unsolved += 1,
            }
        }
    }
    let allocations = most_allocations(programs.len(), |i| {
        solver.solve(&programs[i].0, &mut x);
    });
    Line { off: Some(off), unsolved, allocations: Some(allocations), ..samples.line(name) }
}

/// Where any of the programs has a number, and a bound.
fn pattern(programs: &[(Qp, DVector<f64>)]) -> Qp {
    let (first, _) = &programs[0];
    let mut pattern = Qp::zeros(first.n(), first.b.len(), first.d.len());
    let mark = |pattern: &mut DMatrix<f64>, numbers: &DMatrix<f64>| {
        for (there, number) in pattern.iter_mut().zip(numbers) {
            if *number != 0.0 {
                *there = 1.0;
            }
        }
    };
    for (qp, _) in programs {
        mark(&mut pattern.H, &qp.H);
        mark(&mut pattern.A, &qp.A);
        mark(&mut pattern.C, &qp.C);
    }
    pattern.lower.copy_from(&first.lower);
    pattern.upper.copy_from(&first.upper);
    pattern
}
