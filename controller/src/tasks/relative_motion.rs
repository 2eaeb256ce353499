//! Motion of a link relative to the world or to another link, in the axes of the latter.

use crate::model::{FrameId, Kinematics, Model, frame_bias_acceleration, frame_jacobian};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// The link, the other link, and their Jacobians.
pub(super) struct RelativeMotion {
    link: FrameId,
    relative_to: Option<FrameId>,
    J_link: DMatrix<f64>,
    J_other: DMatrix<f64>,
}

/// Pose, twist and bias acceleration of a frame; position and velocity are relative to the base.
struct Motion {
    p: Vector3<f64>,
    R: Matrix3<f64>,
    v: Vector3<f64>,
    w: Vector3<f64>,
    a: Vector3<f64>,
    al: Vector3<f64>,
}

/// Pose, twist and bias acceleration of the link in the axes of the other link, or of the world.
pub(super) struct Relative {
    pub p: Vector3<f64>,
    pub R: Matrix3<f64>,
    pub v: Vector3<f64>,
    pub w: Vector3<f64>,
    pub linear_bias: Vector3<f64>,
    pub angular_bias: Vector3<f64>,
}

impl Motion {
    fn of(model: &Model, kin: &Kinematics, frame: FrameId) -> Self {
        let bias = frame_bias_acceleration(model, kin, frame);
        Motion {
            p: kin.p_BF_W(model, frame),
            R: kin.R_WF(model, frame),
            v: kin.v_BF_W(model, frame),
            w: kin.w_WF_W(model, frame),
            a: bias.fixed_rows::<3>(0).into_owned(),
            al: bias.fixed_rows::<3>(3).into_owned(),
        }
    }

    /// The world frame: no motion.
    fn world() -> Self {
        let zero = Vector3::zeros();
        Motion { p: zero, R: Matrix3::identity(), v: zero, w: zero, a: zero, al: zero }
    }
}

impl RelativeMotion {
    pub fn new(model: &Model, link: FrameId, relative_to: Option<FrameId>) -> Self {
        let J = DMatrix::from_element(6, model.nv(), f64::NAN);
        RelativeMotion { link, relative_to, J_link: J.clone(), J_other: J }
    }

    /// Whether the motion is relative to the world.
    pub fn in_world(&self) -> bool {
        self.relative_to.is_none()
    }

    /// Writes the Jacobian to `A`, 6 x nv, and returns pose, twist and bias. For the link L and the other link R, p = p_BL - p_BR, all in the axes of R:
    ///
    /// ```text
    /// A = Rᵀ [ J_v,L - J_v,R + [p]x J_w,R ;  J_w,L - J_w,R ]
    /// bias = Rᵀ [ a_L - a_R - α_R x p - 2 ω_R x ṗ - ω_R x (ω_R x p) ;  α_L - α_R - ω_R x (ω_L - ω_R) ],   ṗ = v_L - v_R - ω_R x p
    /// ```
    /// Positions and velocities of a link in the world are relative to the base.
    pub fn update(&mut self, model: &Model, kin: &Kinematics, A: &mut DMatrix<f64>) -> Relative {
        let at = Motion::of(model, kin, self.link);
        let to = self.relative_to.map_or_else(Motion::world, |frame| Motion::of(model, kin, frame));
        let to_axes = to.R.transpose();
        let p = at.p - to.p;
        let v = at.v - to.v - to.w.cross(&p);
        let w = at.w - to.w;
        let linear = at.a - to.a - to.al.cross(&p) - to.w.cross(&v) * 2.0 - to.w.cross(&to.w.cross(&p));
        let angular = at.al - to.al - to.w.cross(&w);

        frame_jacobian(model, kin, self.link, &mut self.J_link);
        match self.relative_to {
            Some(frame) => frame_jacobian(model, kin, frame, &mut self.J_other),
            None => self.J_other.fill(0.0),
        }
        for col in 0..model.nv() {
            let part = |J: &DMatrix<f64>, at: usize| J.fixed_view::<3, 1>(at, col).into_owned();
            let turn = part(&self.J_other, 3);
            let lower = part(&self.J_link, 3) - turn;
            let upper = part(&self.J_link, 0) - part(&self.J_other, 0) + p.cross(&turn);
            A.fixed_view_mut::<3, 1>(0, col).copy_from(&(to_axes * upper));
            A.fixed_view_mut::<3, 1>(3, col).copy_from(&(to_axes * lower));
        }
        Relative {
            p: to_axes * p,
            R: to_axes * at.R,
            v: to_axes * v,
            w: to_axes * w,
            linear_bias: to_axes * linear,
            angular_bias: to_axes * angular,
        }
    }
}
