//! Both back-ends compared with exact solutions of programs of the whole-body controller: stored values of `scripts/qp_fixtures.py`.
//!
//! The programs are not stored. They are built from seeded states, and a digest shows whether they are still the programs that were
//! solved. `QP_DUMP=FILE` writes them to a file for the script.
#![allow(clippy::disallowed_methods, non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Rng, URDF, params_with, set_base, standing};
use controller::digest::Digest;
use controller::math::{Rx, Ry, Rz};
use controller::params::Params;
use controller::qp::{Qp, QpStatus};
use controller::quadruped::estimation::Estimate;
use controller::quadruped::leg::{Leg, LegPhase};
use controller::quadruped::reference::References;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::{Mode, State};
use controller::quadruped::trunk::TrunkReference;
use controller::quadruped::wbc::Wbc;
use controller::stack::S1;
use nalgebra::DVector;
use serde_json::{Value, json};

const PROGRAMS: usize = 20;
/// Solver, its tolerance, and the allowed error relative to the norm of the exact solution (accelerations in SI units, forces in 100 N). The
/// active set has no tolerance: its error is rounding times the ratio 1e9 of the largest and smallest curvature. The second row of
/// Clarabel shows that the error of the first row comes from its tolerance, not from a different program.
const SOLVERS: [(&str, &str, f64); 3] =
    [("active_set", "1e-8", 1e-9), ("clarabel", "1e-8", 2e-4), ("clarabel", "1e-11", 1e-7)];

/// A program and the result of a solver.
struct Solved {
    qp: Qp,
    x: DVector<f64>,
    n_active: usize,
}

/// Programs of a walking robot, and some of a stumbling one: references far from the posture, fast rotations.
fn programs(solver: &str, tolerance: &str) -> Vec<Solved> {
    // Friction as in the source: with the default, a constraint of one program is so close to active that Clarabel's count is ambiguous.
    let solver = format!("\"{solver}\"");
    // The stored programs have no torque limits.
    let formula = format!("{:?}", S1.replace(" << torque_limits", ""));
    let overrides =
        [("qp.solver", &*solver), ("wbc.tolerance", tolerance), ("wbc.friction", "0.8"), ("stack.formula", &formula)];
    let params = Params::from_toml(&params_with(&overrides), "hyq.toml").unwrap();
    let robot = Robot::new(URDF, &params.robot).unwrap();
    let (mut estimate, mut wbc) = (Estimate::new(&robot), Wbc::new(&robot, &params).unwrap());
    let mut references = References::new(&robot);
    let mut rng = Rng(20);
    let stances: [&[Leg]; 4] = [&Leg::ALL, &[Leg::LF, Leg::RH], &[Leg::RF, Leg::LH, Leg::RH], &[Leg::RF, Leg::LH]];
    let mut solved = Vec::new();
    for k in 0..PROGRAMS {
        // From small to large disturbances.
        let size = k as f64 / PROGRAMS as f64;
        let mut input = standing(&robot);
        let tilt = rng.vec3(0.3 * size);
        let R_WB = Rz(3.0 * rng.symmetric()) * Ry(tilt.y) * Rx(tilt.x);
        set_base(&robot, &mut input, &R_WB, &rng.vec3(2.0 * size));
        let mut state = State::new(robot.nj());
        state.mode = Mode::Walk;
        for j in 0..robot.nj() {
            input.state.q[j] += 0.2 * size * rng.symmetric();
            input.state.qd[j] = 2.0 * size * rng.symmetric();
            state.q_des[j] = input.state.q[j] + 0.3 * size * rng.symmetric();
            references.qd_des[j] = size * rng.symmetric();
        }
        for leg in Leg::ALL {
            state.leg_state[leg] = if stances[k % 4].contains(&leg) { LegPhase::Stance } else { LegPhase::SwingDown };
        }
        let trunk = TrunkReference { R_WB: R_WB * Rx(0.1 * size * rng.symmetric()), w_WB_W: rng.vec3(size) };
        estimate.update(&robot, &input.state);
        wbc.build(&robot, &params, &input.state, &estimate, &trunk, &references, &state);
        wbc.solve(&estimate, &state);
        assert_eq!(wbc.info.status, QpStatus::Solved, "program {k}");
        solved.push(Solved { qp: wbc.stack.levels[0].qp.clone(), x: wbc.x.clone(), n_active: wbc.info.n_active });
    }
    solved
}

fn digest(qp: &Qp) -> i64 {
    let mut d = Digest::default();
    for m in [&qp.H, &qp.A, &qp.C] {
        d.dmat(m);
    }
    for v in [&qp.g, &qp.b, &qp.d, &qp.lower, &qp.upper] {
        d.dvec(v);
    }
    d.finish()
}

/// JSON with matrices by column, infinite bounds as null, and floats in the shortest text with the same bits.
fn as_json(Solved { qp, x, .. }: &Solved) -> Value {
    json!({
        "digest": digest(qp),
        "H": qp.H.as_slice(), "g": qp.g.as_slice(), "A": qp.A.as_slice(), "b": qp.b.as_slice(),
        "C": qp.C.as_slice(), "d": qp.d.as_slice(), "lower": qp.lower.as_slice(), "upper": qp.upper.as_slice(),
        "clarabel": x.as_slice(),
    })
}

/// Digest, number of active inequalities and minimizer of each stored solution.
fn exact_solutions() -> Vec<(i64, usize, DVector<f64>)> {
    let stored: Vec<Value> = serde_json::from_str(include_str!("data/qp_solutions.json")).unwrap();
    let solution = |s: &Value| {
        let x: Vec<f64> = s["x"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
        (s["digest"].as_i64().unwrap(), s["active"].as_u64().unwrap().try_into().unwrap(), DVector::from(x))
    };
    stored.iter().map(solution).collect()
}

#[test]
#[expect(clippy::disallowed_methods, reason = "a test that writes the programs on request")]
fn every_back_end_finds_the_exact_solution() {
    if let Ok(path) = std::env::var("QP_DUMP") {
        let programs: Vec<_> = programs("clarabel", "1e-8").iter().map(as_json).collect();
        std::fs::write(path, serde_json::to_string(&programs).unwrap()).unwrap();
        return;
    }
    let exact = exact_solutions();
    assert_eq!(exact.len(), PROGRAMS);
    assert!(
        exact.iter().filter(|(_, active, _)| *active > 0).count() >= 10,
        "number of programs with an active inequality"
    );
    for (solver, tolerance, allowed) in SOLVERS {
        for (k, (Solved { qp, x, n_active }, (expected, active, exact))) in
            programs(solver, tolerance).iter().zip(&exact).enumerate()
        {
            let here = format!("program {k}, {solver} at tolerance {tolerance}");
            assert_eq!(digest(qp), *expected, "{here} is another one: run scripts/qp_fixtures.py");
            let off = (x - exact).norm() / exact.norm();
            assert!(off < allowed, "{here}: off by {off:e} of the norm");
            // The interior-point solver stays away from rows with a multiplier near zero, so only the active set's count is exact.
            assert!(n_active <= active, "{here}: {n_active} rows counted as active, {active} are");
            assert!(
                solver == "clarabel" || n_active == active,
                "{here}: {n_active} rows in the set, {active} are active"
            );
        }
    }
}
