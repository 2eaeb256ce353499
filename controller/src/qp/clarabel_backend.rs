//! Clarabel, an interior-point solver: the reference back-end.
//!
//! The sparsity pattern is fixed when the solver is built, so a tick only writes numbers. Every option is set explicitly. Equilibration
//! is off, because with it an updated solver and a new one differ in the last bits.

use super::program::{Qp, QpInfo, QpSolver, QpStatus};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use nalgebra::DVector;

/// Solver for programs with a fixed sparsity pattern.
pub struct ClarabelSolver {
    solver: DefaultSolver<f64>,
    P: CscMatrix<f64>,
    q: Vec<f64>,
    A: CscMatrix<f64>,
    b: Vec<f64>,
    bounds: Vec<Bound>,
    n_eq: usize,
    n_in: usize,
}

/// A finite bound of a variable; it is a row of Clarabel's constraint matrix.
#[derive(Clone, Copy)]
enum Bound {
    Lower(usize),
    Upper(usize),
}

impl ClarabelSolver {
    /// Builds a solver for programs whose non-zero entries and finite bounds are among those of `pattern`.
    ///
    /// - `max_iterations`: iteration limit.
    /// - `tolerance`: of feasibility (primal, dual) and gap (absolute, relative).
    pub fn new(pattern: &Qp, max_iterations: u32, tolerance: f64) -> Self {
        let n = pattern.n();
        let mut bounds = Vec::new();
        for i in 0..n {
            if pattern.lower[i].is_finite() {
                bounds.push(Bound::Lower(i));
            }
            if pattern.upper[i].is_finite() {
                bounds.push(Bound::Upper(i));
            }
        }
        let (n_eq, n_in) = (pattern.b.len(), pattern.d.len());
        let P = csc(n, n, |i, j| i == j || (i < j && pattern.H[(i, j)] != 0.0));
        let A = csc(n_eq + n_in + bounds.len(), n, |i, j| {
            if i < n_eq {
                pattern.A[(i, j)] != 0.0
            } else if i < n_eq + n_in {
                pattern.C[(i - n_eq, j)] != 0.0
            } else {
                match bounds[i - n_eq - n_in] {
                    Bound::Lower(k) | Bound::Upper(k) => k == j,
                }
            }
        });
        let cones = [SupportedConeT::ZeroConeT(n_eq), SupportedConeT::NonnegativeConeT(n_in + bounds.len())];
        let (q, b) = (vec![0.0; n], vec![0.0; A.m]);
        let solver = DefaultSolver::new(&P, &q, &A, &b, &cones, settings(max_iterations, tolerance))
            .expect("sizes agree by construction, and the settings are ours");
        ClarabelSolver { solver, P, q, A, b, bounds, n_eq, n_in }
    }

    /// Copies the numbers of a program to the solver. If one is not finite, returns false and leaves the solver unchanged: Clarabel would not
    /// recover from it.
    fn load(&mut self, qp: &Qp) -> bool {
        fill(&mut self.P, |i, j| qp.H[(i, j)]);
        let (n_eq, n_in) = (self.n_eq, self.n_in);
        let bounds = &self.bounds;
        fill(&mut self.A, |i, j| {
            if i < n_eq {
                qp.A[(i, j)]
            } else if i < n_eq + n_in {
                qp.C[(i - n_eq, j)]
            } else {
                match bounds[i - n_eq - n_in] {
                    Bound::Lower(_) => -1.0,
                    Bound::Upper(_) => 1.0,
                }
            }
        });
        self.q.copy_from_slice(qp.g.as_slice());
        self.b[..n_eq].copy_from_slice(qp.b.as_slice());
        self.b[n_eq..n_eq + n_in].copy_from_slice(qp.d.as_slice());
        for (row, bound) in bounds.iter().enumerate() {
            self.b[n_eq + n_in + row] = match *bound {
                Bound::Lower(k) => -qp.lower[k],
                Bound::Upper(k) => qp.upper[k],
            };
        }
        if [&self.P.nzval, &self.q, &self.A.nzval, &self.b].into_iter().flatten().any(|x| !x.is_finite()) {
            return false;
        }
        let solver = &mut self.solver;
        let updated = solver
            .update_P(&self.P.nzval)
            .and_then(|()| solver.update_A(&self.A.nzval))
            .and_then(|()| solver.update_q(&self.q))
            .and_then(|()| solver.update_b(&self.b));
        updated.expect("the pattern is that of construction, and presolve is off");
        true
    }
}

impl QpSolver for ClarabelSolver {
    fn solve(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo {
        if !self.load(qp) {
            x.fill(0.0);
            return QpInfo { status: QpStatus::Failed, iterations: 0, n_active: 0, row: None };
        }
        self.solver.solve();
        let solution = &self.solver.solution;
        x.as_mut_slice().copy_from_slice(&solution.x);
        QpInfo {
            status: match solution.status {
                SolverStatus::Solved => QpStatus::Solved,
                SolverStatus::AlmostSolved => QpStatus::AlmostSolved,
                SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => QpStatus::Infeasible,
                _ => QpStatus::Failed,
            },
            iterations: solution.iterations,
            n_active: solution.s[self.n_eq..].iter().filter(|s| **s < 1e-6).count(),
            row: None,
        }
    }
}

fn settings(max_iterations: u32, tolerance: f64) -> DefaultSettings<f64> {
    DefaultSettingsBuilder::default()
        .verbose(false)
        .max_iter(max_iterations)
        .time_limit(f64::INFINITY)
        .tol_gap_abs(tolerance)
        .tol_gap_rel(tolerance)
        .tol_feas(tolerance)
        .max_threads(1)
        .direct_solve_method("qdldl".into())
        .presolve_enable(false)
        .equilibrate_enable(false)
        .input_sparse_dropzeros(false)
        .static_regularization_enable(true)
        .static_regularization_constant(1e-8)
        .dynamic_regularization_enable(true)
        .iterative_refinement_enable(true)
        .iterative_refinement_reltol(1e-13)
        .iterative_refinement_abstol(1e-12)
        .iterative_refinement_max_iter(10)
        .build()
        .expect("every option is in its range")
}

/// A sparse matrix with explicit entries, initially 0, where `present(row, column)`.
fn csc(m: usize, n: usize, present: impl Fn(usize, usize) -> bool) -> CscMatrix<f64> {
    let (mut colptr, mut rowval) = (vec![0], Vec::new());
    for j in 0..n {
        rowval.extend((0..m).filter(|&i| present(i, j)));
        colptr.push(rowval.len());
    }
    let nzval = vec![0.0; rowval.len()];
    CscMatrix::new(m, n, colptr, rowval, nzval)
}

fn fill(matrix: &mut CscMatrix<f64>, value: impl Fn(usize, usize) -> f64) {
    for j in 0..matrix.n {
        for k in matrix.colptr[j]..matrix.colptr[j + 1] {
            matrix.nzval[k] = value(matrix.rowval[k], j);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// min ½|x - t|² s.t. x0 + x1 + x2 = 3, x0 ≤ x1, 0 ≤ x ≤ 10.
    fn program(t: [f64; 3]) -> Qp {
        let mut qp = Qp::zeros(3, 1, 1);
        qp.H = DMatrix::identity(3, 3);
        qp.g = -DVector::from_row_slice(&t);
        qp.A.fill(1.0);
        qp.b[0] = 3.0;
        (qp.C[(0, 0)], qp.C[(0, 1)]) = (1.0, -1.0);
        qp.lower.fill(0.0);
        qp.upper.fill(10.0);
        qp
    }

    #[test]
    fn small_program_has_the_solution_computed_by_hand() {
        // Without the inequality row the minimizer is the projection of t onto the plane, t itself. With x2 ≥ 0 and x0 ≤ x1: (1.5, 1.5, 0).
        let qp = program([3.0, 1.0, -1.0]);
        let mut x = DVector::zeros(3);
        let info = ClarabelSolver::new(&qp, 50, 1e-10).solve(&qp, &mut x);
        assert_eq!(info.status, QpStatus::Solved);
        assert_eq!(info.n_active, 2);
        assert!((x - DVector::from_row_slice(&[1.5, 1.5, 0.0])).norm() < 1e-7);
    }

    #[test]
    fn infeasible_program_is_reported() {
        let mut qp = program([0.0; 3]);
        qp.upper.fill(0.5);
        let mut x = DVector::zeros(3);
        let info = ClarabelSolver::new(&qp, 50, 1e-8).solve(&qp, &mut x);
        assert_eq!(info.status, QpStatus::Infeasible);
    }

    #[test]
    fn earlier_programs_do_not_change_a_bit() {
        let (first, second) = (program([3.0, 1.0, -1.0]), program([0.3, 0.7, 9.0]));
        let (mut infeasible, mut broken, mut huge) = (first.clone(), first.clone(), first.clone());
        infeasible.upper.fill(0.5);
        broken.H[(1, 1)] = f64::NAN;
        (huge.H[(1, 1)], huge.g[0], huge.C[(0, 0)]) = (1e300, 1e300, 1e300);
        let (mut fresh, mut used) = (DVector::zeros(3), DVector::zeros(3));
        ClarabelSolver::new(&first, 50, 1e-8).solve(&second, &mut fresh);
        for before in [&first, &infeasible, &broken, &huge] {
            let mut solver = ClarabelSolver::new(&first, 50, 1e-8);
            solver.solve(before, &mut used);
            let info = solver.solve(&second, &mut used);
            assert_eq!(info.status, QpStatus::Solved);
            for i in 0..3 {
                assert_eq!(fresh[i].to_bits(), used[i].to_bits());
            }
        }
    }
}
