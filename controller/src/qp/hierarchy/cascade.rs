//! The hierarchy in null-space bases: strategy C of the source, with an orthogonal factorization instead of the bases themselves.
//!
//! ```text
//! x = Q [y_fixed; y_free]         Q: product of reflections, one for each direction that the levels above decide
//! level k:   √w A Q = [·  T  0]   after the reflections of its own rows; T: rows x rank
//!            min |T u - r|² + λ |u|² + λ |w|²,   y_free = [u; w];     u is fixed for the levels below, w is free for them
//! ```
//! The Hessian is `TᵀT + λE` and `λE`, so a factor of size rank is enough for the search in `y_free`. Rows enter in the order of the largest part outside the
//! span of those before (pivoting), and linearly dependent ones get no reflection. So a level below changes no row of a level above by more than rounding
//! errors, and dependent or conflicting tasks are no special case. Equality constraints are rows that must hold exactly.
//!
//! A last level with more rows than free directions needs no reflections: its Hessian is computed in a basis of the null space.
//!
//! Source: Laurenzi 2020, section 5.5 and eq. (5.21); A. Escande, N. Mansard, P.-B. Wieber, *Hierarchical quadratic programming*, IJRR 33 (2014).

use super::free::Free;
use super::rows::Rows;
use super::{Entries, Hierarchy, Level, LevelReport};
use crate::qp::constraints::Constraints;
use crate::qp::program::{QpRow, QpStatus, Unsolved};
use crate::qp::search::{Coordinates, Search};

/// Solver with memory for hierarchies up to a size; a solution is a function of the hierarchy alone.
pub struct NullSpaceCascade {
    max_iterations: u32,
    ranks: bool,
    free: Free,
    search: Search,
    rows: Rows,
    x: Vec<f64>,
    reports: Vec<LevelReport>,
    active: Vec<(usize, QpRow)>,
}

impl NullSpaceCascade {
    /// Allocates memory.
    ///
    /// - `largest`: a hierarchy with memory for the largest number of rows, levels and general constraints.
    /// - `max_iterations`: limit of the iterations of each level.
    /// - `ranks`: whether the rank of the last level is needed, too.
    pub fn new(largest: &Hierarchy, max_iterations: u32, ranks: bool) -> Self {
        let n = largest.n();
        let general = largest.general.capacity();
        let rows = largest.levels.iter().map(Level::capacity).max().unwrap_or(0).max(general);
        NullSpaceCascade {
            max_iterations,
            ranks,
            free: Free::new(n, rows),
            search: Search::new(n, Constraints::with_capacity(n, 2 * general)),
            rows: Rows::with_capacity(n, rows),
            x: vec![0.0; n],
            reports: Vec::with_capacity(largest.levels.len()),
            active: Vec::with_capacity(n * largest.levels.len()),
        }
    }

    /// The solution: that of the last level that has one, or zero.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// The reports of the levels.
    pub fn reports(&self) -> &[LevelReport] {
        &self.reports
    }

    /// The constraints that hold with equality at the solution of each level, with the level's number.
    pub fn active(&self) -> &[(usize, QpRow)] {
        &self.active
    }

    /// Whether every level has a solution.
    pub fn solved(&self) -> bool {
        self.reports.iter().all(LevelReport::solved)
    }

    /// Fills scratch memory with NaN: no later solution changes.
    pub fn poison(&mut self) {
        self.free.poison();
        self.rows.poison();
    }

    /// Solves the levels in order until one has no solution. Does not allocate.
    pub fn solve(&mut self, problem: &Hierarchy) {
        self.free.clear();
        self.x.fill(0.0);
        self.active.clear();
        self.reports.clear();
        self.reports.resize(problem.levels.len(), LevelReport::OPEN);
        for k in 0..problem.levels.len() {
            let solved = self.level(problem, k);
            let report = &mut self.reports[k];
            match solved {
                Ok((status, iterations)) => {
                    let rank = self.free.rank();
                    *report = LevelReport { status: Some(status), rank, iterations, ..*report };
                    report.active = self.search.n_active();
                    self.active.extend(self.search.active().map(|row| (k, row)));
                    self.x.copy_from_slice(&self.search.x[..problem.n()]);
                    self.free.fix();
                }
                Err(Unsolved { status, row }) => {
                    *report = LevelReport { status: Some(status), row, ..*report };
                    return;
                }
            }
        }
    }

    fn level(&mut self, problem: &Hierarchy, k: usize) -> Result<(QpStatus, u32), Unsolved> {
        let is_new = |equality: bool| {
            problem.general.iter().any(|(_, sides)| sides.from == k && sides.is_equality() == equality)
        };
        if is_new(true) {
            self.equalities(problem, k)?;
        }
        let has_new = k == 0 || is_new(true) || is_new(false);
        if has_new {
            self.search.constraints.take_general(problem, k)?;
        }
        if k > 0 && !has_new {
            self.search.constraints.include(&self.x);
        }
        let NullSpaceCascade { ranks, free, search, rows, .. } = self;
        let level = &problem.levels[k];
        let is_last = k + 1 == problem.levels.len();
        let in_basis = is_last && !*ranks && level.selective.is_none() && level.len() >= free.len();
        if in_basis {
            free.take_basis();
            rows.normal_equations(level, free, &mut search.v);
            rows.factorize(problem.regularization, free, &mut search.v)?;
        } else {
            rows.load(level.rows(), free)?;
            rows.reflect(free);
            if let Some(selective) = level.selective {
                rows.damp(selective, free, &mut search.v);
            } else {
                rows.squares(free, &mut search.v);
                rows.factorize(problem.regularization, free, &mut search.v)?;
            }
        }
        search.start(free);
        let iterations = match search.inequalities(free, self.max_iterations) {
            // The solution of the level above is feasible: only rounding errors at a point without freedom say otherwise. It stays.
            Err(Unsolved { status: QpStatus::Infeasible, .. }) if !has_new => {
                free.keep_point(&self.x);
                search.x[..problem.n()].copy_from_slice(&self.x);
                return Ok((QpStatus::AlmostSolved, 0));
            }
            other => other?,
        };
        if search.x[..problem.n()].iter().any(|x| !x.is_finite()) {
            return Err(Unsolved::failed());
        }
        free.keep(&search.v);
        Ok((QpStatus::Solved, iterations))
    }

    /// Fixes the directions of the equality constraints that hold from this level on.
    fn equalities(&mut self, problem: &Hierarchy, k: usize) -> Result<(), Unsolved> {
        let NullSpaceCascade { free, rows, .. } = self;
        let equalities =
            || problem.general.iter().enumerate().filter(|(_, (_, sides))| sides.from == k && sides.is_equality());
        rows.load(equalities().map(|(_, (c, sides))| (Entries::Dense(c), sides.upper, 1.0)), free)?;
        rows.reflect(free);
        let broken = rows.hold(free);
        let (name, _) = broken.and_then(|row| equalities().nth(row)).unzip();
        match name {
            Some(i) => Err(Unsolved::infeasible(QpRow::Equality(i))),
            None => {
                free.fix();
                Ok(())
            }
        }
    }
}
