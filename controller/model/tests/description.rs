//! Descriptions of a wheeled-legged robot, a humanoid and quadrupeds, and the errors of a description.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use robot_model::description::*;
use robot_model::*;
use test_support::replace_once;

const CENTAURO: &str = include_str!("../../../robots/centauro/centauro.toml");
const CENTAURO_URDF: &str = include_str!("../../../robots/centauro/centauro.urdf");
const COMAN_PLUS: &str = include_str!("../../../robots/coman_plus/coman_plus.toml");
const COMAN_PLUS_URDF: &str = include_str!("../../../robots/coman_plus/coman_plus.urdf");
const HYQ: &str = include_str!("../../../robots/hyq/hyq.toml");
const HYQ_URDF: &str = include_str!("../../../robots/hyq/hyq.urdf");

fn tree(urdf: &str) -> UrdfTree {
    UrdfTree::parse(urdf, "urdf").unwrap()
}

fn read(text: &str, urdf: &str) -> Result<RobotDescription, DescriptionError> {
    RobotDescription::from_toml(text, "robot.toml", &tree(urdf))
}

fn names<'a>(joints: &[JointId], model: &'a Model) -> Vec<&'a str> {
    joints.iter().map(|joint| model.joints[joint.index()].name.as_str()).collect()
}

#[test]
fn centauro_has_wheels_hands_legs_and_arms() {
    let tree = tree(CENTAURO_URDF);
    let robot = RobotDescription::from_toml(CENTAURO, "centauro.toml", &tree).unwrap();
    let model = robot.model(&tree).unwrap();
    assert_eq!((robot.base, model.nv(), robot.joints.len(), robot.force_torque.len()), (Base::Floating, 45, 39, 2));
    let wheel = ContactGeometry::Wheel { radius: 0.078, axis: [0.0, 0.0, 1.0] };
    assert_eq!(robot.contacts.iter().filter(|contact| contact.geometry == wheel).count(), 4);
    assert_eq!(robot.contacts.iter().map(|contact| contact.geometry.force_size()).sum::<usize>(), 18);
    let legs: Vec<&Group> = robot.groups.iter().filter(|group| group.kind == GroupKind::Leg).collect();
    assert_eq!(legs.iter().map(|leg| leg.joints.len()).collect::<Vec<_>>(), [6; 4]);
    assert_eq!(
        names(&robot.group("leg_3").unwrap().joints, &model),
        ["hip_yaw_3", "hip_pitch_3", "knee_pitch_3", "ankle_pitch_3", "ankle_yaw_3", "j_wheel_3"]
    );
    assert_eq!(robot.group("arm_2").unwrap().joints.len(), 7);
    assert_eq!(robot.joints_of(JointRole::Actuated).count(), 39);
    // Every joint is in exactly one group.
    let mut grouped: Vec<usize> = robot.groups.iter().flat_map(|g| &g.joints).map(|joint| joint.index()).collect();
    grouped.sort_unstable();
    assert_eq!(grouped, (0..39).collect::<Vec<_>>());
}

/// In its posture `nominal` the wheels stand upright at the corners of a square of 0.7 m, and the axes of the wheels are horizontal.
#[test]
fn centauro_stands_on_its_wheels() {
    let tree = tree(CENTAURO_URDF);
    let robot = RobotDescription::from_toml(CENTAURO, "centauro.toml", &tree).unwrap();
    let model = robot.model(&tree).unwrap();
    let home = robot.posture(NOMINAL).unwrap();
    let q: Vec<f64> = model.joints.iter().map(|joint| home[&joint.name]).collect();
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState::identity(), &q, &vec![0.0; model.nj()]);
    for (k, [x, y]) in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].into_iter().enumerate() {
        let wheel = model.frame(&robot.contacts[k].link).unwrap();
        let (p, R) = (kin.p_WF(&model, wheel), kin.R_WF(&model, wheel));
        assert!((p.x - 0.349 * x).abs() < 0.01 && (p.y - 0.350 * y).abs() < 0.01, "{p}");
        assert!((p.z - kin.p_WF(&model, model.frame("wheel_1").unwrap()).z).abs() < 2e-3, "{p}");
        // The axis is z of the link.
        assert!(R[(2, 2)].abs() < 1e-3, "{R}");
    }
}

#[test]
fn the_limits_of_the_description_are_used_and_compared() {
    let tree = tree(CENTAURO_URDF);
    let robot = RobotDescription::from_toml(CENTAURO, "centauro.toml", &tree).unwrap();
    let differences = robot.differences(&tree);
    assert_eq!(differences.len(), 48, "effort and velocity of 24 joints");
    let wheel: Vec<(&str, f64, f64)> = differences
        .iter()
        .filter(|found| found.joint == "j_wheel_4")
        .map(|found| (found.quantity.as_str(), found.urdf, found.description))
        .collect();
    assert_eq!(wheel, [("effort", 23.0, 35.0), ("velocity", 1.0, 20.0)]);
    let model = robot.model(&tree).unwrap();
    let wheel = &model.joints[model.joint("j_wheel_4").unwrap().index()];
    assert_eq!((wheel.effort, wheel.velocity, wheel.lower), (35.0, 20.0, f64::NEG_INFINITY));
    let arm = &model.joints[model.joint("j_arm1_7").unwrap().index()];
    assert_eq!(arm.effort, 28.32, "not in the description");
}

/// A wheel without `<limit>` has no limits of its own, and can run.
#[test]
fn a_continuous_joint_without_limits_drives() {
    let urdf = CENTAURO_URDF.replace("    <limit effort=\"23.0\" velocity=\"1.0\"/>\n", "");
    let tree = tree(&urdf);
    let robot = RobotDescription::from_toml(CENTAURO, "centauro.toml", &tree).unwrap();
    assert_eq!(robot.differences(&tree).len(), 40, "a limit that the URDF does not have is no difference");
    for model in [robot.model(&tree).unwrap(), Model::new(&tree, Base::Floating).unwrap()] {
        check_runnable(&model, &vec![0.0; model.nj()]).unwrap();
    }
    assert_eq!(robot.model(&tree).unwrap().joints[38].effort, 35.0);
}

#[test]
fn coman_plus_has_soles() {
    let tree = tree(COMAN_PLUS_URDF);
    let robot = RobotDescription::from_toml(COMAN_PLUS, "coman_plus.toml", &tree).unwrap();
    let sole = robot.contact("left_sole").unwrap();
    assert_eq!(sole.geometry, ContactGeometry::Sole { x: [-0.1035, 0.107], y: [-0.055, 0.055] });
    assert_eq!((sole.link.as_str(), sole.geometry.force_size(), robot.force_torque.len()), ("l_sole", 6, 4));
    let sizes: Vec<usize> = robot.groups.iter().map(|group| group.joints.len()).collect();
    assert_eq!((sizes, robot.joints.len()), (vec![6, 6, 7, 7, 2], 28));
    // In the posture `nominal` the soles are 0.959 m below an upright waist, and its pitch angles add up to 0.06 rad.
    let model = robot.model(&tree).unwrap();
    let home = robot.posture(NOMINAL).unwrap();
    let q: Vec<f64> = model.joints.iter().map(|joint| home.get(&joint.name).copied().unwrap_or(0.0)).collect();
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState::identity(), &q, &vec![0.0; model.nj()]);
    for name in ["left_sole", "right_sole"] {
        let frame = model.frame(&robot.contact(name).unwrap().link).unwrap();
        let (p, R) = (kin.p_WF(&model, frame), kin.R_WF(&model, frame));
        assert!((p.z + 0.959).abs() < 1e-3 && (p.x + 0.088).abs() < 1e-3 && (R[(0, 2)] - 0.06).abs() < 1e-3, "{p} {R}");
    }
}

/// The virtual frame adds six joints at the end, without mass: the other rows and columns of the mass matrix keep their bits, and a step along each
/// virtual joint moves the frame by it.
#[test]
fn a_virtual_frame_adds_six_joints_without_mass() {
    let tree = tree(CENTAURO_URDF);
    let robot = RobotDescription::from_toml(CENTAURO, "centauro.toml", &tree).unwrap();
    let (plain, model) = (robot.model(&tree).unwrap(), robot.virtual_model(&tree).unwrap());
    assert_eq!((plain.nv(), model.nv(), model.total_mass().to_bits()), (45, 51, plain.total_mass().to_bits()));
    let last: Vec<&str> = model.joints[39..].iter().map(|joint| joint.name.as_str()).collect();
    let names = ["car_frame_tx", "car_frame_ty", "car_frame_tz", "car_frame_rx", "car_frame_ry", "car_frame_rz"];
    assert_eq!(last, names);
    let mut q: Vec<f64> = plain.joints.iter().map(|joint| robot.posture(NOMINAL).unwrap()[&joint.name]).collect();
    let M_of = |model: &Model, q: &[f64]| {
        let mut kin = Kinematics::new(model);
        kin.update(model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
        let mut M = nalgebra::DMatrix::zeros(model.nv(), model.nv());
        mass_matrix(model, &kin, &mut M);
        (kin, M)
    };
    let (_, small) = M_of(&plain, &q);
    q.extend([0.1, 0.2, 0.3, 0.0, 0.0, 0.5]);
    let (kin, large) = M_of(&model, &q);
    assert_eq!(large.view((0, 0), (45, 45)), small.view((0, 0), (45, 45)));
    assert!(large.view((45, 0), (6, 51)).iter().all(|x| *x == 0.0));
    let frame = model.frame("car_frame").unwrap();
    let (p, R) = (kin.p_WF(&model, frame), kin.R_WF(&model, frame));
    assert!((p - nalgebra::Vector3::new(0.1, 0.2, 0.3)).norm() < 1e-15, "{p}");
    assert!((R[(1, 0)] - robot_model::math::sin(0.5)).abs() < 1e-15, "{R}");
    let bad = CENTAURO.replace("name = \"car_frame\"", "name = \"pel\"");
    assert!(
        matches!(read(&bad, CENTAURO_URDF), Err(DescriptionError::BadValue { key, .. }) if key == "robot.virtual_frame.name")
    );
}

/// The keys of a quadruped are four point contacts, four legs, an IMU and two postures.
#[test]
fn a_quadruped_is_four_point_contacts() {
    let tree = tree(HYQ_URDF);
    let robot = RobotDescription::from_toml(HYQ, "hyq.toml", &tree).unwrap();
    let model = robot.model(&tree).unwrap();
    let contacts: Vec<(&str, &str)> = robot.contacts.iter().map(|c| (c.name.as_str(), c.link.as_str())).collect();
    assert_eq!(contacts, [("LF", "lf_foot"), ("RF", "rf_foot"), ("LH", "lh_foot"), ("RH", "rh_foot")]);
    assert!(robot.contacts.iter().all(|c| c.geometry == ContactGeometry::Point { radius: 0.02175 }));
    assert_eq!(names(&robot.group("RH").unwrap().joints, &model), ["rh_haa_joint", "rh_hfe_joint", "rh_kfe_joint"]);
    assert_eq!(robot.imus, [Sensor { name: "imu".into(), link: "trunk_imu".into() }]);
    assert_eq!((robot.posture("nominal").unwrap().len(), robot.posture("lying").unwrap().len()), (12, 12));
    assert_eq!(robot.posture("lying").unwrap()["lf_kfe_joint"], -2.44);
    assert!(robot.differences(&tree).is_empty());
    let with_drives =
        replace_once(HYQ, "[robot.lying]", "[robot.drives]\nlf_haa_joint = { power = 300.0 }\n[robot.lying]");
    let robot = RobotDescription::from_toml(&with_drives, "hyq.toml", &tree).unwrap();
    assert_eq!(robot.model(&tree).unwrap().joints[0].drive.power, 300.0);
    let error = read(&replace_once(&with_drives, "power = 300.0", "power = 0"), HYQ_URDF).unwrap_err();
    assert!(
        matches!(&error, DescriptionError::BadValue { key, .. } if key == "robot.drives.lf_haa_joint.power"),
        "{error}"
    );
    for (table, key) in [("[robot.posture]", "robot.posture"), ("[robot.lying]", "robot.lying")] {
        let error = read(&replace_once(HYQ, table, &format!("{table}\nknee = 0.0")), HYQ_URDF).unwrap_err();
        assert!(matches!(&error, DescriptionError::Unknown { key: found, .. } if found == key), "{error}");
    }
    let anymal = include_str!("../../../robots/anymal_b/anymal_b.toml");
    assert_eq!(read(anymal, include_str!("../../../robots/anymal_b/anymal_b.urdf")).unwrap().groups.len(), 4);
}

#[test]
fn a_quadruped_has_further_groups_beside_its_legs() {
    let text = format!(
        "{HYQ}\n[[robot.group]]\nname = \"hips\"\nkind = \"chain\"\njoints = [\"lf_haa_joint\", \"rf_haa_joint\"]\n"
    );
    let robot = read(&text, HYQ_URDF).unwrap();
    assert_eq!(
        robot.groups.iter().map(|group| group.name.as_str()).collect::<Vec<_>>(),
        ["LF", "RF", "LH", "RH", "hips"]
    );
    let error = read(&replace_once(&text, "\"hips\"", "\"LF\""), HYQ_URDF).unwrap_err();
    assert!(matches!(&error, DescriptionError::Duplicate { name, .. } if name == "LF"), "{error}");
}

#[test]
fn disabled_collisions_are_pairs_of_two_links_of_the_robot() {
    let with = |pairs: &str| read(&format!("{HYQ}\n[robot.disabled_collisions]\n{pairs}\n"), HYQ_URDF);
    let robot = with("trunk = [\"lf_upperleg\", \"lf_foot\"]\nlf_foot = [\"rf_foot\"]").unwrap();
    let pairs: Vec<String> = robot.disabled_collisions.iter().map(|pair| pair.join(" ")).collect();
    assert_eq!(pairs, ["lf_foot rf_foot", "lf_foot trunk", "lf_upperleg trunk"]);
    for (pairs, key, name) in [
        ("trnk = [\"lf_foot\"]", "robot.disabled_collisions", "trnk"),
        ("trunk = [\"toe\"]", "robot.disabled_collisions.trunk", "toe"),
    ] {
        let DescriptionError::Unknown { key: found, name: unknown, .. } = with(pairs).unwrap_err() else {
            panic!("{pairs}")
        };
        assert_eq!((found.as_str(), unknown.as_str()), (key, name));
    }
    let error = with("trunk = [\"trunk\"]").unwrap_err();
    assert!(matches!(&error, DescriptionError::BadValue { found, .. } if found == "trunk"), "{error}");
    let error = with("trunk = [\"lf_foot\"]\nlf_foot = [\"trunk\"]").unwrap_err();
    assert!(
        matches!(&error, DescriptionError::Duplicate { name, .. } if name == "lf_foot" || name == "trunk"),
        "{error}"
    );
}

#[test]
fn roles_gains_and_fixed_bases_are_read() {
    let joints = "[robot.joints]\ntorso_yaw = { role = \"passive\" }\nj_arm1_1 = { stiffness = 500.0, damping = 10.0 }\nhip_yaw_1 = { role = \"virtual\" }\n";
    let text = format!("[robot]\nname = \"upper\"\nurdf = \"centauro.urdf\"\nbase = \"fixed\"\n{joints}");
    let tree = tree(CENTAURO_URDF);
    let robot = RobotDescription::from_toml(&text, "upper.toml", &tree).unwrap();
    assert_eq!(robot.model(&tree).unwrap().nv(), 39);
    let of = |role| robot.joints_of(role).map(|joint| joint.name.as_str()).collect::<Vec<_>>();
    assert_eq!((of(JointRole::Passive), of(JointRole::Virtual)), (vec!["torso_yaw"], vec!["hip_yaw_1"]));
    let arm = robot.joints.iter().find(|joint| joint.name == "j_arm1_1").unwrap();
    assert_eq!((arm.stiffness, arm.damping, arm.effort), (Some(500.0), Some(10.0), None));
}

#[test]
fn names_that_do_not_exist_are_errors_with_similar_ones() {
    for (from, to, key, what, near) in [
        ("link = \"wheel_2\"", "link = \"wheel_5\"", "robot.contact.wheel_2.link", "link", "wheel_2"),
        ("link = \"imu_link\"", "link = \"imu_lnk\"", "robot.imu.imu.link", "link", "imu_link"),
        ("joints = [\"torso_yaw\"]", "joints = [\"torso\"]", "robot.group.torso.joints", "movable joint", "torso_yaw"),
        (
            "root = \"torso_2\"\ntip = \"arm1_8\"",
            "root = \"torso\"\ntip = \"arm1_8\"",
            "robot.group.arm_1.root",
            "link",
            "torso_2",
        ),
        ("torso_yaw = 0.0", "torso_yow = 0.0", "robot.postures.nominal", "movable joint", "torso_yaw"),
        ("j_wheel_4 = { effort", "neck_yaw = { effort", "robot.joints", "movable joint", ""),
    ] {
        let error = read(&replace_once(CENTAURO, from, to), CENTAURO_URDF).unwrap_err();
        let DescriptionError::Unknown { file, key: k, what: w, near: n, .. } = &error else { panic!("{error}") };
        assert_eq!((file.as_str(), k.as_str(), *w), ("robot.toml", key, what), "{error}");
        assert!(near.is_empty() || n.iter().any(|name| name == near), "{error}");
    }
    let robot = read(CENTAURO, CENTAURO_URDF).unwrap();
    assert!(matches!(robot.contact("wheel_9"), Err(DescriptionError::Unknown { what: "contact", .. })));
    assert!(matches!(robot.group("leg"), Err(DescriptionError::Unknown { what: "group", .. })));
    assert!(matches!(robot.posture("nominl"), Err(DescriptionError::Unknown { what: "posture", .. })));
}

#[test]
fn unknown_keys_and_values_of_another_type_are_errors() {
    for (from, to, part) in [
        ("base = \"floating\"", "base = \"flying\"", "flying"),
        ("base = \"floating\"", "bass = \"floating\"", "bass"),
        ("kind = \"chain\"", "kind = \"tail\"", "tail"),
        (
            "geometry.hand = { radius = 0.05 }\n\n[[robot.group]]",
            "geometry.hook = { radius = 0.05 }\n\n[[robot.group]]",
            "hook",
        ),
        ("j_wheel_4 = { effort", "j_wheel_4 = { efort", "efort"),
        ("torso_yaw = 0.0", "torso_yaw = \"zero\"", "zero"),
        ("base = \"floating\"", "base = \"floating\"\n[trunk]\nkpp = 1\n[robot.unused]", "unused"),
    ] {
        let error = read(&replace_once(CENTAURO, from, to), CENTAURO_URDF).unwrap_err();
        let DescriptionError::Parse { file, reason } = &error else { panic!("{error}") };
        assert!(file == "robot.toml" && reason.contains(part), "{error}");
    }
    // Other tables belong to controllers, which read and check them.
    assert!(read(&format!("{CENTAURO}\n[trunk]\nkpp = 1\n"), CENTAURO_URDF).is_ok());
    assert!(matches!(read("[gait]\nduty = 1", HYQ_URDF), Err(DescriptionError::Parse { .. })));
    assert!(matches!(read("[robot", HYQ_URDF), Err(DescriptionError::Parse { .. })));
}

#[test]
fn values_out_of_range_are_errors_with_their_key() {
    let hand = "geometry.hand = { radius = 0.05 }\n\n[[robot.group]]";
    let with_hand = |geometry: &str| format!("geometry.{geometry}\n\n[[robot.group]]");
    for (from, to, key) in [
        (hand, with_hand("hand = { radius = -1 }"), "robot.contact.hand_2.geometry.hand.radius"),
        (hand, with_hand("point = { radius = nan }"), "robot.contact.hand_2.geometry.point.radius"),
        (hand, with_hand("wheel = { radius = 0, axis = [0, 0, 1] }"), "robot.contact.hand_2.geometry.wheel.radius"),
        (hand, with_hand("wheel = { radius = 1, axis = [0, 0, 0] }"), "robot.contact.hand_2.geometry.wheel.axis"),
        (hand, with_hand("sole = { x = [1, -1], y = [0, 1] }"), "robot.contact.hand_2.geometry.sole.x"),
        ("torso_yaw = 0.0", "torso_yaw = 3.0".into(), "robot.postures.nominal.torso_yaw"),
        ("torso_yaw = 0.0", "torso_yaw = nan".into(), "robot.postures.nominal.torso_yaw"),
        ("j_wheel_4 = { effort = 35.0", "j_wheel_4 = { effort = 0.0".into(), "robot.joints.j_wheel_4.effort"),
        ("j_wheel_4 = { ", "j_wheel_4 = { power = 0.0, ".into(), "robot.joints.j_wheel_4.power"),
        (
            "j_wheel_4 = { ",
            "j_wheel_4 = { rated_velocity = 3.0, no_load_velocity = 2.0, ".into(),
            "robot.joints.j_wheel_4.rated_velocity",
        ),
        (
            "j_wheel_4 = { effort = 35.0, velocity = 20.0, stiffness = 350.0",
            "j_wheel_4 = { effort = 35.0, velocity = 20.0, stiffness = -1.0".into(),
            "robot.joints.j_wheel_4.stiffness",
        ),
        ("joints = [\"torso_yaw\"]", "joints = []".into(), "robot.group.torso"),
        ("joints = [\"torso_yaw\"]", "tip = \"pelvis\"".into(), "robot.group.torso"),
        ("joints = [\"torso_yaw\"]", "joints = [\"torso_yaw\"]\ntip = \"torso_2\"".into(), "robot.group.torso"),
        (
            "root = \"torso_2\"\ntip = \"arm1_8\"",
            "root = \"torso_2\"\ntip = \"wheel_1\"".into(),
            "robot.group.arm_1.tip",
        ),
        ("base = \"floating\"", "imu_link = \"imu_link\"".into(), "robot.imu_link"),
        ("link = \"wheel_2\"", "link = \"wheel_1\"".into(), "robot.contact.wheel_2.link"),
        ("base = \"floating\"", "drives = { j_wheel_4 = { power = 300.0 } }".into(), "robot.drives"),
        ("base = \"floating\"", "feet = [\"wheel_1\", \"wheel_2\", \"wheel_3\", \"wheel_4\"]".into(), "robot.contact"),
    ] {
        let error = read(&replace_once(CENTAURO, from, &to), CENTAURO_URDF).unwrap_err();
        let DescriptionError::BadValue { file, key: found, .. } = &error else { panic!("{error}") };
        assert_eq!((file.as_str(), found.as_str()), ("robot.toml", key), "{error}");
    }
    for (from, to, key, name) in [
        ("name = \"wheel_2\"", "name = \"wheel_1\"", "robot.contact", "wheel_1"),
        ("name = \"leg_2\"", "name = \"leg_1\"", "robot.group", "leg_1"),
        ("name = \"arm2\"", "name = \"arm1\"", "robot.force_torque", "arm1"),
        (
            "joints = [\"torso_yaw\"]",
            "joints = [\"torso_yaw\", \"torso_yaw\"]",
            "robot.group.torso.joints",
            "torso_yaw",
        ),
    ] {
        let error = read(&replace_once(CENTAURO, from, to), CENTAURO_URDF).unwrap_err();
        let DescriptionError::Duplicate { key: k, name: n, .. } = &error else { panic!("{error}") };
        assert_eq!((k.as_str(), n.as_str()), (key, name), "{error}");
    }
}
