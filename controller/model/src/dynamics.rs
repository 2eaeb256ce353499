//! Mass matrix, bias force, gravity, inverse dynamics.

use nalgebra::{DMatrix, DVector, Vector3};

use super::bodies::{Base, GRAVITY, Model};
use super::kinematics::Kinematics;

/// Mass matrix `M(q)`, kg, kg m and kg m² by rows of `v`.
///
/// Column i is the generalized force at the base and at the joints above that gives joint i a unit acceleration.
/// Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), §6.2 (composite rigid bodies).
///
/// - writes all of `M`, nv x nv; exactly symmetric.
/// - cost O(nv depth), no allocation.
///
/// # Panics
/// If the shape of `M` is not nv x nv.
#[inline]
pub fn mass_matrix(model: &Model, kin: &Kinematics, M: &mut DMatrix<f64>) {
    let nv = model.nv();
    assert_eq!(M.shape(), (nv, nv), "the mass matrix is nv x nv");
    M.fill(0.0);
    let entries = M.as_mut_slice();
    let mut set = |row: usize, column: usize, value: f64| {
        entries[column * nv + row] = value;
        entries[row * nv + column] = value;
    };
    let floating = model.base() == Base::Floating;
    if floating {
        let whole = &kin.bodies[0].subtree;
        let mc = &whole.mc;
        for k in 0..3 {
            set(k, k, whole.m);
            for l in 0..=k {
                set(3 + k, 3 + l, 0.5 * (whole.I_O[(k, l)] + whole.I_O[(l, k)]));
            }
        }
        // [mc]x below the diagonal: moment of the linear part.
        set(4, 0, mc.z);
        set(5, 0, -mc.y);
        set(3, 1, -mc.z);
        set(5, 1, mc.x);
        set(3, 2, mc.y);
        set(4, 2, -mc.x);
    }
    for i in 1..model.bodies.len() {
        let body = &kin.bodies[i];
        let (f, n) = body.subtree.momentum(&body.s_v, &body.s_w);
        let i_v = model.bodies[i].i_v;
        if floating {
            for k in 0..3 {
                set(k, i_v, f[k]);
                set(3 + k, i_v, n[k]);
            }
        }
        let mut j = i;
        while j != 0 {
            let above = &kin.bodies[j];
            set(model.bodies[j].i_v, i_v, above.s_v.dot(&f) + above.s_w.dot(&n));
            j = model.bodies[j].parent;
        }
    }
}

/// Bias force `h(q, v)`: Coriolis, centrifugal and gravity terms.
///
/// ```text
/// M(q) vd + h(q, v) = Sᵀ tau + Jᵀ F
/// ```
/// Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), §5.3, with v̇ = 0.
///
/// - writes `h`, length nv: rows 0..3 N, 3..6 N m about the origin of B, 6.. N m (N for prismatic joints).
/// - cost O(nv), no allocation. The bits do not depend on `p_WB` and `v_WB`.
///
/// # Panics
/// If the length of `h` is not nv.
#[inline]
pub fn bias_force(model: &Model, kin: &Kinematics, h: &mut DVector<f64>) {
    project(model, kin, h, |i| (kin.bodies[i].f, kin.bodies[i].n));
}

/// Gravity part of the bias force: `h(q, 0)`. Shape and units: see [`bias_force`].
///
/// # Panics
/// If the length of `g` is not nv.
pub fn gravity_force(model: &Model, kin: &Kinematics, g: &mut DVector<f64>) {
    project(model, kin, g, |i| {
        let subtree = &kin.bodies[i].subtree;
        let up = Vector3::new(0.0, 0.0, GRAVITY);
        (subtree.m * up, subtree.mc.cross(&up))
    });
}

/// Derivative of the gravity torques by the joint positions, `G_ij = ∂g_i/∂q_j`: the Hessian of the potential energy.
///
/// With unit rate, joint i gives its subtree the momentum `p_i`, and `g_i = g e_z · p_i`. A joint j above or equal to i turns the whole subtree with the
/// axis of i, so `∂p_i/∂q_j = s_w,j × p_i`. The other half follows by symmetry; joints on different branches have no common entry.
///
/// - writes all of `G`, nj x nj, N m/rad (N/m, N/rad or N m/m for prismatic joints); exactly symmetric.
/// - cost O(nj depth), no allocation.
///
/// # Panics
/// If the shape of `G` is not nj x nj.
pub fn gravity_derivative(model: &Model, kin: &Kinematics, G: &mut DMatrix<f64>) {
    let nj = model.nj();
    assert_eq!(G.shape(), (nj, nj), "the derivative of the gravity torques is nj x nj");
    G.fill(0.0);
    for i in 1..model.bodies.len() {
        let body = &kin.bodies[i];
        let (p, _) = body.subtree.momentum(&body.s_v, &body.s_w);
        let row = model.bodies[i].i_q;
        let mut j = i;
        while j != 0 {
            let s_w = &kin.bodies[j].s_w;
            let (column, entry) = (model.bodies[j].i_q, GRAVITY * (s_w.x * p.y - s_w.y * p.x));
            (G[(row, column)], G[(column, row)]) = (entry, entry);
            j = model.bodies[j].parent;
        }
    }
}

/// Preallocated workspace of [`rnea`].
#[derive(Debug, Clone)]
pub struct RneaScratch {
    bodies: Vec<RneaBody>,
}

/// Spatial acceleration of a body and wrench on its subtree; frame: see [`Kinematics`].
#[derive(Debug, Clone, Copy)]
struct RneaBody {
    a: Vector3<f64>,
    al: Vector3<f64>,
    f: Vector3<f64>,
    n: Vector3<f64>,
}

impl RneaScratch {
    /// Allocates the workspace for a model.
    pub fn new(model: &Model) -> Self {
        let zero = Vector3::zeros();
        Self { bodies: vec![RneaBody { a: zero, al: zero, f: zero, n: zero }; model.bodies.len()] }
    }
}

/// Inverse dynamics: generalized force `M(q) vd + h(q, v)` by the recursive Newton-Euler algorithm.
///
/// Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), §5.3.
///
/// - `vd`: length nv, componentwise derivative of `v`: its base part is the classical acceleration of the origin of B.
/// - writes `tau`, length nv: the first six rows are the wrench on the base about the origin of B, in W axes.
/// - cost O(nv), no allocation.
///
/// # Panics
/// If the length of `vd` or `tau` is not nv, or `scratch` was built for a smaller model.
pub fn rnea(model: &Model, kin: &Kinematics, vd: &DVector<f64>, scratch: &mut RneaScratch, tau: &mut DVector<f64>) {
    assert_eq!(vd.len(), model.nv(), "vd has length nv");
    let bodies = &mut scratch.bodies;
    // In a frame that moves with v_WB, the spatial acceleration of the base equals the classical acceleration of its origin.
    let (a, al) = match model.base() {
        Base::Floating => (vd.fixed_rows::<3>(0).into(), vd.fixed_rows::<3>(3).into()),
        Base::Fixed => (Vector3::zeros(), Vector3::zeros()),
    };
    let (f, n) = kin.bodies[0].wrench(&a, &al);
    bodies[0] = RneaBody { a, al, f, n };
    for i in 1..model.bodies.len() {
        let (body, state) = (&model.bodies[i], &kin.bodies[i]);
        let (above, above_bias) = (&bodies[body.parent], &kin.bodies[body.parent]);
        let qdd = vd[body.i_v];
        // The difference of the two bias accelerations is the velocity-dependent part of the joint.
        let a = above.a + (state.a - above_bias.a) + qdd * state.s_v;
        let al = above.al + (state.al - above_bias.al) + qdd * state.s_w;
        let (f, n) = state.wrench(&a, &al);
        bodies[i] = RneaBody { a, al, f, n };
    }
    for i in (1..model.bodies.len()).rev() {
        let RneaBody { f, n, .. } = bodies[i];
        let above = &mut bodies[model.bodies[i].parent];
        above.f += f;
        above.n += n;
    }
    project(model, kin, tau, |i| (bodies[i].f, bodies[i].n));
}

/// Rows of a generalized force from the wrench `(f, n)` on each subtree, about the origin of B.
#[inline]
fn project(
    model: &Model,
    kin: &Kinematics,
    force: &mut DVector<f64>,
    wrench: impl Fn(usize) -> (Vector3<f64>, Vector3<f64>),
) {
    assert_eq!(force.len(), model.nv(), "a generalized force has length nv");
    let rows = force.as_mut_slice();
    if model.base() == Base::Floating {
        let (f, n) = wrench(0);
        rows[..3].copy_from_slice(f.as_slice());
        rows[3..6].copy_from_slice(n.as_slice());
    }
    for i in 1..model.bodies.len() {
        let (f, n) = wrench(i);
        let body = &kin.bodies[i];
        rows[model.bodies[i].i_v] = body.s_v.dot(&f) + body.s_w.dot(&n);
    }
}
