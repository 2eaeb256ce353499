//! The levels of a stack as quadratic programs, solved one after the other.
//!
//! ```text
//! level k:   min_x  Σ w |A_k vd - b_k|² + Σ λ_i x_i²     subject to   the constraints,   Q x = Q x*_(k-1)          x = [vd; F]
//! ```
//! The rows of `Q` span those of all levels above (and of the equality constraints: see [`super::basis`]), so no level takes away what
//! one above has reached. Source: Raiola et al. 2020, eq. (13); one level is the weighted stack of eq. (15).
//!
//! Sizes are constant: what is switched off leaves zero rows. A level that has no solution ends the cascade: the solution is that
//! of the level above it, which obeys every constraint.

use super::{Basis, Rows};
use crate::qp::{Qp, QpInfo, QpSolver, QpStatus};
use nalgebra::DVector;

/// A task in a level.
#[derive(Clone, Debug)]
pub struct Term {
    /// Which of the tasks' rows.
    pub task: usize,
    /// Weight of its squared error.
    pub weight: f64,
    /// Which of its rows are taken.
    pub takes: Vec<bool>,
}

impl Term {
    fn taken(&self) -> impl Iterator<Item = usize> {
        self.takes.iter().enumerate().filter(|(_, taken)| **taken).map(|(row, _)| row)
    }
}

/// A level, its program, and what came of it.
pub struct Level {
    /// Its tasks.
    pub terms: Vec<Term>,
    /// Its program: the equality rows of the constraints first, then those of the levels above.
    pub qp: Qp,
    /// How the solve went; `None` if a level above has none.
    pub info: Option<QpInfo>,
    /// Its solution, n.
    pub x: DVector<f64>,
    solver: Box<dyn QpSolver>,
}

impl Level {
    /// Whether it has a solution.
    pub fn solved(&self) -> bool {
        self.info.is_some_and(|info| matches!(info.status, QpStatus::Solved | QpStatus::AlmostSolved))
    }
}

/// The levels. All of it is overwritten in every tick.
pub struct Cascade {
    /// Levels, the most important first; at least one.
    pub levels: Vec<Level>,
    regularization: DVector<f64>,
    basis: Basis,
    n_eq: usize,
}

impl Cascade {
    /// Memory and solvers.
    ///
    /// - `levels`: at least one.
    /// - `pattern`: an entry other than 0 is where the constraints may ever have numbers, a finite bound where a variable may have one.
    ///   The Hessian's pattern is that of a level's tasks.
    /// - `regularization`: λ of each variable.
    /// - `solver`: makes the back-end of a level from the pattern of its programs.
    pub fn new(
        levels: Vec<Vec<Term>>,
        pattern: &Qp,
        regularization: DVector<f64>,
        solver: impl Fn(&Qp) -> Box<dyn QpSolver>,
    ) -> Self {
        let (n, n_eq) = (pattern.n(), pattern.b.len());
        let mut above = 0;
        let mut built = Vec::with_capacity(levels.len());
        for terms in levels {
            let mut of_level = Qp::zeros(n, n_eq + above, pattern.d.len());
            of_level.H.copy_from(&pattern.H);
            of_level.A.rows_mut(0, n_eq).copy_from(&pattern.A);
            of_level.A.rows_mut(n_eq, above).fill(1.0);
            of_level.C.copy_from(&pattern.C);
            of_level.lower.copy_from(&pattern.lower);
            of_level.upper.copy_from(&pattern.upper);
            above += terms.iter().map(|term| term.taken().count()).sum::<usize>();
            built.push(Level {
                terms,
                solver: solver(&of_level),
                qp: of_level,
                info: None,
                x: DVector::from_element(n, f64::NAN),
            });
        }
        Cascade { levels: built, regularization, basis: Basis::new(n, n_eq + above), n_eq }
    }

    /// Where the constraints of all levels are to be written: `A`, `b`, `C`, `d` and the bounds of the first level.
    pub fn constraints(&mut self) -> &mut Qp {
        &mut self.levels[0].qp
    }

    /// Builds the programs from the tasks' rows, once the constraints stand.
    pub fn build(&mut self, tasks: &[Rows]) {
        let Cascade { levels, regularization, basis, n_eq } = self;
        basis.clear();
        let constraints = &levels[0].qp;
        if levels.len() > 1 {
            for row in 0..*n_eq {
                basis.push(|col| constraints.A[(row, col)]);
            }
        }
        for k in 0..levels.len() {
            let (above, from_here) = levels.split_at_mut(k);
            let level = &mut from_here[0];
            if let Some(first) = above.first() {
                constrain(&mut level.qp, &first.qp, *n_eq, basis);
            }
            cost(&mut level.qp, &level.terms, tasks, regularization);
            if from_here.len() > 1 {
                for term in &from_here[0].terms {
                    let A = &tasks[term.task].A;
                    for row in term.taken() {
                        basis.push(|col| if col < A.ncols() { A[(row, col)] } else { 0.0 });
                    }
                }
            }
        }
    }

    /// Solves level after level until one has no solution of finite numbers. That level's `x`, and those of the levels below, are zero: what
    /// an iteration broke off with is no result, and the bits of a NaN are not the same on every machine.
    pub fn solve(&mut self) {
        let mut ended = false;
        for k in 0..self.levels.len() {
            let (above, from_here) = self.levels.split_at_mut(k);
            let level = &mut from_here[0];
            level.x.fill(0.0);
            level.info = None;
            if ended {
                continue;
            }
            if let Some(last) = above.last() {
                for row in self.n_eq..level.qp.b.len() {
                    level.qp.b[row] = level.qp.A.row(row).iter().zip(&last.x).fold(0.0, |sum, (q, x)| sum + q * x);
                }
            }
            let mut info = level.solver.solve(&level.qp, &mut level.x);
            if !level.x.iter().all(|x| x.is_finite())
                && matches!(info.status, QpStatus::Solved | QpStatus::AlmostSolved)
            {
                info.status = QpStatus::Failed;
            }
            level.info = Some(info);
            if !level.solved() {
                level.x.fill(0.0);
                ended = true;
            }
        }
    }

    /// The last level that has a solution: the solution of the stack.
    pub fn solution(&self) -> Option<&Level> {
        self.levels.iter().rev().find(|level| level.solved())
    }

    /// How it went: the first status that is no solution, else the worst; iterations of all levels; the active rows of the last solve.
    pub fn info(&self) -> QpInfo {
        let mut sum = QpInfo { status: QpStatus::Solved, iterations: 0, n_active: 0, row: None };
        for info in self.levels.iter().filter_map(|level| level.info) {
            if info.status != QpStatus::Solved {
                (sum.status, sum.row) = (info.status, info.row);
            }
            sum.iterations += info.iterations;
            sum.n_active = info.n_active;
        }
        sum
    }

    /// For every level and term, how many of its rows are free of the constraints and of the levels above, after [`Cascade::build`].
    ///
    /// Not for use in a tick: it allocates.
    pub fn free_rows(&self, tasks: &[Rows]) -> Vec<Vec<usize>> {
        let constraints = &self.levels[0].qp;
        let n = constraints.n();
        let rows = |term: &Term| -> Vec<Vec<f64>> {
            let A = &tasks[term.task].A;
            term.taken().map(|row| (0..n).map(|i| if i < A.ncols() { A[(row, i)] } else { 0.0 }).collect()).collect()
        };
        let mut above: Vec<Vec<f64>> =
            (0..self.n_eq).map(|row| constraints.A.row(row).iter().copied().collect()).collect();
        let mut free = Vec::new();
        for level in &self.levels {
            let of_term = |term: &Term| {
                let rows = rows(term);
                let mut basis = Basis::new(n, above.len() + rows.len());
                for row in &above {
                    basis.push(|i| row[i]);
                }
                rows.iter().filter(|row| basis.push(|i| row[i])).count()
            };
            free.push(level.terms.iter().map(of_term).collect());
            above.extend(level.terms.iter().flat_map(rows));
        }
        free
    }
}

/// Copies the constraints of the first level and hands down what the levels above have reached; the right sides of that come with solving.
fn constrain(qp: &mut Qp, first: &Qp, n_eq: usize, basis: &Basis) {
    let n = qp.n();
    for col in 0..n {
        for row in 0..n_eq {
            qp.A[(row, col)] = first.A[(row, col)];
        }
        for row in n_eq..qp.b.len() {
            qp.A[(row, col)] = basis.at(row, col);
        }
    }
    qp.b.fill(0.0);
    for row in 0..n_eq {
        qp.b[row] = first.b[row];
    }
    qp.C.copy_from(&first.C);
    qp.d.copy_from(&first.d);
    qp.lower.copy_from(&first.lower);
    qp.upper.copy_from(&first.upper);
}

/// The halved cost of a level's tasks, in the order of its terms, and λ on every variable.
fn cost(qp: &mut Qp, terms: &[Term], tasks: &[Rows], regularization: &DVector<f64>) {
    qp.H.fill(0.0);
    qp.g.fill(0.0);
    for term in terms {
        tasks[term.task].accumulate(term.weight, &term.takes, &mut qp.H, &mut qp.g);
    }
    for i in 0..qp.n() {
        qp.H[(i, i)] += regularization[i];
        for j in 0..i {
            qp.H[(i, j)] = qp.H[(j, i)];
        }
    }
}
