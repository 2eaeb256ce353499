//! A sphere that touches a surface: a foot, or a hand that pushes. Three force variables.
//!
//! ```text
//! p_C = p_F - r n          a_bias = a_F + α_F x (-r n)          (at vd = 0)
//! ```
//! The contact point of a sphere that rolls without slip is accelerated by `w x (w x p_FC)` towards the centre. The bias acceleration of the material
//! point contains the same term, so it cancels; the angular bias times the lever remains.
//!
//! Forces: the pyramid `F·n ≥ 0`, `|F·t1| ≤ c F·n`, `|F·t2| ≤ c F·n`. With `c = μ √2/2` it lies inside the friction cone. Source: Raiola et al. 2020,
//! eq. (10).

use super::shape::{ContactModel, ContactState, MAX_FORCE, tangents};
use crate::model::{FrameId, Kinematics, Model, frame_bias_acceleration, point_jacobian_linear};
use nalgebra::{Matrix3, Vector3};

/// Shape of a point contact.
pub(super) struct Point {
    /// Radius, m.
    pub radius: f64,
}

impl ContactModel for Point {
    fn size(&self) -> usize {
        3
    }

    fn update(&self, model: &Model, kin: &Kinematics, frame: FrameId, n_W: &Vector3<f64>, state: &mut ContactState) {
        let p_FC_W = n_W * -self.radius;
        point_jacobian_linear(model, kin, frame, &p_FC_W, state.J.as_view_mut());
        state.p_BC_W = kin.p_BF_W(model, frame) + p_FC_W;
        let bias = frame_bias_acceleration(model, kin, frame);
        let (linear, angular) = (Vector3::new(bias[0], bias[1], bias[2]), Vector3::new(bias[3], bias[4], bias[5]));
        write_bias(state, &(linear + angular.cross(&p_FC_W)));
        let [t1, t2] = tangents(n_W);
        state.R_WC = Matrix3::from_columns(&[t1, t2, *n_W]);
    }

    fn friction_names(&self) -> &'static [&'static str] {
        &PYRAMID
    }

    fn friction(&self, state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE])) {
        pyramid(state, c, give);
    }
}

/// Names of the rows of [`pyramid`].
pub(super) const PYRAMID: [&str; 5] = ["normal force", "friction t1+", "friction t1-", "friction t2+", "friction t2-"];

/// The rows of a friction pyramid over the three forces.
pub(super) fn pyramid(state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE])) {
    let axis = |k: usize| state.R_WC.column(k).into_owned();
    let (t1, t2, n) = (axis(0), axis(1), axis(2));
    let rows = [-n, t1 - n * c, -t1 - n * c, t2 - n * c, -t2 - n * c];
    for (i, row) in rows.iter().enumerate() {
        give(i, &[row.x, row.y, row.z, 0.0, 0.0, 0.0]);
    }
}

/// Writes the bias acceleration of a contact with three force variables.
pub(super) fn write_bias(state: &mut ContactState, linear: &Vector3<f64>) {
    state.a_bias_W.fixed_rows_mut::<3>(0).copy_from(linear);
    state.a_bias_W.fixed_rows_mut::<3>(3).fill(0.0);
}
