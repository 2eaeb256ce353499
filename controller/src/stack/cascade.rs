//! Solves the levels of a stack as quadratic programs, one after the other.
//!
//! ```text
//! level k:   min_x  Σ w |A_k x - b_k|² + Σ λ_i x_i²     subject to   the constraints,   Q x = Q x*_(k-1)          x = [vd; F]
//! ```
//! The rows of `Q` span the rows of all levels above and of the equality constraints (see [`super::basis`]), so no level changes the
//! residuals of a level above. Source: Raiola et al. 2020, eq. (13); one level is the weighted stack of eq. (15).
//!
//! Two methods: [`Solver::Each`] solves the program of every level with its own back-end. [`Solver::Shared`] solves the first program and
//! continues in its null space, without building the programs of the lower levels.
//!
//! Sizes are constant: rows that are switched off are zero. If a level has no solution, the cascade ends: the result is the solution
//! of the level above it, which satisfies every constraint.

use super::{Basis, Rows};
use crate::dense::axpy;
use crate::qp::{Levels, Qp, QpInfo, QpSolver, QpStatus, SquareRow};
use nalgebra::DVector;

/// A task in a level.
#[derive(Clone, Debug)]
pub struct Term {
    /// Index of the task.
    pub task: usize,
    /// Weight of its squared error.
    pub weight: f64,
    /// Which of its rows are used.
    pub takes: Vec<bool>,
}

impl Term {
    fn taken(&self) -> impl Iterator<Item = usize> {
        self.takes.iter().enumerate().filter(|(_, taken)| **taken).map(|(row, _)| row)
    }
}

/// A level, its program and its solution.
pub struct Level {
    /// Its tasks.
    pub terms: Vec<Term>,
    /// Its program. Equality rows: first the constraints, then those of the levels above. For a lower level it is built only if
    /// every level has its own solver; see [`Cascade::program`].
    pub qp: Qp,
    /// Report of the solver; `None` if the level was not solved because a level above has no solution.
    pub info: Option<QpInfo>,
    /// Solution, n.
    pub x: DVector<f64>,
}

/// How the levels are solved.
pub enum Solver<'a> {
    /// Each level with its own back-end, built by the function from the pattern of the level's program.
    Each(&'a dyn Fn(&Qp) -> Box<dyn QpSolver>),
    /// The active-set solver in the null space of the levels above; the number limits the iterations of a level.
    Shared(u32),
}

enum Engine {
    Each(Vec<Box<dyn QpSolver>>),
    Shared(Box<Levels>),
}

impl Level {
    /// Whether the level has a solution.
    pub fn solved(&self) -> bool {
        self.info.is_some_and(|info| matches!(info.status, QpStatus::Solved | QpStatus::AlmostSolved))
    }
}

/// The levels. Everything is overwritten in every tick.
pub struct Cascade {
    /// Levels, the most important first; at least one.
    pub levels: Vec<Level>,
    regularization: DVector<f64>,
    basis: Basis,
    n_eq: usize,
    slack: Option<usize>,
    engine: Engine,
}

impl Cascade {
    /// Allocates memory and builds solvers.
    ///
    /// - `levels`: the terms of each level; at least one level.
    /// - `pattern`: non-zero where the constraints and the Hessian of a level may be non-zero; a finite bound where a variable may have one.
    /// - `regularization`: λ of each variable.
    /// - `columns`: number of leading variables in which tasks may have non-zero entries.
    /// - `slack`: variable that the first level decides for all levels.
    pub fn new(
        levels: Vec<Vec<Term>>,
        pattern: &Qp,
        regularization: DVector<f64>,
        columns: usize,
        slack: Option<usize>,
        solver: &Solver<'_>,
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
            if built.is_empty() {
                above += usize::from(slack.is_some());
            }
            above += terms.iter().map(|term| term.taken().count()).sum::<usize>();
            built.push(Level { terms, qp: of_level, info: None, x: DVector::from_element(n, f64::NAN) });
        }
        let engine = match solver {
            Solver::Each(solver) => Engine::Each(built.iter().map(|level| solver(&level.qp)).collect()),
            Solver::Shared(iterations) => {
                Engine::Shared(Box::new(Levels::new(&built[0].qp, &regularization, above, columns, *iterations)))
            }
        };
        Cascade { levels: built, regularization, basis: Basis::new(n, n_eq + above), n_eq, slack, engine }
    }

    /// The first level's program. The caller writes the constraints of all levels there: `A`, `b`, `C`, `d` and the bounds.
    pub fn constraints(&mut self) -> &mut Qp {
        &mut self.levels[0].qp
    }

    /// Builds the programs from the rows of the tasks, after the constraints were written: those of all levels, or only of the first.
    pub fn build(&mut self, tasks: &[Rows]) {
        let Cascade { levels, regularization, basis, n_eq, slack, engine } = self;
        let count = if matches!(engine, Engine::Each(_)) { levels.len() } else { 1 };
        basis.clear();
        if count > 1 {
            add_constraints(basis, &levels[0].qp, *n_eq, *slack);
        }
        for k in 0..count {
            let (above, from_here) = levels.split_at_mut(k);
            let level = &mut from_here[0];
            if let Some(first) = above.first() {
                constrain(&mut level.qp, &first.qp, *n_eq, basis);
            }
            cost(&mut level.qp, &level.terms, tasks, regularization);
            if k + 1 < count {
                add_level(basis, &level.terms, tasks);
            }
        }
    }

    /// The levels whose programs [`Cascade::build`] builds.
    pub fn built(&self) -> &[Level] {
        if matches!(self.engine, Engine::Each(_)) { &self.levels } else { &self.levels[..1] }
    }

    /// Writes the Hessian and the gradient of a level into a program of its size, as [`Cascade::build`] does. For measuring the time.
    pub fn cost(&self, k: usize, tasks: &[Rows], qp: &mut Qp) {
        cost(qp, &self.levels[k].terms, tasks, &self.regularization);
    }

    /// The complete program of a level, after all levels above were solved. Allocates: not for use in a tick.
    pub fn program(&self, k: usize, tasks: &[Rows]) -> Qp {
        let mut qp = self.levels[k].qp.clone();
        if k < self.built().len() {
            return qp;
        }
        let mut basis = self.basis.clone();
        basis.clear();
        add_constraints(&mut basis, &self.levels[0].qp, self.n_eq, self.slack);
        for level in &self.levels[..k] {
            add_level(&mut basis, &level.terms, tasks);
        }
        constrain(&mut qp, &self.levels[0].qp, self.n_eq, &basis);
        cost(&mut qp, &self.levels[k].terms, tasks, &self.regularization);
        set_reached(&mut qp, self.n_eq, &self.levels[k - 1].x);
        qp
    }

    /// Solves the levels in order until one has no finite solution. `x` of that level and of the levels below is zero: an unfinished iterate is
    /// not a result, and the bits of a NaN differ between machines.
    ///
    /// - `tasks`: the rows that were given to [`Cascade::build`].
    pub fn solve(&mut self, tasks: &[Rows]) {
        for level in &mut self.levels {
            level.x.fill(0.0);
            level.info = None;
        }
        for k in 0..self.levels.len() {
            let (above, from_here) = self.levels.split_at_mut(k);
            let level = &mut from_here[0];
            let mut info = match &mut self.engine {
                Engine::Each(solvers) => {
                    if let Some(last) = above.last() {
                        set_reached(&mut level.qp, self.n_eq, &last.x);
                    }
                    solvers[k].solve(&level.qp, &mut level.x)
                }
                Engine::Shared(shared) => match above {
                    [] => shared.first(&level.qp, &mut level.x),
                    [first] => {
                        let slack = self.slack;
                        shared.below_first(&|take| {
                            rows_of(&first.terms, tasks)(take);
                            let entries = &mut slack.map(|slack| (slack, 1.0)).into_iter();
                            take(SquareRow { weight: 1.0, entries, b: 0.0 });
                        });
                        level.x.copy_from(&first.x);
                        shared.lower(&rows_of(&level.terms, tasks), &mut level.x)
                    }
                    [.., last] => {
                        shared.below();
                        level.x.copy_from(&last.x);
                        shared.lower(&rows_of(&level.terms, tasks), &mut level.x)
                    }
                },
            };
            if !level.x.iter().all(|x| x.is_finite())
                && matches!(info.status, QpStatus::Solved | QpStatus::AlmostSolved)
            {
                info.status = QpStatus::Failed;
            }
            level.info = Some(info);
            if !level.solved() {
                level.x.fill(0.0);
                break;
            }
        }
    }

    /// The last level with a solution; its solution is the solution of the stack.
    pub fn solution(&self) -> Option<&Level> {
        self.levels.iter().rev().find(|level| level.solved())
    }

    /// Summary of all levels: the status of a level without solution, else the worst status; the sum of the iterations; the active rows of the last
    /// level.
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

    /// For every level and term, the number of rows that are linearly independent of the constraints and the levels above, after
    /// [`Cascade::build`].
    ///
    /// Allocates: not for use in a tick.
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

/// Adds the equality rows of the constraints and the slack to the basis.
fn add_constraints(basis: &mut Basis, constraints: &Qp, n_eq: usize, slack: Option<usize>) {
    for row in 0..n_eq {
        basis.push(|col| constraints.A[(row, col)]);
    }
    if let Some(slack) = slack {
        basis.push(|col| if col == slack { 1.0 } else { 0.0 });
    }
}

/// Adds the rows of a level to the basis.
fn add_level(basis: &mut Basis, terms: &[Term], tasks: &[Rows]) {
    for term in terms {
        let A = &tasks[term.task].A;
        for row in term.taken() {
            basis.push(|col| if col < A.ncols() { A[(row, col)] } else { 0.0 });
        }
    }
}

/// The rows of a level that are switched on, in order.
fn rows_of<'a>(terms: &'a [Term], tasks: &'a [Rows]) -> impl Fn(&mut dyn FnMut(SquareRow<'_>)) + 'a {
    move |take| {
        for term in terms {
            tasks[term.task].each(&term.takes, |b, entries| take(SquareRow { weight: term.weight, entries, b }));
        }
    }
}

/// Copies the constraints of the first level, and writes the rows of the levels above. [`set_reached`] writes their right sides.
fn constrain(qp: &mut Qp, first: &Qp, n_eq: usize, basis: &Basis) {
    let (n, rows) = (qp.n(), qp.b.len());
    for col in 0..n {
        let to = &mut qp.A.as_mut_slice()[col * rows..(col + 1) * rows];
        let (of_constraints, of_levels) = to.split_at_mut(n_eq);
        of_constraints.copy_from_slice(&first.A.as_slice()[col * n_eq..(col + 1) * n_eq]);
        basis.column(n_eq, col, of_levels);
    }
    qp.b.fill(0.0);
    qp.b.rows_mut(0, n_eq).copy_from(&first.b);
    qp.C.copy_from(&first.C);
    qp.d.copy_from(&first.d);
    qp.lower.copy_from(&first.lower);
    qp.upper.copy_from(&first.upper);
}

/// Writes `Q x`, with the solution `x` of the level above, to the right sides of its rows.
fn set_reached(qp: &mut Qp, n_eq: usize, x: &DVector<f64>) {
    let (rows, b) = (qp.b.len(), &mut qp.b.as_mut_slice()[n_eq..]);
    b.fill(0.0);
    for (column, x) in qp.A.as_slice().chunks_exact(rows).zip(x) {
        axpy(*x, &column[n_eq..], b);
    }
}

/// Writes half the cost of a level's tasks, in the order of its terms, and λ on every variable.
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
