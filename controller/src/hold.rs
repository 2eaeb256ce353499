//! A controller that moves every joint to the robot's posture and holds it there, for a robot on a stand or a crane.
//!
//! Each joint moves from its present position to the robot's posture `nominal` along a polynomial of fifth order with zero velocity and acceleration at
//! both ends; the joint loop of the drives follows it. Nothing is computed from the dynamics, so the controller works with any robot and any foot position.

pub(crate) mod drive;
pub mod params;

use crate::digest::input_digest;
use crate::error::{LoadError, RestoreError};
use crate::interface::{Controller, Probe};
use crate::model::{JointInfo, NOMINAL, UrdfTree, check_runnable};
use crate::outbox::Outbox;
use crate::params::{Params, parameters_digest};
use crate::safety::Fault;
use crate::time::StepLimit;
use drive::{Gains, Handover, Output, STAGES, judge, posture_of};
use lcmtypes::{ControllerTick, HoldState, Message, RunInfo, TickInput, channels};

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "hold";

/// The controller.
pub struct Hold {
    params: Params,
    joints: Vec<JointInfo>,
    gains: Gains,
    q_posture: Vec<f64>,
    step_limit: StepLimit,
    state: HoldState,
    /// Preallocated message for reading snapshots.
    snapshot_buffer: HoldState,
    output: Output,
    handover: Handover,
}

impl Hold {
    /// Builds the controller of the first component of a run from URDF, parameters and period.
    ///
    /// # Errors
    /// A text is invalid, or the posture `nominal` (`robot.posture` of a quadruped) lacks a joint of the robot.
    pub fn new(info: &RunInfo) -> Result<Self, LoadError> {
        let digest_parameters = parameters_digest(info.params());
        let params = Params::from_toml(info.params(), "parameters")?;
        let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
        let robot = params.robot.description(&tree)?;
        let model = robot.model(&tree)?;
        let q_posture = posture_of(&robot, NOMINAL)?;
        check_runnable(&model, &q_posture)?;
        let nj = q_posture.len();
        let output = Output::new(nj, digest_parameters);
        let state = HoldState {
            tick: -1,
            mode: ControllerTick::MODE_IDLE,
            fault_index: -1,
            nj: output.command.nj,
            q_from: vec![0.0; nj],
            ..HoldState::default()
        };
        let (joints, snapshot_buffer) = (model.joints, state.clone());
        let gains = Gains::new(&robot, &params.hold, &params.safety);
        let step_limit = StepLimit::of(info);
        Ok(Hold {
            params,
            joints,
            gains,
            q_posture,
            step_limit,
            snapshot_buffer,
            state,
            output,
            handover: Handover::new(nj),
        })
    }

    /// Updates the state. The references are a function of it.
    fn advance(&mut self, input: &TickInput) {
        let before_ns = self.state.t_ns;
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        if self.state.mode == ControllerTick::MODE_DAMPING {
            return;
        }
        let (fault, goes_on) = judge(&self.joints, &self.params.safety, input, &mut self.state.mode);
        (self.state.fault, self.state.fault_index, self.state.fault_value) = (fault.code, fault.index, fault.value);
        if !goes_on {
            return;
        }
        if self.state.mode == ControllerTick::MODE_IDLE {
            self.state.mode = ControllerTick::MODE_STAND_UP;
            self.handover.start(&self.joints, &input.state.q, &mut self.state.q_from);
            self.state.progress = 0.0;
        } else {
            let dt = self.step_limit.seconds(input.t_ns, before_ns);
            self.state.progress = (self.state.progress + dt / self.params.hold.duration).min(1.0);
            if self.state.progress >= 1.0 {
                self.state.mode = ControllerTick::MODE_STANCE;
            }
        }
    }

    /// Computes the command from the state, before effort limits.
    fn fill_command(&mut self) {
        let Hold { params, gains, q_posture, state, output: Output { command, .. }, .. } = self;
        command.tau.fill(0.0);
        let moving = matches!(state.mode, ControllerTick::MODE_STAND_UP | ControllerTick::MODE_STANCE);
        let s = state.progress;
        // 10 s³ - 15 s⁴ + 6 s⁵: velocity and acceleration are zero at both ends.
        let fraction = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / params.hold.duration;
        for (j, (&to, &from)) in q_posture.iter().zip(&state.q_from).enumerate() {
            (command.q_des[j], command.qd_des[j]) =
                if moving { (from + fraction * (to - from), rate * (to - from)) } else { (0.0, 0.0) };
        }
        gains.fill(state.mode, command);
    }
}

impl Controller for Hold {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &STAGES
    }

    fn receive(&mut self, _: &TickInput, channel: &str, data: &[u8]) -> bool {
        channel == channels::ROBOT_COMMAND && self.handover.take(data, self.q_posture.len())
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let digest_input = input_digest(input);
        self.advance(input);
        self.handover.clear();
        probe.stage_done(0);
        self.fill_command();
        let HoldState { mode, fault: code, fault_index: index, fault_value: value, .. } = self.state;
        self.output.publish(&self.joints, input, digest_input, mode, Fault { code, index, value }, out);
        probe.stage_done(1);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = &mut self.snapshot_buffer;
        state.decode_into(bytes)?;
        let (found, expected) = (state.q_from.len(), self.q_posture.len());
        if found != expected {
            return Err(RestoreError::Joints { found, expected });
        }
        if state.q_from.iter().chain([&state.progress]).any(|x| !x.is_finite()) {
            return Err(RestoreError::NotFinite { field: "q_from" });
        }
        std::mem::swap(&mut self.state, &mut self.snapshot_buffer);
        Ok(())
    }

    fn poison_workspace(&mut self) {
        self.output.poison();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::{OperatorCommand, RobotState, channels};

    #[test]
    fn requests_for_other_modes_than_stand_are_rejected_by_name() {
        let (urdf, params) = (include_str!("../../robots/hyq/hyq.urdf"), include_str!("../../robots/hyq/hyq.toml"));
        let info = RunInfo { urdf: urdf.to_owned(), ..RunInfo::default() };
        let mut hold = Hold::new(&info.with_component(lcmtypes::ComponentInfo::new(NAME, params))).unwrap();
        let mut input = TickInput { state: RobotState::zeros(hold.q_posture.len(), 1, 0), ..TickInput::default() };
        input.state.q.clone_from(&hold.q_posture);
        let mut out = Outbox::new();
        for (mode, fault) in [
            (OperatorCommand::MODE_STAND, ControllerTick::FAULT_NONE),
            (OperatorCommand::MODE_WALK, ControllerTick::FAULT_OPERATOR_REFUSED),
            (OperatorCommand::MODE_SIT, ControllerTick::FAULT_OPERATOR_REFUSED),
            (OperatorCommand::MODE_STAND, ControllerTick::FAULT_NONE),
            (OperatorCommand::MODE_DAMPING, ControllerTick::FAULT_OPERATOR),
        ] {
            input.op.mode = mode;
            hold.step(&input, &mut out);
            let tick = ControllerTick::decode(out.get(channels::CONTROLLER_TICK).unwrap()).unwrap();
            assert_eq!(tick.fault, fault, "mode {mode}");
            if fault == ControllerTick::FAULT_OPERATOR_REFUSED {
                assert_eq!((tick.mode, tick.fault_index), (ControllerTick::MODE_STAND_UP, mode.into()));
            }
            input.tick += 1;
        }
    }
}
