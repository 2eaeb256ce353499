//! Imperfect drives, moving floors and false touches of a scenario, on the simulated HyQ.
#![allow(non_snake_case, reason = "frames are capital letters")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::base_state;
use controller::params::{Params, RobotConfig};
use drivers::terrain::{TerrainKind, TerrainParams};
use drivers::{DriveParams, DriverError, FloorMove, MujocoSim, SimParams, Simulator, Terrain};
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use nalgebra::{DMatrix, Vector3};
use robot_model::{Base, Kinematics, Model, UrdfTree, point_jacobian_linear};

fn hyq() -> (UrdfTree, RobotConfig) {
    let read =
        |name: &str| std::fs::read_to_string(format!("{}/../robots/hyq/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let tree = UrdfTree::parse(&read("hyq.urdf"), "hyq.urdf").unwrap();
    (tree, Params::from_toml(&read("hyq.toml"), "hyq.toml").unwrap().robot)
}

fn simulation(params: SimParams) -> Result<MujocoSim, DriverError> {
    let (tree, robot) = hyq();
    MujocoSim::new(&tree, &robot, Terrain::new(&TerrainParams::of_kind(TerrainKind::Flat), 0), params)
}

/// A command that holds the posture with joint stiffness and damping; `other` replaces the positions of some joints, rad.
fn hold(sim: &MujocoSim, other: &[(&str, f64)]) -> RobotCommand {
    let posture = hyq().1.posture;
    let nj = sim.joints().len();
    let goal = |joint: &String| other.iter().find(|(name, _)| name == joint).map_or(posture[joint], |(_, q)| *q);
    RobotCommand {
        mode: RobotCommand::MODE_TORQUE,
        q_des: sim.joints().iter().map(goal).collect(),
        kp: vec![1500.0; nj],
        kd: vec![30.0; nj],
        ..RobotCommand::zeros(nj)
    }
}

fn run(sim: &mut MujocoSim, command: &RobotCommand, steps: usize) {
    sim.apply(command).unwrap();
    for _ in 0..steps {
        sim.step().unwrap();
    }
}

fn truth(sim: &MujocoSim) -> GroundTruth {
    let mut truth = GroundTruth::default();
    sim.ground_truth(0, &mut truth);
    truth
}

fn state(sim: &MujocoSim) -> RobotState {
    let mut state = RobotState::default();
    sim.robot_state(0, 0, &mut state);
    state
}

fn joint(sim: &MujocoSim, name: &str) -> usize {
    sim.joints().iter().position(|joint| joint == name).unwrap()
}

#[test]
fn drives_apply_lag_and_gain() {
    let drives = DriveParams { lag_s: 0.005, gain: [("lf_kfe_joint".to_owned(), 0.8)].into(), gain_in_air: false };
    let mut sim = simulation(SimParams { drives, ..SimParams::default() }).unwrap();
    let mut command = hold(&sim, &[]);
    command.kp.fill(0.0);
    command.kd.fill(0.0);
    command.tau.fill(10.0);
    run(&mut sim, &command, 5);
    // 1 - exp(-1) of the torque after one time constant; the sensor resolves 1/128 N m.
    let tau = state(&sim).tau;
    let (whole, part) = (tau[joint(&sim, "rf_kfe_joint")], tau[joint(&sim, "lf_kfe_joint")]);
    assert!((whole - 6.321).abs() < 0.005 && (part - 0.8 * 6.321).abs() < 0.005, "{whole} {part}");
}

#[test]
fn a_gain_in_air_does_not_affect_stance_legs() {
    let gain = [("lf_kfe_joint".to_owned(), 0.5), ("rf_kfe_joint".to_owned(), 0.5)].into();
    let drives = DriveParams { lag_s: 0.0, gain, gain_in_air: true };
    let mut sim = simulation(SimParams { drives, ..SimParams::default() }).unwrap();
    // LF is lifted, RF stands.
    let mut command = hold(&sim, &[("lf_hfe_joint", 1.1), ("lf_kfe_joint", -2.2)]);
    run(&mut sim, &command, 500);
    assert_eq!(truth(&sim).contact[..2], [0, 1]);
    command.kp.fill(0.0);
    command.kd.fill(0.0);
    command.tau.fill(8.0);
    run(&mut sim, &command, 1);
    let tau = state(&sim).tau;
    assert_eq!((tau[joint(&sim, "lf_kfe_joint")], tau[joint(&sim, "rf_kfe_joint")]), (4.0, 8.0));
}

#[test]
fn a_floor_moves_only_under_a_lifted_foot() {
    for (height, lands) in [(0.04, 0.03..0.05), (-0.05, -0.049..-0.005)] {
        let floors = vec![FloorMove { t_ns: 0, contact: "LF".to_owned(), key: "leg", height }];
        let mut sim = simulation(SimParams { floors, ..SimParams::default() }).unwrap();
        let (down, up) = (hold(&sim, &[]), hold(&sim, &[("lf_hfe_joint", 1.1), ("lf_kfe_joint", -2.2)]));
        run(&mut sim, &down, 300);
        let standing = truth(&sim);
        assert_eq!(standing.contact, [1; 4], "the floor does not move while the foot stands on it");
        assert!(standing.p_WF[0][2].abs() < 0.005, "{:?}", standing.p_WF[0]);
        run(&mut sim, &up, 400);
        assert!(truth(&sim).p_WF[0][2] > 0.06);
        run(&mut sim, &down, 600);
        // The leg keeps its length: it touches the raised floor, and hangs above the lowered one, below the ground of the other feet.
        let landed = truth(&sim);
        assert_eq!(landed.contact[0] == 1, height > 0.0, "floor at {height}");
        assert!(lands.contains(&landed.p_WF[0][2]), "floor at {height}: {:?}", landed.p_WF[0]);
        // A stiff robot on one raised foot rocks: another foot may hang, but feet in contact are on the ground.
        for foot in (1..4).filter(|&foot| landed.contact[foot] == 1) {
            assert!(landed.p_WF[foot][2].abs() < 0.005, "floor at {height}: {:?}", landed.p_WF);
        }
    }
}

/// Compared with the Jacobian of the controller's model.
#[test]
fn a_false_touch_gives_the_torque_that_balances_it() {
    let (tree, robot) = hyq();
    let mut sim = simulation(SimParams::default()).unwrap();
    let command = hold(&sim, &[("lf_hfe_joint", 1.1)]);
    run(&mut sim, &command, 200);
    let model = Model::new(&tree, Base::Floating).unwrap();
    let (truth, state) = (truth(&sim), state(&sim));
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &base_state(&truth), &state.q, &state.qd);
    let mut J = DMatrix::zeros(3, model.nv());
    for (foot, link) in robot.feet.iter().enumerate() {
        let p_FC_W = Vector3::z() * -robot.foot_radius;
        point_jacobian_linear(&model, &kin, model.frame(link).unwrap(), &p_FC_W, J.as_view_mut());
        let f_W = Vector3::new(5.0, -7.0, 60.0);
        let expected = -J.columns(6, model.nj()).transpose() * f_W;
        let found = sim.torque_of_touch(foot, f_W.into());
        for (found, expected) in found.iter().zip(expected.iter()) {
            // Encoder resolution 4e-6 rad, lever 1 m, force 60 N.
            assert!((found - expected).abs() < 1e-3, "{link}: {found}, expected {expected}");
        }
    }
}

#[test]
fn an_unknown_joint_is_an_error_with_the_known_ones() {
    let drives = DriveParams { gain: [("elbow".to_owned(), 0.8)].into(), ..DriveParams::default() };
    let error = simulation(SimParams { drives, ..SimParams::default() }).map(|_| ()).unwrap_err();
    let DriverError::Unknown { wanted_by, name, known, .. } = error else { panic!("{error}") };
    assert_eq!((&*wanted_by, &*name, &*known[0]), ("drives.gain", "elbow", "lf_haa_joint"));
}
