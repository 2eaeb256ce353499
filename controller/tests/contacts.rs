//! Contacts against Pinocchio, numerical differences and closed forms: points, wheels and hands.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::contact::{Contact, ContactLoad, ContactState};
use controller::math::{Rx, Ry, Rz};
use controller::model::description::ContactGeometry;
use controller::model::{Base, BaseState, Kinematics, Model, RobotDescription, UrdfTree};
use controller::stack::{ModelState, Structure, Task, Variables};
use controller::tasks::{acceleration, velocity};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::Deserialize;

const CENTAURO: (&str, &str) =
    (include_str!("../../robots/centauro/centauro.urdf"), include_str!("../../robots/centauro/centauro.toml"));

#[derive(Deserialize)]
struct Fixtures {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    link: String,
    n_W: [f64; 3],
    state: CaseState,
    expected: Expected,
}

#[derive(Deserialize)]
struct CaseState {
    p_WB: [f64; 3],
    R_WB: [[f64; 3]; 3],
    v_WB: [f64; 3],
    w_WB_W: [f64; 3],
    q: Vec<f64>,
    qd: Vec<f64>,
}

#[derive(Deserialize)]
struct Expected {
    p_WC: [f64; 3],
    velocity: [f64; 3],
    jacobian: Vec<Vec<f64>>,
    bias: [f64; 3],
}

fn generalized(base: &BaseState, qd: &[f64]) -> DVector<f64> {
    DVector::from_iterator(6 + qd.len(), base.v_WB.iter().chain(base.w_WB_W.iter()).chain(qd).copied())
}

#[test]
fn wheels_of_centauro_equal_pinocchio() {
    let tree = UrdfTree::parse(CENTAURO.0, "centauro.urdf").unwrap();
    let description = RobotDescription::from_toml(CENTAURO.1, "centauro.toml", &tree).unwrap();
    let model = description.model(&tree).unwrap();
    let contacts = Contact::all(&description, &model).unwrap();
    let sizes: Vec<usize> = contacts.iter().map(Contact::size).collect();
    assert_eq!(sizes, [3; 6]);
    let fixtures: Fixtures = serde_json::from_str(include_str!("data/contacts.json")).unwrap();
    assert_eq!(fixtures.cases.len(), 3);
    for Case { link, n_W, state, expected } in fixtures.cases {
        let contact = contacts.iter().find(|contact| contact.name == link).unwrap();
        let base = BaseState {
            p_WB: state.p_WB.into(),
            R_WB: Matrix3::from_fn(|r, c| state.R_WB[r][c]),
            v_WB: state.v_WB.into(),
            w_WB_W: state.w_WB_W.into(),
        };
        let mut kin = Kinematics::new(&model);
        kin.update(&model, &base, &state.q, &state.qd);
        let mut at = contact.state(&model);
        contact.update(&model, &kin, &n_W.into(), &mut at);
        assert!((at.p_BC_W + base.p_WB - Vector3::from(expected.p_WC)).norm() < 1e-12, "{link}");
        let J = DMatrix::from_fn(3, model.nv(), |r, c| expected.jacobian[r][c]);
        assert!((&at.J - &J).norm() < 1e-12, "{link}");
        let v = generalized(&base, &state.qd);
        assert!((&at.J * &v - DVector::from_row_slice(&expected.velocity)).norm() < 1e-11, "{link}");
        // The expected value is a difference of fourth order.
        let off = (at.linear_bias() - Vector3::from(expected.bias)).norm();
        assert!(off < 1e-6 * at.linear_bias().norm(), "{link}: {off}");
        let outside = (0..model.nv()).filter(|col| !contact.columns.contains(col));
        assert!(outside.into_iter().all(|col| J.column(col).norm() == 0.0), "{link}");
        for axis in 0..3 {
            assert!((at.R_WC.column(axis).norm() - 1.0).abs() < 1e-12 && (at.R_WC.determinant() - 1.0).abs() < 1e-12);
        }
    }
}

/// A body that floats; its contact is at the origin of the link.
const BODY: &str = r#"<robot name="body"><link name="body"><inertial><mass value="3"/>
<inertia ixx="0.02" iyy="0.03" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

fn body() -> Model {
    Model::new(&UrdfTree::parse(BODY, "body.urdf").unwrap(), Base::Floating).unwrap()
}

fn contact_at(model: &Model, geometry: ContactGeometry, base: &BaseState, n_W: &Vector3<f64>) -> ContactState {
    let contact = Contact::new("it", model, model.frame("body").unwrap(), &geometry);
    let mut kin = Kinematics::new(model);
    kin.update(model, base, &[], &[]);
    let mut at = contact.state(model);
    contact.update(model, &kin, n_W, &mut at);
    at
}

const WHEEL: ContactGeometry = ContactGeometry::Wheel { radius: 0.3, axis: [0.0, 1.0, 0.0] };

/// A wheel with constant tilt rolls along a circle: a closed form in which the material point at the contact is always at rest.
///
/// ```text
/// R_WB = Rz(Ω t) Rx(β) Ry(σ t),   p_C = ρ (sin Ωt, -cos Ωt, 0),   p_WB = p_C + r Rz(Ωt) Rx(β) e_z,   σ r = Ω ρ
/// ```
#[test]
fn a_tilted_turning_wheel_rolls_without_slip() {
    let (model, radius) = (body(), 0.3);
    for (tilt, turn, circle) in [(0.0, 0.9, 2.0), (0.4, 0.9, 1.5), (-0.5, -1.3, 0.8), (0.7, 2.0, -1.1)] {
        let spin = turn * circle / radius;
        let motion = |t: f64| {
            let frame = Rz(turn * t) * Rx(tilt);
            let contact = Rz(turn * t) * Vector3::new(0.0, -circle, 0.0);
            let p_WB = contact + frame * Vector3::z() * radius;
            let w_WB_W = Vector3::z() * turn + frame * Vector3::y() * spin;
            let v_WB = Vector3::z().cross(&p_WB) * turn;
            (contact, BaseState { p_WB, R_WB: frame * Ry(spin * t), v_WB, w_WB_W })
        };
        for t in [0.0, 0.37, 1.9] {
            let (contact, base) = motion(t);
            let at = contact_at(&model, WHEEL, &base, &Vector3::z());
            assert!((at.p_BC_W + base.p_WB - contact).norm() < 1e-12);
            let v = generalized(&base, &[]);
            assert!((&at.J * &v).norm() < 1e-12, "slip {}", &at.J * &v);
            // Closed forms: the centre turns about the vertical with Ω, and so does the angular velocity.
            let (p, w) = (Vector3::z().cross(&base.v_WB) * turn, Vector3::z().cross(&base.w_WB_W) * turn);
            let vd = DVector::from_iterator(6, p.iter().chain(w.iter()).copied());
            let left = &at.J * &vd + DVector::from_row_slice(at.linear_bias().as_slice());
            assert!(left.norm() < 1e-12, "tilt {tilt}: {left}");
            // A sphere or a fixed point has another bias: the term of the turning axis is needed.
            let sphere = contact_at(&model, ContactGeometry::Point { radius }, &base, &Vector3::z());
            assert!(tilt == 0.0 || (sphere.linear_bias() - at.linear_bias()).norm() > 0.1);
        }
    }
}

/// Steering about the vertical at rate `s` with level axis: `dv_C/dt = -r q̈ i - r q s j`. Source: Laurenzi 2020, eq. (5.32), corrected.
#[test]
fn the_bias_of_a_steered_wheel_is_the_closed_form() {
    let model = body();
    let (rate, steering) = (4.0, 0.7);
    let w_WB_W = Vector3::new(0.0, rate, steering);
    let base = BaseState { w_WB_W, ..BaseState::identity() };
    let at = contact_at(&model, WHEEL, &base, &Vector3::z());
    let v = generalized(&base, &[]);
    assert!((&at.J * &v - DVector::from_row_slice(&[-0.3 * rate, 0.0, 0.0])).norm() < 1e-12);
    // Constant rates: the wheel's axis turns, wd = s k x q j.
    let wd = Vector3::z().cross(&Vector3::y()) * (rate * steering);
    let vd = DVector::from_row_slice(&[0.0, 0.0, 0.0, wd.x, wd.y, wd.z]);
    let rate_of = &at.J * vd + DVector::from_row_slice(at.linear_bias().as_slice());
    assert!((rate_of - DVector::from_row_slice(&[0.0, -0.3 * rate * steering, 0.0])).norm() < 1e-12);
}

#[test]
fn a_wheel_that_lies_flat_has_finite_numbers() {
    let model = body();
    for tilt in [std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_2 - 1e-9] {
        let base = BaseState { R_WB: Rx(tilt), w_WB_W: Vector3::new(1.0, 2.0, 3.0), ..BaseState::identity() };
        let at = contact_at(&model, WHEEL, &base, &Vector3::z());
        let all = at.J.iter().chain(at.a_bias_W.iter()).chain(at.R_WC.iter()).chain(at.p_BC_W.iter());
        assert!(all.into_iter().all(|x| x.is_finite()));
        assert!((at.p_BC_W.norm() - 0.3).abs() < 1e-12);
    }
}

/// A hand is a sphere that touches any surface: its rows admit exactly the forces that push the robot away from the surface, inside the pyramid.
#[test]
fn the_force_of_a_hand_points_away_from_the_surface() {
    let (model, mut rng) = (body(), Rng(31));
    let contact = Contact::new("hand", &model, model.frame("body").unwrap(), &ContactGeometry::Hand { radius: 0.05 });
    let (mut inside, mut outside) = (0, 0);
    for _ in 0..300 {
        let n = rng.vec3(1.0).normalize();
        let at = contact_at(&model, ContactGeometry::Hand { radius: 0.05 }, &BaseState::identity(), &n);
        assert!((at.p_BC_W + n * 0.05).norm() < 1e-15);
        let f = n + rng.vec3(0.8);
        let c = 0.4;
        let (t1, t2) = (at.R_WC.column(0).dot(&f), at.R_WC.column(1).dot(&f));
        let admissible = f.dot(&n) >= 0.0 && t1.abs() <= c * f.dot(&n) && t2.abs() <= c * f.dot(&n);
        let mut worst = f64::NEG_INFINITY;
        contact.friction(&at, c, &mut |_, a| worst = worst.max((0..3).map(|k| a[k] * f[k]).sum()));
        assert_eq!(worst <= 0.0, admissible, "{f}");
        inside += usize::from(admissible);
        outside += usize::from(!admissible);
    }
    assert!(inside > 30 && outside > 30, "{inside} {outside}");
}

/// The tasks of velocity and acceleration level over contacts of different kinds; a contact without load has no rows.
#[test]
fn contacts_at_rest_have_rows_of_both_levels() {
    let tree = UrdfTree::parse(CENTAURO.0, "centauro.urdf").unwrap();
    let description = RobotDescription::from_toml(CENTAURO.1, "centauro.toml", &tree).unwrap();
    let model = description.model(&tree).unwrap();
    let contacts = Contact::all(&description, &model).unwrap();
    let (nj, mut rng) = (model.nj(), Rng(4));
    let variables = Variables::new(model.nv(), contacts.iter().map(Contact::size), false);
    let of = Structure { model: &model, contacts: &contacts, variables: &variables };
    let q: Vec<f64> = (0..nj).map(|_| rng.symmetric()).collect();
    let qd: Vec<f64> = (0..nj).map(|_| rng.symmetric()).collect();
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState::identity(), &q, &qd);
    let at: Vec<ContactState> = contacts
        .iter()
        .map(|contact| {
            let mut at = contact.state(&model);
            contact.update(&model, &kin, &Vector3::z(), &mut at);
            at
        })
        .collect();
    let mut loads = vec![ContactLoad::FREE; contacts.len()];
    loads[1] = ContactLoad::NONE;
    let (M, h) = (DMatrix::zeros(0, 0), DVector::zeros(0));
    let (contacts, variables) = (&contacts[..], &variables);
    let state = ModelState {
        model: &model,
        contacts,
        variables,
        q: &q,
        qd: &qd,
        kin: &kin,
        M: &M,
        h: &h,
        at: &at,
        loads: &loads,
    };
    let mut rolling = velocity::ContactsAtRest::new(&of);
    let mut rest = acceleration::ContactsAtRest::new(&of);
    let (mut first, mut second) = (rolling.rows(), rest.rows());
    assert_eq!((rolling.size(), rest.size(), first.len(), second.len()), (18, 18, 18, 18));
    rolling.update(&state, &(), &mut first);
    rest.update(&state, &(), &mut second);
    for (i, at) in at.iter().enumerate() {
        let on = i != 1;
        assert_eq!((first.is_on(i), second.is_on(i)), (on, on));
        let expected = if on { at.J.clone() } else { DMatrix::zeros(3, model.nv()) };
        assert_eq!(
            (first.A.rows(3 * i, 3).into_owned(), second.A.rows(3 * i, 3).into_owned()),
            (expected.clone(), expected)
        );
        let bias = if on { -at.linear_bias() } else { Vector3::zeros() };
        assert_eq!((first.b.fixed_rows::<3>(3 * i).norm(), second.b.fixed_rows::<3>(3 * i).into_owned()), (0.0, bias));
    }
}
