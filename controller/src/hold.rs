//! Brings every joint to the robot's posture, and holds it there: for a robot on a stand or a crane, before it is asked to walk.
//!
//! The joints go from where they are to `robot.posture` along a polynomial of fifth order, at rest at both ends, and the driver's joint
//! loop follows. Nothing is computed from a model, so it works with any robot and with the feet anywhere.

use crate::digest::Digest;
use crate::model::{Base, JointInfo, Model, UrdfTree};
use crate::params::{Params, RobotConfig};
use crate::quadruped::safety::{check_joints, fault, is_plausible, limit, seconds};
use crate::quadruped::state::Fault;
use crate::{Controller, LoadError, Outbox, Probe, RestoreError, Stage};
use lcmtypes::{
    ControllerInput, ControllerTick, HoldState, Message, OperatorCommand, RobotCommand, RobotState, channels,
};
use serde::{Deserialize, Serialize};

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "hold";
/// Ticks between two snapshots of the state.
const SNAPSHOT_TICKS: i64 = 1000;

/// The `[hold]` table of the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HoldParams {
    /// Stiffness of every joint, N m/rad.
    pub kp: f64,
    /// Damping of every joint, N m s/rad.
    pub kd: f64,
    /// Time in which the joints go to the posture, s.
    pub duration: f64,
}

impl Default for HoldParams {
    fn default() -> Self {
        HoldParams { kp: 300.0, kd: 10.0, duration: 3.0 }
    }
}

/// The controller.
pub struct Hold {
    params: Params,
    joints: Vec<JointInfo>,
    q_posture: Vec<f64>,
    state: HoldState,
    /// Through which a state comes in, kept so that no memory is asked for then.
    passage: HoldState,
    command: RobotCommand,
}

impl Hold {
    /// Builds the controller from the text of a URDF and of the parameters.
    ///
    /// # Errors
    /// Unusable texts; a posture that leaves a joint of the robot out.
    pub fn new(urdf: &str, params: &str) -> Result<Self, LoadError> {
        let params = Params::from_toml(params, "parameters")?;
        let RobotConfig { name, urdf: file, posture, .. } = &params.robot;
        let model = Model::new(&UrdfTree::parse(urdf, file)?, Base::Floating)?;
        let of_posture = |joint: &JointInfo| {
            let what = || format!("robot.posture does not name joint {}", joint.name);
            posture.get(&joint.name).copied().ok_or_else(|| LoadError::Robot { robot: name.clone(), what: what() })
        };
        let q_posture: Vec<f64> = model.joints.iter().map(of_posture).collect::<Result<_, _>>()?;
        let nj = i32::try_from(q_posture.len()).expect("robots have fewer than 2^31 joints");
        let zeros = || vec![0.0; q_posture.len()];
        let state = HoldState {
            tick: -1,
            mode: ControllerTick::MODE_IDLE,
            fault_index: -1,
            nj,
            q_from: zeros(),
            ..HoldState::default()
        };
        let command = RobotCommand {
            nj,
            tau: zeros(),
            q_des: zeros(),
            qd_des: zeros(),
            kp: zeros(),
            kd: zeros(),
            ..Default::default()
        };
        Ok(Hold { params, joints: model.joints, q_posture, passage: state.clone(), state, command })
    }

    /// What is wrong with an input, if anything.
    fn check(&self, input: &ControllerInput) -> Option<Fault> {
        let RobotState { t_ns, q, qd, tau, .. } = &input.state;
        for values in [q, qd, tau] {
            if values.len() != self.joints.len() {
                #[expect(clippy::cast_precision_loss, reason = "a count for a person to read")]
                return fault(ControllerTick::FAULT_INPUT_SIZE, None, values.len() as f64);
            }
            if let Some(j) = values.iter().position(|x| !is_plausible(*x)) {
                return fault(ControllerTick::FAULT_INPUT_NOT_FINITE, Some(j), values[j]);
            }
        }
        let age = seconds(input.t_ns.saturating_sub(*t_ns));
        if age.abs() > self.params.safety.max_state_age {
            return fault(ControllerTick::FAULT_STATE_STALE, None, age);
        }
        // A robot on a stand may lean, and stand on nothing.
        if let Some(fault) = check_joints(&self.joints, &self.params, &input.state) {
            return Some(fault);
        }
        if input.op.mode == OperatorCommand::MODE_DAMPING {
            return fault(ControllerTick::FAULT_OPERATOR, None, 0.0);
        }
        None
    }

    /// Moves the state; references are a function of it.
    fn advance(&mut self, input: &ControllerInput) {
        let before_ns = self.state.t_ns;
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        if self.state.mode == ControllerTick::MODE_DAMPING {
            return;
        }
        if let Some(Fault { code, index, value }) = self.check(input) {
            (self.state.fault, self.state.fault_index, self.state.fault_value) = (code, index, value);
            // Before the first good input there is nothing to save: it waits and says what for.
            if self.state.mode != ControllerTick::MODE_IDLE {
                self.state.mode = ControllerTick::MODE_DAMPING;
            }
            return;
        }
        (self.state.fault, self.state.fault_index, self.state.fault_value) = (ControllerTick::FAULT_NONE, -1, 0.0);
        if self.state.mode == ControllerTick::MODE_IDLE {
            self.state.mode = ControllerTick::MODE_STAND_UP;
            self.state.q_from.copy_from_slice(&input.state.q);
            self.state.progress = 0.0;
        } else {
            // A late tick must not throw the references.
            let dt = seconds(input.t_ns.saturating_sub(before_ns)).clamp(0.0, 0.01);
            self.state.progress = (self.state.progress + dt / self.params.hold.duration).min(1.0);
            if self.state.progress >= 1.0 {
                self.state.mode = ControllerTick::MODE_STANCE;
            }
        }
    }

    fn fill_command(&mut self) {
        self.command.tau.fill(0.0);
        let Hold { params, q_posture, state, command, .. } = self;
        (command.t_ns, command.tick) = (state.t_ns, state.tick);
        let moving = matches!(state.mode, ControllerTick::MODE_STAND_UP | ControllerTick::MODE_STANCE);
        let s = state.progress;
        // 10 s³ - 15 s⁴ + 6 s⁵: velocity and acceleration are zero at both ends.
        let part = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / params.hold.duration;
        for (j, (&to, &from)) in q_posture.iter().zip(&state.q_from).enumerate() {
            (command.q_des[j], command.qd_des[j]) =
                if moving { (from + part * (to - from), rate * (to - from)) } else { (0.0, 0.0) };
        }
        let (mode, kp, kd) = match state.mode {
            _ if moving => (RobotCommand::MODE_TORQUE, params.hold.kp, params.hold.kd),
            ControllerTick::MODE_IDLE => (RobotCommand::MODE_IDLE, 0.0, 0.0),
            _ => (RobotCommand::MODE_DAMPING, 0.0, params.safety.damping),
        };
        command.mode = mode;
        command.kp.fill(kp);
        command.kd.fill(kd);
    }
}

impl Controller for Hold {
    fn name(&self) -> &'static str {
        NAME
    }

    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let digest_input = crate::quadruped::digest_of_input(input);
        self.advance(input);
        probe.stage_done(Stage::Input);
        self.fill_command();
        limit(&self.joints, &mut self.command, &input.state);
        let mut digest = Digest::default();
        let c = &self.command;
        for values in [&c.tau, &c.q_des, &c.qd_des, &c.kp, &c.kd] {
            digest.f64s(values);
        }
        digest.word(u64::from(c.mode.cast_unsigned()));
        let HoldState { t_ns, tick, mode, fault, fault_index, fault_value, .. } = self.state;
        let digest_output = digest.finish();
        let status = ControllerTick {
            t_ns,
            tick,
            mode,
            fault,
            fault_index,
            fault_value,
            digest_input,
            digest_output,
            ..Default::default()
        };
        out.clear();
        let mut put = out.put(channels::ROBOT_COMMAND, &self.command);
        put = put.and_then(|()| out.put(channels::CONTROLLER_TICK, &status));
        if tick % SNAPSHOT_TICKS == 0 {
            put = put.and_then(|()| out.put(channels::CONTROLLER_SNAPSHOT, &self.state));
        }
        put.expect("every array has the length of the robot since construction");
        probe.stage_done(Stage::Output);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = &mut self.passage;
        state.decode_into(bytes)?;
        let (found, expected) = (state.q_from.len(), self.q_posture.len());
        if found != expected {
            return Err(RestoreError::Joints { found, expected });
        }
        if state.q_from.iter().chain([&state.progress]).any(|x| !x.is_finite()) {
            return Err(RestoreError::NotFinite { field: "q_from" });
        }
        std::mem::swap(&mut self.state, &mut self.passage);
        Ok(())
    }

    fn poison_workspace(&mut self) {
        let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = &mut self.command;
        for values in [tau, q_des, qd_des, kp, kd] {
            values.fill(f64::NAN);
        }
    }
}
