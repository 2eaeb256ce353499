//! Lockstep runs of scenarios that a test writes, and their messages.
#![allow(dead_code, reason = "no test file needs all of it")]

use controller::params::{Params, apply_overrides};
use drivers::lockstep::{self, LockstepOthers, Outcome};
use drivers::{MujocoSim, Scenario, SimParams, Terrain};
use lcmtypes::{
    ComponentInfo, ControllerTick, Event, GroundTruth, Message, RobotCommand, RobotState, RunInfo, channels,
};
use replay::record::EventSink;
use robot_model::{BaseState, UrdfTree};
use std::path::Path;

/// Both robots of the project.
pub const ROBOTS: [&str; 2] = ["hyq", "anymal_b"];

/// Pose and twist of the base for kinematics, from the ground truth.
pub fn base_state(truth: &GroundTruth) -> BaseState {
    BaseState {
        p_WB: truth.p_WB.into(),
        R_WB: robot_model::math::quaternion::to_rotation(truth.q_WB_wxyz),
        v_WB: truth.v_WB.into(),
        w_WB_W: truth.w_WB_W.into(),
    }
}

/// The messages of a run.
#[derive(Default)]
pub struct Seen {
    /// All events in the order of the log: channel, time in ns, bytes.
    pub events: Vec<(String, i64, Vec<u8>)>,
    pub ticks: Vec<ControllerTick>,
    pub commands: Vec<RobotCommand>,
    pub states: Vec<RobotState>,
    pub truth: Vec<GroundTruth>,
    pub messages: Vec<Event>,
}

impl EventSink for Seen {
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), replay::Error> {
        match channel {
            channels::CONTROLLER_TICK => self.ticks.push(ControllerTick::decode(data).unwrap()),
            channels::ROBOT_COMMAND => self.commands.push(RobotCommand::decode(data).unwrap()),
            channels::ROBOT_STATE => self.states.push(RobotState::decode(data).unwrap()),
            channels::GROUND_TRUTH => self.truth.push(GroundTruth::decode(data).unwrap()),
            channels::EVENT => self.messages.push(Event::decode(data).unwrap()),
            _ => {}
        }
        self.events.push((channel.to_owned(), t_ns, data.to_vec()));
        Ok(())
    }
}

impl Seen {
    /// The sequence of modes of the controller, without repetitions.
    pub fn modes(&self) -> Vec<i8> {
        let mut modes: Vec<i8> = self.ticks.iter().map(|tick| tick.mode).collect();
        modes.dedup();
        modes
    }

    /// The first tick in a mode.
    pub fn first(&self, mode: i8) -> Option<&ControllerTick> {
        self.ticks.iter().find(|tick| tick.mode == mode)
    }

    /// Largest joint speed in the ticks of a mode, rad/s.
    pub fn fastest(&self, mode: i8) -> f64 {
        let in_mode = self.ticks.iter().zip(&self.states).filter(|(tick, _)| tick.mode == mode);
        in_mode.flat_map(|(_, state)| &state.qd).fold(0.0, |most, qd| most.max(qd.abs()))
    }
}

/// RUN_INFO with parameters and URDF of a robot.
pub fn description(robot: &str, set: &[(&str, &str)]) -> RunInfo {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let read = |path: String| std::fs::read_to_string(root.join(path)).unwrap();
    let set: Vec<_> = set.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let params = apply_overrides(&read(format!("robots/{robot}/{robot}.toml")), &set).unwrap();
    let urdf = Params::from_toml(&params, robot).unwrap().robot.urdf;
    RunInfo { robot: robot.to_owned(), urdf: read(format!("robots/{robot}/{urdf}")), ..RunInfo::default() }
        .with_component(ComponentInfo::new("quadruped", &params))
}

/// Runs a scenario in lockstep.
pub fn run(robot: &str, scenario: &str, set: &[(&str, &str)]) -> (Seen, Outcome) {
    run_with(description(robot, set), scenario)
}

/// Runs a scenario in lockstep with the parameters of RUN_INFO.
pub fn run_with(mut info: RunInfo, scenario: &str) -> (Seen, Outcome) {
    let params = Params::from_toml(info.params(), &info.robot).unwrap();
    let scenario = Scenario::parse(scenario, "test", &params.gait).unwrap();
    info.components[0].kind.clone_from(&scenario.controller);
    let tree = UrdfTree::parse(&info.urdf, &info.robot).unwrap();
    let terrain = Terrain::new(&scenario.terrain, scenario.seed);
    let mut sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(&scenario)).unwrap();
    let mut controller = controller::load(&info).unwrap();
    let mut seen = Seen::default();
    let others = LockstepOthers::build(&info, &[], &[]).unwrap();
    let outcome = lockstep::run(&scenario, &info, &mut sim, &mut controller, others, &mut seen, &mut |_| {}).unwrap();
    (seen, outcome)
}

/// Effort limits of the joints, URDF order.
pub fn efforts(robot: &str) -> Vec<f64> {
    let tree = UrdfTree::parse(&description(robot, &[]).urdf, robot).unwrap();
    let movable = tree.joints.iter().filter(|joint| joint.limits.effort.is_finite() && joint.limits.effort > 0.0);
    movable.map(|joint| joint.limits.effort).collect()
}

/// Asserts that the joint loop of every command, at the measured state, stays within the effort limits, and that commands are finite.
#[track_caller]
pub fn assert_torques_bounded(robot: &str, seen: &Seen) {
    let efforts = efforts(robot);
    assert_eq!(seen.states.len(), seen.commands.len());
    for (state, command) in seen.states.iter().zip(&seen.commands) {
        let RobotCommand { tick, mode, tau, q_des, qd_des, kp, kd, .. } = command;
        for (j, effort) in efforts.iter().enumerate() {
            let (q, qd) = (state.q[j], state.qd[j]);
            let total = match *mode {
                RobotCommand::MODE_TORQUE => tau[j] + kp[j] * (q_des[j] - q) + kd[j] * (qd_des[j] - qd),
                RobotCommand::MODE_DAMPING => -kd[j] * qd,
                _ => 0.0,
            };
            assert!(total.is_nan() || total.abs() <= effort + 1e-9, "tick {tick}, joint {j}: {total} of {effort} N m");
            assert!(
                [tau[j], q_des[j], qd_des[j], kp[j], kd[j]].iter().all(|x| x.is_finite()),
                "tick {tick}, joint {j}"
            );
        }
    }
}

/// The text of a scenario.
///
/// - `terrain`: keys of the `[terrain]` table.
/// - `start`: a `[start]` table, or empty.
/// - `operator`: operator keys by time, s.
/// - `rest`: further tables.
pub fn scenario(duration_s: f64, terrain: &str, start: &str, operator: &[(f64, &str)], rest: &str) -> String {
    let mut text = format!("name = \"test\"\nduration_s = {duration_s}\nseed = 1\n[terrain]\n{terrain}\n{start}\n");
    for (t_s, keys) in operator {
        text += &format!("[[operator]]\nt_s = {t_s}\n{keys}\n");
    }
    text + rest
}
