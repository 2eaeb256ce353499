//! `hoof solve`: a hierarchy of least-squares problems or a quadratic program from a file.

mod file;

use crate::{Outcome, say, say_json};
use anyhow::Context;
use clap::ValueEnum;
use controller::qp::hierarchy::{ByPrograms, Hierarchy, LevelReport, NullSpaceCascade, Strategy};
use controller::qp::{Backend, QpRow, QpStatus};
use file::{Problem, Program};
use nalgebra::DVector;
use serde::Serialize;
use std::path::PathBuf;

/// Version of the result's format.
const VERSION: u32 = 1;
/// Tolerance of Clarabel.
const TOLERANCE: f64 = 1e-10;

/// Solve a hierarchy of least-squares problems, or a quadratic program, from a JSON file
#[derive(clap::Args)]
#[command(after_help = "Example: hoof solve problem.json\n         \
    hoof solve problem.json --strategy optimality --with clarabel --json\n\n\
    Hierarchy: {n, regularization, lower, upper, C, c_lower, c_upper, levels: [{A, b, weight, C, c_lower, c_upper, law, threshold}]}\n\
    Level k minimizes sum of weight (A x - b)^2 + regularization |x|^2 under all constraints of levels 1 to k, without a change of A_j x of the levels j above.\n\
    Program: {kind: \"qp\", H, g, A_eq, b_eq, C, c_lower, c_upper, lower, upper}: 1/2 x'Hx + g'x.\n\
    The programs that `hoof replay LOG --break TICK --json` prints are of this form. Matrices are lists of rows; null is an absent side; equal sides are an equality. law (\"smooth\", \"exact\") and threshold damp small singular values.\n\
    Exit code 0: solved; 1: not solved; 2: malformed.")]
pub struct Args {
    /// JSON file with the problem; - reads standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Solver of the programs
    #[arg(long, value_enum, default_value = "active_set")]
    with: With,
    /// How a level keeps the solutions of the levels above: null-space bases, projectors, or equality rows
    #[arg(long, value_enum, default_value = "null_space")]
    strategy: Form,
    /// Limit of the iterations of each level
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    max_iterations: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
#[value(rename_all = "snake_case")]
enum With {
    ActiveSet,
    Clarabel,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Form {
    NullSpace,
    Projectors,
    Optimality,
}

/// The result of `hoof solve --json`.
#[derive(Serialize)]
struct Solution {
    version: u32,
    status: &'static str,
    x: Vec<f64>,
    /// `√(Σ w (A x - b)²)` of each level; empty for a program.
    residuals: Vec<f64>,
    level_status: Vec<&'static str>,
    /// Number of directions that each level decides.
    rank: Vec<usize>,
    iterations: u32,
    /// Largest violation of a constraint.
    violation: f64,
    /// `½ xᵀHx + gᵀx` of a program.
    #[serde(skip_serializing_if = "Option::is_none")]
    objective: Option<f64>,
    /// A constraint that cannot hold together with others.
    #[serde(skip_serializing_if = "Option::is_none")]
    contradiction: Option<String>,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let from_input = args.file.as_os_str() == "-";
    let name = if from_input { "standard input".to_owned() } else { args.file.display().to_string() };
    let text = if from_input { replay::text_file::text_of(std::io::stdin())? } else { crate::robot::read(&args.file)? };
    let solution = match Problem::from_json(&text).with_context(|| name.clone())? {
        Problem::Hierarchy(problem) => args.hierarchy(&problem),
        Problem::Program(program) => args.program(&program).with_context(|| name.clone())?,
    };
    if args.json {
        say_json(&solution)?;
    } else {
        say(solution.text())?;
    }
    Ok(Outcome::failed_if(solution.status != "solved"))
}

impl Args {
    fn backend(&self) -> Backend {
        match self.with {
            With::ActiveSet => Backend::ActiveSet,
            With::Clarabel => Backend::Clarabel,
        }
    }

    fn hierarchy(&self, problem: &Hierarchy) -> Solution {
        let strategy = match self.strategy {
            Form::NullSpace => Strategy::NullSpace,
            Form::Projectors => Strategy::Projectors,
            Form::Optimality => Strategy::Optimality,
        };
        let (x, reports) = if strategy == Strategy::NullSpace && matches!(self.with, With::ActiveSet) {
            let mut solver = NullSpaceCascade::new(problem, self.max_iterations, true);
            solver.solve(problem);
            (solver.x().to_vec(), solver.reports().to_vec())
        } else {
            let (backend, max_iterations) = (self.backend(), self.max_iterations);
            let solver = ByPrograms { strategy, backend, max_iterations, tolerance: TOLERANCE };
            let (x, reports) = solver.solve(problem);
            (x.as_slice().to_vec(), reports)
        };
        let first_unsolved = reports.iter().find(|report| !report.solved());
        Solution {
            version: VERSION,
            status: first_unsolved.map_or("solved", |report| status_name(report.status)),
            residuals: problem.levels.iter().map(|level| level.residual(&x)).collect(),
            level_status: reports.iter().map(|report| status_name(report.status)).collect(),
            rank: reports.iter().map(|report| report.rank).collect(),
            iterations: reports.iter().map(|report| report.iterations).sum(),
            violation: problem.violation(&x),
            objective: None,
            contradiction: first_unsolved.and_then(|report: &LevelReport| report.row).map(row_name),
            x,
        }
    }

    fn program(&self, Program { qp, row_of }: &Program) -> anyhow::Result<Solution> {
        let is_definite = qp.H.clone().cholesky().is_some();
        anyhow::ensure!(
            is_definite || matches!(self.with, With::Clarabel),
            "H is not positive definite, which active_set needs; use --with clarabel for a positive semidefinite H"
        );
        let mut x = DVector::zeros(qp.n());
        let info = self.backend().build(qp, self.max_iterations, TOLERANCE).solve(qp, &mut x);
        let objective = 0.5 * x.dot(&(&qp.H * &x)) + qp.g.dot(&x);
        let row = info.row.map(|row| match row {
            QpRow::Inequality(i) => QpRow::Inequality(row_of[i]),
            other => other,
        });
        Ok(Solution {
            version: VERSION,
            status: status_name(Some(info.status)),
            residuals: Vec::new(),
            level_status: vec![status_name(Some(info.status))],
            rank: Vec::new(),
            iterations: info.iterations,
            violation: qp.violation(&x),
            objective: Some(objective),
            contradiction: row.map(row_name),
            x: x.as_slice().to_vec(),
        })
    }
}

impl Solution {
    fn text(&self) -> String {
        let mut lines =
            vec![format!("{}: {} iterations, largest violation {:.1e}", self.status, self.iterations, self.violation)];
        lines.extend(
            self.contradiction.iter().map(|row| format!("{row} cannot hold together with the other constraints")),
        );
        for (k, residual) in self.residuals.iter().enumerate() {
            lines.push(format!(
                "level {}: {}, residual {residual:.6e}, rank {}",
                k + 1,
                self.level_status[k],
                self.rank[k]
            ));
        }
        lines.extend(self.objective.iter().map(|objective| format!("objective {objective:.9e}")));
        lines.push(format!("x = {:?}", self.x));
        lines.join("\n")
    }
}

fn status_name(status: Option<QpStatus>) -> &'static str {
    match status {
        Some(QpStatus::Solved | QpStatus::AlmostSolved) => "solved",
        Some(QpStatus::Infeasible) => "infeasible",
        Some(QpStatus::Failed) => "iteration_limit",
        None => "not_reached",
    }
}

fn row_name(row: QpRow) -> String {
    match row {
        QpRow::Equality(i) | QpRow::Inequality(i) => format!("row {i} of C"),
        QpRow::Lower(i) => format!("lower[{i}]"),
        QpRow::Upper(i) => format!("upper[{i}]"),
    }
}
