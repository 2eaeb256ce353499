//! Joint references compared with the foot references that they follow; bias acceleration of the feet compared with finite differences.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{DT, PARAMS, Rng, URDF, set_base, standing};
use controller::math::{Rx, Ry, Rz, cos, norm, sin};
use controller::params::Params;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::gait::Transitions;
use controller::quadruped::leg::{Leg, LegPhase, PerLeg};
use controller::quadruped::reference::{References, Tick};
use controller::quadruped::robot::Robot;
use controller::quadruped::state::State;
use lcmtypes::TickInput;
use nalgebra::{DVector, Matrix3, Vector3};

fn hyq() -> (Params, Robot) {
    let params = Params::from_toml(PARAMS, "hyq.toml").unwrap();
    let robot = Robot::new(URDF, &params.robot).unwrap();
    (params, robot)
}

/// Rotation by the vector `w dt`, Rodrigues' formula.
fn turn(w: &Vector3<f64>, dt: f64) -> Matrix3<f64> {
    let (angle, K) = (norm(w) * dt, (w / norm(w)).cross_matrix());
    Matrix3::identity() + K * sin(angle) + K * K * (1.0 - cos(angle))
}

/// Foot contact points at joint angles `q`, from the base, in W axes.
fn feet(robot: &Robot, input: &TickInput, q: &[f64]) -> PerLeg<Vector3<f64>> {
    let mut at = input.clone();
    at.state.q.copy_from_slice(q);
    let mut estimate = Estimate::new(robot);
    estimate.update(robot, &at.state);
    PerLeg(Leg::ALL.map(|leg| estimate.legs[leg].p_BF_W))
}

#[test]
fn joint_references_follow_fixed_feet_while_the_base_rotates() {
    // Feet fixed in H while the base rotates about all axes. Without ω × r in the CLIK they would lag by |ω × r|/P, about 20 mm.
    let (params, robot) = hyq();
    let (mut estimate, mut references) = (Estimate::new(&robot), References::new(&robot));
    let mut input = standing(&robot);
    let mut state = State::new(robot.nj());
    state.q_des.clone_from(&robot.q_nominal);
    state.height = robot.nominal_height;
    state.leg_state = PerLeg([LegPhase::FaultHold; 4]);
    // Leg phase at the end of REACH, one step height below the lift-off: the references are the present foot positions.
    state.t_leg = PerLeg([10.0; 4]);
    let start = feet(&robot, &input, &robot.q_nominal);
    for leg in Leg::ALL {
        state.p_lift_H[leg] = start[leg] + Vector3::z() * params.swing.height;
        state.step_height[leg] = params.swing.height;
    }
    let w = Vector3::new(0.3, -0.2, 0.4);
    let mut R_WB = Matrix3::identity();
    let (mut worst, mut lag) = (0.0_f64, 0.0_f64);
    for _ in 0..500 {
        set_base(&robot, &mut input, &R_WB, &w);
        estimate.update(&robot, &input.state);
        let q = input.state.q.clone();
        let transitions = &Transitions::default();
        references.update(
            &Tick { robot: &robot, params: &params, estimate: &estimate, q: &q, transitions, dt: DT },
            &mut state,
        );
        R_WB = turn(&w, DT) * R_WB;
        // The references are for the end of the tick, after the rotation of the base in this tick.
        set_base(&robot, &mut input, &R_WB, &w);
        estimate.update(&robot, &input.state);
        let reached = feet(&robot, &input, &state.q_des);
        for leg in Leg::ALL {
            let p_des_W = estimate.base.R_WH * references.p_BF_H[leg];
            worst = worst.max(norm(&(reached[leg] - p_des_W)));
            lag = lag.max(norm(&(w - Vector3::z() * estimate.base.yaw_rate).cross(&p_des_W)) / params.swing.clik_gain);
        }
    }
    assert!(worst < 1e-4, "a foot was {worst} m off");
    assert!(lag > 15e-3, "the base turns too gently for the lag of {lag} m to show");
}

#[test]
fn joint_references_converge_to_the_foot_references() {
    let (mut params, robot) = hyq();
    // The measured joints do not follow the references here.
    params.posture.max_stance_lead = 10.0;
    let (mut estimate, mut references) = (Estimate::new(&robot), References::new(&robot));
    let mut rng = Rng(4);
    let mut input = standing(&robot);
    set_base(&robot, &mut input, &(Rz(1.0) * Ry(0.1) * Rx(-0.08)), &Vector3::zeros());
    estimate.update(&robot, &input.state);
    let mut state = State::new(robot.nj());
    state.height = robot.nominal_height;
    state.q_des = robot.q_nominal.iter().map(|q| q + 0.1 * rng.symmetric()).collect();
    let q = input.state.q.clone();
    for _ in 0..6000 {
        let transitions = &Transitions::default();
        references.update(
            &Tick { robot: &robot, params: &params, estimate: &estimate, q: &q, transitions, dt: DT },
            &mut state,
        );
    }
    let reached = feet(&robot, &input, &state.q_des);
    for leg in Leg::ALL {
        let off = norm(&(reached[leg] - estimate.base.R_WH * references.p_BF_H[leg]));
        assert!(off < 1e-6, "{}: {off} m off", leg.name());
    }
    assert!(references.qd_des.iter().all(|qd| qd.abs() < 1e-4));
}

#[test]
fn bias_acceleration_of_the_contact_points_is_the_derivative_of_j_v() {
    // a_bias = d(J v)/dt at constant v, J at the contact point below the foot's centre. By central differences of J along the motion.
    let (_, robot) = hyq();
    let mut rng = Rng(9);
    let h = 1e-5;
    for _ in 0..10 {
        let mut input = standing(&robot);
        let tilt = rng.vec3(0.3);
        let R_WB = Rz(3.0 * rng.symmetric()) * Ry(tilt.y) * Rx(tilt.x);
        let w = rng.vec3(1.5);
        for j in 0..robot.nj() {
            input.state.q[j] += 0.2 * rng.symmetric();
            input.state.qd[j] = 3.0 * rng.symmetric();
        }
        let mut v = DVector::zeros(robot.model.nv());
        v.fixed_rows_mut::<3>(0).copy_from(&rng.vec3(1.0));
        v.fixed_rows_mut::<3>(3).copy_from(&w);
        v.rows_mut(6, robot.nj()).copy_from_slice(&input.state.qd);

        let estimate_at = |t: f64| {
            let mut at = input.clone();
            at.state.q.iter_mut().zip(&input.state.qd).for_each(|(q, qd)| *q += qd * t);
            let R = if t == 0.0 { R_WB } else { turn(&w, t) * R_WB };
            set_base(&robot, &mut at, &R, &w);
            let mut estimate = Estimate::new(&robot);
            estimate.update(&robot, &at.state);
            estimate
        };
        let (before, now, after) = (estimate_at(-h), estimate_at(0.0), estimate_at(h));
        for leg in Leg::ALL {
            let difference = (&after.contacts[leg].J * &v - &before.contacts[leg].J * &v) / (2.0 * h);
            let off = (&difference - now.contacts[leg].linear_bias()).norm();
            assert!(off < 1e-6 * (1.0 + difference.norm()), "{}: off by {off:e} of {}", leg.name(), difference.norm());
        }
    }
}

#[test]
fn only_the_part_of_a_velocity_error_above_the_threshold_moves_the_footholds() {
    let (mut params, robot) = hyq();
    params.recovery.capture_threshold = 0.1;
    let mut state = State::new(robot.nj());
    let time = (robot.nominal_height / controller::model::GRAVITY).sqrt();
    state.v_H_des = [0.3, 0.0];
    for (error, moved) in [([0.06, -0.08], [0.0; 2]), ([0.0, 0.3], [0.0, 0.2]), ([-0.3, -0.4], [-0.24, -0.32])] {
        state.v_H_est = [state.v_H_des[0] + error[0], error[1]];
        let shift = controller::quadruped::recovery::capture(&robot, &params, &state);
        assert!((0..2).all(|k| (shift[k] - time * moved[k]).abs() < 1e-12), "{error:?}: {shift:?}");
    }
}
