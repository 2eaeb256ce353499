//! One control tick: the fields of its messages that figures and metrics use.
//!
//! Ten minutes have 600 000 ticks, so fields without a user, such as digests, are omitted.

use lcmtypes::{BaseTracking, ContactEstimate, ControllerTick, GroundTruth, LegState, Timing, WbcSolution};

use crate::math::{Vec3, from_w_to_h};
use robot_model::math::quaternion;

/// Ground truth at a tick; frames and units as in `ground_truth_t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Simulation time, ns.
    pub t_ns: i64,
    /// Origin of the base in W, m.
    pub p_WB: Vec3,
    /// Roll, pitch, yaw, rad: `R_WB = Rz(yaw) Ry(pitch) Rx(roll)`.
    pub rpy: Vec3,
    /// Velocity of the base in W, m/s.
    pub v_WB: Vec3,
    /// Angular velocity of the base in W, rad/s.
    pub w_WB_W: Vec3,
    /// Contact point of each foot in W, m.
    pub p_WF: [Vec3; 4],
    /// Velocity of each foot's centre in W, m/s.
    pub v_WF: [Vec3; 4],
    /// Force of the ground on each foot in W, N.
    pub f_F_W: [Vec3; 4],
    /// The foot touches the ground.
    pub contact: [bool; 4],
    /// The scenario pushes the base.
    pub pushed: bool,
}

impl Truth {
    /// The first four contacts are the feet; one that the robot does not have is at NaN and touches nothing.
    pub(super) fn of(message: &GroundTruth) -> Self {
        let four = |v: &[[f64; 3]]| std::array::from_fn(|leg| v.get(leg).copied().unwrap_or([f64::NAN; 3]));
        Self {
            t_ns: message.t_ns,
            p_WB: message.p_WB,
            rpy: quaternion::to_rpy(message.q_WB_wxyz),
            v_WB: message.v_WB,
            w_WB_W: message.w_WB_W,
            p_WF: four(&message.p_WF),
            v_WF: four(&message.v_WF),
            f_F_W: four(&message.f_F_W),
            contact: std::array::from_fn(|leg| message.contact.get(leg).is_some_and(|touches| *touches != 0)),
            pushed: message.f_push_W.iter().chain(&message.tau_push_W).any(|&x| x != 0.0),
        }
    }

    /// Horizontal speed of the center of a foot, m/s; `None` without contact.
    pub fn slip_speed(&self, leg: usize) -> Option<f64> {
        self.contact[leg].then(|| self.v_WF[leg][0].hypot(self.v_WF[leg][1]))
    }

    /// Foot relative to the base in H (origin of the base, z up, heading of the base), m.
    pub fn p_BF_H(&self, leg: usize) -> Vec3 {
        let p_BF_W = std::array::from_fn(|k| self.p_WF[leg][k] - self.p_WB[k]);
        from_w_to_h(self.rpy[2], p_BF_W)
    }
}

/// Gait and swing of the four legs; as in `leg_state_t`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Legs {
    /// Gait, `operator_command_t` `GAIT_*`.
    pub gait: i8,
    /// `leg_state_t` `STATE_*` of each leg.
    pub state: [i8; 4],
    /// Foot reference in H from the base, m.
    pub p_BF_H_des: [Vec3; 4],
    /// Foot from the encoders, m.
    pub p_BF_H_est: [Vec3; 4],
}

impl From<LegState> for Legs {
    fn from(m: LegState) -> Self {
        Self { gait: m.gait, state: m.state, p_BF_H_des: m.p_BF_H_des, p_BF_H_est: m.p_BF_H_est }
    }
}

/// Contact forces and flags; as in `contact_estimate_t`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Estimated force on each foot in W, N.
    pub f_F_W: [Vec3; 4],
    /// Its component along the terrain normal, N.
    pub f_normal: [f64; 4],
    /// Estimated contact flag of each foot.
    pub contact: [bool; 4],
    /// Terrain normal in W.
    pub n_W: Vec3,
}

impl Contact {
    /// `None` unless the message has four contacts.
    pub(super) fn of(m: ContactEstimate) -> Option<Self> {
        let f_normal = m.f_normal.try_into().ok()?;
        let contact: [i8; 4] = m.contact.try_into().ok()?;
        Some(Self {
            f_F_W: m.f_F_W.try_into().ok()?,
            f_normal,
            contact: contact.map(|touches| touches != 0),
            n_W: m.n_W,
        })
    }
}

/// Result of the quadratic program; as in `wbc_solution_t`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wbc {
    /// `STATUS_*`.
    pub status: i8,
    /// Iterations, summed over all levels.
    pub iterations: i32,
    /// Variables.
    pub n_var: i32,
    /// Equality rows of the last level.
    pub n_eq: i32,
    /// Inequality rows.
    pub n_ineq: i32,
    /// Inequality rows that hold with equality.
    pub n_active: i32,
    /// Number of torques clamped after the solve.
    pub n_clamped: i32,
    /// Residual of contact (m/s²), trunk (rad/s²) and posture (rad/s²).
    pub residual: [f64; 3],
    /// Largest violation of the floating-base dynamics, N or N m.
    pub base_residual: f64,
    /// Contact force commanded on each foot in W, N.
    pub f_F_W: [Vec3; 4],
}

impl Wbc {
    /// `None` unless the message has four contacts.
    pub(super) fn of(m: WbcSolution) -> Option<Self> {
        let WbcSolution {
            status,
            iterations,
            n_var,
            n_eq,
            n_ineq,
            n_active,
            n_clamped,
            residual,
            base_residual,
            f_F_W,
            ..
        } = m;
        let f_F_W = f_F_W.try_into().ok()?;
        Some(Self { status, iterations, n_var, n_eq, n_ineq, n_active, n_clamped, residual, base_residual, f_F_W })
    }
}

/// Mode and fault of the controller; as in `controller_tick_t`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Status {
    /// Number of the tick.
    pub tick: i64,
    /// `MODE_*`.
    pub mode: i8,
    /// `FAULT_*`.
    pub fault: i32,
    /// Index of joint, leg or row; -1: none.
    pub fault_index: i32,
    /// Value that violated the check.
    pub fault_value: f64,
}

impl From<ControllerTick> for Status {
    fn from(m: ControllerTick) -> Self {
        Self { tick: m.tick, mode: m.mode, fault: m.fault, fault_index: m.fault_index, fault_value: m.fault_value }
    }
}

/// Input that the controller consumed, without joint signals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Consumed {
    /// Number of the tick.
    pub tick: i64,
    /// `seq` of the robot state: equal in two ticks if a state was late, with a jump if one was lost.
    pub seq: i64,
    /// Age of the robot state, s.
    pub age_s: f64,
}

/// One control tick.
#[derive(Clone, Debug, Default)]
pub struct Tick {
    /// Time of the tick, controller clock, ns.
    pub t_ns: i64,
    /// Time since the first tick of the run, s.
    pub t_s: f64,
    /// References and estimates of the base.
    pub base: Option<BaseTracking>,
    /// Ground truth of the simulator.
    pub truth: Option<Truth>,
    /// Gait and swing.
    pub legs: Option<Legs>,
    /// Contact estimate.
    pub contact: Option<Contact>,
    /// Result of the quadratic program.
    pub wbc: Option<Wbc>,
    /// Mode and fault of the controller.
    pub status: Option<Status>,
    /// Wall-clock times.
    pub timing: Option<Timing>,
    /// Input that the controller consumed.
    pub consumed: Option<Consumed>,
    /// Rows of [`Joints`](super::Joints): measured, commanded.
    pub(super) joint_rows: [Option<u32>; 2],
}

impl Tick {
    /// Fills missing fields from another record of the same tick.
    pub(super) fn absorb(&mut self, other: Self) {
        let Self { t_ns: _, t_s: _, base, truth, legs, contact, wbc, status, timing, consumed, joint_rows } = other;
        self.base = self.base.take().or(base);
        self.truth = self.truth.take().or(truth);
        self.legs = self.legs.or(legs);
        self.contact = self.contact.or(contact);
        self.wbc = self.wbc.or(wbc);
        self.status = self.status.or(status);
        self.timing = self.timing.take().or(timing);
        self.consumed = self.consumed.or(consumed);
        for (own, row) in self.joint_rows.iter_mut().zip(joint_rows) {
            *own = own.or(row);
        }
    }

    /// Number of the tick; `None` if none of its messages contains it.
    pub fn number(&self) -> Option<i64> {
        let number = self.status.map(|s| s.tick).or_else(|| self.consumed.map(|c| c.tick));
        number.or_else(|| self.base.as_ref().map(|b| b.tick)).or_else(|| self.timing.as_ref().map(|t| t.tick))
    }

    /// The leg is in state `SWING_UP` or `SWING_DOWN`.
    pub fn swings(&self, leg: usize) -> bool {
        self.legs
            .as_ref()
            .is_some_and(|l| matches!(l.state[leg], LegState::STATE_SWING_UP | LegState::STATE_SWING_DOWN))
    }

    /// The leg is in state `STANCE`; `None` without LEG_STATE.
    pub fn stands(&self, leg: usize) -> Option<bool> {
        self.legs.as_ref().map(|l| l.state[leg] == LegState::STATE_STANCE)
    }

    /// True if the number of this tick is the next after that of `before`, at any time.
    pub fn follows(&self, before: &Self) -> bool {
        self.number().zip(before.number()).is_some_and(|(number, last)| last.checked_add(1) == Some(number))
    }

    /// The controller estimates the base: the mode is neither `IDLE` nor `DAMPING`; true without CONTROLLER_TICK.
    pub fn estimates(&self) -> bool {
        self.status.as_ref().is_none_or(|s| !matches!(s.mode, ControllerTick::MODE_IDLE | ControllerTick::MODE_DAMPING))
    }

    /// The mode is `STANCE` or `WALK`; true without CONTROLLER_TICK.
    pub fn balances(&self) -> bool {
        self.status.as_ref().is_none_or(|s| matches!(s.mode, ControllerTick::MODE_STANCE | ControllerTick::MODE_WALK))
    }

    /// True vertical height of the base above the mean contact point of the stance feet, m. Stance is the state of the leg, or true contact without
    /// LEG_STATE. `None` without ground truth or without a stance foot.
    pub fn true_height(&self) -> Option<f64> {
        let truth = self.truth.as_ref()?;
        let stance = (0..4).filter(|&leg| self.stands(leg).unwrap_or(truth.contact[leg]));
        let (count, sum) = stance.fold((0_u32, 0.0), |(n, z), leg| (n + 1, z + truth.p_WF[leg][2]));
        (count > 0).then(|| truth.p_WB[2] - sum / f64::from(count))
    }

    /// Component of the true force on a foot along the estimated terrain normal (vertical without CONTACT_ESTIMATE), N; `None` without ground truth.
    pub fn true_normal_force(&self, leg: usize) -> Option<f64> {
        let f = self.truth.as_ref()?.f_F_W[leg];
        let n = self.contact.as_ref().map_or([0.0, 0.0, 1.0], |c| c.n_W);
        Some(f[0] * n[0] + f[1] * n[1] + f[2] * n[2])
    }
}
