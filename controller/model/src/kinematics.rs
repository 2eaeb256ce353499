//! All quantities that depend on the state, computed in one pass from the root outward and one pass back.

use nalgebra::{Matrix3, Vector3};

use super::bodies::{Base, FrameId, GRAVITY, Model, Motion};
use super::inertia::SpatialInertia;

/// Pose and velocity of the root link. SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseState {
    /// Origin of B, in W, m.
    pub p_WB: Vector3<f64>,
    /// Rotates B coordinates into W coordinates.
    pub R_WB: Matrix3<f64>,
    /// Velocity of the origin of B, in W, m/s. Ignored for a fixed base.
    pub v_WB: Vector3<f64>,
    /// Angular velocity of B, in W, rad/s. Ignored for a fixed base.
    pub w_WB_W: Vector3<f64>,
}

impl BaseState {
    /// B coincides with W, at rest.
    #[inline]
    pub fn identity() -> Self {
        Self { p_WB: Vector3::zeros(), R_WB: Matrix3::identity(), v_WB: Vector3::zeros(), w_WB_W: Vector3::zeros() }
    }
}

/// One body at one state. Spatial quantities are in W axes about the origin of B, in a frame that moves with `v_WB`.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyState {
    /// Rotates body coordinates into W coordinates; the third column is the joint axis.
    pub(super) R: Matrix3<f64>,
    /// Origin of the body from the origin of B, m.
    pub(super) r: Vector3<f64>,
    /// Joint motion per unit of `qd`, linear part: velocity of the body-fixed point at the origin of B.
    pub(super) s_v: Vector3<f64>,
    /// Joint motion per unit of `qd`, angular part.
    pub(super) s_w: Vector3<f64>,
    /// Velocity of the body-fixed point at the origin of B.
    pub(super) v: Vector3<f64>,
    /// Angular velocity.
    pub(super) w: Vector3<f64>,
    /// Spatial acceleration with `vd = 0`, linear part. Not the classical acceleration of a point: see `point_acceleration`.
    pub(super) a: Vector3<f64>,
    /// Spatial acceleration with `vd = 0`, angular part.
    pub(super) al: Vector3<f64>,
    /// Inertia of this body.
    pub(super) inertia: SpatialInertia,
    /// Inertia of this body and its descendants.
    pub(super) subtree: SpatialInertia,
    /// Force on this body and its descendants with `vd = 0`, against gravity, N.
    pub(super) f: Vector3<f64>,
    /// Torque of that force about the origin of B, N m.
    pub(super) n: Vector3<f64>,
}

impl BodyState {
    fn at_rest() -> Self {
        let zero = Vector3::zeros();
        Self {
            R: Matrix3::identity(),
            r: zero,
            s_v: zero,
            s_w: zero,
            v: zero,
            w: zero,
            a: zero,
            al: zero,
            inertia: SpatialInertia::zero(),
            subtree: SpatialInertia::zero(),
            f: zero,
            n: zero,
        }
    }

    /// Velocity of the body-fixed point at `r` from the origin of B, in a frame that moves with `v_WB`.
    #[inline]
    pub(super) fn point_velocity(&self, r: &Vector3<f64>) -> Vector3<f64> {
        self.v + self.w.cross(r)
    }

    /// Classical acceleration with `vd = 0` of the body-fixed point at `r` from the origin of B.
    #[inline]
    pub(super) fn point_acceleration(&self, r: &Vector3<f64>) -> Vector3<f64> {
        self.a + self.al.cross(r) + self.w.cross(&self.point_velocity(r))
    }

    /// Force and torque about the origin of B that give this body alone the spatial acceleration `(a, al)`, against gravity.
    #[inline]
    pub(super) fn wrench(&self, a: &Vector3<f64>, al: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let held = Vector3::new(a.x, a.y, a.z + GRAVITY);
        let (f, n) = self.inertia.momentum(&held, al);
        let (p, l) = self.inertia.momentum(&self.v, &self.w);
        (f + self.w.cross(&p), n + self.w.cross(&l) + self.v.cross(&p))
    }
}

/// Kinematics of a model at one state `(base, q, qd)`. Allocated once, updated in place.
///
/// An update writes every number that later functions read, so results do not depend on earlier states.
#[derive(Debug, Clone)]
pub struct Kinematics {
    pub(super) base: BaseState,
    pub(super) bodies: Vec<BodyState>,
}

impl Kinematics {
    /// Allocates for a model. The state is zero: B coincides with W, joints at zero, at rest.
    pub fn new(model: &Model) -> Self {
        let mut kin = Self { base: BaseState::identity(), bodies: vec![BodyState::at_rest(); model.bodies.len()] };
        let zero = vec![0.0; model.nj()];
        kin.update(model, &BaseState::identity(), &zero, &zero);
        kin
    }

    /// Computes placements, velocities, bias accelerations, inertias and bias wrenches of all bodies at a state.
    ///
    /// ```text
    /// V_i = V_p + S_i qd_i      A_i = A_p + V_i × S_i qd_i      F_i = I_i A_i + V_i ×* I_i V_i
    /// ```
    /// Source: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), §5.3 and §6.2, with v̇ = 0.
    ///
    /// - `base`: pose and velocity of the root link; `R_WB` must be a rotation; it is not checked.
    /// - `q`, `qd`: length `nj`, rad and rad/s (m and m/s for prismatic joints).
    /// - cost O(nj), no allocation. Non-finite values propagate; the caller must exclude them.
    ///
    /// # Panics
    /// If the length of `q` or `qd` is not `nj`, or `self` was built for a model with another number of bodies.
    #[inline]
    pub fn update(&mut self, model: &Model, base: &BaseState, q: &[f64], qd: &[f64]) {
        assert_eq!(q.len(), model.nj(), "q has one position for each movable joint");
        assert_eq!(qd.len(), model.nj(), "qd has one velocity for each movable joint");
        assert_eq!(
            self.bodies.len(),
            model.bodies.len(),
            "the kinematics were built for a model with this number of bodies"
        );
        self.base = *base;
        if model.base() == Base::Fixed {
            self.base.v_WB = Vector3::zeros();
            self.base.w_WB_W = Vector3::zeros();
        }
        self.root(model);
        for i in 1..model.bodies.len() {
            self.outward(model, i, q, qd);
        }
        for i in (1..model.bodies.len()).rev() {
            let BodyState { subtree, f, n, .. } = self.bodies[i];
            let parent = &mut self.bodies[model.bodies[i].parent];
            parent.subtree += subtree;
            parent.f += f;
            parent.n += n;
        }
    }

    fn root(&mut self, model: &Model) {
        let body = &model.bodies[0];
        let mut state = BodyState::at_rest();
        state.R = self.base.R_WB * body.X_PB.R;
        state.w = self.base.w_WB_W;
        state.finish(body.m, &body.c, &body.I_C);
        self.bodies[0] = state;
    }

    /// Computes one body from its parent.
    #[inline]
    fn outward(&mut self, model: &Model, i: usize, q: &[f64], qd: &[f64]) {
        let body = &model.bodies[i];
        let (q, qd) = (q[body.i_q], qd[body.i_q]);
        let parent = &self.bodies[body.parent];
        let R_WJ = parent.R * body.X_PB.R;
        let r_J = parent.r + parent.R * body.X_PB.p;
        let z: Vector3<f64> = R_WJ.column(2).into();
        let (v_p, w_p, a_p, al_p) = (parent.v, parent.w, parent.a, parent.al);

        let state = &mut self.bodies[i];
        match body.motion {
            Motion::Rotation => {
                let (s, c) = libm::sincos(q);
                let (x, y) = (R_WJ.column(0), R_WJ.column(1));
                state.R = Matrix3::from_columns(&[c * x + s * y, c * y - s * x, z]);
                state.r = r_J;
                state.s_v = r_J.cross(&z);
                state.s_w = z;
            }
            Motion::Translation => {
                state.R = R_WJ;
                state.r = r_J + q * z;
                state.s_v = z;
                state.s_w = Vector3::zeros();
            }
        }
        let (dv, dw) = (qd * state.s_v, qd * state.s_w);
        state.v = v_p + dv;
        state.w = w_p + dw;
        state.a = a_p + state.w.cross(&dv) + state.v.cross(&dw);
        state.al = al_p + state.w.cross(&dw);
        state.finish(body.m, &body.c, &body.I_C);
    }

    /// Pose and velocity of the root link at the last update.
    #[inline]
    pub fn base(&self) -> &BaseState {
        &self.base
    }

    /// Origin of a frame from the origin of W, in W, m.
    #[inline]
    pub fn p_WF(&self, model: &Model, frame: FrameId) -> Vector3<f64> {
        self.base.p_WB + self.p_BF_W(model, frame)
    }

    /// Origin of a frame from the origin of B, in W, m.
    #[inline]
    pub fn p_BF_W(&self, model: &Model, frame: FrameId) -> Vector3<f64> {
        let frame = &model.frames[frame.index()];
        let body = &self.bodies[frame.body];
        body.r + body.R * frame.X_BL.p
    }

    /// Rotates coordinates of a frame into W coordinates.
    #[inline]
    pub fn R_WF(&self, model: &Model, frame: FrameId) -> Matrix3<f64> {
        let frame = &model.frames[frame.index()];
        self.bodies[frame.body].R * frame.X_BL.R
    }

    /// Velocity of the origin of a frame, in W, m/s.
    #[inline]
    pub fn v_WF(&self, model: &Model, frame: FrameId) -> Vector3<f64> {
        self.base.v_WB + self.v_BF_W(model, frame)
    }

    /// Velocity of the origin of a frame minus that of the origin of B, in W axes, m/s.
    #[inline]
    pub fn v_BF_W(&self, model: &Model, frame: FrameId) -> Vector3<f64> {
        let r = self.p_BF_W(model, frame);
        self.bodies[model.frames[frame.index()].body].point_velocity(&r)
    }

    /// Angular velocity of a frame, in W, rad/s.
    #[inline]
    pub fn w_WF_W(&self, model: &Model, frame: FrameId) -> Vector3<f64> {
        self.bodies[model.frames[frame.index()].body].w
    }
}

impl BodyState {
    /// Computes inertia and bias wrench of this body alone from its pose, velocity and acceleration.
    #[inline]
    fn finish(&mut self, m: f64, c: &Vector3<f64>, I_C: &Matrix3<f64>) {
        let c_W = self.r + self.R * c;
        let I_C_W = self.R * I_C * self.R.transpose();
        self.inertia = SpatialInertia::from_com(m, c_W, &I_C_W);
        self.subtree = self.inertia;
        (self.f, self.n) = self.wrench(&self.a, &self.al);
    }
}
