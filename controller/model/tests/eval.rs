//! The functions behind `hoof robot eval` and `hoof robot info`: results compared with Pinocchio; invalid states.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use robot_model::eval::{EvalRequest, RobotInfo, eval};
use robot_model::*;
use serde_json::{Value, json};

const HYQ: &str = include_str!("../../../robots/hyq/hyq.urdf");
const ANYMAL_B: &str = include_str!("../../../robots/anymal_b/anymal_b.urdf");
const ARM: &str = include_str!("data/arm.urdf");

#[test]
fn hyq_agrees_with_pinocchio() {
    check(HYQ, include_str!("data/hyq.json"));
}

#[test]
fn anymal_b_agrees_with_pinocchio() {
    check(ANYMAL_B, include_str!("data/anymal_b.json"));
}

#[test]
fn the_arm_on_a_null_base_agrees_with_pinocchio() {
    check(ARM, include_str!("data/arm.json"));
}

fn check(urdf: &str, fixture: &str) {
    let tree = UrdfTree::parse(urdf, "urdf").unwrap();
    let fixture: Value = serde_json::from_str(fixture).unwrap();
    for state in fixture["states"].as_array().unwrap() {
        let (state, expected) = (&state["state"], &state["expected"]);
        let request: EvalRequest = serde_json::from_value(request(&fixture["joints"], state)).unwrap();
        let result = serde_json::to_value(eval(&tree, &request).unwrap()).unwrap();
        near(&expected["mass_matrix"], &result["mass_matrix"]);
        near(&expected["bias_force"], &result["bias_force"]);
        near(&expected["gravity_force"], &result["gravity"]);
        near(&expected["com"], &result["com_m"]);
        near(&fixture["total_mass"], &result["total_mass_kg"]);
        for (link, frame) in expected["frames"].as_object().unwrap() {
            let found = &result["frames"][link];
            near(&frame["p_WF"], &found["position_m"]);
            near(&frame["jacobian"], &found["jacobian"]);
            let R_WF = Matrix3::from_row_slice(&numbers(&frame["R_WF"]));
            let wxyz = numbers(&found["quaternion_wxyz"]);
            let quaternion = nalgebra::Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
            let found = UnitQuaternion::new_unchecked(quaternion).to_rotation_matrix();
            assert!((found.matrix() - R_WF).abs().max() < 1e-12, "{link}");
        }
        let order: Vec<&str> =
            result["velocity_order"].as_array().unwrap().iter().map(|x| x.as_str().unwrap()).collect();
        assert_eq!(order.len(), result["bias_force"].as_array().unwrap().len());
        let joints = fixture["joints"].as_array().unwrap();
        assert_eq!(json!(order[order.len() - joints.len()..]), fixture["joints"]);
    }
}

/// The request of a stored state; base velocities are transformed to base axes.
fn request(joints: &Value, state: &Value) -> Value {
    let named = |key: &str| {
        let names = joints.as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned());
        Value::Object(names.zip(state[key].as_array().unwrap().iter().cloned()).collect())
    };
    let base = state.get("R_WB").map(|R_WB| {
        let R_WB = Matrix3::from_row_slice(&numbers(R_WB));
        let in_B =
            |key: &str| (R_WB.transpose() * Vector3::from_column_slice(&numbers(&state[key]))).as_slice().to_vec();
        let quaternion = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(R_WB));
        json!({
            "position_m": state["p_WB"],
            "quaternion_wxyz": [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
            "linear_velocity": in_B("v_WB"),
            "angular_velocity": in_B("w_WB_W"),
        })
    });
    json!({ "base": base, "q": named("q"), "qd": named("qd") })
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().expect("a number")],
    }
}

#[track_caller]
fn near(expected: &Value, found: &Value) {
    let (expected, found) = (numbers(expected), numbers(found));
    assert_eq!(expected.len(), found.len());
    let scale = expected.iter().fold(1.0_f64, |scale, x| scale.max(x.abs()));
    for (i, (e, f)) in expected.iter().zip(&found).enumerate() {
        assert!((e - f).abs() <= 1e-11 * scale, "[{i}]: found {f}, expected {e}");
    }
}

fn arm_request(change: impl FnOnce(&mut Value)) -> Result<(), String> {
    let tree = UrdfTree::parse(ARM, "arm.urdf").unwrap();
    let fixture: Value = serde_json::from_str(include_str!("data/arm.json")).unwrap();
    let mut request = request(&fixture["joints"], &fixture["states"][0]["state"]);
    change(&mut request);
    let request: EvalRequest = serde_json::from_value(request).map_err(|error| error.to_string())?;
    eval(&tree, &request).map(|_| ()).map_err(|error| error.to_string())
}

#[test]
fn a_state_with_an_unknown_or_missing_joint_is_rejected() {
    assert_eq!(arm_request(|_| ()), Ok(()));
    let error = arm_request(|r| r["q"]["shulder"] = json!(0.1)).unwrap_err();
    assert!(error.contains("\"shulder\"") && error.contains("near: shoulder"), "{error}");
    let error = arm_request(|r| drop(r["qd"].as_object_mut().unwrap().remove("shoulder"))).unwrap_err();
    assert!(error.contains("qd.shoulder"), "{error}");
    let error = arm_request(|r| r["speed"] = json!(0.1)).unwrap_err();
    assert!(error.contains("speed"), "{error}");
}

/// Values whose products would overflow are refused by name; the largest that are accepted give finite results.
#[test]
fn a_state_that_would_overflow_is_rejected() {
    let error = arm_request(|r| r["qd"]["shoulder"] = json!(1e300)).unwrap_err();
    assert!(error.contains("qd.shoulder") && error.contains("1e9"), "{error}");
    let error = arm_request(|r| r["q"]["shoulder"] = json!(-2e9)).unwrap_err();
    assert!(error.contains("q.shoulder"), "{error}");
    let base = |v: f64| json!({ "position_m": [v, 0.0, 1.0], "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0], "angular_velocity": [v, 0.0, v] });
    assert!(arm_request(|r| r["base"] = base(1e10)).unwrap_err().contains("base.position_m"));

    let tree = UrdfTree::parse(ARM, "arm.urdf").unwrap();
    let names: Vec<String> = RobotInfo::new(&tree).unwrap().joints.into_iter().map(|joint| joint.name).collect();
    let all = |value: f64| names.iter().map(|name| (name.clone(), json!(value))).collect::<serde_json::Map<_, _>>();
    let request = json!({ "base": base(1e9), "q": all(1e9), "qd": all(1e9) });
    let result = eval(&tree, &serde_json::from_value(request).unwrap()).unwrap();
    assert!(result.bias_force.iter().chain(result.mass_matrix.iter().flatten()).all(|x| x.is_finite()));
}

#[test]
fn a_quaternion_that_is_not_normalized_is_rejected() {
    let base = json!({ "position_m": [0.0, 0.0, 1.0], "quaternion_wxyz": [1.0, 1.0, 0.0, 0.0] });
    let error = arm_request(|r| r["base"] = base).unwrap_err();
    assert!(error.contains("base.quaternion_wxyz") && error.contains("1.41"), "{error}");
}

#[test]
fn info_names_mass_joints_and_feet() {
    let info = RobotInfo::new(&UrdfTree::parse(HYQ, "hyq.urdf").unwrap()).unwrap();
    assert_eq!((info.name.as_str(), info.dof), ("hyq", 12));
    assert!((info.mass_kg - 86.774005).abs() < 1e-9);
    assert_eq!(info.feet, ["lf_foot", "rf_foot", "lh_foot", "rh_foot"]);
    assert_eq!(info.warnings, [""; 0]);
    assert_eq!((info.joints[2].name.as_str(), info.joints[2].effort), ("lf_kfe_joint", Some(150.0)));

    let info = RobotInfo::new(&UrdfTree::parse(ANYMAL_B, "anymal_b.urdf").unwrap()).unwrap();
    assert!((info.mass_kg - 30.475397462).abs() < 1e-9);
    assert_eq!(info.feet, ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"]);
    assert_eq!(info.warnings, [""; 0]);

    let info = RobotInfo::new(&UrdfTree::parse(ARM, "arm.urdf").unwrap()).unwrap();
    let spin = info.joints.iter().find(|joint| joint.name == "tool_spin").unwrap();
    assert_eq!((spin.kind.as_str(), spin.lower, spin.effort), ("continuous", None, Some(6.0)));
    assert_eq!(info.links[1].parent.as_deref(), Some("pedestal"));
}
