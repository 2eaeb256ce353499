//! The active-set solver on programs built around a known minimizer: random, degenerate, rank-deficient, infeasible, non-finite.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::qp::{ActiveSetSolver, Qp, QpInfo, QpRow, QpSolver, QpStatus};
use nalgebra::{DMatrix, DVector};

/// Allowed error relative to the norm: rounding times the condition of the programs, up to 1e4.
const ALLOWED: f64 = 1e-9;

fn solve(qp: &Qp) -> (QpInfo, DVector<f64>) {
    let mut x = DVector::from_element(qp.n(), f64::NAN);
    let info = ActiveSetSolver::new(qp, 1000).solve(qp, &mut x);
    (info, x)
}

fn matrix(m: usize, n: usize, rng: &mut Rng) -> DMatrix<f64> {
    DMatrix::from_fn(m, n, |_, _| rng.symmetric())
}

/// An integer from 0 to `below` - 1.
fn pick(below: usize, rng: &mut Rng) -> usize {
    (rng.word() % below as u64) as usize
}

/// A program and its minimizer: point and multipliers are chosen, and the optimality conditions are solved for the gradient.
///
/// Source of the conditions: S. Boyd, L. Vandenberghe, *Convex Optimization* (2004), section 5.5.3.
struct Made {
    qp: Qp,
    x: DVector<f64>,
    active: usize,
}

/// `dense`: dense Hessian, otherwise blocks of two. `weak`: fraction of the active rows whose multiplier is 0.
fn made(rng: &mut Rng, dense: bool, weak: f64) -> Made {
    let n = 1 + pick(14, rng);
    let (n_eq, n_in) = (pick(n.min(6), rng), pick(20, rng));
    let mut qp = Qp::zeros(n, n_eq, n_in);
    let half = matrix(n, n, rng);
    qp.H = &half * half.transpose() + DMatrix::identity(n, n) * 1e-2;
    if !dense {
        qp.H = DMatrix::from_fn(n, n, |i, j| if i / 2 == j / 2 { qp.H[(i, j)] } else { 0.0 });
    }
    (qp.A, qp.C) = (matrix(n_eq, n, rng), matrix(n_in, n, rng));
    let x = DVector::from_fn(n, |_, _| 3.0 * rng.symmetric());
    qp.b = &qp.A * &x;
    let mut gradient = &qp.H * &x;
    gradient += qp.A.transpose() * DVector::from_fn(n_eq, |_, _| rng.symmetric());
    // At most as many active rows as the equalities leave directions, so that the multipliers are unique.
    let mut active = 0;
    let mut holds = |rng: &mut Rng| {
        let takes = active + n_eq < n && rng.symmetric() < -0.2;
        active += usize::from(takes);
        let multiplier = if rng.symmetric() < 2.0 * weak - 1.0 { 0.0 } else { 1.0 + rng.symmetric() };
        if takes { (0.0, multiplier) } else { (1.0 + rng.symmetric(), 0.0) }
    };
    for i in 0..n_in {
        let (slack, multiplier) = holds(rng);
        qp.d[i] = qp.C.row(i).dot(&x.transpose()) + slack;
        gradient += qp.C.row(i).transpose() * multiplier;
    }
    for i in 0..n {
        let (slack, multiplier) = holds(rng);
        if rng.symmetric() < 0.0 {
            qp.upper[i] = x[i] + slack;
            gradient[i] += multiplier;
        } else {
            qp.lower[i] = x[i] - slack;
            gradient[i] -= multiplier;
        }
    }
    qp.g = -gradient;
    Made { qp, x, active }
}

#[track_caller]
fn assert_found(Made { qp, x: expected, .. }: &Made, what: &str) -> QpInfo {
    let (info, x) = solve(qp);
    assert_eq!(info.status, QpStatus::Solved, "{what}: {info:?}");
    let off = (&x - expected).norm() / (1.0 + expected.norm());
    assert!(off < ALLOWED, "{what}: off by {off:e}");
    assert!(qp.violation(&x) < ALLOWED, "{what}: violated by {:e}", qp.violation(&x));
    info
}

#[test]
fn random_programs_are_solved() {
    let mut rng = Rng(1);
    let mut sets = 0;
    for k in 0..3000 {
        let made = made(&mut rng, k % 2 == 0, 0.0);
        let info = assert_found(&made, &format!("program {k}"));
        assert_eq!(info.n_active, made.active, "program {k}");
        sets += made.active;
    }
    assert!(sets > 5000, "{sets} active rows in all");
}

#[test]
fn active_rows_without_multiplier_do_no_harm() {
    let mut rng = Rng(2);
    for k in 0..3000 {
        assert_found(&made(&mut rng, k % 2 == 0, 0.5), &format!("program {k}"));
    }
}

#[test]
fn repeated_scaled_and_summed_rows_do_no_harm() {
    let mut rng = Rng(3);
    for k in 0..1000 {
        let mut made = made(&mut rng, true, 0.2);
        let Qp { A, b, C, d, .. } = &mut made.qp;
        let (n_eq, n_in, n) = (b.len(), d.len(), A.ncols());
        if n_in == 0 || n_eq == 0 {
            continue;
        }
        let (i, j, e) = (pick(n_in, &mut rng), pick(n_in, &mut rng), pick(n_eq, &mut rng));
        // The row again, scaled by ten thousand, and the sum of two rows: all redundant.
        let more = [(C.row(i).clone_owned(), d[i]), (C.row(j) * 1e4, d[j] * 1e4), (C.row(i) + C.row(j), d[i] + d[j])];
        *C = C.clone().resize(n_in + 3, n, 0.0);
        *d = d.clone().resize_vertically(n_in + 3, 0.0);
        for (at, (row, side)) in (n_in..).zip(more) {
            C.row_mut(at).copy_from(&row);
            d[at] = side;
        }
        let (row, side) = (A.row(e) * 2.0 + A.row(0), 2.0 * b[e] + b[0]);
        *A = A.clone().resize(n_eq + 1, n, 0.0);
        *b = b.clone().resize_vertically(n_eq + 1, side);
        A.row_mut(n_eq).copy_from(&row);
        assert_found(&made, &format!("program {k}"));
    }
}

#[test]
fn a_vertex_of_many_more_rows_than_variables_is_found() {
    let mut rng = Rng(4);
    for k in 0..300 {
        let (n, rows) = (3, 40);
        let mut qp = Qp::zeros(n, 0, rows);
        qp.H = DMatrix::identity(n, n);
        qp.C = matrix(rows, n, &mut rng);
        let x = DVector::from_fn(n, |_, _| rng.symmetric());
        // Every row is active at x, and three of them have a multiplier.
        qp.d = &qp.C * &x;
        qp.g = -&x - qp.C.rows(0, 3).transpose() * DVector::from_fn(3, |_, _| 1.0 + rng.symmetric());
        assert_found(&Made { qp, x, active: 3 }, &format!("program {k}"));
    }
}

#[test]
fn contradicting_rows_are_infeasible_and_one_of_them_is_named() {
    let mut rng = Rng(5);
    for k in 0..1000 {
        let Made { mut qp, .. } = made(&mut rng, k % 2 == 0, 0.2);
        let (n, n_in) = (qp.n(), qp.d.len());
        // Two rows that leave a gap of 1 between them.
        let row = matrix(1, n, &mut rng);
        qp.C = qp.C.clone().resize(n_in + 2, n, 0.0);
        qp.d = qp.d.clone().resize_vertically(n_in + 2, 0.0);
        qp.C.row_mut(n_in).copy_from(&row);
        qp.C.row_mut(n_in + 1).copy_from(&-row);
        qp.d[n_in + 1] = -1.0;
        let (info, x) = solve(&qp);
        assert_eq!((info.status, x.norm()), (QpStatus::Infeasible, 0.0), "program {k}");
        assert!(info.row.is_some(), "program {k}");
    }
    // Without other rows the name is unique.
    let mut qp = Qp::zeros(3, 1, 1);
    qp.H = DMatrix::identity(3, 3);
    (qp.A[(0, 0)], qp.A[(0, 1)], qp.b[0], qp.C[(0, 2)], qp.d[0]) = (1.0, 1.0, 3.0, 1.0, 5.0);
    qp.upper[0] = 1.0;
    qp.upper[1] = 1.0;
    let named = solve(&qp).0.row.unwrap();
    assert!([QpRow::Upper(0), QpRow::Upper(1)].contains(&named), "{named:?}");
}

#[test]
fn contradictions_are_found_before_the_search() {
    let mut qp = Qp::zeros(2, 2, 1);
    qp.H = DMatrix::identity(2, 2);
    (qp.A[(0, 0)], qp.A[(1, 0)]) = (1.0, 2.0);
    (qp.b[0], qp.b[1]) = (1.0, 2.0);
    assert_eq!(solve(&qp).0.status, QpStatus::Solved, "the second row repeats the first");
    let with = |edit: &dyn Fn(&mut Qp)| {
        let mut qp = qp.clone();
        edit(&mut qp);
        let (info, x) = solve(&qp);
        assert_eq!((info.status, x), (QpStatus::Infeasible, DVector::zeros(2)));
        info.row.unwrap()
    };
    assert_eq!(with(&|qp| qp.b[1] = 2.1), QpRow::Equality(1), "the first is kept");
    assert_eq!(with(&|qp| qp.d[0] = -1.0), QpRow::Inequality(0), "0 <= -1");
    assert_eq!(with(&|qp| (qp.A[(1, 0)], qp.b[1]) = (0.0, 1.0)), QpRow::Equality(1), "0 = 1");
    assert_eq!(with(&|qp| (qp.lower[1], qp.upper[1]) = (1.0, 0.0)), QpRow::Lower(1));
    assert_eq!(with(&|qp| qp.lower[0] = 1.5), QpRow::Lower(0), "against an equality");
}

#[test]
fn non_finite_numbers_and_too_few_iterations_fail() {
    let made = made(&mut Rng(10), true, 0.0);
    let (n, n_in) = (made.qp.n(), made.qp.d.len());
    assert!(n > 2 && n_in > 2 && !made.qp.b.is_empty() && made.active > 2, "the program has everything");
    let edits: [&dyn Fn(&mut Qp); 10] = [
        &|qp| qp.H[(n - 1, n - 1)] = f64::NAN,
        &|qp| (qp.H[(1, 0)], qp.H[(0, 1)]) = (f64::NAN, f64::NAN),
        &|qp| qp.H[(0, 0)] = f64::INFINITY,
        &|qp| qp.H[(1, 1)] = -1.0,
        &|qp| qp.g[1] = f64::NAN,
        &|qp| qp.A[(0, 0)] = f64::NAN,
        &|qp| qp.b[0] = f64::INFINITY,
        &|qp| qp.C[(1, 1)] = f64::NAN,
        &|qp| qp.d[0] = f64::NAN,
        &|qp| qp.upper[0] = f64::NAN,
    ];
    for (k, edit) in edits.iter().enumerate() {
        let mut qp = made.qp.clone();
        edit(&mut qp);
        let (info, x) = solve(&qp);
        assert_eq!((info.status, x.norm()), (QpStatus::Failed, 0.0), "edit {k}");
    }
    let mut x = DVector::zeros(n);
    let mut starved = ActiveSetSolver::new(&made.qp, 2);
    assert_eq!(starved.solve(&made.qp, &mut x).status, QpStatus::Failed);
}

#[test]
fn earlier_programs_change_no_bit() {
    let mut rng = Rng(7);
    // Programs of the same size, feasible and infeasible, with one solver and with a new solver each.
    let mut shared: Option<ActiveSetSolver> = None;
    let mut statuses = Vec::new();
    for k in 0..200 {
        let mut qp = Qp::zeros(8, 2, 12);
        let half = matrix(8, 8, &mut rng);
        qp.H = &half * half.transpose() + DMatrix::identity(8, 8) * 1e-2;
        (qp.A, qp.C) = (matrix(2, 8, &mut rng), matrix(12, 8, &mut rng));
        (qp.g, qp.b) = (DVector::from_fn(8, |_, _| rng.symmetric()), DVector::from_fn(2, |_, _| rng.symmetric()));
        qp.d.fill(0.3 * rng.symmetric());
        qp.upper.fill(0.5);
        if k % 10 == 0 {
            qp.g[3] = f64::NAN;
        }
        let (own_info, own) = solve(&qp);
        let solver = shared.get_or_insert_with(|| ActiveSetSolver::new(&qp, 1000));
        let mut x = DVector::zeros(8);
        assert_eq!(solver.solve(&qp, &mut x), own_info, "program {k}");
        assert!(own.iter().zip(&x).all(|(a, b)| a.to_bits() == b.to_bits()), "program {k}");
        statuses.push(own_info.status);
    }
    for status in [QpStatus::Solved, QpStatus::Infeasible, QpStatus::Failed] {
        assert!(statuses.iter().filter(|s| **s == status).count() > 10, "{status:?} is rare");
    }
}
