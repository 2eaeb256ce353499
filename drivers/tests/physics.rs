//! The simulated HyQ compared with values that can be worked out by hand.
#![allow(non_snake_case, reason = "frames are capital letters")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::base_state;
use controller::params::{Params, RobotConfig};
use drivers::terrain::{TerrainKind, TerrainParams};
use drivers::{DriverError, MujocoSim, NoiseParams, SimParams, Simulator, Terrain};
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use mujoco_rs::prelude::{MjData, MjModel};
use robot_model::math::quaternion;
use robot_model::{DescriptionError, GRAVITY, ModelError, UrdfTree};

/// `total_mass` of `robots/hyq/SOURCES`, kg.
const MASS: f64 = 86.774_005;

fn hyq() -> (UrdfTree, RobotConfig) {
    let read =
        |name: &str| std::fs::read_to_string(format!("{}/../robots/hyq/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let tree = UrdfTree::parse(&read("hyq.urdf"), "hyq.urdf").unwrap();
    (tree, Params::from_toml(&read("hyq.toml"), "hyq.toml").unwrap().robot)
}

fn simulation_on(ground: &TerrainParams, seed: i64, params: SimParams) -> MujocoSim {
    let (tree, robot) = hyq();
    MujocoSim::new(&tree, &robot, Terrain::new(ground, seed), params).unwrap()
}

fn simulation(kind: TerrainKind, seed: i64, params: SimParams) -> MujocoSim {
    simulation_on(&TerrainParams::of_kind(kind), seed, params)
}

/// A small field: MuJoCo parses its text quickly.
fn small(kind: TerrainKind) -> TerrainParams {
    TerrainParams { extent_m: Some([6.0, 6.0]), ..TerrainParams::of_kind(kind) }
}

fn flat() -> MujocoSim {
    simulation(TerrainKind::Flat, 0, SimParams::default())
}

/// A command that holds the posture with joint stiffness and damping.
fn hold(sim: &dyn Simulator, robot: &RobotConfig) -> RobotCommand {
    let nj = sim.joints().len();
    RobotCommand {
        mode: RobotCommand::MODE_TORQUE,
        q_des: sim.joints().iter().map(|joint| robot.posture[joint]).collect(),
        kp: vec![800.0; nj],
        kd: vec![20.0; nj],
        ..RobotCommand::zeros(nj)
    }
}

fn run(sim: &mut MujocoSim, steps: usize) {
    for _ in 0..steps {
        sim.step().unwrap();
    }
}

fn standing(mut sim: MujocoSim) -> MujocoSim {
    let command = hold(&sim, &hyq().1);
    sim.apply(&command).unwrap();
    run(&mut sim, 3000);
    sim
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

fn sum(forces: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|axis| forces.iter().map(|f| f[axis]).sum())
}

#[test]
fn standing_feet_carry_the_weight_on_plane_and_height_field() {
    for kind in [TerrainKind::Flat, TerrainKind::Rough] {
        let sim = standing(simulation(kind, 1, SimParams::default()));
        let truth = truth(&sim);
        let [fx, fy, fz] = sum(&truth.f_F_W);
        let weight = MASS * GRAVITY;
        assert!((fz - weight).abs() < 0.005 * weight, "{kind:?}: feet carry {fz} N, the robot weighs {weight} N");
        assert!(fx.abs() < 1.0 && fy.abs() < 1.0, "{kind:?}: horizontal forces {fx} {fy} do not cancel");
        assert!(truth.f_F_W.iter().all(|f| f[2] > 100.0) && truth.contact == [1; 4], "{kind:?}: {:?}", truth.f_F_W);
        assert!(!sim.fallen());
        let speed = truth.v_WB.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        assert!(speed < 1e-3, "{kind:?}: base moves at {speed} m/s");
    }
}

#[test]
fn a_reset_robot_stands_on_the_ground_at_its_nominal_height() {
    let (_, robot) = hyq();
    let mut sim = flat();
    let truth = truth(&sim);
    // 0.5775 m from the hips to the centre of a foot (computed in Python from the joint origins), plus the radius of the foot.
    assert!((truth.p_WB[2] - 0.599).abs() < 1e-3, "base at {}", truth.p_WB[2]);
    for p_WF in &truth.p_WF {
        assert!(p_WF[2].abs() < 1e-12, "foot at {p_WF:?}");
    }
    let fresh = state(&sim);
    // Held until the first step; the z axis of the IMU points down.
    assert!(fresh.a_I[0][0].abs() < 1e-3 && (fresh.a_I[0][2] + GRAVITY).abs() < 1e-3, "specific force {:?}", fresh.a_I);
    run(&mut sim, 100);
    sim.reset(&robot.posture).unwrap();
    assert_eq!(state(&sim), fresh);
}

#[test]
fn two_simulations_are_equal_in_every_bit() {
    let noise = NoiseParams { position: 1e-3, gyro: 1e-2, ..NoiseParams::default() };
    let params = SimParams { seed: 5, noise, ..SimParams::default() };
    let run_one = || {
        let mut sim = simulation(TerrainKind::Rough, 3, params.clone());
        sim.apply(&hold(&sim, &hyq().1)).unwrap();
        sim.add_push(None, [80.0, 40.0, 0.0], [0.0; 3]).unwrap();
        let mut states = Vec::new();
        for seq in 0..500 {
            let mut state = RobotState::default();
            sim.robot_state(seq, seq, &mut state);
            states.push((state, truth(&sim)));
            sim.step().unwrap();
        }
        states
    };
    let (first, second) = (run_one(), run_one());
    let different = first.iter().zip(&second).position(|(a, b)| format!("{a:?}") != format!("{b:?}"));
    assert_eq!(different, None, "first different step");
    assert_ne!(first[499].1.v_WB, first[400].1.v_WB);
}

#[test]
fn momentum_changes_by_push_weight_and_contact_forces_times_time() {
    for kind in [TerrainKind::Flat, TerrainKind::Rough] {
        let mut sim = standing(simulation(kind, 1, SimParams::default()));
        let f_W = [150.0, -300.0, 50.0];
        sim.add_push(None, [150.0, -400.0, 0.0], [0.0; 3]).unwrap();
        sim.add_push(None, [0.0, 100.0, 50.0], [0.0; 3]).unwrap();
        let before = momentum(&sim);
        let mut impulse = [0.0; 3];
        for _ in 0..200 {
            sim.step().unwrap();
            let truth = truth(&sim);
            assert_eq!(truth.f_push_W, f_W);
            let contact = sum(&truth.f_F_W);
            for axis in 0..3 {
                let weight = if axis == 2 { -MASS * GRAVITY } else { 0.0 };
                impulse[axis] += (f_W[axis] + weight + contact[axis]) * 1e-3;
            }
        }
        let after = momentum(&sim);
        assert!((after[1] - before[1]).abs() > 1.0, "{kind:?}: the push moved nothing");
        for axis in 0..3 {
            let found = after[axis] - before[axis];
            // Forces act at the start of a step, momentum is read at its end: an error of first order in 1 ms.
            assert!(
                (found - impulse[axis]).abs() < 0.15,
                "{kind:?}, axis {axis}: {found} N s, forces give {}",
                impulse[axis]
            );
        }
        sim.clear_pushes();
        assert_eq!(truth(&sim).f_push_W, [0.0; 3]);
    }
}

/// Linear momentum in W, computed with the controller's model.
fn momentum(sim: &MujocoSim) -> [f64; 3] {
    use robot_model::{Base, Kinematics, Model, com_velocity};
    let (tree, _) = hyq();
    let model = Model::new(&tree, Base::Floating).unwrap();
    let truth = truth(sim);
    let state = state(sim);
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &base_state(&truth), &state.q, &state.qd);
    (com_velocity(&kin) * MASS).into()
}

#[test]
fn an_imu_at_rest_reads_gravity_in_its_own_axes() {
    let sim = standing(flat());
    let RobotState { q_WI_wxyz, a_I, w_WI_I, .. } = state(&sim);
    let ([q_WI_wxyz], [a_I], [w_WI_I]) = (&q_WI_wxyz[..], &a_I[..], &w_WI_I[..]) else { panic!("one IMU") };
    let R_WI = quaternion::to_rotation(*q_WI_wxyz);
    let a_W = R_WI * nalgebra::Vector3::from(*a_I);
    assert!((a_W - nalgebra::Vector3::new(0.0, 0.0, GRAVITY)).norm() < 0.01, "specific force in W {a_W:?}");
    assert!(w_WI_I.iter().all(|w| w.abs() < 1e-3), "turn rate {w_WI_I:?}");
    // HyQ's IMU is rotated by half a turn about y of the trunk.
    assert!(a_I[2] < -9.7, "specific force in the IMU {a_I:?}");
}

#[test]
fn the_measured_torque_is_the_applied_torque_limited_to_the_effort() {
    let mut sim = flat();
    let nj = sim.joints().len();
    let zero = hold(&sim, &hyq().1);
    let command = |tau: f64, kd: f64, mode| RobotCommand {
        mode,
        tau: vec![tau; nj],
        kp: vec![0.0; nj],
        kd: vec![kd; nj],
        ..zero.clone()
    };
    for (given, expected) in [(10.0, 10.0), (400.0, 150.0), (-400.0, -150.0)] {
        sim.apply(&command(given, 0.0, RobotCommand::MODE_TORQUE)).unwrap();
        run(&mut sim, 1);
        assert_eq!(state(&sim).tau, vec![expected; nj]);
    }
    let before = state(&sim);
    sim.apply(&command(400.0, 2.0, RobotCommand::MODE_DAMPING)).unwrap();
    run(&mut sim, 1);
    for (tau, qd) in state(&sim).tau.iter().zip(&before.qd) {
        // half a step of the torque's and the velocity's resolution
        assert!((tau + 2.0 * qd).abs() <= 0.5 / 128.0 + 2.0 * 0.5 / 4096.0, "damping torque {tau} at {qd} rad/s");
    }
    sim.apply(&command(400.0, 2.0, RobotCommand::MODE_IDLE)).unwrap();
    run(&mut sim, 1);
    assert_eq!(state(&sim).tau, vec![0.0; nj]);
}

#[test]
fn a_robot_without_torque_lies_on_the_ground_and_has_fallen() {
    for kind in [TerrainKind::Flat, TerrainKind::Rough] {
        let mut sim = simulation(kind, 2, SimParams::default());
        assert!(!sim.fallen());
        run(&mut sim, 3000);
        assert!(sim.fallen());
        // half the trunk's height is 0.1 m; the trunk lies on the ground or on the legs, not in it
        let height = truth(&sim).p_WB[2];
        assert!((0.08..0.3).contains(&height), "{kind:?}: base at {height} m");
    }
}

#[test]
fn friction_of_the_scenario_holds_and_slips() {
    // A horizontal push of 0.5 m g: above friction 0.3, below 0.8.
    let slid = |friction: f64| {
        let mut sim = standing(simulation(TerrainKind::Flat, 0, SimParams { friction, ..SimParams::default() }));
        let before = truth(&sim).p_WF[0][0];
        sim.add_push(None, [0.5 * MASS * GRAVITY, 0.0, 0.0], [0.0; 3]).unwrap();
        run(&mut sim, 150);
        truth(&sim).p_WF[0][0] - before
    };
    assert!(slid(0.8).abs() < 0.005, "slid {} m at friction 0.8", slid(0.8));
    assert!(slid(0.3) > 0.01, "slid {} m at friction 0.3", slid(0.3));
}

#[test]
fn height_of_the_terrain_is_that_of_the_simulator() {
    for kind in [TerrainKind::Rough, TerrainKind::Steps, TerrainKind::Slope] {
        let sim = simulation_on(&small(kind), 3, SimParams::default());
        let model = Box::new(MjModel::from_xml_string(&sim.mjcf()).unwrap());
        let mut data = MjData::new(model);
        data.forward();
        for step in 0..400 {
            // A spiral over the field, away from the robot, between grid points.
            let (radius, angle) = (1.2 + 0.004 * f64::from(step), 0.37 * f64::from(step));
            let [x, y] = [radius * angle.cos(), radius * angle.sin()];
            let (_, distance) = data.ray(&[x, y, 9.0], &[0.0, 0.0, -1.0], None, true, None, None);
            let (found, expected) = (sim.terrain().height_at(x, y), 9.0 - distance);
            assert!((found - expected).abs() < 1e-6, "{kind:?} at {x} {y}: {found}, MuJoCo has {expected}");
        }
    }
}

#[test]
fn feet_on_rough_ground_are_at_the_height_of_the_terrain() {
    let ground = TerrainParams { flat_radius_m: Some(0.1), ..TerrainParams::of_kind(TerrainKind::Rough) };
    for seed in [3, 4] {
        let sim = standing(simulation_on(&ground, seed, SimParams::default()));
        for (p_WF, touches) in truth(&sim).p_WF.into_iter().zip(truth(&sim).contact) {
            // The lowest point of a sphere of 22 mm is 3.6 mm above ground with slope 0.6, and higher in front of a step.
            let gap = p_WF[2] - sim.terrain().height_at(p_WF[0], p_WF[1]);
            assert!(touches == 0 || (-0.002..0.005).contains(&gap), "foot at {p_WF:?} is {gap} m above the ground");
        }
    }
}

#[test]
fn twists_are_the_time_derivatives_of_poses() {
    let mut sim = flat();
    sim.add_push(None, [300.0, 200.0, 2500.0], [60.0, -120.0, 90.0]).unwrap();
    run(&mut sim, 200);
    let before = truth(&sim);
    sim.step().unwrap();
    let middle = truth(&sim);
    sim.step().unwrap();
    let after = truth(&sim);
    let close = |what: &str, rate: [f64; 3], twist: [f64; 3]| {
        let error = rate.iter().zip(&twist).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        let size = twist.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        // The integrator is of first order: the error is the acceleration times 1 ms.
        assert!(size > 0.3 && error < 0.03 * size, "{what}: {rate:?} by differences, {twist:?}");
    };
    let rate = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| (b[axis] - a[axis]) / 2e-3);
    close("v_WB", rate(before.p_WB, after.p_WB), middle.v_WB);
    for foot in 0..4 {
        close("v_WF", rate(before.p_WF[foot], after.p_WF[foot]), middle.v_WF[foot]);
    }
    let [R_before, R_after] = [before, after].map(|truth| quaternion::to_rotation(truth.q_WB_wxyz));
    let turn = R_after * R_before.transpose();
    let w = [turn[(2, 1)] - turn[(1, 2)], turn[(0, 2)] - turn[(2, 0)], turn[(1, 0)] - turn[(0, 1)]];
    close("w_WB_W", w.map(|twice| twice / 4e-3), middle.w_WB_W);
}

#[test]
fn an_invalid_command_is_an_error_with_tick_field_and_joint() {
    let mut sim = flat();
    let good = hold(&sim, &hyq().1);
    let mut error = |command: RobotCommand| sim.apply(&command).unwrap_err();
    let short = error(RobotCommand { tick: 7, kp: vec![0.0; 3], ..good.clone() });
    assert!(matches!(short, DriverError::CommandSize { tick: 7, field: "kp", found: 3, expected: 12 }), "{short}");
    let mut tau = vec![0.0; 12];
    tau[2] = f64::NAN;
    let nan = error(RobotCommand { tick: 8, tau, ..good.clone() });
    assert!(
        matches!(&nan, DriverError::CommandNotFinite { tick: 8, field: "tau", joint, .. } if joint == "lf_kfe_joint"),
        "{nan}"
    );
    let mode = error(RobotCommand { tick: 9, mode: 5, ..good });
    assert!(matches!(mode, DriverError::CommandMode { tick: 9, found: 5 }), "{mode}");
    let unknown = sim.add_push(Some("tail"), [0.0; 3], [0.0; 3]).unwrap_err();
    let DriverError::Unknown { wanted_by, name, known, .. } = unknown else { panic!("{unknown}") };
    assert_eq!((&*wanted_by, &*name, &*known[0], &*known[1]), ("push.link", "tail", "base_link", "trunk"));
}

#[test]
fn an_unknown_imu_link_is_an_error() {
    let (tree, robot) = hyq();
    let other = RobotConfig { imu_link: "nose_imu".to_owned(), ..robot };
    let result = MujocoSim::new(
        &tree,
        &other,
        Terrain::new(&TerrainParams::of_kind(TerrainKind::Flat), 0),
        SimParams::default(),
    );
    assert!(
        matches!(result, Err(DriverError::Description(DescriptionError::Unknown { ref name, .. })) if name == "nose_imu")
    );
}

#[test]
fn the_mjcf_text_contains_the_heights_and_the_mass() {
    let sim = simulation_on(&small(TerrainKind::Rough), 1, SimParams::default());
    let model = MjModel::from_xml_string(&sim.mjcf()).unwrap();
    let heights = model.hfield_data();
    let terrain = sim.terrain();
    let field = terrain.field().unwrap();
    let low = field.min_count();
    let range = f64::from(field.max_count() - low);
    for (index, (height, count)) in heights.iter().zip(&field.counts).enumerate() {
        let expected = f64::from(count - low) / range;
        assert!((f64::from(*height) - expected).abs() < 1e-6, "point {index}: {height}, expected {expected}");
    }
    assert_eq!(heights.len(), field.counts.len());
    assert!((model.totalmass() - MASS).abs() < 1e-4);
}

/// HyQ with edited URDF and parameters.
fn edited(urdf: &[(&str, &str)], link: Option<(&str, &str)>) -> Result<MujocoSim, DriverError> {
    let (tree, mut robot) = hyq();
    let text = std::fs::read_to_string(format!("{}/../robots/hyq/hyq.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let mut text = urdf.iter().fold(text, |text, (from, to)| test_support::replace_once(&text, from, to));
    if let Some((from, to)) = link {
        text = text.replace(&format!("\"{from}\""), &format!("\"{to}\""));
        robot.feet.iter_mut().filter(|foot| *foot == from).for_each(|foot| *foot = to.to_owned());
    }
    // With the same source name the trees differ only if an edit took effect.
    let edited = UrdfTree::parse(&text, &tree.source).unwrap();
    assert_ne!(edited, tree);
    let flat = Terrain::new(&TerrainParams::of_kind(TerrainKind::Flat), 0);
    MujocoSim::new(&edited, &robot, flat, SimParams::default())
}

/// Names that the simulator uses itself, or that are special in XML.
#[test]
fn a_link_may_have_any_name() {
    for (from, to) in
        [("base_link", "world"), ("lf_foot", "plane"), ("trunk", "a &amp; &lt;b&gt; &quot;c&quot;"), ("lh_foot", "imu")]
    {
        let sim = edited(&[], Some((from, to))).unwrap();
        assert_eq!(sim.joints().len(), 12, "{to}");
    }
}

/// Inertias that MuJoCo refuses are balanced: here 0.1, 0.1 and 1 kg m² become 0.4 kg m² about each axis, and a negative moment is removed.
#[test]
fn impossible_inertias_are_balanced() {
    let old = "ixx=\"1.5725937\" iyy=\"8.5015928\" izz=\"9.1954911\"";
    for (ixx, mean) in [("1.0", 6.5657), ("-1.0", 5.8990)] {
        let sim = edited(&[(old, &old.replace("1.5725937", ixx).replace("9.1954911", "10.195511"))], None).unwrap();
        let model = MjModel::from_xml_string(&sim.mjcf()).unwrap();
        for moment in model.body_inertia()[1] {
            assert!((moment - mean).abs() < 1e-3, "{moment}, expected {mean}");
        }
    }
}

/// What cannot run is refused before it runs, with joint and link.
#[test]
fn a_robot_that_cannot_move_is_refused_by_joint() {
    let refused = |from: &str, to: &str, quantity: &str| {
        let error = edited(&[(from, to)], None).err().expect("refused");
        match error {
            DriverError::Urdf(ModelError::CannotRun { joint, link, quantity: found, .. }) => {
                assert_eq!((joint.as_str(), link.as_str(), found), ("lf_kfe_joint", "lf_lowerleg", quantity));
            }
            error => panic!("{error}"),
        }
    };
    let text = std::fs::read_to_string(format!("{}/../robots/hyq/hyq.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let limit = |text: &str| {
        let joint = text.split("<joint name=\"lf_kfe_joint\"").nth(1).unwrap().split("</joint>").next().unwrap();
        joint.to_owned()
    };
    let joint = limit(&text);
    let number = |key: &str| joint.split(&format!("{key}=\"")).nth(1).unwrap().split('"').next().unwrap().to_owned();
    for key in ["effort", "velocity"] {
        let from = format!("{key}=\"{}\"", number(key));
        refused(&joint, &joint.replace(&from, &format!("{key}=\"0\"")), &format!("{key} limit"));
    }
    let link = text.split("<link name=\"lf_lowerleg\">").nth(1).unwrap().split("</link>").next().unwrap();
    let mass = link.split("<mass value=\"").nth(1).unwrap().split('"').next().unwrap();
    let named = format!("<link name=\"lf_lowerleg\">{link}");
    refused(&named, &named.replace(&format!("<mass value=\"{mass}\""), "<mass value=\"0\""), "moved mass");
}
