//! Robots without the legs of a quadruped in simulation: they hold their posture, fall without torque, and stand on wheels and soles.
#![allow(non_snake_case, clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod common;

use common::{assert_torques_bounded, base_state, description, run, run_with};
use controller::params::Params;
use drivers::simulation::{Components, Job, Setup};
use drivers::terrain::{TerrainKind, TerrainParams};
use drivers::{MujocoSim, SimParams, Simulator, Terrain};
use lcmtypes::{ComponentInfo, ControllerTick, GroundTruth, RobotState};
use nalgebra::Vector3;
use replay::engine::Build;
use robot_model::{GRAVITY, Kinematics, Model, UrdfTree, centroidal_momentum, com};
use std::path::Path;

const ROBOTS: [&str; 4] = ["centauro", "coman_plus", "coman", "centauro_upper"];

fn hold(duration_s: f64, controller: &str) -> String {
    format!(
        "name = \"hold\"\nduration_s = {duration_s}\ncontroller = \"{controller}\"\n[terrain]\nkind = \"flat\"\n\
         [[operator]]\nt_s = 0.0\nmode = \"stand\"\n"
    )
}

fn simulator(robot: &str) -> (MujocoSim, Model) {
    let info = description(robot, &[]);
    let params = Params::from_toml(info.params(), robot).unwrap();
    let tree = UrdfTree::parse(&info.urdf, robot).unwrap();
    let model = params.robot.description(&tree).unwrap().model(&tree).unwrap();
    let flat = Terrain::new(&TerrainParams::of_kind(TerrainKind::Flat), 0);
    (MujocoSim::new(&tree, &params.robot, flat, SimParams::default()).unwrap(), model)
}

#[test]
fn each_robot_holds_its_posture() {
    for robot in ROBOTS {
        let (seen, outcome) = run(robot, &hold(6.0, "hold"), &[("hold.duration", "0.5")]);
        assert_eq!((outcome.fell_at_s, &outcome.safe_state), (None, &None), "{robot}");
        assert_eq!(seen.modes(), [ControllerTick::MODE_STAND_UP, ControllerTick::MODE_STANCE], "{robot}");
        assert_torques_bounded(robot, &seen);
        let (first, last) = (&seen.states[0], seen.states.last().unwrap());
        let error = |j: usize| (last.q[j] - seen.commands[0].q_des[j]).abs();
        let largest = (0..first.q.len()).map(error).fold(0.0, f64::max);
        let fastest = last.qd.iter().fold(0.0_f64, |most, qd| most.max(qd.abs()));
        assert!(largest < 0.1 && fastest < 0.05, "{robot}: error {largest} rad, speed {fastest} rad/s");
    }
}

/// The feet of a standing robot carry its weight: m g.
#[test]
fn wheels_and_soles_carry_the_weight() {
    for (robot, feet) in [("centauro", 4), ("coman_plus", 2), ("coman", 2)] {
        let (_, model) = simulator(robot);
        let (seen, _) = run(robot, &hold(6.0, "hold"), &[("hold.duration", "0.5")]);
        let last = &seen.truth[seen.truth.len() - 500..];
        let f_z: f64 = last.iter().map(|truth| truth.f_F_W.iter().map(|f| f[2]).sum::<f64>()).sum::<f64>() / 500.0;
        let weight = model.total_mass() * GRAVITY;
        assert!((f_z / weight - 1.0).abs() < 0.005, "{robot}: {f_z} N of {weight} N");
        assert_eq!(last[0].contact.iter().map(|c| usize::from(*c == 1)).sum::<usize>(), feet, "{robot}");
    }
}

/// Weight and contact forces of a swaying robot on soles change its angular momentum about the origin of W,
/// `d/dt (p_WC x m v_WC + l_C) = p_WC x m g + sum(p_WF x f + tau)`, summed over 1 s.
#[test]
fn forces_and_moments_on_the_soles_change_the_angular_momentum() {
    let (_, model) = simulator("coman_plus");
    let (seen, _) = run("coman_plus", &hold(3.0, "hold"), &[("hold.duration", "0.5")]);
    let mut kin = Kinematics::new(&model);
    let weight = Vector3::new(0.0, 0.0, -model.total_mass() * GRAVITY);
    let (mut momenta, mut impulse, mut on_soles) = (Vec::new(), Vector3::zeros(), Vector3::zeros());
    for (state, truth) in seen.states.iter().zip(&seen.truth).skip(2000) {
        kin.update(&model, &base_state(truth), &state.q, &state.qd);
        let momentum = centroidal_momentum(&kin);
        let (linear, angular) = (momentum.fixed_rows::<3>(0).into_owned(), momentum.fixed_rows::<3>(3));
        momenta.push(com(&kin).cross(&linear) + angular);
        if momenta.len() == 1 {
            continue;
        }
        impulse += com(&kin).cross(&weight) * 1e-3;
        for ((p_WF, f), tau) in truth.p_WF.iter().zip(&truth.f_F_W).zip(&truth.tau_F_W) {
            impulse += (Vector3::from(*p_WF).cross(&Vector3::from(*f)) + Vector3::from(*tau)) * 1e-3;
            on_soles += Vector3::from(*tau) * 1e-3;
        }
    }
    let change = momenta.last().unwrap() - momenta[0];
    let error = (change - impulse).norm();
    assert!(on_soles.norm() > 5.0, "{on_soles}");
    assert!(error < 0.1, "{error} N m s: {change} and {impulse}");
}

/// Without torque a robot falls within 3 s; the arms of one with a fixed base drop.
#[test]
fn without_torque_each_robot_falls() {
    for robot in ROBOTS {
        let (mut sim, _) = simulator(robot);
        let (mut truth, mut state) = (GroundTruth::default(), RobotState::default());
        let hand = |sim: &MujocoSim, truth: &mut GroundTruth| {
            sim.ground_truth(0, truth);
            truth.p_WF[truth.p_WF.len() - 1][2]
        };
        let before = hand(&sim, &mut truth);
        assert!(!sim.fallen(), "{robot}");
        (0..3000).for_each(|_| sim.step().unwrap());
        sim.robot_state(0, 0, &mut state);
        let drop = before - hand(&sim, &mut truth);
        let expected = if robot == "centauro_upper" { drop > 0.1 } else { sim.fallen() };
        assert!(expected, "{robot}: the hand dropped by {drop} m");
    }
}

/// Equal runs give equal bytes, also with several physics steps per tick; more steps change the motion.
#[test]
fn physics_steps_divide_a_tick() {
    let text = |steps: u32| hold(0.2, "hold").replace("duration_s", &format!("physics_steps = {steps}\nduration_s"));
    let messages = |steps: u32| run("coman", &text(steps), &[]).0;
    let (one, four, again) = (messages(1), messages(4), messages(4));
    assert_eq!((one.states.len(), four.states.len()), (200, 200));
    assert_eq!(four.states, again.states);
    assert_ne!(one.states.last().unwrap().q, four.states.last().unwrap().q);
    let apart = |j: usize| (one.states[199].q[j] - four.states[199].q[j]).abs();
    assert!((0..29).map(apart).fold(0.0, f64::max) < 0.01);
}

/// The posture controller starts where the robot is and stays within the limits of its trajectory.
#[test]
fn the_posture_controller_moves_an_arm_within_its_limits() {
    let start = "[start]\njoints = { j_arm1_1 = 0.0, j_arm2_4 = -1.2 }\n";
    let text = hold(4.0, "posture").replace("[[operator]]", &format!("{start}[[operator]]"));
    let (seen, outcome) = run("centauro_upper", &text, &[("motion.acceleration", "3.0"), ("motion.velocity", "0.1")]);
    assert_eq!((outcome.fell_at_s, &outcome.safe_state), (None, &None));
    assert_eq!(seen.modes(), [ControllerTick::MODE_STAND_UP, ControllerTick::MODE_STANCE]);
    let (_, model) = simulator("centauro_upper");
    for (before, after) in seen.commands.iter().zip(&seen.commands[1..]) {
        for (j, joint) in model.joints.iter().enumerate() {
            assert!(after.qd_des[j].abs() <= 0.1 * joint.velocity * (1.0 + 1e-12), "{}", joint.name);
            assert!((after.qd_des[j] - before.qd_des[j]).abs() <= 3e-3 * (1.0 + 1e-9), "{}", joint.name);
        }
    }
    let j = model.joint("j_arm1_1").unwrap().index();
    assert!((seen.commands[0].q_des[j]).abs() < 1e-5 && (seen.commands.last().unwrap().q_des[j] - 0.5).abs() < 1e-12);
}

/// A posture within the limits of the arms, rad.
fn second_posture(joint: &str) -> f64 {
    match joint {
        "j_arm1_1" => -1.2,
        "j_arm1_2" => 0.4,
        "j_arm2_2" => -0.4,
        "j_arm1_4" | "j_arm2_4" => -1.5,
        _ => 0.0,
    }
}

/// A change of the posture while the robot moves continues from the present references, without a step.
#[test]
fn a_new_posture_is_followed_from_the_present_references() {
    let change = "[[parameter]]\nt_s = 1.0\nkey = \"motion.posture\"\nvalue = \"second\"\n";
    let start = "[start]\njoints = { j_arm1_1 = -1.5 }\n";
    let text = hold(4.0, "posture").replace("[[operator]]", &format!("{start}[[operator]]")) + change;
    let (sim, model) = simulator("centauro_upper");
    // The nominal posture has j_arm1_1 at 0.5 rad.
    let second: Vec<String> = sim.joints().iter().map(|joint| format!("{joint} = {}", second_posture(joint))).collect();
    let mut info = description("centauro_upper", &[("motion.velocity", "0.2")]);
    let params = format!("{}\n[robot.postures.second]\n{}\n", info.params(), second.join("\n"));
    info.components[0] = ComponentInfo::new("posture", &params);
    let (seen, outcome) = run_with(info, &text);
    assert_eq!(outcome.safe_state, None);
    let j = model.joint("j_arm1_1").unwrap().index();
    let of = |k: usize| (seen.commands[k].q_des[j], seen.commands[k].qd_des[j]);
    assert!(of(999).1 > 0.5, "{:?}", of(999));
    for k in 990..1100 {
        assert!((of(k + 1).1 - of(k).1).abs() <= 2e-3 * (1.0 + 1e-9) && (of(k + 1).0 - of(k).0).abs() < 1e-3);
    }
    assert!((seen.commands.last().unwrap().q_des[j] - second_posture("j_arm1_1")).abs() < 1e-12);
}

/// `hoof sim --prove`: the log of each robot in the shipped scenario replays bit for bit. Writes the real-time factor with log to the output of the test.
#[test]
fn the_log_of_each_robot_replays_bit_for_bit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let scenario = root.join("scenarios/hold.toml");
    for robot in ROBOTS {
        let toml = root.join(format!("robots/{robot}/{robot}.toml")).display().to_string();
        let job = Job {
            robot: &toml,
            scenario: &scenario,
            seconds: Some(3.0),
            seed: None,
            preset: None,
            gaits: &[],
            set: &["hold.duration=0.5".to_owned()],
            components: Components::default(),
        };
        let setup = Setup { prove: Some(2), ..Setup::read(&job).unwrap() };
        let log = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("hold_{robot}.mcap"));
        let summary = setup.simulate(&log, &Build::default(), &mut |_| {}).unwrap();
        assert_eq!((summary.fell, summary.proved, summary.ticks), (false, Some(true), 3000), "{robot}");
        assert_eq!((&summary.safe_state, summary.robot.as_str()), (&None, robot));
    }
}
