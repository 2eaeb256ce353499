//! Jacobians of frames and points, and their bias accelerations.

use nalgebra::{DMatrix, DMatrixViewMut, Vector3, Vector6};

use super::bodies::{Base, FrameId, Model};
use super::kinematics::Kinematics;

/// Jacobian of a link's frame: `[v_WF; w_WF_W] = J v`.
///
/// - writes `J`, 6 x nv: rows 0..3 linear (of the origin of the frame), 3..6 angular, both in W axes.
/// - cost O(nv), no allocation.
///
/// # Panics
/// If the shape of `J` is not 6 x nv.
#[inline]
pub fn frame_jacobian(model: &Model, kin: &Kinematics, frame: FrameId, J: &mut DMatrix<f64>) {
    point_jacobian(model, kin, frame, &Vector3::zeros(), J);
}

/// Jacobian of a point P fixed to a link's frame F. `p_FP_W` is the position of P from the origin of F, in W axes, m.
///
/// Shape, rows and cost: see [`frame_jacobian`]. A point given in F must be rotated first: `R_WF * p_FP`.
///
/// # Panics
/// If the shape of `J` is not 6 x nv.
#[inline]
pub fn point_jacobian(model: &Model, kin: &Kinematics, frame: FrameId, p_FP_W: &Vector3<f64>, J: &mut DMatrix<f64>) {
    assert_eq!(J.shape(), (6, model.nv()), "a frame's Jacobian is 6 x nv");
    J.fill(0.0);
    let r = kin.p_BF_W(model, frame) + p_FP_W;
    let nb = model.nv_base();
    if model.base() == Base::Floating {
        write_base_linear(&r, &mut J.rows_mut(0, 3));
        for k in 0..3 {
            J[(3 + k, 3 + k)] = 1.0;
        }
    }
    let columns = J.as_mut_slice();
    for_each_joint_above(model, kin, frame, &r, |i_v, linear, angular| {
        debug_assert!(i_v >= nb);
        let column = &mut columns[6 * i_v..6 * i_v + 6];
        column[..3].copy_from_slice(linear.as_slice());
        column[3..].copy_from_slice(angular.as_slice());
    });
}

/// The three linear rows of [`point_jacobian`]. They can be written into a part of a larger matrix.
///
/// - writes `J`, 3 x nv, for example `stack.rows_mut(3 * leg, 3)`.
///
/// # Panics
/// If the shape of `J` is not 3 x nv.
#[inline]
pub fn point_jacobian_linear(
    model: &Model,
    kin: &Kinematics,
    frame: FrameId,
    p_FP_W: &Vector3<f64>,
    mut J: DMatrixViewMut<'_, f64>,
) {
    assert_eq!(J.shape(), (3, model.nv()), "the linear rows of a point's Jacobian are 3 x nv");
    J.fill(0.0);
    let r = kin.p_BF_W(model, frame) + p_FP_W;
    if model.base() == Base::Floating {
        write_base_linear(&r, &mut J);
    }
    for_each_joint_above(model, kin, frame, &r, |i_v, linear, _| J.column_mut(i_v).copy_from(linear));
}

/// Bias acceleration `Jd v` of a link's frame, its acceleration with `vd = 0`: `[dv_WF/dt; dw_WF_W/dt] = J vd + Jd v`.
///
/// Linear part: classical acceleration of the origin of the frame, m/s². Angular part: rad/s². Both in W axes, without gravity.
/// Does not depend on `v_WB`.
#[inline]
pub fn frame_bias_acceleration(model: &Model, kin: &Kinematics, frame: FrameId) -> Vector6<f64> {
    point_bias_acceleration(model, kin, frame, &Vector3::zeros())
}

/// Bias acceleration of a point P fixed to a link's frame F, at `p_FP_W` from the origin of F, in W axes, m. See [`frame_bias_acceleration`].
#[inline]
pub fn point_bias_acceleration(model: &Model, kin: &Kinematics, frame: FrameId, p_FP_W: &Vector3<f64>) -> Vector6<f64> {
    let body = &kin.bodies[model.frames[frame.index()].body];
    let a = body.point_acceleration(&(kin.p_BF_W(model, frame) + p_FP_W));
    Vector6::new(a.x, a.y, a.z, body.al.x, body.al.y, body.al.z)
}

/// Writes `[E  -[r]x]`, the first six columns of the linear rows.
fn write_base_linear(r: &Vector3<f64>, J: &mut DMatrixViewMut<'_, f64>) {
    for k in 0..3 {
        J[(k, k)] = 1.0;
    }
    (J[(1, 3)], J[(2, 3)]) = (-r.z, r.y);
    (J[(0, 4)], J[(2, 4)]) = (r.z, -r.x);
    (J[(0, 5)], J[(1, 5)]) = (-r.y, r.x);
}

/// Calls `write(i_v, linear, angular)` for every joint between the base and a frame; `r` is the point from the origin of B.
#[inline]
fn for_each_joint_above(
    model: &Model,
    kin: &Kinematics,
    frame: FrameId,
    r: &Vector3<f64>,
    mut write: impl FnMut(usize, &Vector3<f64>, &Vector3<f64>),
) {
    let mut i = model.frames[frame.index()].body;
    while i != 0 {
        let body = &kin.bodies[i];
        write(model.bodies[i].i_v, &(body.s_v + body.s_w.cross(r)), &body.s_w);
        i = model.bodies[i].parent;
    }
}
