//! Motion of one link relative to another: the joints that cause it, and their columns of the relative Jacobian.
//!
//! A joint above both links moves them as one rigid body, and so does the base. Their columns are exactly zero, so only the joints on the two chains from the
//! links up to the last common body are visited. Source of the Jacobian: Laurenzi 2020, eqs. (5.22)-(5.24).

use nalgebra::Vector3;

use super::bodies::{Base, FrameId, Model};
use super::kinematics::Kinematics;

/// Velocity indices of the joints that move a link relative to another link, or to the root link: those above `frame` but not above `other`, then those above
/// `other` but not above `frame`. Both lists start at the link.
pub fn joints_between(model: &Model, frame: FrameId, other: Option<FrameId>) -> [Vec<usize>; 2] {
    let mut joints = [Vec::new(), Vec::new()];
    walk(model, frame, other, |i, sign| joints[usize::from(sign < 0.0)].push(model.bodies[i].i_v));
    joints
}

/// Calls `write(i_v, linear, angular)` for every column of the relative Jacobian that can be non-zero.
///
/// For a point P fixed to a link's frame F, and the point of another link's frame O at the same place:
///
/// ```text
/// v_P - v_O - w_O × (p_P - p_O) = Σ linear v[i_v]        w_F - w_O = Σ angular v[i_v]
/// ```
/// - `other`: O; `None` for the world, where a floating base has six columns.
/// - `p_BP_W`: P from the origin of B, in W axes, m.
/// - `linear`, `angular`: in W axes, per unit of `v[i_v]`.
/// - cost O(number of columns), no allocation.
#[inline]
pub fn for_each_relative_column(
    model: &Model,
    kin: &Kinematics,
    (frame, other): (FrameId, Option<FrameId>),
    p_BP_W: &Vector3<f64>,
    mut write: impl FnMut(usize, Vector3<f64>, Vector3<f64>),
) {
    if other.is_none() && model.base() == Base::Floating {
        for k in 0..3 {
            let mut e = Vector3::zeros();
            e[k] = 1.0;
            write(k, e, Vector3::zeros());
            write(3 + k, e.cross(p_BP_W), e);
        }
    }
    walk(model, frame, other, |i, sign| {
        let body = &kin.bodies[i];
        write(model.bodies[i].i_v, (body.s_v + body.s_w.cross(p_BP_W)) * sign, body.s_w * sign);
    });
}

/// Calls `visit(body, 1)` for the bodies from `frame` up to the last body above both, and `visit(body, -1)` for those from `other`; without it, from the root.
#[inline]
fn walk(model: &Model, frame: FrameId, other: Option<FrameId>, mut visit: impl FnMut(usize, f64)) {
    let body_of = |frame: FrameId| model.frames[frame.index()].body;
    let (mut i, mut j) = (body_of(frame), other.map_or(0, body_of));
    // Parents come before children, so the larger of two different indices is not above the other.
    while i != j {
        if i > j {
            visit(i, 1.0);
            i = model.bodies[i].parent;
        } else {
            visit(j, -1.0);
            j = model.bodies[j].parent;
        }
    }
}
