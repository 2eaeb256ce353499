//! Objects of a scenario against closed forms: they slide, are pushed, rest on fixtures, and are held and released by a link.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{description, run};
use controller::params::Params;
use drivers::run_info::{Run, describe};
use drivers::{DriverError, MujocoSim, Scenario, SimParams, Simulator, Terrain};
use lcmtypes::{GroundTruth, RobotCommand};
use replay::engine::Build;
use robot_model::{GRAVITY, UrdfTree};

fn scenario(robot: &str, text: &str) -> Result<Scenario, DriverError> {
    let info = description(robot, &[]);
    let head =
        "name = \"objects\"\nduration_s = 2.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n";
    Scenario::parse(&format!("{head}{text}"), "objects.toml", &Params::from_toml(info.params(), robot).unwrap().gait)
}

fn simulator(robot: &str, text: &str) -> Result<MujocoSim, DriverError> {
    let scenario = scenario(robot, text)?;
    let info = description(robot, &[]);
    let params = Params::from_toml(info.params(), robot).unwrap();
    let tree = UrdfTree::parse(&info.urdf, robot).unwrap();
    MujocoSim::new(&tree, &params.robot, Terrain::new(&scenario.terrain, 0), SimParams::of(&scenario))
}

/// A robot that stays out of the way: arms on a stand.
fn with(text: &str) -> MujocoSim {
    simulator("centauro_upper", text).unwrap()
}

fn steps(sim: &mut MujocoSim, n: usize) {
    (0..n).for_each(|_| sim.step().unwrap());
}

fn cube(mass: &str, friction: f64, p: [f64; 3], rpy: [f64; 3]) -> String {
    format!(
        "[[object]]\nname = \"cube\"\nshape = \"box\"\nsize_m = [0.2, 0.2, 0.2]\n{mass}\nfriction = {friction}\nposition_m = {p:?}\nrpy_rad = {rpy:?}\n"
    )
}

/// On a ramp a box slides if the angle is above atan(friction), with g (sin - friction cos), and stays below.
#[test]
fn a_box_slides_on_a_ramp_steeper_than_its_friction_angle() {
    let friction = 0.3_f64;
    for (angle, slides) in [(friction.atan() + 0.06, true), (friction.atan() - 0.06, false)] {
        let (sin, cos) = angle.sin_cos();
        let up = |h: f64| [3.0 + h * sin, 0.0, 3.0 + h * cos];
        let ramp = format!(
            "[[object]]\nname = \"ramp\"\nshape = \"box\"\nsize_m = [4.0, 1.0, 0.2]\nfriction = {friction}\nposition_m = {:?}\nrpy_rad = [0.0, {angle}, 0.0]\n",
            up(0.0)
        );
        let mut sim = with(&(ramp + &cube("mass_kg = 2.0", friction, up(0.2), [0.0, angle, 0.0])));
        let start = sim.object_pose("cube").unwrap().p;
        steps(&mut sim, 500);
        let way = (sim.object_pose("cube").unwrap().p - start).norm();
        let expected = 0.5 * GRAVITY * (sin - friction * cos) * 0.5 * 0.5;
        if slides {
            assert!((way / expected - 1.0).abs() < 0.05, "{way} m, expected {expected} m");
        } else {
            assert!(way < 0.002, "{way} m");
        }
    }
}

/// A push F moves a box by (F / m - friction g) t² / 2; a fixture does not move; another friction than that of the ground counts.
#[test]
fn a_push_moves_a_box_and_not_a_fixture() {
    let (m, friction, F) = (4.0, 0.2, 20.0);
    let at = [3.0, 0.0, 0.1];
    for (mass, expected) in [("mass_kg = 4.0", 0.5 * (F / m - friction * GRAVITY) * 0.25), ("", 0.0)] {
        let mut sim = with(&cube(mass, friction, at, [0.0; 3]));
        for _ in 0..500 {
            sim.clear_pushes();
            sim.add_push(Some("cube"), [F, 0.0, 0.0], [0.0; 3]).unwrap();
            sim.step().unwrap();
        }
        let way = sim.object_pose("cube").unwrap().p.x - 3.0;
        assert!((way - expected).abs() < 0.02 * expected.max(1e-6), "{way} m, expected {expected} m");
    }
}

/// A force F in the air: F / m beside the fall with g. A cylinder falls as a box does.
#[test]
fn in_the_air_an_object_moves_as_a_free_mass() {
    let cylinder = "[[object]]\nname = \"can\"\nshape = \"cylinder\"\nradius_m = 0.05\nlength_m = 0.2\nmass_kg = 0.5\nposition_m = [3.0, 0.0, 5.0]\n";
    let mut sim = with(cylinder);
    for _ in 0..400 {
        sim.clear_pushes();
        sim.add_push(Some("can"), [0.0, 2.0, 0.0], [0.0; 3]).unwrap();
        sim.step().unwrap();
    }
    let p = sim.object_pose("can").unwrap().p;
    // Semi-implicit steps: t (t + dt) / 2 instead of t² / 2.
    let t2 = 0.5 * 0.4 * 0.401;
    assert!((p.y - 2.0 / 0.5 * t2).abs() < 1e-6 && (p.z - 5.0 + GRAVITY * t2).abs() < 1e-6, "{p}");
    let mut truth = GroundTruth::default();
    sim.ground_truth(0, &mut truth);
    let [vx, vy, vz] = truth.v_WO[0];
    assert_eq!((truth.n_objects, truth.p_WO[0], truth.w_WO_W[0]), (1, p.into(), [0.0; 3]));
    assert_eq!(truth.q_WO_wxyz, [[1.0, 0.0, 0.0, 0.0]]);
    assert!(vx.abs() < 1e-9 && (vy - 2.0 / 0.5 * 0.4).abs() < 1e-9 && (vz + GRAVITY * 0.4).abs() < 1e-9, "{truth:?}");
}

#[test]
fn a_log_names_the_objects_of_its_scenario() {
    let text = cube("mass_kg = 1.0", 0.5, [3.0, 0.0, 1.0], [0.0; 3]);
    let (info, scenario) = (description("hyq", &[]), scenario("hyq", &text).unwrap());
    let run = Run {
        first: ("quadruped", "quadruped"),
        others: &[],
        robot: "hyq",
        urdf: &info.urdf,
        params: info.params(),
        scenario: (&scenario.name, &text),
        objects: &scenario.objects,
        seed: 0,
    };
    let info = describe(&run, &Build::default());
    assert_eq!((info.n_objects, info.objects), (1, vec!["cube".to_owned()]));
}

/// A plate 3 cm high under a foot lifts the foot, whether or not its leg has a floor of its own.
#[test]
fn a_leg_with_its_own_floor_stands_on_an_object() {
    let text =
        "name = \"plate\"\nduration_s = 1.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n";
    let foot = |text: &str| run("hyq", text, &[]).0.truth;
    let [x, y, _] = foot(&text.replace("1.0", "0.01"))[0].p_WF[0];
    let plate = format!(
        "[[object]]\nname = \"plate\"\nshape = \"box\"\nsize_m = [0.2, 0.2, 0.1]\nposition_m = [{x}, {y}, -0.02]\n"
    );
    let floor = "[[floor]]\nt_s = 100.0\nleg = \"LF\"\nheight_m = 0.1\n";
    for (rest, expected) in [(floor, 0.0), (&*plate, 0.03), (&*format!("{plate}{floor}"), 0.03)] {
        let height = foot(&format!("{text}{rest}")).last().unwrap().p_WF[0][2];
        assert!((height - expected).abs() < 0.003, "{rest}{height} m, expected {expected} m");
    }
}

/// A held object stays at its pose in the hand; released, it falls with g.
#[test]
fn a_hand_holds_an_object_and_releases_it() {
    let info = description("centauro_upper", &[]);
    let params = Params::from_toml(info.params(), "centauro_upper").unwrap();
    let tree = UrdfTree::parse(&info.urdf, "robot").unwrap();
    let robot = params.robot.description(&tree).unwrap();
    let X_WL = with("").link_pose("arm1_8").unwrap();
    // In front of the hand, so that it falls freely.
    let p_LO = X_WL.R.transpose() * nalgebra::Vector3::new(0.15, 0.0, 0.0);
    let p: [f64; 3] = (X_WL.p + X_WL.R * p_LO).into();
    let object = format!(
        "[[object]]\nname = \"ball\"\nshape = \"box\"\nsize_m = [0.04, 0.04, 0.04]\nmass_kg = 0.5\nposition_m = {p:?}\n"
    );
    let at: [f64; 3] = p_LO.into();
    let weld =
        format!("[[weld]]\nt_s = 0.0\nduration_s = 1.0\nlink = \"arm1_8\"\nobject = \"ball\"\nposition_m = {at:?}\n");
    let mut sim = with(&format!("{object}{weld}"));
    let q_des = sim.joints().iter().map(|joint| robot.postures["nominal"][joint]).collect();
    let gain =
        |of: fn(&robot_model::JointDescription) -> Option<f64>| robot.joints.iter().map(|j| of(j).unwrap()).collect();
    let mut command = RobotCommand::zeros(robot.joints.len());
    (command.mode, command.q_des) = (RobotCommand::MODE_TORQUE, q_des);
    (command.kp, command.kd) = (gain(|joint| joint.stiffness), gain(|joint| joint.damping));
    sim.apply(&command).unwrap();
    steps(&mut sim, 990);
    let X_WL = sim.link_pose("arm1_8").unwrap();
    let held = sim.object_pose("ball").unwrap();
    let error = (X_WL.p + X_WL.R * p_LO - held.p).norm();
    assert!(error < 0.005 && (X_WL.R.transpose() * held.R - nalgebra::Matrix3::identity()).norm() < 0.05, "{error} m");
    steps(&mut sim, 20);
    let released = sim.object_pose("ball").unwrap().p.z;
    steps(&mut sim, 300);
    let fall = released - sim.object_pose("ball").unwrap().p.z;
    // Released at 1 s: from 10 ms to 310 ms after it.
    let expected = 0.5 * GRAVITY * (0.31 * 0.31 - 0.01 * 0.01);
    assert!((fall / expected - 1.0).abs() < 0.05, "{fall} m, expected {expected} m");
}

#[test]
fn invalid_objects_and_welds_are_errors_with_their_key() {
    let ok = cube("mass_kg = 1.0", 0.5, [3.0, 0.0, 1.0], [0.0; 3]);
    let weld =
        "[[weld]]\nt_s = 0.0\nduration_s = 1.0\nlink = \"arm1_8\"\nobject = \"cube\"\nposition_m = [0.0, 0.0, 0.1]\n";
    for (text, key) in [
        (ok.replace("0.2, 0.2, 0.2", "0.2, 0.0, 0.2"), "object[1].size_m"),
        (ok.replace("size_m = [0.2, 0.2, 0.2]\n", ""), "object[1].shape"),
        (ok.replace("mass_kg = 1.0", "mass_kg = -1.0"), "object[1].mass_kg"),
        (format!("{ok}{ok}"), "object[2].name"),
        (ok.replace("cube", "cu\\u001b[2Jbe"), "object[1].name"),
        (ok.replace("mass_kg = 1.0", "") + weld, "weld[1].object"),
        (format!("{ok}{}", weld.replace("cube", "cup")), "weld[1].object"),
    ] {
        let error = scenario("centauro_upper", &text).unwrap_err();
        assert!(matches!(&error, DriverError::Value { key: found, .. } if found == key), "{key}: {error}");
    }
    let refused = |text: &str| simulator("centauro_upper", text).err().unwrap();
    let floor = "[[floor]]\nt_s = 1.0\nleg = \"hand_1\"\nheight_m = 0.1\n";
    for (text, key, name) in [
        (format!("{ok}{}", weld.replace("arm1_8", "arm9")), "weld.link", "arm9"),
        (format!("{floor}{}", floor.replace("hand_1", "tail")), "floor[2].leg", "tail"),
        (floor.replace("leg = \"hand_1\"", "contact = \"tail\""), "floor[1].contact", "tail"),
        ("[start]\njoints = { j_tail = 0.1 }\n".to_owned(), "start.joints", "j_tail"),
    ] {
        let error = refused(&text);
        let DriverError::Unknown { wanted_by, name: found, .. } = &error else { panic!("{error}") };
        assert_eq!((wanted_by.as_str(), found.as_str()), (key, name));
    }
    let error = refused(&ok.replace("cube", "arm1_8"));
    assert!(matches!(&error, DriverError::ObjectNamedAsLink { name } if name == "arm1_8"), "{error}");
    for floor in [floor.replace("leg = \"hand_1\"\n", ""), floor.replace("leg", "contact = \"hand_1\"\nleg")] {
        let error = scenario("centauro_upper", &floor).unwrap_err();
        assert!(matches!(&error, DriverError::Value { key, .. } if key == "floor[1].contact"), "{error}");
    }
}

/// The object of the first weld is 0.2 m from the pose: an error, not a simulation that diverges.
#[test]
fn a_weld_of_an_object_that_is_elsewhere_is_an_error() {
    let hand = with("").link_pose("arm1_8").unwrap().p;
    let text = |away: f64, t_s: f64| {
        let p = [hand.x + away, hand.y, hand.z];
        let object = "name = \"ball\"\nshape = \"box\"\nsize_m = [0.04, 0.04, 0.04]";
        let weld = "duration_s = 1.0\nlink = \"arm1_8\"\nobject = \"ball\"\nposition_m = [0.0, 0.0, 0.0]";
        format!("[[object]]\n{object}\nmass_kg = 0.5\nposition_m = {p:?}\n[[weld]]\nt_s = {t_s:?}\n{weld}\n")
    };
    let distance_of = |error: DriverError| match error {
        DriverError::FarWeld { number: 1, distance, .. } => distance,
        error => panic!("{error}"),
    };
    let found = distance_of(simulator("centauro_upper", &text(0.2, 0.0)).err().unwrap());
    assert!((found - 0.2).abs() < 1e-9, "{found}");
    assert!(simulator("centauro_upper", &text(0.04, 0.0)).is_ok());
    // Later in the run the object has fallen.
    let mut sim = with(&text(0.0, 0.5));
    let failed = (0..510).find_map(|_| sim.step().err()).map(distance_of);
    assert!(failed.is_some_and(|distance| distance > 0.05), "{failed:?}");
}

/// A robot with a fixed base at rest: the accelerometer reads what holds it against gravity, in the frame of the IMU.
#[test]
fn an_imu_on_a_fixed_base_reads_gravity() {
    let mut state = lcmtypes::RobotState::default();
    with("").robot_state(0, 0, &mut state);
    let R_WI = robot_model::math::quaternion::to_rotation(state.q_WI_wxyz[0]);
    let a_W = R_WI * nalgebra::Vector3::from(state.a_I[0]);
    assert!(
        (a_W - nalgebra::Vector3::new(0.0, 0.0, GRAVITY)).norm() < 2e-3,
        "{a_W}, resolution of the sensor 1/1024 m/s²"
    );
}
