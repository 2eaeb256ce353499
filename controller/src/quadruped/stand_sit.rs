//! Standing up from the ground and sitting down, with the joint loop of the drives. No quadratic program and no contact is needed.
//!
//! | phase | motion | end | next |
//! |---|---|---|---|
//! | gather | joints, from the present posture to folded legs | motion complete | rise |
//! | rise | feet, straight down from folded to standing | motion complete, four feet in contact (three after half of `stand.patience`), joints at rest | stance |
//! | lower | feet, straight up to folded | motion complete | spread |
//! | spread | feet, one diagonal pair after the other, out to where they lie; then joints, to the lying posture | motion complete | release |
//! | release | none; the joint stiffness decreases | joints at rest | lie |
//! | lie | none; the joints are damped | | |
//!
//! The reference of a phase follows the minimum-jerk profile `σ(u) = 10u³ - 15u⁴ + 6u⁵`. It waits for the robot: it slows down when a joint error
//! exceeds half of `stand.max_error`, and stops at `stand.max_error`, so a blocked leg stops all four. A motion that has waited for
//! `stand.patience` is aborted; the controller enters the safe state, and the fault names the joint or foot.
//!
//! If all feet slid outward at once, those with less load would slide alone, and the base would move to their side. So one pair holds the base while
//! the other, without load, moves.
//!
//! ```text
//! tau = support (h_joint - J_legᵀ f) ,  command = tau + kp (q_des - q) + kd (qd_des - qd)
//! ```
//! `f` are the vertical foot forces with the least sum of squares that balance the weight at the centre of mass. `support` changes to 1 while the robot
//! stands up or lowers itself, and to 0 before it lies. With `support` = 1, spread legs lift the trunk while they fold under it, and a foot
//! without ground contact moves a few centimetres further towards the ground.

use super::estimation::Estimate;
use super::leg::{Leg, PerLeg};
use super::leg_postures::{WAYPOINT, folding, widened};
use super::robot::Robot;
use super::state::{Mode, MovePhase, State};
use crate::error::LoadError;
use crate::math::ramp;
use crate::model::{GRAVITY, com};
use crate::params::Params;
use crate::safety::{Fault, fault};
use lcmtypes::{ControllerTick, RobotState};
use nalgebra::{Matrix3, Vector3};

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
/// Rate at which a leg unloads with the progress of its step: it is unloaded after a seventh.
const UNLOADING: f64 = 8.0;
/// Part of its load that a stepping leg does not carry.
const UNLOADED: f64 = 0.98;
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
    /// The folded posture with the feet below where they lie; the folded posture if they are near there. nj.
    q_wide: Vec<f64>,
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
        let q_wide = widened(robot, &path[0], &q_lying);
        Ok(StandSit { path, folded_height, standing_height: robot.nominal_height, q_lying, q_wide })
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
        if phase == MovePhase::Gather {
            begin(state, MovePhase::Spread);
            state.move_start = 0.0;
        } else {
            begin(state, MovePhase::Lower);
        }
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
            MovePhase::Spread => 1.0 - self.spread(params, state).lowered(state.move_progress),
            _ => 0.0,
        };
        state.support = ramp(state.support, target, SUPPORT_RATE * dt);
        self.references(robot, params, state, dt);
        self.torques(robot, params, estimate, state);

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
            MovePhase::Lower if done => {
                begin(state, MovePhase::Spread);
                state.move_start = 1.0;
            }
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
        let by_joints = |to: &[f64]| time_between(params, &state.move_q, to);
        let by_height = |part: f64| part * range * PEAK / params.stand.rise_speed;
        let time = match state.move_phase {
            MovePhase::Gather => by_joints(&self.path[0]),
            MovePhase::Rise => by_height(1.0),
            MovePhase::Lower => by_height(state.move_start),
            MovePhase::Spread => self.spread(params, state).time(),
            _ => RELEASE_TIME,
        };
        time.max(MIN_TIME)
    }

    /// Times of the spread phase. Only a robot that has lowered itself steps.
    fn spread(&self, params: &Params, state: &State) -> Spread {
        let steps = state.move_start > 0.0 && self.q_wide != self.path[0];
        Spread {
            step: if steps { time_between(params, &state.move_q, &self.q_wide).max(MIN_TIME) } else { 0.0 },
            // Not less with the feet further out, from where the joints move less: the base descends as far.
            lower: time_between(params, &state.move_q, &self.q_lying).max(MIN_TIME),
        }
    }

    /// Position of a joint in the spread phase at the progress `u`, rad.
    fn spread_at(&self, spread: &Spread, u: f64, from: f64, joint: usize, leg: Leg) -> f64 {
        let wide = if spread.step > 0.0 { self.q_wide[joint] } else { from };
        let lowered = least_jerk(spread.lowered(u));
        from + (wide - from) * least_jerk(spread.stepped(u, leg)) + (self.q_lying[joint] - wide) * lowered
    }

    /// Computes the joint references at the present progress; velocities are differences of positions.
    fn references(&self, robot: &Robot, params: &Params, state: &mut State, dt: f64) {
        if state.move_phase == MovePhase::Spread {
            let spread = self.spread(params, state);
            for leg in Leg::ALL {
                for joint in robot.legs[leg].joints {
                    let to = self.spread_at(&spread, state.move_progress, state.move_q[joint], joint, leg);
                    set_reference(state, joint, to, dt);
                }
            }
            return;
        }
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
                _ => from,
            };
            set_reference(state, joint, to, dt);
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

    fn torques(&self, robot: &Robot, params: &Params, estimate: &Estimate, state: &mut State) {
        let mut carries = PerLeg([1.0; 4]);
        if state.move_phase == MovePhase::Spread {
            let spread = self.spread(params, state);
            carries = PerLeg(Leg::ALL.map(|leg| spread.carries(state.move_progress, leg)));
        }
        let f_z = shares(robot, estimate, &carries);
        let support = state.support;
        for joint in 0..state.tau_last.len() {
            let row = 6 + joint;
            let feet = Leg::ALL.into_iter().fold(0.0, |sum, leg| sum + estimate.contacts[leg].J[(2, row)] * f_z[leg]);
            state.tau_last[joint] = support * (estimate.h[row] - feet);
        }
    }
}

/// Times of the spread phase, s: two steps of a diagonal pair, then the motion to the lying posture.
struct Spread {
    step: f64,
    lower: f64,
}

impl Spread {
    fn time(&self) -> f64 {
        2.0 * self.step + self.lower
    }

    /// Progress of a leg's step at the progress `u` of the phase, 0 to 1.
    fn stepped(&self, u: f64, leg: Leg) -> f64 {
        let before = if matches!(leg, Leg::LF | Leg::RH) { 0.0 } else { self.step };
        if self.step > 0.0 { ((u * self.time() - before) / self.step).clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Progress of the motion to the lying posture at the progress `u` of the phase, 0 to 1.
    fn lowered(&self, u: f64) -> f64 {
        if self.step > 0.0 { ((u * self.time() - 2.0 * self.step) / self.lower).clamp(0.0, 1.0) } else { u }
    }

    /// Fraction of its load that a leg carries: less while it steps.
    fn carries(&self, u: f64, leg: Leg) -> f64 {
        let stepped = self.stepped(u, leg);
        1.0 - (UNLOADING * stepped * (1.0 - stepped)).min(1.0) * UNLOADED
    }
}

/// Time of a motion from one posture to another, s.
fn time_between(params: &Params, from: &[f64], to: &[f64]) -> f64 {
    largest_difference(from, to).1.abs() * PEAK / params.stand.joint_speed
}

fn set_reference(state: &mut State, joint: usize, to: f64, dt: f64) {
    state.qd_des[joint] = if dt > 0.0 { (to - state.q_des[joint]) / dt } else { 0.0 };
    state.q_des[joint] = to;
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

/// Vertical foot forces with the least weighted sum of squares that balance the weight, limited to 0 to the weight, N.
///
/// ```text
/// f_i = w_i (a + b x_i + c y_i) ,   Σ f_i = m g ,  Σ f_i (x_i, y_i) = m g (x_C, y_C)
/// ```
/// - `carries`: w, greater than 0.
fn shares(robot: &Robot, estimate: &Estimate, carries: &PerLeg<f64>) -> PerLeg<f64> {
    let weight = robot.mass() * GRAVITY;
    let p_WB = estimate.kin.base().p_WB;
    let mut A = Matrix3::zeros();
    for (leg, of_leg) in estimate.legs.iter() {
        let row = Vector3::new(1.0, of_leg.p_BF_W.x, of_leg.p_BF_W.y);
        A += row * row.transpose() * carries[leg];
    }
    let p_BC_W = com(&estimate.kin) - p_WB;
    let b = Vector3::new(1.0, p_BC_W.x, p_BC_W.y) * weight;
    let plane = A.try_inverse().map_or(Vector3::new(weight / 4.0, 0.0, 0.0), |inverse| inverse * b);
    let mut shares = PerLeg::default();
    for (leg, of_leg) in estimate.legs.iter() {
        let share = plane.x + plane.y * of_leg.p_BF_W.x + plane.z * of_leg.p_BF_W.y;
        let share = share * carries[leg];
        shares[leg] = share.clamp(0.0, weight);
    }
    shares
}
