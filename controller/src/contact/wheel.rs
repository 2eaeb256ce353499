//! A wheel that rolls: its lowest point touches the surface. Three force variables.
//!
//! ```text
//! m = n - (n·a) a,   u = m/|m|,   p_C = p_F - r u          a: axis of the wheel
//! v_C = v_F + w x (-r u)                                   velocity of the material point at p_C; pure rolling: v_C = 0
//! dv_C/dt = a_F + α x (-r u) + w x (-r du/dt),   du/dt = (1 - u uᵀ) dm/dt / |m|,   dm/dt = -(n·da/dt) a - (n·a) da/dt,   da/dt = w x a
//! ```
//! The contact point is the projection of the normal on the plane of the wheel, so the wheel may be tilted. It does not turn with the wheel: only the
//! motion of the axis moves it. With a level axis, steering rate `s` and wheel rate `q`: `dv_C/dt = -r q̈ i - r q s j`.
//! Source: Laurenzi 2020, eqs. (5.30)-(5.36), with the sign for a wheel that rolls forward at a positive rate about its axis `j` (left).
//!
//! Forces: the pyramid of a point, with the first tangent along the rolling direction.

use super::point::{PYRAMID, pyramid, write_bias};
use super::shape::{ContactModel, ContactState, MAX_FORCE, tangents};
use crate::model::{FrameId, Kinematics, Model, frame_bias_acceleration, point_jacobian_linear};
use nalgebra::{Matrix3, Vector3};

/// Least |m|. A wheel that lies flatter has no lowest point; one is chosen, so that the numbers stay finite.
const FLAT: f64 = 1e-6;

/// Shape of a wheel.
pub(super) struct Wheel {
    /// Radius, m.
    pub radius: f64,
    /// Axis in the axes of the link, a unit vector.
    pub axis: Vector3<f64>,
}

impl ContactModel for Wheel {
    fn size(&self) -> usize {
        3
    }

    fn update(&self, model: &Model, kin: &Kinematics, frame: FrameId, n_W: &Vector3<f64>, state: &mut ContactState) {
        let a_W = kin.R_WF(model, frame) * self.axis;
        let m = n_W - a_W * n_W.dot(&a_W);
        let length = m.norm();
        let lies = length < FLAT;
        let u = if lies { tangents(&a_W)[0] } else { m / length };
        let r_W = u * -self.radius;
        let w = kin.w_WF_W(model, frame);
        let ad = w.cross(&a_W);
        let md = a_W * -n_W.dot(&ad) - ad * n_W.dot(&a_W);
        let ud = if lies { Vector3::zeros() } else { (md - u * u.dot(&md)) / length };
        let bias = frame_bias_acceleration(model, kin, frame);
        let (linear, angular) = (Vector3::new(bias[0], bias[1], bias[2]), Vector3::new(bias[3], bias[4], bias[5]));
        point_jacobian_linear(model, kin, frame, &r_W, state.J.as_view_mut());
        write_bias(state, &(linear + angular.cross(&r_W) + w.cross(&(ud * -self.radius))));
        state.p_BC_W = kin.p_BF_W(model, frame) + r_W;
        // The rolling direction `a x u` lies in the surface.
        let forward = a_W.cross(&u);
        let t1 = if lies { tangents(n_W)[0] } else { forward };
        state.R_WC = Matrix3::from_columns(&[t1, n_W.cross(&t1), *n_W]);
    }

    fn friction_names(&self) -> &'static [&'static str] {
        &PYRAMID
    }

    fn friction(&self, state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE])) {
        pyramid(state, c, give);
    }
}
