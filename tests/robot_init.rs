//! `hoof robot init`: the parameter file that it writes for a URDF makes the robot stand and trot.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof, messages};
use lcmtypes::{ControllerTick, channels};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const PONY: &str = include_str!("data/pony.urdf");

/// Writes a parameter file for a URDF; returns it as TOML, with its path.
fn init(urdf: &str, out: &Path) -> (toml::Table, PathBuf) {
    let report = hoof(&format!("robot init {urdf} --out {} --json", out.display())).exits(0).json();
    let path = PathBuf::from(report["toml"].as_str().unwrap());
    (std::fs::read_to_string(&path).unwrap().parse().unwrap(), path)
}

/// Stands for a second, then trots forward.
fn trots(toml: &Path, out: &Path, name: &str) {
    let scenario = out.join(format!("{name}_walk.toml"));
    let text = "duration_s = 5.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n\
                [[operator]]\nt_s = 1.0\nmode = \"walk\"\nv_x = 0.2\n";
    std::fs::write(&scenario, format!("name = \"{name}_walk\"\n{text}")).unwrap();
    let log = out.join(format!("{name}.mcap"));
    let (toml, scenario) = (toml.display(), scenario.display());
    let run = hoof(&format!("sim --robot {toml} --scenario {scenario} --log {} --json", log.display())).exits(0).json();
    assert_eq!((&run["fell"], &run["safe_state"]), (&json!(false), &json!(null)), "{run}");
    assert!(run["distance_m"].as_f64().unwrap() > 0.4, "{run}");
}

#[test]
fn a_robot_with_other_names_axes_and_leg_order_stands_and_trots() {
    let out = folder("pony");
    let (toml, path) = init("tests/data/pony.urdf", &out);
    let robot = &toml["robot"];
    assert_eq!(path.file_name().unwrap(), "pony_1.toml");
    let toes = ["front_left_toe", "front_right_toe", "rear_left_toe", "rear_right_toe"];
    assert_eq!(robot["feet"].as_array().unwrap().iter().map(|foot| foot.as_str().unwrap()).collect::<Vec<_>>(), toes);
    assert_eq!((robot["imu_link"].as_str(), robot["foot_radius"].as_float()), (Some("imu_sensor"), Some(0.02)));
    assert_eq!(std::fs::read_to_string(out.join("pony.urdf")).unwrap(), PONY);

    // The knee is straightest 0.05 rad inside its limit of 0.9: 85 % of 0.4 m cos(0.475) below the hips, which are 0.13 m to the side.
    let q: Value = serde_json::to_value(&robot["posture"]).unwrap();
    let state = out.join("state.json");
    std::fs::write(&state, json!({ "base": null, "q": q }).to_string()).unwrap();
    let frames = hoof(&format!("robot eval {} --state {}", path.display(), state.display())).exits(0).json();
    for (toe, (x, y)) in toes.iter().zip([(0.18, 0.13), (0.18, -0.13), (-0.18, 0.13), (-0.18, -0.13)]) {
        let p = &frames["frames"][toe]["position_m"];
        let expected = [x, y, -0.85 * 0.4 * 0.475_f64.cos()];
        for k in 0..3 {
            // Angles are rounded to 0.1 mrad.
            assert!((p[k].as_f64().unwrap() - expected[k]).abs() < 1e-4, "{toe}: {p}, expected {expected:?}");
        }
    }
    trots(&path, &out, "pony");
    gets_up_and_sits_down(&path, &out, "pony");
}

/// Lies, stands up, and sits down again.
fn gets_up_and_sits_down(toml: &Path, out: &Path, name: &str) {
    let scenario = out.join(format!("{name}_lie.toml"));
    let text = "duration_s = 18.0\n[terrain]\nkind = \"flat\"\n[start]\nposture = \"lying\"\n[[operator]]\nt_s = 0.0\nmode = \"idle\"\n\
                [[operator]]\nt_s = 0.5\nmode = \"stand\"\n[[operator]]\nt_s = 10.0\nmode = \"sit\"\n";
    std::fs::write(&scenario, format!("name = \"{name}_lie\"\n{text}")).unwrap();
    let log = out.join(format!("{name}_lie.lcmlog"));
    let arguments = format!("--robot {} --scenario {} --log {}", toml.display(), scenario.display(), log.display());
    let run = hoof(&format!("sim {arguments} --json")).exits(0).json();
    assert_eq!((&run["fell"], &run["safe_state"]), (&json!(false), &json!(null)), "{run}");
    let mut modes: Vec<i8> =
        messages::<ControllerTick>(&log, channels::CONTROLLER_TICK).iter().map(|tick| tick.mode).collect();
    modes.dedup();
    let [idle, up, stance, sit] = [
        ControllerTick::MODE_IDLE,
        ControllerTick::MODE_STAND_UP,
        ControllerTick::MODE_STANCE,
        ControllerTick::MODE_SIT,
    ];
    assert_eq!(modes, [idle, up, stance, sit], "{run}");
}

/// A base_footprint, an arm, meshes, feet off their links, and placeholder limits: the changed copy describes the same robot and walks.
#[test]
fn what_controller_and_simulator_cannot_use_is_changed_in_a_copy() {
    let out = folder("changed");
    let mesh = "<geometry><mesh filename=\"package://none/body.stl\"/></geometry>";
    let arm = "<link name=\"arm\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"0.3\"/>\
               <inertia ixx=\"0.001\" iyy=\"0.001\" izz=\"0.001\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\
               <joint name=\"elbow\" type=\"revolute\"><origin xyz=\"0.1 0 0.06\"/><parent link=\"chassis\"/><child link=\"arm\"/>\
               <axis xyz=\"0 1 0\"/><limit lower=\"-3\" upper=\"-0.2\" effort=\"9\" velocity=\"9\"/></joint>";
    let footprint = "<link name=\"base_footprint\"/><joint name=\"base_joint\" type=\"fixed\"><origin xyz=\"0 0 1\"/>\
                     <parent link=\"base_footprint\"/><child link=\"chassis\"/></joint>";
    let mut urdf = PONY.replace("<robot name=\"Pony 1\">", &format!("<robot name=\"Pony 1\">{footprint}{arm}"));
    for (from, to) in [
        ("effort=\"33\" velocity=\"20\"", "effort=\"1000\" velocity=\"1000\""),
        ("<geometry><box size=\"0.38 0.19 0.11\"/></geometry>", mesh),
        ("<geometry><box size=\"0.03 0.02 0.2\"/></geometry>", mesh),
        ("<geometry><box size=\"0.016 0.016 0.19\"/></geometry>", mesh),
        ("<collision>\n      <geometry><sphere", "<collision><origin xyz=\"0 0 0.02\"/>\n      <geometry><sphere"),
    ] {
        assert!(urdf.contains(from), "the URDF has no {from}");
        urdf = urdf.replace(from, to);
    }
    let source = out.join("source.urdf");
    std::fs::write(&source, &urdf).unwrap();
    let init = format!("robot init {} --out {} --name pony --json", source.display(), out.join("pony").display());
    let report = hoof(&format!("{init} --fix elbow=-1")).exits(0).json();
    let said = report["look_at"].to_string();
    for part in ["base_footprint", "elbow", "fixed at -1", "chassis", "front_left_toe", "0.0200 m", "rear_left_bend"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(std::fs::read_to_string(&source).unwrap(), urdf, "the source is unchanged");
    let path = PathBuf::from(report["toml"].as_str().unwrap());
    let toml: toml::Table = std::fs::read_to_string(&path).unwrap().parse().unwrap();
    assert_eq!(toml["robot"]["urdf"].as_str(), Some("pony.urdf"));

    let info = hoof(&format!("robot info {} --json", path.display())).exits(0).json();
    let original = hoof(&format!("robot info {} --json", source.display())).exits(0).json();
    assert_eq!((&info["dof"], &original["dof"]), (&json!(12), &json!(13)));
    assert!((info["mass_kg"].as_f64().unwrap() - original["mass_kg"].as_f64().unwrap()).abs() < 1e-12);
    assert_eq!(info["links"][0]["name"], json!("chassis"));
    assert!(!info["warnings"].to_string().contains("toe"), "{info}");
    for joint in info["joints"].as_array().unwrap() {
        let [effort, velocity] = ["effort", "velocity"].map(|key| joint[key].as_f64().unwrap());
        // 14 kg on legs of 0.36 m: half of 49 N m.
        assert!((20.0..30.0).contains(&effort) && velocity == 40.0, "{joint}");
    }
    // The sphere is 0.02 m above the old origin of the toe, and the arm points up and forward.
    let frames = |robot: &Path, arm: f64| {
        let q: serde_json::Map<String, Value> =
            toml["robot"]["posture"].as_table().unwrap().keys().map(|joint| (joint.clone(), json!(1.0))).collect();
        let mut q = Value::Object(q);
        if robot == source {
            q["elbow"] = json!(arm);
        }
        let state = out.join("state.json");
        std::fs::write(&state, json!({ "base": null, "q": q }).to_string()).unwrap();
        hoof(&format!("robot eval {} --state {}", robot.display(), state.display())).exits(0).json()
    };
    let (new, old) = (frames(&path, 0.0), frames(&source, -1.0));
    for k in 0..3 {
        let com = |of: &Value| of["com_m"][k].as_f64().unwrap();
        assert!((com(&new) - com(&old) + [0.0, 0.0, 1.0][k]).abs() < 1e-9, "{k}: {} {}", new["com_m"], old["com_m"]);
    }
    trots(&path, &out, "pony");
    gets_up_and_sits_down(&path, &out, "pony");

    let wrong = hoof(&format!("{init} --force --fix knee=1")).exits(2).stderr;
    assert!(wrong.contains("knee") && wrong.contains("elbow"), "{wrong}");
    hoof(&init).exits(2);
    let beside = hoof(&format!("robot init {} --name source --json", source.display())).exits(0).json();
    assert!(beside["urdf"].as_str().unwrap().ends_with("source_prepared.urdf"), "{beside}");
}

#[test]
fn the_files_for_hyq_and_anymal_agree_with_the_shipped_ones() {
    for name in ["hyq", "anymal_b"] {
        let out = folder(name);
        let (guessed, path) = init(&format!("robots/{name}/{name}.urdf"), &out);
        let shipped: toml::Table =
            std::fs::read_to_string(format!("robots/{name}/{name}.toml")).unwrap().parse().unwrap();
        for key in ["name", "urdf", "feet", "foot_radius", "imu_link"] {
            assert_eq!(guessed["robot"][key], shipped["robot"][key], "{name}: {key}");
        }
        // Hips and knees bend to the same side. Abduction is not compared: the shipped angles are a free choice.
        for (joint, angle) in shipped["robot"]["posture"].as_table().unwrap() {
            let bends = ["hfe", "kfe"].iter().any(|kind| joint.to_lowercase().contains(kind));
            let (ours, theirs) = (guessed["robot"]["posture"][joint].as_float().unwrap(), angle.as_float().unwrap());
            assert!(!bends || (ours - theirs).abs() < 0.4, "{name}: {joint} is {ours}, shipped {theirs}");
        }
        trots(&path, &out, name);
    }
}

/// Exit code 2, and an error with the file and the names of the joints or links.
#[test]
fn errors_name_the_joints_or_links() {
    let out = folder("errors");
    let refuses = |name: &str, edits: &[(&str, &str)], expected: &[&str]| {
        let urdf = edits.iter().fold(PONY.to_owned(), |urdf, (from, to)| {
            assert!(urdf.contains(from), "the URDF has no {from}");
            urdf.replace(from, to)
        });
        let path = out.join(name);
        std::fs::write(&path, urdf).unwrap();
        let error = hoof(&format!("robot init {}", path.display())).exits(2).stderr;
        for text in [&[name], expected].concat() {
            assert!(error.contains(text), "{error}\nexpected {text}");
        }
    };
    let fixed = ["abduct", "swing", "bend"].map(|joint| {
        let joint = format!("\"rear_left_{joint}\" type=");
        (format!("{joint}\"revolute\""), format!("{joint}\"fixed\""))
    });
    let fixed = fixed.each_ref().map(|(from, to)| (from.as_str(), to.as_str()));
    refuses("three.urdf", &fixed, &["3 chains", "rear_right_abduct"]);
    let stub =
        ("xyz=\"0 0 -0.2\"/>\n    <parent link=\"rear_right_lower\"", "/>\n    <parent link=\"rear_right_lower\"");
    refuses("stub.urdf", &[stub], &["rear_right_bend"]);
    let turned = ("xyz=\"-0.18 0.05 0\"", "xyz=\"0.19 0.05 0\"");
    refuses("turned.urdf", &[turned], &["front_left_toe", "rear_left_toe", "left front"]);
    let stiff = [
        ("lower=\"0.9\" upper=\"2.7\"", "lower=\"2.5\" upper=\"2.7\""),
        ("lower=\"-1\" upper=\"4\"", "lower=\"-1\" upper=\"-0.5\""),
    ];
    refuses("stiff.urdf", &stiff, &["front_left_toe", "front_left_abduct", "front_left_bend"]);
    // A joint without a range, as some exporters write it, and one without torque.
    let stuck = ("lower=\"0.9\" upper=\"2.7\"", "lower=\"1.5\" upper=\"1.5\"");
    refuses("stuck.urdf", &[stuck], &["front_left_toe", "front_left_bend"]);
    refuses("idle.urdf", &[("effort=\"33\"", "effort=\"0\"")], &["effort limit", "_abduct"]);
}

#[test]
fn an_existing_file_is_not_replaced() {
    let out = folder("twice");
    let (_, path) = init("tests/data/pony.urdf", &out);
    std::fs::write(&path, "mine").unwrap();
    let again = hoof(&format!("robot init tests/data/pony.urdf --out {}", out.display())).exits(2).stderr;
    assert!(again.contains("pony_1.toml") && again.contains("--force"), "{again}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    hoof(&format!("robot init tests/data/pony.urdf --out {} --force", out.display())).exits(0);

    // Nor is another URDF of the same name, whatever the name of the robot is.
    let urdf = out.join("pony.urdf");
    std::fs::write(&urdf, "mine").unwrap();
    let init = format!("robot init tests/data/pony.urdf --name other --out {}", out.display());
    let again = hoof(&init).exits(2).stderr;
    assert!(again.contains("pony.urdf") && again.contains("--force"), "{again}");
    assert_eq!(std::fs::read_to_string(&urdf).unwrap(), "mine");
    std::fs::write(&urdf, PONY).unwrap();
    hoof(&init).exits(0);
}
