//! Joint accelerations towards a posture.
//!
//! ```text
//! qdd = qdd_des + K_P (q_des - q) + K_D (qd_des - qd)
//! qdd = qdd_des + M_g⁻¹ (K_P (q_des - q) + K_D (qd_des - qd))          M_g: block of the mass matrix at the joints of a group
//! ```
//! Source: Raiola et al. 2020, eq. (9), appendix A. The second form, where the gains are those of a joint impedance, is chosen for each group.

use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// The task: one row for each joint, rad/s² or m/s².
pub struct Posture {
    nv: usize,
    n_base: usize,
    groups: Vec<Vec<usize>>,
    /// Right side of the last update, nj.
    pub qdd: DVector<f64>,
    /// Feedback of a group, and the factor of its inertia.
    u: Vec<f64>,
    L: DMatrix<f64>,
}

/// Reference of a posture; all vectors have nj numbers, or one for each group.
#[derive(Clone, Debug)]
pub struct PostureReference {
    /// Positions, rad or m.
    pub q: Vec<f64>,
    /// Velocities, rad/s or m/s.
    pub qd: Vec<f64>,
    /// Accelerations, rad/s² or m/s². -0.0 leaves every bit of the feedback unchanged.
    pub qdd: Vec<f64>,
    /// Stiffness, 1/s²; N m/rad or N/m in a group with inertia.
    pub kp: Vec<f64>,
    /// Damping, 1/s; N m s/rad or N s/m in a group with inertia.
    pub kd: Vec<f64>,
    /// For each group, whether its feedback is premultiplied by its inverse inertia.
    pub inertia: Vec<bool>,
    /// For each group, whether its joints have rows.
    pub active: Vec<bool>,
}

impl Posture {
    /// - `groups`: joints of each group, by index in `q`; every joint is in one group.
    pub fn new(of: &Structure<'_>, groups: Vec<Vec<usize>>) -> Self {
        let largest = groups.iter().map(Vec::len).max().unwrap_or(0);
        let nan = f64::NAN;
        Posture {
            nv: of.model.nv(),
            n_base: of.model.nv_base(),
            groups,
            qdd: DVector::from_element(of.model.nj(), nan),
            u: vec![nan; largest],
            L: DMatrix::from_element(largest, largest, nan),
        }
    }

    /// Allocates a reference, filled with NaN; all groups are active, without inertia.
    pub fn reference(&self) -> PostureReference {
        let (n, groups) = (vec![f64::NAN; self.qdd.len()], self.groups.len());
        PostureReference {
            q: n.clone(),
            qd: n.clone(),
            qdd: n.clone(),
            kp: n.clone(),
            kd: n,
            inertia: vec![false; groups],
            active: vec![true; groups],
        }
    }

    /// `u ← M_g⁻¹ u`. A singular block gives 0.
    fn premultiply(&mut self, M: &DMatrix<f64>, group: usize) {
        let (joints, nb) = (&self.groups[group], self.n_base);
        let entry = |r: usize, c: usize| M[(nb + joints[r], nb + joints[c])];
        let (n, u, L) = (joints.len(), &mut self.u, &mut self.L);
        if n == 3 {
            // The closed form, which needs a third of the operations.
            let M_g = Matrix3::from_fn(entry);
            let u3 = Vector3::new(u[0], u[1], u[2]);
            let solved = M_g.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * u3);
            u[..3].copy_from_slice(solved.as_slice());
            return;
        }
        for j in 0..n {
            for i in j..n {
                let sum = (0..j).fold(entry(i, j), |sum, k| sum - L[(i, k)] * L[(j, k)]);
                if i == j && (sum.is_nan() || sum <= 0.0) {
                    u[..n].fill(0.0);
                    return;
                }
                L[(i, j)] = if i == j { sum.sqrt() } else { sum / L[(j, j)] };
            }
        }
        for i in 0..n {
            u[i] = (0..i).fold(u[i], |sum, k| sum - L[(i, k)] * u[k]) / L[(i, i)];
        }
        for i in (0..n).rev() {
            u[i] = (i + 1..n).fold(u[i], |sum, k| sum - L[(k, i)] * u[k]) / L[(i, i)];
        }
    }
}

impl Task for Posture {
    type Reference = PostureReference;

    fn size(&self) -> usize {
        self.qdd.len()
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, self.n_base..self.nv)
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &PostureReference, rows: &mut Rows) {
        for group in 0..self.groups.len() {
            for (k, &j) in self.groups[group].iter().enumerate() {
                self.u[k] =
                    reference.kp[j] * (reference.q[j] - state.q[j]) + reference.kd[j] * (reference.qd[j] - state.qd[j]);
            }
            if reference.inertia[group] {
                self.premultiply(state.M, group);
            }
            for (k, &j) in self.groups[group].iter().enumerate() {
                self.qdd[j] = self.u[k] + reference.qdd[j];
                if rows.is_on(j) != reference.active[group] {
                    rows.switch(j, reference.active[group]);
                    rows.A[(j, self.n_base + j)] = f64::from(u8::from(reference.active[group]));
                }
                rows.b[j] = if reference.active[group] { self.qdd[j] } else { 0.0 };
            }
        }
    }
}
