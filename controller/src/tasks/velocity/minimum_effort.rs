//! Joints move towards a posture that needs less torque against gravity, down the gradient of
//!
//! ```text
//! E(q) = ½ |W g(q)|²          v = -k ∂E/∂q = -k Gᵀ W² g,    G = ∂g/∂q
//! ```
//! `g`: gravity torques of the joints; `W`: diagonal, by default the inverse of the torque limits, so that E is half the sum of the squared fractions of the limits.
//! `G` is the Hessian of the potential energy and is computed exactly ([`gravity_derivative`]): it costs less than one difference quotient and has no step size. Contact
//! forces are not part of E, and neither is the attitude of the base a variable of it: the task suits arms and a trunk, not the loaded legs.

use crate::model::{JointInfo, gravity_derivative, gravity_force};
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{DMatrix, DVector};

/// The task: one row for each joint, rad/s or m/s.
pub struct MinimumEffort {
    /// Gain k, rad²/s with the default weights.
    pub gain: f64,
    /// Diagonal of W, nj: 1/(N m) or 1/N; 0 without a torque limit.
    pub weights: Vec<f64>,
    nv: usize,
    n_base: usize,
    g: DVector<f64>,
    G: DMatrix<f64>,
}

impl MinimumEffort {
    /// With the torque limits of the model.
    pub fn new(of: &Structure<'_>, gain: f64) -> Self {
        let (nv, nj, nan) = (of.model.nv(), of.model.nj(), f64::NAN);
        let weight = |joint: &JointInfo| if joint.effort > 0.0 { 1.0 / joint.effort } else { 0.0 };
        MinimumEffort {
            gain,
            weights: of.model.joints.iter().map(weight).collect(),
            nv,
            n_base: of.model.nv_base(),
            g: DVector::from_element(nv, nan),
            G: DMatrix::from_element(nj, nj, nan),
        }
    }
}

impl Task for MinimumEffort {
    type Reference = ();

    fn size(&self) -> usize {
        self.nv - self.n_base
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, self.n_base..self.nv)
    }

    fn update(&mut self, state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        gravity_force(state.model, state.kin, &mut self.g);
        gravity_derivative(state.model, state.kin, &mut self.G);
        for (j, b) in rows.b.iter_mut().enumerate() {
            let entries = self.weights.iter().enumerate();
            let slope = entries.fold(0.0, |sum, (i, w)| sum + self.G[(i, j)] * (w * w) * self.g[self.n_base + i]);
            *b = -self.gain * slope;
        }
    }
}
