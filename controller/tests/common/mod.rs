//! The HyQ controller, and inputs for it without a simulator.
//!
//! A [`Puppet`] has no dynamics: its joints follow the references, its base sways, and its joint torques correspond to foot forces that
//! depend on the leg phases. This closes the loop well enough to reach every leg phase and needs only this crate.
#![allow(dead_code, reason = "each test file uses its part of it")]

use controller::math::{Rx, Ry, Rz, cos, quaternion, sin};
use controller::model::GRAVITY;
use controller::params::{Params, apply_overrides};
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::leg::Leg;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::Cadence;
use controller::quadruped::timing::Timing;
use controller::{Controller, Outbox};
use lcmtypes::{
    BaseTracking, ControllerTick, LegState, Message, OperatorCommand, RobotCommand, RobotState, TickInput, WbcSolution,
    channels,
};
use nalgebra::{Matrix3, Vector3};

pub const URDF: &str = include_str!("../../../robots/hyq/hyq.urdf");
pub const PARAMS: &str = include_str!("../../../robots/hyq/hyq.toml");
/// Control period, ns and s.
pub const PERIOD_NS: i64 = 1_000_000;
pub const DT: f64 = 1e-3;

/// Parameters of HyQ with overrides, as TOML.
pub fn params_with(overrides: &[(&str, &str)]) -> String {
    let overrides: Vec<_> = overrides.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    apply_overrides(PARAMS, &overrides).unwrap()
}

/// The controller of HyQ.
pub fn hyq() -> Quadruped {
    Quadruped::new(URDF, PARAMS).unwrap()
}

/// The controller of HyQ with overridden parameters.
pub fn hyq_with(overrides: &[(&str, &str)]) -> Quadruped {
    Quadruped::new(URDF, &params_with(overrides)).unwrap()
}

/// Seeded random numbers: SplitMix64.
pub struct Rng(pub u64);

impl Rng {
    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [-1, 1).
    pub fn symmetric(&mut self) -> f64 {
        (self.word() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn vec3(&mut self, size: f64) -> Vector3<f64> {
        Vector3::new(self.symmetric(), self.symmetric(), self.symmetric()) * size
    }
}

/// The message that a tick published on a channel.
pub fn get<M: Message>(out: &Outbox, channel: &str) -> M {
    M::decode(out.get(channel).unwrap_or_else(|| panic!("no {channel}"))).unwrap()
}

pub fn tick_of(out: &Outbox) -> ControllerTick {
    get(out, channels::CONTROLLER_TICK)
}

pub fn command_of(out: &Outbox) -> RobotCommand {
    get(out, channels::ROBOT_COMMAND)
}

pub fn wbc_of(out: &Outbox) -> WbcSolution {
    get(out, channels::WBC_SOLUTION)
}

/// Writes orientation and angular velocity of the base to a measurement, as the IMU would measure them.
pub fn set_base(robot: &Robot, input: &mut TickInput, R_WB: &Matrix3<f64>, w_WB_W: &Vector3<f64>) {
    let R_WI = R_WB * robot.R_IB.transpose();
    input.state.q_WI_wxyz[0] = quaternion::from_rotation(&R_WI);
    input.state.w_WI_I[0] = (R_WI.transpose() * w_WB_W).into();
    input.state.a_I[0] = (R_WI.transpose() * Vector3::z() * GRAVITY).into();
}

/// Writes the joint torques from which the estimator computes the forces `f_F_W`: `tau = h - Jᵀ F` at the joints.
pub fn set_torques(robot: &Robot, estimate: &mut Estimate, input: &mut TickInput, f_F_W: &[Vector3<f64>; 4]) {
    estimate.update(robot, &input.state);
    for j in 0..robot.nj() {
        let lever = |leg: Leg| estimate.contacts[leg].J.column(6 + j).dot(&f_F_W[leg as usize]);
        input.state.tau[j] = estimate.h[6 + j] - Leg::ALL.into_iter().map(lever).sum::<f64>();
    }
}

/// A measurement of HyQ: level, in the nominal posture, the weight on all feet, no operator message yet.
pub fn standing(robot: &Robot) -> TickInput {
    let mut input = TickInput::default();
    input.op.seq = -1;
    input.state = RobotState::zeros(robot.nj(), 1, 0);
    input.state.q.clone_from(&robot.q_nominal);
    set_base(robot, &mut input, &Matrix3::identity(), &Vector3::zeros());
    let f = Vector3::z() * (robot.mass() * GRAVITY / 4.0);
    set_torques(robot, &mut Estimate::new(robot), &mut input, &[f; 4]);
    input
}

/// Operator commands: stand, trot in a curve with inclined trunk, crawl, stand.
pub fn operator_at(tick: i64) -> OperatorCommand {
    let (mode, gait) = match tick {
        100..700 => (OperatorCommand::MODE_WALK, OperatorCommand::GAIT_TROT),
        700..1900 => (OperatorCommand::MODE_WALK, OperatorCommand::GAIT_CRAWL),
        _ => (OperatorCommand::MODE_STAND, OperatorCommand::GAIT_TROT),
    };
    OperatorCommand {
        sender_id: 1,
        t_mode_ns: 0,
        t_ns: tick / 100 * 100 * PERIOD_NS,
        seq: tick / 100,
        mode,
        gait,
        v_H: [0.2, 0.05],
        yaw_rate: 0.2,
        roll: 0.04,
        pitch: -0.03,
        height_offset: 0.02,
        // Cadence and step height change in the middle of the trot.
        swing_frequency: if tick < 400 { 0.0 } else { 3.5 },
        duty: if tick < 400 { 0.0 } else { 0.6 },
        step_height: if tick < 400 { 0.0 } else { 0.08 },
    }
}

/// Computes the input of each tick from the outputs of the tick before.
pub struct Puppet {
    /// The input of the next tick.
    pub input: TickInput,
    /// Factor on sway and sensor noise.
    pub noise: f64,
    robot: Robot,
    params: Params,
    estimate: Estimate,
    rng: Rng,
    q: Vec<f64>,
    yaw: f64,
    lift_offs: usize,
    was_stance: [bool; 4],
    /// Time in the swing at which each foot touches the ground, in units of the swing time.
    lands_at: [f64; 4],
}

impl Puppet {
    pub fn new(seed: u64) -> Self {
        let params = Params::from_toml(PARAMS, "hyq.toml").unwrap();
        let robot = Robot::new(URDF, &params.robot).unwrap();
        let mut input = standing(&robot);
        input.op = operator_at(0);
        Puppet {
            input,
            noise: 1.0,
            params,
            estimate: Estimate::new(&robot),
            rng: Rng(seed),
            q: robot.q_nominal.clone(),
            yaw: 0.0,
            lift_offs: 0,
            was_stance: [true; 4],
            lands_at: [0.0; 4],
            robot,
        }
    }

    /// Puts the joints into another posture.
    pub fn put(&mut self, q: &[f64]) {
        self.q.copy_from_slice(q);
        self.input.state.q.copy_from_slice(q);
    }

    /// Computes the input of the next tick from the outputs `out`.
    pub fn react(&mut self, out: &Outbox) {
        self.input.t_ns += PERIOD_NS;
        self.input.tick += 1;
        self.input.state.t_ns = self.input.t_ns;
        self.input.state.seq += 1;
        let seq = self.input.op.seq;
        if seq >= 0 {
            self.input.op = operator_at(self.input.tick);
            self.input.t_op_ns = self.input.t_ns;
        }
        self.joints(&get(out, channels::ROBOT_COMMAND));
        self.base(&get(out, channels::BASE_TRACKING));
        let forces = self.forces(&get(out, channels::LEG_STATE));
        set_torques(&self.robot, &mut self.estimate, &mut self.input, &forces);
        for tau in &mut self.input.state.tau {
            *tau += 0.5 * self.noise * self.rng.symmetric();
        }
    }

    fn joints(&mut self, command: &RobotCommand) {
        let follows = if command.mode == RobotCommand::MODE_TORQUE { 0.3 } else { 0.0 };
        for (j, q) in self.q.iter_mut().enumerate() {
            let moved = follows * (command.q_des[j] - *q);
            *q += moved;
            self.input.state.q[j] = *q + 1e-4 * self.noise * self.rng.symmetric();
            self.input.state.qd[j] = moved / DT + 1e-2 * self.noise * self.rng.symmetric();
        }
    }

    fn base(&mut self, base: &BaseTracking) {
        self.yaw += base.yaw_rate_des * DT;
        let t = self.input.tick as f64 * DT;
        let sway = |size: f64, rate: f64| (size * self.noise * sin(rate * t), size * self.noise * rate * cos(rate * t));
        let ((roll, roll_rate), (pitch, pitch_rate)) = (sway(0.02, 8.0), sway(0.015, 11.0));
        let R_WB = Rz(self.yaw) * Ry(pitch) * Rx(roll);
        let tilting = Rz(self.yaw) * (Ry(pitch) * Vector3::x() * roll_rate + Vector3::y() * pitch_rate);
        let w_WB_W = tilting + Vector3::z() * base.yaw_rate_des;
        set_base(&self.robot, &mut self.input, &R_WB, &w_WB_W);
    }

    /// The weight, shared by the feet on the ground. Most feet touch down a little early, some late, the third one very late.
    fn forces(&mut self, legs: &LegState) -> [Vector3<f64>; 4] {
        let gait = self.params.gait.gait(legs.gait).unwrap();
        let T_sw = Timing::at(gait, Cadence::default(), &self.params).T_sw;
        let mut loaded = [true; 4];
        for (i, loaded) in loaded.iter_mut().enumerate() {
            let stance = legs.state[i] == LegState::STATE_STANCE;
            if !stance && self.was_stance[i] {
                self.lift_offs += 1;
                self.lands_at[i] = match self.lift_offs {
                    3 => 2.2,
                    n if n % 3 == 0 => 1.3,
                    _ => 0.95,
                };
            }
            self.was_stance[i] = stance;
            *loaded = stance || legs.t_swing[i] >= self.lands_at[i] * T_sw;
        }
        let n = loaded.iter().filter(|l| **l).count();
        let share = Vector3::z() * (self.robot.mass() * GRAVITY / n.max(1) as f64);
        loaded.map(|l| if l { share } else { Vector3::zeros() })
    }
}

/// Messages of a tick: channel and bytes.
pub type Messages = Vec<(&'static str, Vec<u8>)>;

pub fn messages(out: &Outbox) -> Messages {
    out.iter().map(|(channel, bytes)| (channel, bytes.to_vec())).collect()
}

/// Inputs and outputs, tick by tick.
pub struct Run {
    pub inputs: Vec<TickInput>,
    pub outputs: Vec<Messages>,
}

/// Runs a controller with the puppet.
pub fn run_with_puppet(controller: &mut dyn Controller, seed: u64, ticks: usize) -> Run {
    let (mut puppet, mut out) = (Puppet::new(seed), Outbox::new());
    let mut run = Run { inputs: Vec::new(), outputs: Vec::new() };
    for _ in 0..ticks {
        controller.step(&puppet.input, &mut out);
        run.inputs.push(puppet.input.clone());
        run.outputs.push(messages(&out));
        puppet.react(&out);
    }
    run
}

/// Number of good ticks; the robot trots afterwards.
pub const GOOD: i64 = 160;

/// A controller that is walking, its puppet with the next input, and its last outputs.
pub fn walking() -> (Quadruped, Puppet, Outbox) {
    let (mut controller, mut puppet, mut out) = (hyq(), Puppet::new(5), Outbox::new());
    for _ in 0..GOOD {
        controller.step(&puppet.input, &mut out);
        puppet.react(&out);
    }
    assert_eq!(tick_of(&out).mode, ControllerTick::MODE_WALK);
    (controller, puppet, out)
}

pub fn finite(command: &RobotCommand) -> bool {
    [&command.tau, &command.q_des, &command.qd_des, &command.kp, &command.kd]
        .into_iter()
        .flatten()
        .all(|x| x.is_finite())
}

/// Asserts the command of the safe state.
#[track_caller]
pub fn assert_damps(command: &RobotCommand) {
    assert_eq!(command.mode, RobotCommand::MODE_DAMPING);
    assert!(finite(command));
    assert_eq!(command.tau, vec![0.0; 12]);
    assert_eq!(command.qd_des, vec![0.0; 12]);
    assert_eq!(command.kp, vec![0.0; 12]);
    assert_eq!(command.kd, vec![20.0; 12], "safety.damping of HyQ");
}
