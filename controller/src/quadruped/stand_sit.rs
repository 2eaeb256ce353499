//! Standing up from the ground and sitting down, with the joint loop of the drives. No quadratic program and no contact is needed.
//!
//! | phase | motion | end | next |
//! |---|---|---|---|
//! | gather | joints, from the present posture to folded legs | motion complete | rise |
//! | rise | feet, straight down from folded to standing | motion complete, four feet in contact (three after half of `stand.patience`), joints at rest | stance |
//! | lower | feet, straight up to folded | motion complete | spread |
//! | spread | joints, to the lying posture | motion complete | release |
//! | release | none; the joint stiffness decreases | joints at rest | lie |
//! | lie | none; the joints are damped | | |
//!
//! The reference of a phase follows the minimum-jerk profile `σ(u) = 10u³ - 15u⁴ + 6u⁵`. It waits for the robot: it slows down when a joint error
//! exceeds half of `stand.max_error`, and stops at `stand.max_error`, so a blocked leg stops all four. A motion that has waited for
//! `stand.patience` is aborted; the controller enters the safe state, and the fault names the joint or foot.
//!
//! ```text
//! tau = support (h_joint - J_legᵀ f) ,  command = tau + kp (q_des - q) + kd (qd_des - qd)
//! ```
//! `f` are the vertical foot forces with the least sum of squares that balance the weight at the centre of mass. `support` changes to 1 while the robot
//! stands up or lowers itself, and to 0 before it lies. With `support` = 1, spread legs lift the trunk while they fold under it, and a foot
//! without ground contact moves a few centimetres further towards the ground.

use super::estimation::Estimate;
use super::leg::{Leg, PerLeg};
use super::robot::Robot;
use super::state::{Mode, MovePhase, State};
use crate::error::LoadError;
use crate::math::ramp;
use crate::model::{BaseState, GRAVITY, Kinematics, com, point_jacobian_linear};
use crate::params::Params;
use crate::safety::{Fault, fault};
use lcmtypes::{ControllerTick, RobotState};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Height between two postures of the path, m.
const WAYPOINT: f64 = 0.01;
/// Distance of the path from the joint limits, rad.
const LIMIT_MARGIN: f64 = 0.03;
/// Distance of a foot from its waypoint at which the waypoint counts as reached, m.
const REACHED: f64 = 1e-6;
/// Largest change of a joint in an iteration towards a waypoint, rad.
const MAX_NEWTON_STEP: f64 = 0.2;
/// Rate of change of `support`, 1/s.
const SUPPORT_RATE: f64 = 2.0;
/// Shortest duration of a phase, s.
const MIN_TIME: f64 = 0.3;
/// Time in which the joint stiffness decreases to zero, s.
const RELEASE_TIME: f64 = 1.0;
/// Speed below which a joint counts as at rest, rad/s. A damped joint then has a torque of a small fraction of its effort.
pub const REST_SPEED: f64 = 0.3;
/// Time at rest after which the robot counts as lying, s.
const REST_TIME: f64 = 0.3;
/// Fraction of its full pace below which a motion counts as waiting.
const STANDSTILL: f64 = 0.1;
/// Ratio of peak to mean speed of the minimum-jerk profile.
const PEAK: f64 = 1.875;

/// The postures between lying and standing.
pub struct StandSit {
    /// Postures from folded to standing, nj each. The feet move on vertical lines through their virtual footholds.
    path: Vec<Vec<f64>>,
    /// Height of the base above the feet with folded legs, m.
    folded_height: f64,
    standing_height: f64,
    /// Posture in which the robot lies without torque, nj.
    q_lying: Vec<f64>,
}

impl StandSit {
    /// Computes the postures.
    ///
    /// # Errors
    /// `robot.lying` lacks a joint or violates a joint limit, or the legs cannot fold at all.
    pub fn new(robot: &Robot, params: &Params) -> Result<Self, LoadError> {
        let wrong = |what: String| LoadError::Robot { robot: params.robot.name.clone(), what };
        let mut path = folding(robot, params.stand.fold * robot.nominal_height);
        if path.len() < 2 {
            return Err(wrong(
                "the legs cannot fold: the feet cannot move up from their positions in robot.posture".into(),
            ));
        }
        #[expect(clippy::cast_precision_loss, reason = "tens of waypoints")]
        let folded_height = robot.nominal_height - (path.len() - 1) as f64 * WAYPOINT;
        path.reverse();
        let mut q_lying = path[0].clone();
        if !params.robot.lying.is_empty() {
            q_lying.fill(f64::NAN);
            for (name, &q) in &params.robot.lying {
                q_lying[robot.model.joint(name)?.index()] = q;
            }
            for (joint, q) in robot.model.joints.iter().zip(&q_lying) {
                if !(joint.lower..=joint.upper).contains(q) {
                    let (name, lower, upper) = (&joint.name, joint.lower, joint.upper);
                    return Err(wrong(format!("robot.lying.{name} is {q}, expected {lower} to {upper}")));
                }
            }
        }
        Ok(StandSit { path, folded_height, standing_height: robot.nominal_height, q_lying })
    }

    /// Starts to stand up from the present posture.
    pub fn stand_up(&self, measured: &RobotState, state: &mut State) {
        let (support, was_moving) = (state.support, state.mode == Mode::Sit);
        state.enter(Mode::StandUp);
        if !was_moving {
            state.q_des.copy_from_slice(&measured.q);
        }
        state.support = if was_moving { support } else { 0.0 };
        begin(state, MovePhase::Gather);
    }

    /// Starts to sit down from standing, or from the present height while standing up.
    pub fn sit(&self, measured: &RobotState, state: &mut State) {
        let (support, phase) = (state.support, state.move_phase);
        let from_stance = state.mode != Mode::StandUp;
        state.enter(Mode::Sit);
        if from_stance {
            state.q_des.copy_from_slice(&measured.q);
        }
        state.support = if from_stance { 1.0 } else { support };
        let range = self.standing_height - self.folded_height;
        state.move_start = ((state.height - self.folded_height) / range).clamp(0.0, 1.0);
        begin(state, if phase == MovePhase::Gather { MovePhase::Spread } else { MovePhase::Lower });
    }

    /// Computes a tick: updates the joint references and the feed-forward torques, before effort limits. When the robot stands, the phase becomes
    /// [`MovePhase::None`]. Returns the fault if the motion is aborted.
    pub fn update(
        &self,
        robot: &Robot,
        params: &Params,
        estimate: &Estimate,
        measured: &RobotState,
        state: &mut State,
        dt: f64,
    ) -> Option<Fault> {
        let (joint, error) = largest_difference(&state.q_des, &measured.q);
        let stand = &params.stand;
        let pace = ((stand.max_error - error.abs()) / (0.5 * stand.max_error)).clamp(0.0, 1.0);
        let time = self.time(params, state);
        let before = state.move_progress;
        state.move_progress = (before + pace * dt / time).min(1.0);
        let done = state.move_progress >= 1.0;
        let waits = pace < STANDSTILL || (done && state.move_phase == MovePhase::Rise);
        state.t_held = if waits { state.t_held + dt } else { 0.0 };

        let target = match state.move_phase {
            MovePhase::Gather | MovePhase::Rise | MovePhase::Lower => 1.0,
            MovePhase::Spread => 1.0 - state.move_progress,
            _ => 0.0,
        };
        state.support = ramp(state.support, target, SUPPORT_RATE * dt);
        self.references(state, dt);
        self.torques(robot, estimate, state);

        if state.t_held > stand.timeout {
            let without_contact = Leg::ALL.into_iter().find(|&leg| !state.contact[leg]);
            return match without_contact {
                Some(leg) if pace >= STANDSTILL => {
                    fault(ControllerTick::FAULT_NO_CONTACT, Some(leg as usize), state.t_held)
                }
                _ => fault(ControllerTick::FAULT_POSTURE, Some(joint), error),
            };
        }
        match state.move_phase {
            MovePhase::Rise if done && pace >= 1.0 && self.is_up(params, measured, state) => {
                state.move_phase = MovePhase::None
            }
            MovePhase::Gather if done => begin(state, MovePhase::Rise),
            MovePhase::Lower if done => begin(state, MovePhase::Spread),
            MovePhase::Spread if done => begin(state, MovePhase::Release),
            MovePhase::Release if done && state.t_still >= REST_TIME => begin(state, MovePhase::Lie),
            _ => {}
        }
        None
    }

    /// Stiffness (N m/rad) and damping (N m s/rad) of a joint in the present phase.
    pub fn gains(&self, params: &Params, state: &State, effort: f64) -> (f64, f64) {
        // The gains scale with the effort. A joint without effort limit has feed-forward torque only.
        let effort = if effort.is_finite() { effort } else { 0.0 };
        let (kp, kd) = (params.stand.stiffness * effort, params.stand.damping * effort);
        match state.move_phase {
            MovePhase::Release => (kp * (1.0 - state.move_progress), kd),
            MovePhase::Lie => (0.0, params.safety.damping),
            _ => (kp, kd),
        }
    }

    /// Whether standing can start: full support, feet in contact, joints at rest.
    fn is_up(&self, params: &Params, measured: &RobotState, state: &State) -> bool {
        let at_rest = measured.qd.iter().all(|qd| qd.abs() < REST_SPEED);
        let feet = state.contact.0.into_iter().filter(|contact| *contact).count();
        // The stance controller lowers a foot that is above a hole.
        let enough = if state.t_held > 0.5 * params.stand.timeout { 3 } else { 4 };
        state.support >= 1.0 && at_rest && feet >= enough
    }

    /// Duration of the present phase, s.
    fn time(&self, params: &Params, state: &State) -> f64 {
        let range = self.standing_height - self.folded_height;
        let by_joints = |to: &[f64]| largest_difference(&state.move_q, to).1.abs() * PEAK / params.stand.joint_speed;
        let by_height = |part: f64| part * range * PEAK / params.stand.rise_speed;
        let time = match state.move_phase {
            MovePhase::Gather => by_joints(&self.path[0]),
            MovePhase::Rise => by_height(1.0),
            MovePhase::Lower => by_height(state.move_start),
            MovePhase::Spread => by_joints(&self.q_lying),
            _ => RELEASE_TIME,
        };
        time.max(MIN_TIME)
    }

    /// Computes the joint references at the present progress; velocities are differences of positions.
    fn references(&self, state: &mut State, dt: f64) {
        let (phase, u, start) = (state.move_phase, state.move_progress, state.move_start);
        let sigma = least_jerk(u);
        // The distance of the start posture from the path decreases to zero in the first half.
        let fading = 1.0 - least_jerk((2.0 * u).min(1.0));
        for joint in 0..state.q_des.len() {
            let from = state.move_q[joint];
            let to = match phase {
                MovePhase::Gather => from + (self.path[0][joint] - from) * sigma,
                MovePhase::Rise => self.at(sigma, joint) + (from - self.path[0][joint]) * fading,
                MovePhase::Lower => self.at(start * (1.0 - sigma), joint) + (from - self.at(start, joint)) * fading,
                MovePhase::Spread => from + (self.q_lying[joint] - from) * sigma,
                _ => from,
            };
            state.qd_des[joint] = if dt > 0.0 { (to - state.q_des[joint]) / dt } else { 0.0 };
            state.q_des[joint] = to;
        }
    }

    /// Position of a joint on the path at a height from 0 (folded) to 1 (standing), rad.
    fn at(&self, height: f64, joint: usize) -> f64 {
        let last = self.path.len() - 1;
        #[expect(clippy::cast_precision_loss, reason = "tens of waypoints")]
        let place = height.clamp(0.0, 1.0) * last as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and the last waypoint")]
        let below = (place as usize).min(last - 1);
        #[expect(clippy::cast_precision_loss, reason = "tens of waypoints")]
        let part = place - below as f64;
        self.path[below][joint] + (self.path[below + 1][joint] - self.path[below][joint]) * part
    }

    fn torques(&self, robot: &Robot, estimate: &Estimate, state: &mut State) {
        let f_z = shares(robot, estimate);
        let support = state.support;
        for joint in 0..state.tau_last.len() {
            let row = 6 + joint;
            let feet = Leg::ALL.into_iter().fold(0.0, |sum, leg| sum + estimate.legs[leg].J[(2, row)] * f_z[leg]);
            state.tau_last[joint] = support * (estimate.h[row] - feet);
        }
    }
}

fn begin(state: &mut State, phase: MovePhase) {
    (state.move_phase, state.move_progress, state.t_held) = (phase, 0.0, 0.0);
    state.move_q.copy_from_slice(&state.q_des);
}

/// Minimum-jerk profile from 0 to 1.
fn least_jerk(u: f64) -> f64 {
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// The joint with the largest difference `a - b` of two postures, and the difference, rad.
fn largest_difference(a: &[f64], b: &[f64]) -> (usize, f64) {
    let mut found = (0, 0.0_f64);
    for (joint, (a, b)) in a.iter().zip(b).enumerate() {
        if (a - b).abs() > found.1.abs() {
            found = (joint, a - b);
        }
    }
    found
}

/// Vertical foot forces with the least sum of squares that balance the weight, limited to 0 to the weight, N.
///
/// ```text
/// f_i = a + b x_i + c y_i ,   Σ f_i = m g ,  Σ f_i (x_i, y_i) = m g (x_C, y_C)
/// ```
fn shares(robot: &Robot, estimate: &Estimate) -> PerLeg<f64> {
    let weight = robot.mass() * GRAVITY;
    let p_WB = estimate.kin.base().p_WB;
    let mut A = Matrix3::zeros();
    for (_, of_leg) in estimate.legs.iter() {
        let row = Vector3::new(1.0, of_leg.p_BF_W.x, of_leg.p_BF_W.y);
        A += row * row.transpose();
    }
    let p_BC_W = com(&estimate.kin) - p_WB;
    let b = Vector3::new(1.0, p_BC_W.x, p_BC_W.y) * weight;
    let plane = A.try_inverse().map_or(Vector3::new(weight / 4.0, 0.0, 0.0), |inverse| inverse * b);
    let mut shares = PerLeg::default();
    for (leg, of_leg) in estimate.legs.iter() {
        let share = plane.x + plane.y * of_leg.p_BF_W.x + plane.z * of_leg.p_BF_W.y;
        shares[leg] = share.clamp(0.0, weight);
    }
    shares
}

/// Postures with the feet above their virtual footholds, in steps of [`WAYPOINT`], until the base height would be below `height` or a joint is at its
/// limit. The first is the standing posture.
fn folding(robot: &Robot, height: f64) -> Vec<Vec<f64>> {
    let mut kin = Kinematics::new(&robot.model);
    let mut J = DMatrix::zeros(3, robot.model.nv());
    let mut path: Vec<Vec<f64>> = Vec::new();
    let mut q = robot.q_nominal.clone();
    let mut raised = 0.0;
    while robot.nominal_height - raised >= height {
        for leg in Leg::ALL {
            let target = robot.legs[leg].p_nominal_H + Vector3::z() * raised;
            if !reach(robot, leg, &target, &mut q, &mut kin, &mut J) {
                return path;
            }
        }
        path.push(q.clone());
        raised += WAYPOINT;
    }
    path
}

/// Moves the joints of a leg in `q` until its contact point is at `target` below a level base; returns false if it cannot reach it.
fn reach(
    robot: &Robot,
    leg: Leg,
    target: &Vector3<f64>,
    q: &mut [f64],
    kin: &mut Kinematics,
    J: &mut DMatrix<f64>,
) -> bool {
    let of_robot = &robot.legs[leg];
    let zero = Vector3::zeros();
    let level = BaseState { p_WB: zero, R_WB: Matrix3::identity(), v_WB: zero, w_WB_W: zero };
    let rest = vec![0.0; q.len()];
    for _ in 0..100 {
        kin.update(&robot.model, &level, q, &rest);
        let off = target - (kin.p_WF(&robot.model, of_robot.foot) - Vector3::z() * robot.foot_radius);
        if off.norm() < REACHED {
            return true;
        }
        point_jacobian_linear(&robot.model, kin, of_robot.foot, &zero, J.as_view_mut());
        let J_leg = Matrix3::from_fn(|row, k| J[(row, 6 + of_robot.joints[k])]);
        let damped = J_leg * J_leg.transpose() + Matrix3::identity() * 1e-6;
        let Some(inverse) = damped.try_inverse() else { return false };
        let step = J_leg.transpose() * (inverse * off);
        for (k, &joint) in of_robot.joints.iter().enumerate() {
            let limits = &robot.model.joints[joint];
            let (lower, upper) = (limits.lower + LIMIT_MARGIN, limits.upper - LIMIT_MARGIN);
            let moved = q[joint] + step[k].clamp(-MAX_NEWTON_STEP, MAX_NEWTON_STEP);
            q[joint] = moved.min(upper).max(lower);
        }
    }
    false
}
