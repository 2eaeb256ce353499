//! The model compared with Pinocchio: stored values of `scripts/pinocchio_fixtures.py`.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use robot_model::*;
use serde_json::Value;

/// Tolerance relative to the largest entry of the expected value: both sides compute in f64, in different order.
const TOLERANCE: f64 = 1e-11;

#[test]
fn hyq() {
    check(include_str!("../../../robots/hyq/hyq.urdf"), include_str!("data/hyq.json"), Base::Floating);
}

#[test]
fn anymal_b() {
    check(include_str!("../../../robots/anymal_b/anymal_b.urdf"), include_str!("data/anymal_b.json"), Base::Floating);
}

#[test]
fn fixed_base_arm_with_prismatic_and_continuous_joints() {
    check(include_str!("data/arm.urdf"), include_str!("data/arm.json"), Base::Fixed);
}

/// Wheels behind four legs, two arms; the neck is fixed.
#[test]
fn centauro() {
    let urdf = include_str!("../../../robots/centauro/centauro.urdf");
    check(urdf, include_str!("data/centauro.json"), Base::Floating);
    let model = Model::new(&UrdfTree::parse(urdf, "centauro.urdf").unwrap(), Base::Floating).unwrap();
    assert_eq!((model.nj(), model.nv()), (39, 45));
    assert!((model.total_mass() - 94.969_089_18).abs() < 1e-9, "{}", model.total_mass());
}

#[test]
fn coman_plus() {
    let urdf = include_str!("../../../robots/coman_plus/coman_plus.urdf");
    check(urdf, include_str!("data/coman_plus.json"), Base::Floating);
    let model = Model::new(&UrdfTree::parse(urdf, "coman_plus.urdf").unwrap(), Base::Floating).unwrap();
    assert_eq!((model.nj(), model.nv()), (28, 34));
    assert!((model.total_mass() - 65.267_070_13).abs() < 1e-9, "{}", model.total_mass());
}

#[test]
fn coman() {
    let urdf = include_str!("../../../robots/coman/coman.urdf");
    check(urdf, include_str!("data/coman.json"), Base::Floating);
    let model = Model::new(&UrdfTree::parse(urdf, "coman.urdf").unwrap(), Base::Floating).unwrap();
    assert_eq!((model.nj(), model.nv()), (29, 35));
    assert!((model.total_mass() - 31.463_860_196).abs() < 1e-9, "{}", model.total_mass());
}

#[test]
fn centauro_upper() {
    let urdf = include_str!("../../../robots/centauro_upper/centauro_upper.urdf");
    check(urdf, include_str!("data/centauro_upper.json"), Base::Fixed);
    let model = Model::new(&UrdfTree::parse(urdf, "centauro_upper.urdf").unwrap(), Base::Fixed).unwrap();
    assert_eq!((model.nj(), model.nv()), (15, 15));
}

fn check(urdf: &str, fixture: &str, base: Base) {
    let tree = UrdfTree::parse(urdf, "urdf").unwrap();
    let model = Model::new(&tree, base).unwrap();
    let fixture: Value = serde_json::from_str(fixture).unwrap();

    let names: Vec<&str> = model.joints.iter().map(|j| j.name.as_str()).collect();
    assert_eq!(serde_json::json!(names), fixture["joints"], "joint order");
    near("total mass", &fixture["total_mass"], &[model.total_mass()]);

    // One `Kinematics` for all states: results must not depend on the state before.
    let mut kin = Kinematics::new(&model);
    let states = fixture["states"].as_array().unwrap();
    assert!(states.len() >= 2);
    for state in states {
        let (state, expected) = (&state["state"], &state["expected"]);
        let (q, qd) = (numbers(&state["q"]), numbers(&state["qd"]));
        kin.update(&model, &base_state(state), &q, &qd);
        whole_robot(&model, &kin, &DVector::from(numbers(&state["vd"])), expected);
        let frames = expected["frames"].as_object().unwrap();
        assert!(frames.len() == tree.links.len() || frames.len() == 5);
        for (link, expected) in frames {
            one_frame(&model, &kin, link, expected);
        }
    }
}

fn whole_robot(model: &Model, kin: &Kinematics, vd: &DVector<f64>, expected: &Value) {
    let nv = model.nv();
    let mut M = DMatrix::from_element(nv, nv, f64::NAN);
    mass_matrix(model, kin, &mut M);
    near_matrix("mass matrix", &expected["mass_matrix"], &M);

    let mut force = DVector::from_element(nv, f64::NAN);
    bias_force(model, kin, &mut force);
    near("bias force", &expected["bias_force"], force.as_slice());
    gravity_force(model, kin, &mut force);
    near("gravity force", &expected["gravity_force"], force.as_slice());
    let mut G = DMatrix::from_element(model.nj(), model.nj(), f64::NAN);
    gravity_derivative(model, kin, &mut G);
    near_matrix("gravity derivative", &expected["gravity_derivative"], &G);
    rnea(model, kin, vd, &mut RneaScratch::new(model), &mut force);
    near("rnea", &expected["rnea"], force.as_slice());

    near("com", &expected["com"], com(kin).as_slice());
    near("com velocity", &expected["com_velocity"], com_velocity(kin).as_slice());
    near("com bias acceleration", &expected["com_bias_acceleration"], com_bias_acceleration(kin).as_slice());
    let mut J = DMatrix::from_element(3, nv, f64::NAN);
    com_jacobian(model, kin, &mut J);
    near_matrix("com Jacobian", &expected["com_jacobian"], &J);
    near("centroidal momentum", &expected["centroidal_momentum"], centroidal_momentum(kin).as_slice());
    let mut A_G = DMatrix::from_element(6, nv, f64::NAN);
    centroidal_momentum_matrix(model, kin, &mut A_G);
    near_matrix("centroidal momentum matrix", &expected["centroidal_momentum_matrix"], &A_G);
}

fn one_frame(model: &Model, kin: &Kinematics, link: &str, expected: &Value) {
    let frame = model.frame(link).unwrap();
    let named = |quantity: &str| format!("{link}: {quantity}");
    near(&named("p_WF"), &expected["p_WF"], kin.p_WF(model, frame).as_slice());
    let R_WF = kin.R_WF(model, frame);
    near_matrix(&named("R_WF"), &expected["R_WF"], &DMatrix::from_column_slice(3, 3, R_WF.as_slice()));
    near(&named("v_WF"), &expected["v_WF"], kin.v_WF(model, frame).as_slice());
    near(&named("w_WF_W"), &expected["w_WF_W"], kin.w_WF_W(model, frame).as_slice());
    let mut J = DMatrix::from_element(6, model.nv(), f64::NAN);
    frame_jacobian(model, kin, frame, &mut J);
    near_matrix(&named("Jacobian"), &expected["jacobian"], &J);
    near(
        &named("bias acceleration"),
        &expected["bias_acceleration"],
        frame_bias_acceleration(model, kin, frame).as_slice(),
    );
}

fn base_state(state: &Value) -> BaseState {
    if state.get("R_WB").is_none() {
        return BaseState::identity();
    }
    let vector = |key: &str| Vector3::from_column_slice(&numbers(&state[key]));
    BaseState {
        p_WB: vector("p_WB"),
        R_WB: Matrix3::from_row_slice(&numbers(&state["R_WB"])),
        v_WB: vector("v_WB"),
        w_WB_W: vector("w_WB_W"),
    }
}

/// The numbers of a value, row by row.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().expect("a number")],
    }
}

fn near(what: &str, expected: &Value, found: &[f64]) {
    let expected = numbers(expected);
    assert_eq!(expected.len(), found.len(), "{what}: count");
    let scale = expected.iter().fold(1.0_f64, |scale, x| scale.max(x.abs()));
    for (i, (e, f)) in expected.iter().zip(found).enumerate() {
        assert!((e - f).abs() <= TOLERANCE * scale, "{what}[{i}]: found {f}, expected {e}");
    }
}

fn near_matrix(what: &str, expected: &Value, found: &DMatrix<f64>) {
    near(what, expected, found.transpose().as_slice());
}
