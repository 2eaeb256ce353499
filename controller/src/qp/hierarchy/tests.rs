use super::*;
use crate::math::Rng;
use crate::qp::Backend;

/// A random hierarchy. Rows of a level are `U S Vᵀ` with singular values between 0.1 and 1, and `lost` of them 0; some levels repeat rows of the level above
/// with other right sides, so that they conflict.
fn random(rng: &mut Rng, n: usize, rows: &[usize], lost: usize, bound: f64) -> Hierarchy {
    let mut problem = Hierarchy::with_capacity(n, rows, 4);
    problem.regularization = 1e-8;
    let mut last: Vec<f64> = Vec::new();
    for (k, &count) in rows.iter().enumerate() {
        let mut factors = |size: usize| -> Vec<f64> { (0..size).map(|_| rng.normal()).collect() };
        let rank = count.min(n).saturating_sub(lost).max(1);
        let (left, right) =
            (orthonormal(&factors(count * rank), count, rank), orthonormal(&factors(n * rank), n, rank));
        for i in 0..count {
            let repeats = k > 0 && i == 0 && rng.uniform(0.0, 1.0) < 0.5;
            let weight = rng.uniform(0.5, 2.0);
            let a = problem.levels[k].push(rng.uniform(-1.0, 1.0), weight);
            if repeats {
                a.copy_from_slice(&last);
                continue;
            }
            for s in 0..rank {
                let value = 0.1 + 0.9 * f64::from(u32::try_from(s).unwrap()) / f64::from(u32::try_from(rank).unwrap());
                a.iter_mut().enumerate().for_each(|(j, a)| *a += left[s * count + i] * value * right[s * n + j]);
            }
            last = a.to_vec();
        }
    }
    problem.lower.fill(-bound);
    problem.upper.fill(bound);
    problem
}

/// Orthonormal columns, `rows` numbers each, from random ones.
fn orthonormal(numbers: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    let mut q: Vec<f64> = Vec::new();
    for column in numbers.chunks_exact(rows).take(columns) {
        let mut column = column.to_vec();
        for _ in 0..2 {
            for other in q.chunks_exact(rows) {
                let along = product(other, &column);
                column.iter_mut().zip(other).for_each(|(x, q)| *x -= along * q);
            }
        }
        let size = product(&column, &column).sqrt();
        q.extend(column.iter().map(|x| x / size));
    }
    q
}

fn fast(problem: &Hierarchy, ranks: bool) -> NullSpaceCascade {
    let mut solver = NullSpaceCascade::new(problem, 200, ranks);
    solver.solve(problem);
    solver
}

fn reference(strategy: Strategy, backend: Backend) -> ByPrograms {
    ByPrograms { strategy, backend, max_iterations: 200, tolerance: 1e-11 }
}

fn residuals(problem: &Hierarchy, x: &[f64]) -> Vec<f64> {
    problem.levels.iter().map(|level| level.residual(x)).collect()
}

const SIZES: [&[usize]; 4] = [&[6], &[3, 6, 12], &[3, 6, 6, 20], &[5, 25, 4]];

#[test]
fn all_strategies_and_back_ends_agree_where_tasks_are_independent() {
    let mut rng = Rng::new(1, "hierarchy");
    for round in 0..40 {
        let sizes = SIZES[round % SIZES.len()];
        let problem = random(&mut rng, 20, sizes, 0, if round % 3 == 0 { f64::INFINITY } else { 0.6 });
        let expected = fast(&problem, true);
        assert!(expected.solved(), "{round}: {:?}", expected.reports());
        assert!(problem.violation(expected.x()) < 1e-9);
        let is_independent = sizes.iter().sum::<usize>() <= 20;
        for strategy in [Strategy::Optimality, Strategy::Projectors, Strategy::NullSpace] {
            for backend in [Backend::ActiveSet, Backend::Clarabel] {
                if strategy == Strategy::Optimality && !is_independent {
                    continue;
                }
                let (x, reports) = reference(strategy, backend).solve(&problem);
                assert!(reports.iter().all(LevelReport::solved), "{round} {strategy:?} {backend:?} {reports:?}");
                for (k, (found, expected)) in
                    residuals(&problem, x.as_slice()).iter().zip(residuals(&problem, expected.x())).enumerate()
                {
                    assert!(
                        (found - expected).abs() < 2e-6,
                        "{round} {strategy:?} {backend:?} level {k}: {found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_level_below_does_not_change_a_residual_above_for_dependent_and_conflicting_rows() {
    let mut rng = Rng::new(2, "hierarchy");
    for round in 0..300 {
        let sizes = SIZES[round % SIZES.len()];
        let problem = random(&mut rng, 20, sizes, round % 3, if round % 2 == 0 { f64::INFINITY } else { 0.4 });
        let whole = fast(&problem, false);
        assert!(whole.solved(), "{round} {:?}", whole.reports());
        let found = residuals(&problem, whole.x());
        for k in 0..sizes.len() {
            let mut part = problem.clone();
            part.levels.truncate(k + 1);
            let expected = residuals(&part, fast(&part, true).x());
            assert!((found[k] - expected[k]).abs() < 1e-9, "{round} level {k}: {} {}", found[k], expected[k]);
        }
    }
}

/// The last level in a basis, and by reflections, with the same result; and memory of an earlier solve changes no bit.
#[test]
fn a_solution_depends_on_the_hierarchy_alone() {
    let mut rng = Rng::new(3, "hierarchy");
    let problems: Vec<_> = (0..20).map(|_| random(&mut rng, 20, SIZES[2], 1, 0.4)).collect();
    let mut solver = NullSpaceCascade::new(&problems[0], 200, false);
    for problem in &problems {
        solver.poison();
        solver.solve(problem);
        let (fresh, ranks) = (fast(problem, false), fast(problem, true));
        for ((a, b), c) in solver.x().iter().zip(fresh.x()).zip(ranks.x()) {
            assert_eq!(a.to_bits(), b.to_bits());
            assert!((a - c).abs() < 1e-6, "{a} {c}");
        }
    }
}

/// x + y = 1 above x - y = 3, y ≥ -0.5: the bound leaves 0.5 of the second level. By hand: y = -0.5, x = 1.5.
#[test]
fn a_bound_and_an_equality_computed_by_hand() {
    let mut problem = Hierarchy::with_capacity(2, &[1], 1);
    problem.levels[0].push(3.0, 1.0).copy_from_slice(&[1.0, -1.0]);
    problem.general.push(Sides { lower: 1.0, upper: 1.0, from: 0 }).copy_from_slice(&[1.0, 1.0]);
    problem.lower[1] = -0.5;
    for ranks in [false, true] {
        let solver = fast(&problem, ranks);
        assert!((solver.x()[0] - 1.5).abs() < 1e-12 && (solver.x()[1] + 0.5).abs() < 1e-12, "{:?}", solver.x());
        assert_eq!(solver.active(), [(0, QpRow::Lower(1))]);
    }
    // A second equality contradicts the first; a bound contradicts both; a row of zeros contradicts itself.
    let mut broken = problem.clone();
    broken.general.push(Sides { lower: 2.0, upper: 2.0, from: 0 }).copy_from_slice(&[1.0, 1.0]);
    assert_eq!(fast(&broken, true).reports()[0].row, Some(QpRow::Equality(1)));
    let mut broken = problem.clone();
    (broken.upper[0], broken.upper[1]) = (0.25, 0.25);
    assert_eq!(fast(&broken, true).reports()[0].status, Some(QpStatus::Infeasible));
    let mut broken = problem;
    broken.general.push(Sides { lower: 1.0, upper: 2.0, from: 0 });
    assert_eq!(fast(&broken, true).reports()[0].row, Some(QpRow::Inequality(1)));
}

/// A constraint from the second level on does not change the first level, and one that the first level contradicts ends the cascade there.
#[test]
fn a_constraint_from_one_level_downwards() {
    let mut problem = Hierarchy::with_capacity(2, &[1, 2], 1);
    problem.levels[0].push(2.0, 1.0).copy_from_slice(&[1.0, 0.0]);
    problem.levels[1].push_pick(Pick { column: 1, factor: 1.0, b: 5.0, weight: 1.0 });
    let row = |problem: &mut Hierarchy, from, c: [f64; 2]| {
        problem.general.push(Sides { lower: f64::NEG_INFINITY, upper: 1.0, from }).copy_from_slice(&c);
    };
    let mut second = problem.clone();
    row(&mut second, 1, [0.0, 1.0]);
    let solver = fast(&second, true);
    assert!((solver.x()[0] - 2.0).abs() < 1e-6 && (solver.x()[1] - 1.0).abs() < 1e-9);
    let mut contradicts = problem.clone();
    row(&mut contradicts, 1, [1.0, 0.0]);
    let solver = fast(&contradicts, true);
    assert_eq!(solver.reports().map_statuses(), [Some(QpStatus::Solved), Some(QpStatus::Infeasible)]);
    assert!((solver.x()[0] - 2.0).abs() < 1e-6);
}

trait Statuses {
    fn map_statuses(&self) -> Vec<Option<QpStatus>>;
}

impl Statuses for [LevelReport] {
    fn map_statuses(&self) -> Vec<Option<QpStatus>> {
        self.iter().map(|report| report.status).collect()
    }
}

/// The source's example, `[[0, 1], [e, 1]]` with e = 1e-4 and the right side (0, 1): the exact solution is 1e4; damped, it is bounded.
#[test]
fn selective_damping_bounds_the_solution_near_a_singularity() {
    let mut problem = Hierarchy::with_capacity(2, &[2], 0);
    problem.levels[0].push(0.0, 1.0).copy_from_slice(&[0.0, 1.0]);
    problem.levels[0].push(1.0, 1.0).copy_from_slice(&[1e-4, 1.0]);
    problem.regularization = 1e-16;
    assert!((fast(&problem, true).x()[0] - 1e4).abs() < 1.0);
    problem.levels[0].selective = Some(Selective { law: Law::Exact, threshold: 0.05 });
    let x = fast(&problem, true).x().to_vec();
    assert!(x[0].abs() < 0.1 && (x[1] - 0.5).abs() < 1e-3, "{x:?}");
    // Exact far from the singularity.
    problem.levels[0].clear();
    problem.levels[0].push(2.0, 1.0).copy_from_slice(&[1.0, 0.5]);
    problem.levels[0].push(1.0, 1.0).copy_from_slice(&[0.0, 1.0]);
    let x = fast(&problem, true).x().to_vec();
    assert!((x[0] - 1.5).abs() < 1e-12 && (x[1] - 1.0).abs() < 1e-12, "{x:?}");
}

#[test]
fn numbers_that_are_not_finite_fail_and_give_zero() {
    for (column, value) in [(0, f64::NAN), (1, f64::INFINITY)] {
        for ranks in [false, true] {
            let mut problem = Hierarchy::with_capacity(2, &[2], 0);
            problem.levels[0].push(1.0, 1.0)[column] = value;
            problem.levels[0].push(1.0, 1.0)[0] = 1.0;
            let solver = fast(&problem, ranks);
            assert_eq!((solver.reports()[0].status, solver.x()), (Some(QpStatus::Failed), &[0.0, 0.0][..]));
        }
    }
    let mut problem = Hierarchy::with_capacity(1, &[1], 0);
    problem.lower[0] = f64::NAN;
    assert_eq!(fast(&problem, false).reports()[0].status, Some(QpStatus::Failed));
}

#[test]
fn both_solvers_report_the_rank_of_each_level() {
    let mut rng = Rng::new(4, "hierarchy");
    for _ in 0..50 {
        let problem = random(&mut rng, 20, &[4, 8, 30], 2, f64::INFINITY);
        let (_, expected) = reference(Strategy::NullSpace, Backend::ActiveSet).solve(&problem);
        let found = fast(&problem, true);
        for (found, expected) in found.reports().iter().zip(expected) {
            assert_eq!(found.rank, expected.rank);
        }
    }
}
