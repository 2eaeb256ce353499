//! A planner that visits named postures in turn: it commands no joint, but publishes each goal as JOINT_REFERENCE for a component `posture`.
//!
//! It shows how a planner takes part in a run at its own rate (10 Hz, say) in its own thread or process, and keeps robots in motion for tests and
//! demonstrations. `tour.postures` are visited for `tour.dwell` seconds each, from the first measurement on, and again from the first one. With
//! an operator's emergency stop it holds the goal that it has; the component that commands the joints damps them.

pub mod params;

use crate::digest::{Digest, input_digest};
use crate::error::{LoadError, RestoreError};
use crate::hold::drive::{STAGES, posture_of};
use crate::interface::{Controller, Probe};
use crate::model::UrdfTree;
use crate::outbox::Outbox;
use crate::params::{Params, parameters_digest};
use crate::time::seconds;
use lcmtypes::{ControllerTick, JointReference, Message, OperatorCommand, RunInfo, TickInput, TourState, channels};

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "tour";

/// The controller.
pub struct Tour {
    dwell: f64,
    /// Positions of all joints in each posture.
    goals: Vec<Vec<f64>>,
    state: TourState,
    reference: JointReference,
    status: ControllerTick,
}

impl Tour {
    /// Builds the controller of the first component of a run from URDF and parameters.
    ///
    /// # Errors
    /// A text is invalid, `tour.postures` is empty or names a posture that the robot does not have, or a posture lacks a joint of the robot.
    pub fn new(info: &RunInfo) -> Result<Self, LoadError> {
        let params = Params::from_toml(info.params(), "parameters")?;
        let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
        let robot = params.robot.description(&tree)?;
        if params.tour.postures.is_empty() {
            let what = "tour.postures is empty, expected names of postures".to_owned();
            return Err(LoadError::Robot { robot: robot.name, what });
        }
        let goals = params.tour.postures.iter().map(|name| posture_of(&robot, name)).collect::<Result<Vec<_>, _>>()?;
        let joints: Vec<String> = robot.joints.iter().map(|joint| joint.name.clone()).collect();
        let n = i32::try_from(joints.len()).expect("a robot's joints");
        let status = ControllerTick {
            mode: ControllerTick::MODE_STANCE,
            fault_index: -1,
            n_stages: i32::try_from(STAGES.len()).expect("two stages"),
            digest: vec![0; STAGES.len()],
            digest_parameters: parameters_digest(info.params()),
            ..ControllerTick::default()
        };
        Ok(Tour {
            dwell: params.tour.dwell,
            reference: JointReference { n, q: vec![0.0; joints.len()], joints, ..JointReference::default() },
            goals,
            state: TourState { tick: -1, ..TourState::default() },
            status,
        })
    }

    /// Index of the posture that is visited.
    fn visited(&self) -> usize {
        let since = seconds(self.state.t_ns.saturating_sub(self.state.t_start_ns));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of visits, not negative")]
        let visits = (since / self.dwell).max(0.0) as u64;
        usize::try_from(visits % self.goals.len() as u64).expect("below the number of goals")
    }
}

impl Controller for Tour {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &STAGES
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let digest_input = input_digest(input);
        let state = &mut self.state;
        let is_stopped = input.op.mode == OperatorCommand::MODE_DAMPING;
        if !is_stopped {
            state.t_ns = input.t_ns;
        }
        state.tick = input.tick;
        if !state.started && !input.state.q.is_empty() {
            (state.started, state.t_start_ns) = (true, input.t_ns);
        }
        probe.stage_done(0);
        let goal = self.visited();
        let Tour { reference, goals, status, state, .. } = self;
        (reference.t_ns, reference.seq) = (input.t_ns, input.tick);
        reference.q.copy_from_slice(&goals[goal]);
        let mut digest = Digest::default();
        digest.f64s(&reference.q);
        (status.t_ns, status.tick, status.run_id) = (input.t_ns, input.tick, input.run_id);
        status.n_ignored = input.n_ignored;
        status.mode = if state.started { ControllerTick::MODE_STANCE } else { ControllerTick::MODE_IDLE };
        status.digest.copy_from_slice(&[digest_input, digest.finish()]);
        out.clear();
        let mut put = out.put(channels::CONTROLLER_TICK, status);
        if state.started {
            put = put.and_then(|()| out.put(channels::JOINT_REFERENCE, reference));
        }
        put.expect("every array has the length of the robot since construction");
        probe.stage_done(1);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state.encode(out).expect("a state without arrays");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        self.state = TourState::decode(bytes)?;
        Ok(())
    }

    fn poison_workspace(&mut self) {
        self.reference.q.fill(f64::NAN);
    }
}
