//! Explains an infeasible program: the constraints that contradict each other, by name.

use super::clarabel_backend::ClarabelSolver;
use super::program::{Qp, QpSolver, QpStatus};
use nalgebra::DVector;

/// Names of the rows and variables of a program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowNames {
    /// Names of the equality rows. Rows beyond the list are numbered.
    pub equalities: Vec<String>,
    /// Names of the inequality rows.
    pub inequalities: Vec<String>,
    /// Names of the variables, for their bounds.
    pub variables: Vec<String>,
}

/// A constraint of an infeasible set.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedViolation {
    /// Its name.
    pub name: String,
    /// Its violation at the point of least total violation, in its own unit.
    pub by: f64,
}

/// A constraint counts as satisfied below this fraction of the largest violation.
const SATISFIED: f64 = 1e-4;
/// Largest violation of a scaled row in a feasible program: the solver's residual.
const FEASIBLE: f64 = 1e-6;

/// The constraints that make a program infeasible, the most violated first; empty if it is feasible. `None` if the elastic program cannot be
/// solved.
///
/// ```text
/// min  ½ |s|² + ½ ε |x|²    subject to   A x - b = s,   C x - d ≤ s,   l - x ≤ s,   x - u ≤ s
/// ```
/// The multipliers of this elastic program equal its slacks, and the rows weighted by them sum to zero. The rows with a slack are therefore
/// an infeasible set (Farkas' lemma); the rows without slack are not part of it. Rows are scaled to norm 1, so that the result does not depend
/// on units. Not for use in a tick: builds a program and a solver.
pub fn explain(qp: &Qp, names: &RowNames) -> Option<Vec<NamedViolation>> {
    let rows = constraints(qp, names);
    let (n, m) = (qp.n(), rows.len());
    let n_eq = rows.iter().filter(|row| row.equality).count();
    let mut elastic = Qp::zeros(n + m, n_eq, m - n_eq);
    for i in 0..n {
        elastic.H[(i, i)] = 1e-9;
    }
    let (mut at_eq, mut at_in) = (0, 0);
    for (k, row) in rows.iter().enumerate() {
        elastic.H[(n + k, n + k)] = 1.0;
        let (matrix, side, at) = if row.equality {
            (&mut elastic.A, &mut elastic.b, &mut at_eq)
        } else {
            (&mut elastic.C, &mut elastic.d, &mut at_in)
        };
        for &(col, value) in &row.entries {
            matrix[(*at, col)] = value / row.size;
        }
        matrix[(*at, n + k)] = -1.0;
        side[*at] = row.side / row.size;
        *at += 1;
    }
    let mut x = DVector::zeros(n + m);
    let info = ClarabelSolver::new(&elastic, 200, 1e-10).solve(&elastic, &mut x);
    if !matches!(info.status, QpStatus::Solved | QpStatus::AlmostSolved) {
        return None;
    }
    let slack = |k: usize| x[n + k].abs();
    let largest = (0..m).map(slack).fold(0.0, f64::max);
    let mut found: Vec<(f64, NamedViolation)> = Vec::new();
    for (k, row) in rows.into_iter().enumerate() {
        if largest > FEASIBLE && slack(k) > SATISFIED * largest {
            found.push((slack(k), NamedViolation { by: slack(k) * row.size, name: row.name }));
        }
    }
    found.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    Some(found.into_iter().map(|(_, violation)| violation).collect())
}

/// A non-zero row; one-sided unless `equality`.
struct Row {
    name: String,
    entries: Vec<(usize, f64)>,
    side: f64,
    size: f64,
    equality: bool,
}

fn constraints(qp: &Qp, names: &RowNames) -> Vec<Row> {
    let name = |names: &[String], kind: &str, i: usize| names.get(i).cloned().unwrap_or_else(|| format!("{kind} {i}"));
    let mut rows = Vec::new();
    for (matrix, side, of, kind, equality) in
        [(&qp.A, &qp.b, &names.equalities, "equality", true), (&qp.C, &qp.d, &names.inequalities, "inequality", false)]
    {
        for i in 0..side.len() {
            let entries: Vec<(usize, f64)> =
                matrix.row(i).iter().copied().enumerate().filter(|(_, value)| *value != 0.0).collect();
            let size = entries.iter().fold(0.0, |sum, (_, value)| sum + value * value).sqrt();
            if size > 0.0 {
                rows.push(Row { name: name(of, kind, i), entries, side: side[i], size, equality });
            }
        }
    }
    for i in 0..qp.n() {
        for (sign, bound, which) in [(-1.0, -qp.lower[i], "lower"), (1.0, qp.upper[i], "upper")] {
            if bound.is_finite() {
                let name = format!("{which} bound of {}", name(&names.variables, "variable", i));
                rows.push(Row { name, entries: vec![(i, sign)], side: bound, size: 1.0, equality: false });
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> RowNames {
        let named = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        RowNames { equalities: named(&["sum"]), inequalities: named(&["order"]), variables: named(&["a", "b", "c"]) }
    }

    /// x0 + x1 = 3, x0 ≤ x1, 0 ≤ x ≤ upper.
    fn program(upper: f64) -> Qp {
        let mut qp = Qp::zeros(3, 1, 1);
        (qp.A[(0, 0)], qp.A[(0, 1)], qp.b[0]) = (1.0, 1.0, 3.0);
        (qp.C[(0, 0)], qp.C[(0, 1)]) = (1.0, -1.0);
        qp.lower.fill(0.0);
        qp.upper.fill(upper);
        qp
    }

    #[test]
    fn only_the_contradicting_constraints_are_named() {
        // With x ≤ 1 the sum is at most 2. Of the residual 1 = s_0 + s_1 + √2 s_sum, |s|² is least at s = (1, 1, √2)/4.
        let found = explain(&program(1.0), &names()).unwrap();
        let found: Vec<(&str, f64)> = found.iter().map(|v| (v.name.as_str(), (v.by * 1e5).round() / 1e5)).collect();
        assert_eq!(found[0], ("sum", 0.5));
        assert_eq!(found[1..].iter().map(|v| v.1).collect::<Vec<_>>(), [0.25; 2]);
        let mut bounds: Vec<&str> = found[1..].iter().map(|v| v.0).collect();
        bounds.sort_unstable();
        assert_eq!(bounds, ["upper bound of a", "upper bound of b"]);
    }

    #[test]
    fn a_feasible_program_has_nothing_to_explain() {
        assert_eq!(explain(&program(2.0), &names()), Some(vec![]));
    }

    #[test]
    fn rows_without_a_name_are_numbered() {
        let mut qp = program(10.0);
        (qp.lower[0], qp.upper[0], qp.C[(0, 1)], qp.d[0]) = (5.0, 10.0, 0.0, 4.0);
        let found = explain(&qp, &RowNames::default()).unwrap();
        let mut named: Vec<&str> = found.iter().map(|v| v.name.as_str()).collect();
        named.sort_unstable();
        // x0 ≥ 5 contradicts the inequality x0 ≤ 4, and the equality together with 0 ≤ x1.
        assert_eq!(named, ["equality 0", "inequality 0", "lower bound of variable 0", "lower bound of variable 1"]);
    }
}
