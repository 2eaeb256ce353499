//! Conversion of the quadruped's quantities to LCM messages. No other file fills these messages.

use super::estimation::Estimate;
use super::leg::Leg;
use super::reference::References;
use super::robot::Robot;
use super::stand_sit::StandSit;
use super::state::{Mode, State};
use super::timing::{Timing, cyclic};
use super::trunk::TrunkReference;
use super::wbc::Wbc;
use crate::math::rpy_of;
use crate::params::Params;
use crate::qp::QpStatus;
use crate::stack::Level;
use lcmtypes::channels::Stage;
use lcmtypes::{BaseTracking, ContactEstimate, ControllerTick, LegState, QuadrupedState, RobotCommand, WbcSolution};

/// The messages of a tick. They are reused in every tick, so that their arrays are allocated only once.
#[derive(Default)]
pub struct Messages {
    /// CONTACT_ESTIMATE.
    pub contact: ContactEstimate,
    /// BASE_TRACKING.
    pub base: BaseTracking,
    /// LEG_STATE.
    pub legs: LegState,
    /// WBC_SOLUTION.
    pub wbc: WbcSolution,
    /// ROBOT_COMMAND.
    pub command: RobotCommand,
    /// CONTROLLER_TICK.
    pub tick: ControllerTick,
    /// The controller's part of CONTROLLER_SNAPSHOT.
    pub snapshot: QuadrupedState,
}

impl Messages {
    /// Allocates messages with arrays of the robot's size.
    pub fn new(robot: &Robot, wbc: &Wbc) -> Self {
        let (nj, nv, n_levels) = (robot.nj(), robot.model.nv(), wbc.stack.levels.len());
        let mut m = Messages { command: RobotCommand::zeros(nj), ..Messages::default() };
        let n_contacts = i32::try_from(Leg::ALL.len()).expect("four legs");
        m.contact.n_contacts = n_contacts;
        m.contact.f_F_W = vec![[0.0; 3]; Leg::ALL.len()];
        m.contact.f_normal = vec![0.0; Leg::ALL.len()];
        m.contact.contact = vec![0; Leg::ALL.len()];
        m.wbc.n_contacts = n_contacts;
        m.wbc.f_F_W = vec![[0.0; 3]; Leg::ALL.len()];
        m.wbc.tau_F_W = vec![[0.0; 3]; Leg::ALL.len()];
        m.tick.digest = vec![0; Stage::ALL.len()];
        m.tick.n_stages = i32::try_from(Stage::ALL.len()).expect("six stages");
        m.wbc.vd.resize(nv, 0.0);
        m.wbc.level_status.resize(n_levels, WbcSolution::STATUS_NOT_RUN);
        m.wbc.n_levels = i32::try_from(n_levels).expect("a formula has fewer than 2^31 levels");
        m.wbc.nv = i32::try_from(nv).expect("robots have fewer than 2^31 joints");
        State::new(nj).write(&mut m.snapshot);
        m
    }

    /// Fills CONTACT_ESTIMATE and BASE_TRACKING.
    pub fn estimation(&mut self, robot: &Robot, estimate: &Estimate, trunk: &TrunkReference, wbc: &Wbc, state: &State) {
        (self.contact.t_ns, self.contact.tick) = (state.t_ns, state.tick);
        self.contacts(estimate, state);
        let m = &mut self.base;
        (m.t_ns, m.tick) = (state.t_ns, state.tick);
        m.rpy_des = rpy_of(&trunk.R_WB);
        m.rpy_est = estimate.base.rpy;
        m.w_WB_W_des = trunk.w_WB_W.into();
        m.w_WB_W_est = estimate.base.w_WB_W.into();
        m.e_o_W = wbc.tasks.trunk.e_o_W.into();
        m.height_des = robot.nominal_height + state.height_offset;
        m.height_est = state.height;
        m.v_H_des = state.v_H_des;
        m.yaw_rate_des = state.yaw_rate_des;
    }

    /// Fills the estimates of CONTACT_ESTIMATE.
    fn contacts(&mut self, estimate: &Estimate, state: &State) {
        let m = &mut self.contact;
        for leg in Leg::ALL {
            let i = leg as usize;
            m.f_F_W[i] = state.f_F_W[leg].into();
            m.f_normal[i] = estimate.n_W.dot(&state.f_F_W[leg]);
            m.contact[i] = i8::from(state.contact[leg]);
        }
        m.height = state.height;
        m.n_W = estimate.n_W.into();
    }

    /// Fills LEG_STATE.
    pub fn legs(&mut self, params: &Params, estimate: &Estimate, references: &References, wbc: &Wbc, state: &State) {
        let m = &mut self.legs;
        (m.t_ns, m.tick) = (state.t_ns, state.tick);
        m.gait = state.gait.number();
        let T = Timing::of(state, params).T;
        m.gait_phase = cyclic(state.gait_clock / T + state.first_phase, 1.0);
        let R_HW = estimate.base.R_WH.transpose();
        for leg in Leg::ALL {
            let i = leg as usize;
            let phase = state.leg_state[leg];
            m.state[i] = phase as i8;
            m.t_swing[i] = if phase.is_stance() { 0.0 } else { state.t_leg[leg] };
            (m.f_z_min[i], m.f_z_max[i]) = wbc.f_z_bounds[leg];
            m.step_length[i] = state.step_length[leg];
            m.step_heading[i] = state.step_heading[leg];
            m.foothold_H[i] = references.foothold_H[leg].into();
            m.p_BF_H_des[i] = references.p_BF_H[leg].into();
            m.p_BF_H_est[i] = (R_HW * estimate.legs[leg].p_BF_W).into();
            m.v_BF_H_des[i] = references.v_BF_H[leg].into();
        }
    }

    /// Fills WBC_SOLUTION.
    pub fn wbc(&mut self, estimate: &Estimate, wbc: &Wbc, state: &State, n_clamped: i32) {
        let m = &mut self.wbc;
        (m.t_ns, m.tick) = (state.t_ns, state.tick);
        m.status = status(wbc.info.status);
        let count = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
        m.iterations = i32::try_from(wbc.info.iterations).unwrap_or(i32::MAX);
        let last = &wbc.stack.levels[wbc.stack.levels.len() - 1].qp;
        m.n_var = count(last.n());
        m.n_eq = count(last.b.len());
        let first = &wbc.stack.levels[0].qp;
        let bounds = first.lower.iter().chain(first.upper.iter()).filter(|b| b.is_finite()).count();
        m.n_ineq = count(last.d.len() + bounds);
        m.n_active = count(wbc.info.n_active);
        m.level = wbc.stack.levels.iter().rposition(Level::solved).map_or(-1, count);
        for (to, level) in m.level_status.iter_mut().zip(&wbc.stack.levels) {
            *to = level.info.map_or(WbcSolution::STATUS_NOT_RUN, |info| status(info.status));
        }
        m.n_clamped = n_clamped;
        m.torque_slack = wbc.torque_slack;
        (m.residual, m.base_residual) = if wbc.solved() {
            (wbc.tasks.residuals(&wbc.vd, estimate, state), wbc.base_residual())
        } else {
            ([0.0; 3], 0.0)
        };
        m.vd.copy_from_slice(wbc.vd.as_slice());
        m.f_F_W.copy_from_slice(&wbc.f_F_W.0.map(Into::into));
    }

    /// Fills all estimation and solution messages with the values of a tick that computed nothing: zeros, and STATUS_NOT_RUN.
    pub fn clear(&mut self, state: &State) {
        let (t_ns, tick) = (state.t_ns, state.tick);
        let m = &mut self.contact;
        (m.t_ns, m.tick, m.height, m.n_W) = (t_ns, tick, 0.0, [0.0; 3]);
        m.f_F_W.fill([0.0; 3]);
        m.f_normal.fill(0.0);
        m.contact.fill(0);
        self.base = BaseTracking { t_ns, tick, ..Default::default() };
        self.legs = LegState { t_ns, tick, ..Default::default() };
        let m = &mut self.wbc;
        (m.t_ns, m.tick, m.status) = (t_ns, tick, WbcSolution::STATUS_NOT_RUN);
        (m.iterations, m.n_active, m.n_clamped) = (0, 0, 0);
        (m.n_var, m.n_eq, m.n_ineq, m.level) = (0, 0, 0, -1);
        m.level_status.fill(WbcSolution::STATUS_NOT_RUN);
        (m.residual, m.base_residual) = ([0.0; 3], 0.0);
        m.f_F_W.fill([0.0; 3]);
        m.torque_slack = 0.0;
        m.vd.fill(0.0);
    }

    /// Fills CONTACT_ESTIMATE, BASE_TRACKING and LEG_STATE in a tick of standing up or sitting down: the estimates, and a level base as the only
    /// reference.
    pub fn stand_sit(&mut self, robot: &Robot, estimate: &Estimate, state: &State) {
        self.contacts(estimate, state);
        let base = &mut self.base;
        base.rpy_des = [0.0, 0.0, estimate.base.rpy[2]];
        base.rpy_est = estimate.base.rpy;
        base.w_WB_W_est = estimate.base.w_WB_W.into();
        base.height_des = robot.nominal_height;
        base.height_est = state.height;
        let R_HW = estimate.base.R_WH.transpose();
        for (leg, of_leg) in estimate.legs.iter() {
            self.legs.p_BF_H_est[leg as usize] = (R_HW * of_leg.p_BF_W).into();
        }
    }

    /// Fills ROBOT_COMMAND, before the effort limits: torques while standing or walking, torques and joint loop while standing up or sitting down, damping
    /// in the safe state, zeros in IDLE.
    pub fn command(
        &mut self,
        robot: &Robot,
        params: &Params,
        stand_sit: &StandSit,
        references: &References,
        state: &State,
    ) {
        let m = &mut self.command;
        (m.t_ns, m.tick) = (state.t_ns, state.tick);
        m.mode = match state.mode {
            Mode::Idle => RobotCommand::MODE_IDLE,
            Mode::Stance | Mode::Walk | Mode::StandUp | Mode::Sit => RobotCommand::MODE_TORQUE,
            Mode::Damping => RobotCommand::MODE_DAMPING,
        };
        m.tau.copy_from_slice(&state.tau_last);
        m.q_des.copy_from_slice(&state.q_des);
        m.kp.fill(0.0);
        m.kd.fill(if m.mode == RobotCommand::MODE_DAMPING { params.safety.damping } else { 0.0 });
        match state.mode {
            Mode::Stance | Mode::Walk => m.qd_des.copy_from_slice(&references.qd_des),
            Mode::StandUp | Mode::Sit => {
                m.qd_des.copy_from_slice(&state.qd_des);
                for (j, joint) in robot.model.joints.iter().enumerate() {
                    (m.kp[j], m.kd[j]) = stand_sit.gains(params, state, joint.effort);
                }
            }
            Mode::Idle | Mode::Damping => m.qd_des.fill(0.0),
        }
    }
}

fn status(status: QpStatus) -> i8 {
    match status {
        QpStatus::Solved => WbcSolution::STATUS_SOLVED,
        QpStatus::AlmostSolved => WbcSolution::STATUS_ALMOST_SOLVED,
        QpStatus::Failed => WbcSolution::STATUS_FAILED,
        QpStatus::Infeasible => WbcSolution::STATUS_INFEASIBLE,
    }
}
