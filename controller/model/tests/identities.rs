//! Identities of rigid-body mechanics at seeded random states, without another library.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use robot_model::math::Rng;
use robot_model::*;
use std::ops::{Div, Sub};

const ROBOTS: [(&str, Base); 4] = [
    (include_str!("../../../robots/hyq/hyq.urdf"), Base::Floating),
    (include_str!("../../../robots/anymal_b/anymal_b.urdf"), Base::Floating),
    (include_str!("data/arm.urdf"), Base::Fixed),
    (include_str!("data/arm.urdf"), Base::Floating),
];
const STATES: usize = 20;
/// Step of a central difference, s.
const DT: f64 = 1e-6;

/// Calls `check` at seeded random states of every robot.
fn at_random_states(mut check: impl FnMut(&Model, &State, &mut Random)) {
    for (seed, (urdf, base)) in (1000..).zip(ROBOTS) {
        let model = Model::new(&UrdfTree::parse(urdf, "urdf").unwrap(), base).unwrap();
        let mut random = Random(Rng::from_state(seed));
        for _ in 0..STATES {
            let state = State::random(&model, &mut random);
            check(&model, &state, &mut random);
        }
    }
}

/// Random vectors with entries in `-scale..scale`.
struct Random(Rng);

impl Random {
    fn vector(&mut self, n: usize, scale: f64) -> DVector<f64> {
        DVector::from_fn(n, |_, _| self.0.uniform(-scale, scale))
    }

    fn vector3(&mut self, scale: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.0.uniform(-scale, scale))
    }
}

/// A state of the robot, with `v`.
#[derive(Clone)]
struct State {
    base: BaseState,
    q: DVector<f64>,
    v: DVector<f64>,
}

impl State {
    fn random(model: &Model, random: &mut Random) -> Self {
        let mut state = Self {
            base: BaseState { p_WB: random.vector3(3.0), ..BaseState::identity() },
            q: random.vector(model.nj(), 2.0),
            v: random.vector(model.nv(), 3.0),
        };
        state.base.R_WB = rotation(&random.vector3(2.0));
        state.with_v(state.v.clone())
    }

    /// The same configuration with another velocity.
    fn with_v(&self, v: DVector<f64>) -> Self {
        let mut state = Self { v, ..self.clone() };
        if state.v.len() > state.q.len() {
            state.base.v_WB = state.v.fixed_rows::<3>(0).into();
            state.base.w_WB_W = state.v.fixed_rows::<3>(3).into();
        }
        state
    }

    fn qd(&self) -> &[f64] {
        &self.v.as_slice()[self.v.len() - self.q.len()..]
    }

    fn kinematics(&self, model: &Model) -> Kinematics {
        let mut kin = Kinematics::new(model);
        kin.update(model, &self.base, self.q.as_slice(), self.qd());
        kin
    }

    /// The state after `dt` at constant `vd`, to second order.
    fn after(&self, dt: f64, vd: &DVector<f64>) -> Self {
        let mean = &self.v + 0.5 * dt * vd;
        let mut state = self.with_v(&self.v + dt * vd);
        if self.v.len() > self.q.len() {
            state.base.p_WB += dt * Vector3::from(mean.fixed_rows::<3>(0));
            state.base.R_WB = rotation(&(dt * Vector3::from(mean.fixed_rows::<3>(3)))) * self.base.R_WB;
        }
        state.q += dt * mean.rows(self.v.len() - self.q.len(), self.q.len());
        state
    }
}

/// Derivative in time of a quantity at constant `vd`, by a central difference.
fn rate<T>(model: &Model, state: &State, vd: &DVector<f64>, quantity: impl Fn(&Kinematics) -> T) -> T
where
    T: Sub<Output = T> + Div<f64, Output = T>,
{
    let at = |dt: f64| quantity(&state.after(dt, vd).kinematics(model));
    (at(DT) - at(-DT)) / (2.0 * DT)
}

/// Rotation about a vector by its length.
fn rotation(w: &Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::new(*w).into_inner()
}

fn mass(model: &Model, kin: &Kinematics) -> DMatrix<f64> {
    let mut M = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, kin, &mut M);
    M
}

fn bias(model: &Model, kin: &Kinematics) -> DVector<f64> {
    let mut h = DVector::zeros(model.nv());
    bias_force(model, kin, &mut h);
    h
}

fn gravity(model: &Model, kin: &Kinematics) -> DVector<f64> {
    let mut g = DVector::zeros(model.nv());
    gravity_force(model, kin, &mut g);
    g
}

fn jacobian(model: &Model, kin: &Kinematics, frame: FrameId) -> DMatrix<f64> {
    let mut J = DMatrix::zeros(6, model.nv());
    frame_jacobian(model, kin, frame, &mut J);
    J
}

#[track_caller]
fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(1.0_f64, |scale, x| scale.max(x.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance * scale, "[{i}]: found {f}, expected {e}");
    }
}

#[test]
fn mass_matrix_is_exactly_symmetric_and_positive_definite() {
    at_random_states(|model, state, _| {
        let M = mass(model, &state.kinematics(model));
        assert_eq!(M, M.transpose());
        assert!(M.cholesky().is_some());
    });
}

#[test]
fn inverse_dynamics_is_mass_times_acceleration_plus_bias() {
    at_random_states(|model, state, random| {
        let kin = state.kinematics(model);
        let vd = random.vector(model.nv(), 10.0);
        let mut tau = DVector::zeros(model.nv());
        rnea(model, &kin, &vd, &mut RneaScratch::new(model), &mut tau);
        let expected = mass(model, &kin) * vd + bias(model, &kin);
        near(tau.as_slice(), expected.as_slice(), 1e-12);
    });
}

#[test]
fn rotation_matrices_are_orthogonal() {
    at_random_states(|model, state, _| {
        let kin = state.kinematics(model);
        for (frame, _) in model.frames() {
            let R = kin.R_WF(model, frame);
            near((R * R.transpose()).as_slice(), Matrix3::identity().as_slice(), 1e-13);
            assert!(R.determinant() > 0.0);
        }
    });
}

#[test]
fn jacobian_times_v_is_the_velocity_and_the_derivative_of_the_pose() {
    at_random_states(|model, state, _| {
        let kin = state.kinematics(model);
        let still = DVector::zeros(model.nv());
        for (frame, _) in model.frames() {
            let V = jacobian(model, &kin, frame) * &state.v;
            near(&V.as_slice()[..3], kin.v_WF(model, frame).as_slice(), 1e-13);
            near(&V.as_slice()[3..], kin.w_WF_W(model, frame).as_slice(), 1e-13);
            let dp = rate(model, state, &still, |kin| kin.p_WF(model, frame));
            near(&V.as_slice()[..3], dp.as_slice(), 1e-8);
            // dR/dt Rᵀ = [w]x
            let W = rate(model, state, &still, |kin| kin.R_WF(model, frame)) * kin.R_WF(model, frame).transpose();
            near(&V.as_slice()[3..], &[W[(2, 1)], W[(0, 2)], W[(1, 0)]], 1e-8);
        }
    });
}

#[test]
fn bias_acceleration_is_the_derivative_of_the_velocity_with_vd_zero() {
    at_random_states(|model, state, _| {
        let kin = state.kinematics(model);
        let still = DVector::zeros(model.nv());
        for (frame, _) in model.frames() {
            let a = frame_bias_acceleration(model, &kin, frame);
            let dv = rate(model, state, &still, |kin| kin.v_WF(model, frame));
            let dw = rate(model, state, &still, |kin| kin.w_WF_W(model, frame));
            near(&a.as_slice()[..3], dv.as_slice(), 1e-7);
            near(&a.as_slice()[3..], dw.as_slice(), 1e-7);
        }
        let dv = rate(model, state, &still, com_velocity);
        near(com_bias_acceleration(&kin).as_slice(), dv.as_slice(), 1e-7);
    });
}

#[test]
fn a_point_moves_with_its_frame() {
    at_random_states(|model, state, random| {
        let kin = state.kinematics(model);
        let p = random.vector3(0.5);
        let nv = model.nv();
        let mut J = DMatrix::zeros(6, nv);
        let mut stack = DMatrix::from_element(9, nv, f64::NAN);
        for (frame, _) in model.frames() {
            let (v, w) = (kin.v_WF(model, frame), kin.w_WF_W(model, frame));
            point_jacobian(model, &kin, frame, &p, &mut J);
            point_jacobian_linear(model, &kin, frame, &p, stack.rows_mut(3, 3));
            near((J.rows(0, 3) * &state.v).as_slice(), (v + w.cross(&p)).as_slice(), 1e-13);
            assert_eq!(stack.rows(3, 3), J.rows(0, 3));

            let of_frame = frame_bias_acceleration(model, &kin, frame);
            let (a, al) = (of_frame.fixed_rows::<3>(0), of_frame.fixed_rows::<3>(3));
            let expected = a + al.cross(&p) + w.cross(&w.cross(&p));
            let of_point = point_bias_acceleration(model, &kin, frame, &p);
            near(&of_point.as_slice()[..3], expected.as_slice(), 1e-12);
        }
    });
}

/// Kinetic energy, J, and `tau · v` when `tau` holds gravity and gives `vd`.
fn energy(model: &Model, state: &State) -> f64 {
    0.5 * state.v.dot(&(mass(model, &state.kinematics(model)) * &state.v))
}

#[test]
fn power_of_the_generalized_force_is_the_change_of_energy() {
    at_random_states(|model, state, random| {
        let kin = state.kinematics(model);
        let vd = random.vector(model.nv(), 5.0);
        let (before, after) = (state.after(-DT, &vd), state.after(DT, &vd));
        let height = |state: &State| com(&state.kinematics(model)).z;
        let change = energy(model, &after) - energy(model, &before)
            + model.total_mass() * GRAVITY * (height(&after) - height(&before));
        let mut tau = DVector::zeros(model.nv());
        rnea(model, &kin, &vd, &mut RneaScratch::new(model), &mut tau);
        near(&[tau.dot(&state.v)], &[change / (2.0 * DT)], 1e-6);
    });
}

#[test]
fn momentum_is_its_matrix_times_v_and_its_rate_is_the_external_force() {
    at_random_states(|model, state, random| {
        let kin = state.kinematics(model);
        let mut A_G = DMatrix::zeros(6, model.nv());
        centroidal_momentum_matrix(model, &kin, &mut A_G);
        near((&A_G * &state.v).as_slice(), centroidal_momentum(&kin).as_slice(), 1e-12);
        let mut J = DMatrix::zeros(3, model.nv());
        com_jacobian(model, &kin, &mut J);
        near((&J * &state.v).as_slice(), com_velocity(&kin).as_slice(), 1e-13);
        near((J * model.total_mass()).as_slice(), A_G.rows(0, 3).clone_owned().as_slice(), 1e-12);

        if model.base() == Base::Floating {
            // The base rows of inverse dynamics are the one external wrench besides gravity, which has no moment about C.
            let vd = random.vector(model.nv(), 5.0);
            let mut tau = DVector::zeros(model.nv());
            rnea(model, &kin, &vd, &mut RneaScratch::new(model), &mut tau);
            let rate = rate(model, state, &vd, centroidal_momentum);
            let (f, n) = (Vector3::from(tau.fixed_rows::<3>(0)), Vector3::from(tau.fixed_rows::<3>(3)));
            let weight = Vector3::new(0.0, 0.0, -model.total_mass() * GRAVITY);
            near(&rate.as_slice()[..3], (f + weight).as_slice(), 1e-6);
            let p_CB = kin.base().p_WB - com(&kin);
            near(&rate.as_slice()[3..], (n + p_CB.cross(&f)).as_slice(), 1e-6);
        }
    });
}

#[test]
fn gravity_is_the_bias_at_rest_and_the_gradient_of_height() {
    at_random_states(|model, state, _| {
        let rest = state.with_v(DVector::zeros(model.nv())).kinematics(model);
        let g = gravity(model, &rest);
        near(bias(model, &rest).as_slice(), g.as_slice(), 1e-13);
        let mut J = DMatrix::zeros(3, model.nv());
        com_jacobian(model, &rest, &mut J);
        let gradient = model.total_mass() * GRAVITY * J.row(2).transpose();
        near(g.as_slice(), gradient.as_slice(), 1e-12);
    });
}

#[test]
fn position_and_linear_velocity_of_the_base_change_no_bit() {
    at_random_states(|model, state, random| {
        let mut moved = state.clone();
        moved.base.p_WB = random.vector3(1e6);
        moved.base.v_WB = random.vector3(100.0);
        let (a, b) = (state.kinematics(model), moved.kinematics(model));
        assert_eq!(bias(model, &a), bias(model, &b));
        assert_eq!(mass(model, &a), mass(model, &b));
        for (frame, _) in model.frames() {
            assert_eq!(jacobian(model, &a, frame), jacobian(model, &b, frame));
            assert_eq!(frame_bias_acceleration(model, &a, frame), frame_bias_acceleration(model, &b, frame));
        }
    });
}

#[test]
fn earlier_states_change_no_bit() {
    at_random_states(|model, state, random| {
        let fresh = state.kinematics(model);
        let mut used = State::random(model, random).kinematics(model);
        let nan = BaseState { R_WB: Matrix3::from_element(f64::NAN), ..state.base };
        used.update(model, &nan, &vec![f64::NAN; model.nj()], &vec![f64::NAN; model.nj()]);
        used.update(model, &state.base, state.q.as_slice(), state.qd());
        assert_eq!(mass(model, &fresh), mass(model, &used));
        assert_eq!(bias(model, &fresh), bias(model, &used));
    });
}
