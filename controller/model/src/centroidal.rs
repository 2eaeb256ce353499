//! Centre of mass and centroidal momentum.
//!
//! Source: D. E. Orin, A. Goswami, S.-H. Lee, *Centroidal dynamics of a humanoid robot* (2013). With spatial quantities about
//! the origin of B, the momentum per unit of `v` is the upper part of the mass matrix; only the reference point is moved to C.

use nalgebra::{DMatrix, Vector3, Vector6};

use super::bodies::{Base, GRAVITY, Model};
use super::kinematics::Kinematics;

/// Centre of mass `p_WC`, in W, m.
#[inline]
pub fn com(kin: &Kinematics) -> Vector3<f64> {
    kin.base.p_WB + p_BC_W(kin)
}

/// Centre of mass from the origin of B, in W axes, m.
#[inline]
pub fn p_BC_W(kin: &Kinematics) -> Vector3<f64> {
    kin.bodies[0].subtree.mc / kin.bodies[0].subtree.m
}

/// Velocity of the centre of mass `v_WC`, in W, m/s.
#[inline]
pub fn com_velocity(kin: &Kinematics) -> Vector3<f64> {
    kin.base.v_WB + momentum_seen_from_base(kin).0 / kin.bodies[0].subtree.m
}

/// Acceleration of the centre of mass with `vd = 0`, in W, m/s², without gravity: `dv_WC/dt = J_WC vd + Jd_WC v`.
#[inline]
pub fn com_bias_acceleration(kin: &Kinematics) -> Vector3<f64> {
    let whole = &kin.bodies[0];
    whole.f / whole.subtree.m - Vector3::new(0.0, 0.0, GRAVITY)
}

/// Jacobian of the centre of mass: `v_WC = J v`.
///
/// - writes `J`, 3 x nv, in W axes.
/// - cost O(nv), no allocation.
///
/// # Panics
/// If `J` has another shape.
pub fn com_jacobian(model: &Model, kin: &Kinematics, J: &mut DMatrix<f64>) {
    assert_eq!(J.shape(), (3, model.nv()), "the Jacobian of the centre of mass is 3 x nv");
    let m = kin.bodies[0].subtree.m;
    if model.base() == Base::Floating {
        let c = p_BC_W(kin);
        for k in 0..3 {
            let e = unit(k);
            J.set_column(k, &e);
            J.set_column(3 + k, &e.cross(&c));
        }
    }
    for i in 1..model.bodies.len() {
        let body = &kin.bodies[i];
        let (p, _) = body.subtree.momentum(&body.s_v, &body.s_w);
        J.set_column(model.bodies[i].i_v, &(p / m));
    }
}

/// Momentum of the robot about its centre of mass: `[p; l]`, linear N s, angular N m s, in W axes.
pub fn centroidal_momentum(kin: &Kinematics) -> Vector6<f64> {
    let (p, l) = momentum_seen_from_base(kin);
    let l = l - p_BC_W(kin).cross(&p);
    let p = p + kin.bodies[0].subtree.m * kin.base.v_WB;
    Vector6::new(p.x, p.y, p.z, l.x, l.y, l.z)
}

/// Centroidal momentum matrix: `[p; l] = A_G v`.
///
/// - writes `A_G`, 6 x nv, rows as [`centroidal_momentum`].
/// - cost O(nv), no allocation.
///
/// # Panics
/// If `A_G` has another shape.
pub fn centroidal_momentum_matrix(model: &Model, kin: &Kinematics, A_G: &mut DMatrix<f64>) {
    assert_eq!(A_G.shape(), (6, model.nv()), "the centroidal momentum matrix is 6 x nv");
    let c = p_BC_W(kin);
    let mut set = |column: usize, (p, l): (Vector3<f64>, Vector3<f64>)| {
        let l = l - c.cross(&p);
        A_G.column_mut(column).copy_from(&Vector6::new(p.x, p.y, p.z, l.x, l.y, l.z));
    };
    if model.base() == Base::Floating {
        for k in 0..3 {
            set(k, kin.bodies[0].subtree.momentum(&unit(k), &Vector3::zeros()));
            set(3 + k, kin.bodies[0].subtree.momentum(&Vector3::zeros(), &unit(k)));
        }
    }
    for i in 1..model.bodies.len() {
        let body = &kin.bodies[i];
        set(model.bodies[i].i_v, body.subtree.momentum(&body.s_v, &body.s_w));
    }
}

/// Momentum `(p, l)` about the origin of B in a frame that moves with `v_WB`.
fn momentum_seen_from_base(kin: &Kinematics) -> (Vector3<f64>, Vector3<f64>) {
    let (mut p, mut l) = (Vector3::zeros(), Vector3::zeros());
    for body in &kin.bodies {
        let (p_i, l_i) = body.inertia.momentum(&body.v, &body.w);
        p += p_i;
        l += l_i;
    }
    (p, l)
}

fn unit(k: usize) -> Vector3<f64> {
    let mut e = Vector3::zeros();
    e[k] = 1.0;
    e
}
