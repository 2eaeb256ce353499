//! `hoof robot`: facts about a robot, and model quantities compared with Pinocchio's.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, folder, hoof, ran};
use controller::params::bounds;
use serde_json::{Value, json};
use std::io::Write;
use std::process::Stdio;
use test_support::replace_once;

/// Written by scripts/pinocchio_fixtures.py.
const HYQ: &str = include_str!("../controller/model/tests/data/hyq.json");

#[test]
fn hyq_has_its_mass_joints_and_feet() {
    let by_name = hoof("robot info hyq --json").exits(0).json();
    assert!((by_name["mass_kg"].as_f64().unwrap() - 86.774_005).abs() < 1e-9);
    assert_eq!((&by_name["name"], &by_name["dof"]), (&json!("hyq"), &json!(12)));
    assert_eq!(by_name["feet"], json!(["lf_foot", "rf_foot", "lh_foot", "rh_foot"]));
    let joints: Vec<&Value> = by_name["joints"].as_array().unwrap().iter().map(|joint| &joint["name"]).collect();
    let fixture: Value = serde_json::from_str(HYQ).unwrap();
    assert_eq!(json!(joints), fixture["joints"]);
    assert_eq!(hoof("robot info robots/hyq/hyq.toml --json").exits(0).json(), by_name);
    let by_urdf = hoof("robot info robots/hyq/hyq.urdf --json").exits(0).json();
    assert_eq!((&by_urdf["joints"], &by_urdf["mass_kg"]), (&by_name["joints"], &by_name["mass_kg"]));
    let text = hoof("robot info hyq").exits(0).stdout;
    for fact in ["86.774 kg", "12 joints", "lf_foot rf_foot lh_foot rh_foot"] {
        assert!(text.contains(fact), "{fact}: {text}");
    }
}

/// A robot that is not a quadruped is described; what only a quadruped has is an error that says so.
#[test]
fn centauro_has_contacts_groups_and_limits_that_differ_from_its_urdf() {
    let info = hoof("robot info centauro --json").exits(0).json();
    assert!((info["mass_kg"].as_f64().unwrap() - 94.969_089_18).abs() < 1e-9 && info["dof"] == 39);
    let wheels_and_hands = ["wheel_1", "wheel_2", "wheel_3", "wheel_4", "hand_1", "hand_2"];
    assert_eq!((&info["contacts"], &info["feet"]), (&json!(wheels_and_hands), &json!([])));
    assert_eq!((&info["groups"][0], info["groups"].as_array().unwrap().len()), (&json!("leg_1"), 7));
    let differences = info["differences"].as_array().unwrap();
    assert_eq!(differences.len(), 48);
    let wheel = json!({"joint": "j_wheel_1", "quantity": "velocity", "urdf": 1.0, "description": 20.0});
    assert!(differences.contains(&wheel));
    assert_eq!(hoof("robot info hyq --json").exits(0).json()["differences"], json!([]));
    let text = hoof("robot info centauro").exits(0).stdout;
    for fact in ["94.969 kg", "39 joints", "wheel_1", "arm_2", "20.000"] {
        assert!(text.contains(fact), "{fact}: {text}");
    }
    let params = hoof("robot info centauro --params").exits(0).stdout;
    assert!(params.contains("[hold]") && params.contains("[motion]") && !params.contains("[gait"), "{params}");
    hoof("sim --robot centauro --scenario scenarios/flat_trot.toml").exits(2);
}

/// A description with an unknown link, and a URDF in Latin-1.
#[test]
fn files_of_another_robot_are_read_and_checked() {
    let folder = folder("described");
    let toml = std::fs::read_to_string("robots/centauro/centauro.toml").unwrap();
    let urdf = std::fs::read("robots/centauro/centauro.urdf").unwrap();
    let file = folder.join("centauro.toml");
    std::fs::write(folder.join("centauro.urdf"), [urdf, b"<!-- ge\xe4ndert -->".to_vec()].concat()).unwrap();
    std::fs::write(&file, &toml).unwrap();
    hoof(&format!("robot info {}", file.display())).exits(0);
    std::fs::write(&file, replace_once(&toml, "link = \"wheel_3\"", "link = \"wheel_5\"")).unwrap();
    let error = hoof(&format!("robot info {}", file.display())).exits(2).stderr;
    for part in ["centauro.toml", "robot.contact.wheel_3.link", "wheel_5"] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

#[test]
fn listed_parameters_are_a_valid_robot_file() {
    let folder = folder("params");
    let listed = hoof("robot info hyq --params").exits(0).stdout;
    let with_range = listed.lines().filter(|line| line.contains("  # ") && line.contains(" to ")).count();
    // Those of duty and phases are not "A to B"; HyQ's file has no drives.
    assert_eq!(with_range, bounds().count() - 5);
    let toml = folder.join("hyq.toml");
    std::fs::write(&toml, &listed).unwrap();
    std::fs::copy("robots/hyq/hyq.urdf", folder.join("hyq.urdf")).unwrap();
    assert_eq!(hoof(&format!("robot info {} --params", toml.display())).exits(0).stdout, listed);
}

#[test]
fn model_quantities_agree_with_pinocchio() {
    let fixture: Value = serde_json::from_str(HYQ).unwrap();
    let folder = folder("eval");
    for (number, state) in fixture["states"].as_array().unwrap().iter().enumerate() {
        let expected = &state["expected"];
        let request = request(&fixture["joints"], &state["state"]).to_string();
        let file = folder.join(format!("{number}.json"));
        std::fs::write(&file, &request).unwrap();
        let found = hoof(&format!("robot eval hyq --state {}", file.display())).exits(0).json();
        assert_eq!(eval_of_standard_input(&request), found);

        near(&expected["mass_matrix"], &found["mass_matrix"]);
        near(&expected["bias_force"], &found["bias_force"]);
        near(&expected["gravity_force"], &found["gravity"]);
        near(&expected["com"], &found["com_m"]);
        near(&fixture["total_mass"], &found["total_mass_kg"]);
        for (link, frame) in expected["frames"].as_object().unwrap() {
            let found = &found["frames"][link];
            near(&frame["p_WF"], &found["position_m"]);
            near(&frame["jacobian"], &found["jacobian"]);
            near(&frame["R_WF"], &json!(rotation(&numbers(&found["quaternion_wxyz"]))));
        }
    }
}

fn eval_of_standard_input(request: &str) -> Value {
    let mut eval = command();
    eval.args(["robot", "eval", "robots/hyq/hyq.urdf", "--state", "-"]).stdin(Stdio::piped());
    let mut eval = eval.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    eval.stdin.take().unwrap().write_all(request.as_bytes()).unwrap();
    ran(eval.wait_with_output().unwrap()).exits(0).json()
}

/// The state of a fixture in the format of `hoof robot eval`: base velocities in base axes, the rotation as quaternion.
fn request(joints: &Value, state: &Value) -> Value {
    let named = |key: &str| {
        let names = joints.as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned());
        Value::Object(names.zip(state[key].as_array().unwrap().iter().cloned()).collect())
    };
    let R_WB = numbers(&state["R_WB"]);
    let in_B = |key: &str| {
        let v_W = numbers(&state[key]);
        [0, 1, 2].map(|column| (0..3).map(|row| R_WB[3 * row + column] * v_W[row]).sum::<f64>())
    };
    json!({
        "base": {
            "position_m": state["p_WB"],
            "quaternion_wxyz": quaternion(&R_WB),
            "linear_velocity": in_B("v_WB"),
            "angular_velocity": in_B("w_WB_W"),
        },
        "q": named("q"),
        "qd": named("qd"),
    })
}

/// Unit quaternion of a rotation matrix by rows, from its largest component (Shepperd).
fn quaternion(R: &[f64]) -> [f64; 4] {
    let trace = R[0] + R[4] + R[8];
    let squares = [trace, R[0], R[4], R[8]];
    let largest = (0..4).max_by(|i, j| squares[*i].total_cmp(&squares[*j])).unwrap();
    let differences = [R[7] - R[5], R[2] - R[6], R[3] - R[1]];
    let mut wxyz = [0.0; 4];
    if largest == 0 {
        wxyz = [1.0 + trace, differences[0], differences[1], differences[2]];
    } else {
        let (i, j, k) = (largest - 1, largest % 3, (largest + 1) % 3);
        wxyz[0] = differences[i];
        wxyz[1 + i] = 1.0 + 2.0 * R[4 * i] - trace;
        wxyz[1 + j] = R[3 * i + j] + R[3 * j + i];
        wxyz[1 + k] = R[3 * i + k] + R[3 * k + i];
    }
    let norm = wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
    wxyz.map(|x| x / norm)
}

/// Rotation matrix by rows of a unit quaternion.
fn rotation(wxyz: &[f64]) -> [f64; 9] {
    let &[w, x, y, z] = wxyz else { panic!("{wxyz:?}") };
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}

/// The numbers of nested arrays, in order.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

/// Tolerance: 1e-12 of the largest entry, a few hundred roundings of sums over a dozen bodies.
#[track_caller]
fn near(expected: &Value, found: &Value) {
    let (expected, found) = (numbers(expected), numbers(found));
    assert_eq!(expected.len(), found.len());
    let scale = expected.iter().fold(1.0_f64, |scale, x| scale.max(x.abs()));
    for (i, (expected, found)) in expected.iter().zip(&found).enumerate() {
        assert!((expected - found).abs() <= 1e-12 * scale, "entry {i}: found {found}, expected {expected}");
    }
}
