//! Times the quantities of the rigid-body model: each one with the kinematics pass that it needs, and all quantities of a tick after one pass.

use crate::export::read_states;
use crate::sample::time_each;
use anyhow::{Context, Result};
use controller::math::{Rng, Rx, Ry, Rz, quaternion};
use controller::model::eval::RobotInfo;
use controller::model::{
    Base, BaseState, FrameId, Kinematics, Model, UrdfTree, bias_force, centroidal_momentum, centroidal_momentum_matrix,
    com, com_velocity, frame_bias_acceleration, frame_jacobian, mass_matrix,
};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use std::path::Path;

/// State of a robot with a floating base. The linear velocity of the base is zero: no quantity depends on it, and Pinocchio's base velocity, in
/// base axes, can be transformed without a drift term.
pub struct State {
    /// Pose and velocity of the base.
    pub base: BaseState,
    /// Orientation of the base as stored in the file.
    pub q_WB_wxyz: [f64; 4],
    /// Joint positions, rad.
    pub q: Vec<f64>,
    /// Joint velocities, rad/s.
    pub qd: Vec<f64>,
}

impl State {
    /// Builds the state from the numbers of a file.
    pub fn new(p_WB: &DVector<f64>, q_wxyz: &DVector<f64>, w_WB_W: &DVector<f64>, q: &[f64], qd: &[f64]) -> Self {
        let vector = |v: &DVector<f64>| Vector3::new(v[0], v[1], v[2]);
        let q_WB_wxyz = [q_wxyz[0], q_wxyz[1], q_wxyz[2], q_wxyz[3]];
        let base = BaseState {
            p_WB: vector(p_WB),
            R_WB: quaternion::to_rotation(q_WB_wxyz),
            v_WB: Vector3::zeros(),
            w_WB_W: vector(w_WB_W),
        };
        State { base, q_WB_wxyz, q: q.to_vec(), qd: qd.to_vec() }
    }
}

/// A robot with preallocated memory for its quantities.
pub struct Body {
    /// Model with a floating base.
    pub model: Model,
    /// Joints in the order of `q`.
    pub joint_names: Vec<String>,
    /// Links of the feet.
    pub foot_names: Vec<String>,
    /// Their frames.
    pub feet: Vec<FrameId>,
    /// Mass matrix.
    pub M: DMatrix<f64>,
    /// Bias force.
    pub h: DVector<f64>,
    /// Jacobian of each foot.
    pub J: Vec<DMatrix<f64>>,
    /// Bias acceleration of each foot.
    pub dJv: Vec<Vector6<f64>>,
    /// Centre of mass.
    pub com: Vector3<f64>,
    /// Its velocity.
    pub v_com: Vector3<f64>,
    /// Centroidal momentum matrix.
    pub A_G: DMatrix<f64>,
    /// Centroidal momentum.
    pub momentum: Vector6<f64>,
    kin: Kinematics,
}

impl Body {
    /// The robot of a URDF.
    pub fn read(urdf: &Path) -> Result<Self> {
        let name = urdf.display().to_string();
        let tree = UrdfTree::parse(&std::fs::read_to_string(urdf).with_context(|| name.clone())?, &name)?;
        let model = Model::new(&tree, Base::Floating)?;
        let foot_names = RobotInfo::new(&tree)?.feet;
        let feet = foot_names.iter().map(|link| model.frame(link)).collect::<Result<Vec<_>, _>>()?;
        let nv = model.nv();
        Ok(Body {
            joint_names: model.joints.iter().map(|joint| joint.name.clone()).collect(),
            M: DMatrix::zeros(nv, nv),
            h: DVector::zeros(nv),
            J: vec![DMatrix::zeros(6, nv); feet.len()],
            dJv: vec![Vector6::zeros(); feet.len()],
            com: Vector3::zeros(),
            v_com: Vector3::zeros(),
            A_G: DMatrix::zeros(6, nv),
            momentum: Vector6::zeros(),
            kin: Kinematics::new(&model),
            foot_names,
            feet,
            model,
        })
    }

    fn pass(&mut self, state: &State) {
        self.kin.update(&self.model, &state.base, &state.q, &state.qd);
    }

    fn foot_jacobians(&mut self, state: &State) {
        self.pass(state);
        self.write_jacobians();
    }

    fn write_jacobians(&mut self) {
        for (J, foot) in self.J.iter_mut().zip(&self.feet) {
            frame_jacobian(&self.model, &self.kin, *foot, J);
        }
    }

    fn mass_matrix(&mut self, state: &State) {
        self.pass(state);
        mass_matrix(&self.model, &self.kin, &mut self.M);
    }

    fn bias_force(&mut self, state: &State) {
        self.pass(state);
        bias_force(&self.model, &self.kin, &mut self.h);
    }

    fn foot_accelerations(&mut self, state: &State) {
        self.pass(state);
        self.write_accelerations();
    }

    fn write_accelerations(&mut self) {
        for (dJv, foot) in self.dJv.iter_mut().zip(&self.feet) {
            *dJv = frame_bias_acceleration(&self.model, &self.kin, *foot);
        }
    }

    fn com(&mut self, state: &State) {
        self.pass(state);
        (self.com, self.v_com) = (com(&self.kin), com_velocity(&self.kin));
    }

    /// Centroidal momentum and its matrix.
    pub fn centroidal(&mut self, state: &State) {
        self.pass(state);
        centroidal_momentum_matrix(&self.model, &self.kin, &mut self.A_G);
        self.momentum = centroidal_momentum(&self.kin);
    }

    /// All quantities that a tick needs: mass matrix, bias force, Jacobians and bias accelerations of the feet, centre of mass.
    pub fn set(&mut self, state: &State) {
        self.pass(state);
        mass_matrix(&self.model, &self.kin, &mut self.M);
        bias_force(&self.model, &self.kin, &mut self.h);
        self.write_jacobians();
        self.write_accelerations();
        (self.com, self.v_com) = (com(&self.kin), com_velocity(&self.kin));
    }

    /// Stacked Jacobians of the feet.
    pub fn stacked_jacobians(&self) -> DMatrix<f64> {
        DMatrix::from_fn(6 * self.J.len(), self.model.nv(), |row, col| self.J[row / 6][(row % 6, col)])
    }
}

/// Seeded random states: any heading, tilt, angular velocity; joints within their limits and within ±π.
pub fn states(body: &Body, n: usize) -> Vec<State> {
    let mut rng = Rng::from_state(8);
    let mut symmetric = || rng.uniform(-1.0, 1.0);
    let mut state = || {
        let R_WB = Rz(3.0 * symmetric()) * Ry(0.3 * symmetric()) * Rx(0.3 * symmetric());
        let p = DVector::from_fn(3, |_, _| symmetric());
        let w = DVector::from_fn(3, |_, _| 2.0 * symmetric());
        let joints = &body.model.joints;
        let q: Vec<f64> = joints.iter().map(|j| (3.0 * symmetric()).clamp(j.lower, j.upper)).collect();
        let qd: Vec<f64> = joints.iter().map(|_| 5.0 * symmetric()).collect();
        let wxyz = quaternion::from_rotation(&R_WB);
        State::new(&p, &DVector::from_row_slice(&wxyz), &w, &q, &qd)
    };
    (0..n).map(|_| state()).collect()
}

/// Name of a quantity in tables, and the function that computes it.
type Case = (&'static str, fn(&mut Body, &State));

/// Times every quantity at every state.
pub fn time(states: &Path, urdf: &Path, passes: usize) -> Result<()> {
    let mut body = Body::read(urdf)?;
    let states = read_states(states, &body)?;
    let cases: [Case; 8] = [
        ("pass", Body::pass),
        ("foot_jacobians", Body::foot_jacobians),
        ("mass_matrix", Body::mass_matrix),
        ("bias_force", Body::bias_force),
        ("foot_accelerations", Body::foot_accelerations),
        ("com", Body::com),
        ("centroidal", Body::centroidal),
        ("set", Body::set),
    ];
    for (name, compute) in cases {
        time_each(name, states.len(), passes, |i| compute(&mut body, &states[i])).print()?;
    }
    Ok(())
}
