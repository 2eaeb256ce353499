//! Cartesian task: the pose of a link, in the world or relative to another link of the robot.

use super::{Rows, StackError};
use crate::math::{Rz, log};
use crate::model::{FrameId, Kinematics, Model, frame_bias_acceleration, frame_jacobian};
use crate::params::exact::array;
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// Largest gain of a task, in its own unit.
const MAX_GAIN: f64 = 1e4;

/// A Cartesian task in the parameters: `[stack.tasks.NAME]` with `type = "cartesian"`.
///
/// Six rows: x, y, z of the link's origin, then rotation about x, y, z; in the axes of `relative_to`, or of the world. The
/// reference is the pose in the nominal posture with level trunk. A reference in the world rotates with the commanded heading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CartesianConfig {
    /// Link that the task controls.
    pub link: String,
    /// Link in whose frame the pose is controlled; default: the world. The controller does not know the position of the robot in the world:
    /// position rows in the world have no gains and keep the acceleration of the link at zero.
    #[serde(default)]
    pub relative_to: Option<String>,
    /// Stiffness of each row: 1/s², or N/m and N m/rad with `inertia`.
    #[serde(deserialize_with = "array")]
    pub kp: [f64; 6],
    /// Damping of each row: 1/s, or N s/m and N m s/rad.
    #[serde(deserialize_with = "array")]
    pub kd: [f64; 6],
    /// Gains give forces: they are premultiplied by the inverse of the inertia at the link. Set the gains of rows that the formula does not
    /// use to 0 in this case.
    #[serde(default)]
    pub inertia: bool,
}

/// A Cartesian task of a robot, with preallocated memory.
pub struct Cartesian {
    link: FrameId,
    relative_to: Option<FrameId>,
    kp: Vector6<f64>,
    kd: Vector6<f64>,
    inertia: bool,
    p_des: Vector3<f64>,
    R_des: Matrix3<f64>,
    J_link: DMatrix<f64>,
    J_other: DMatrix<f64>,
    L: DMatrix<f64>,
    Y: DMatrix<f64>,
}

/// Pose, twist and bias acceleration of a frame; position and velocity are relative to the base. For two links only their difference is
/// used, and position rows in the world have no gains.
struct Motion {
    p: Vector3<f64>,
    R: Matrix3<f64>,
    v: Vector3<f64>,
    w: Vector3<f64>,
    a: Vector3<f64>,
    al: Vector3<f64>,
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

impl Cartesian {
    /// Builds the task; its reference is the pose at `home`.
    ///
    /// - `name`: name of the task, used in errors.
    /// - `home`: kinematics in the nominal posture with level trunk.
    ///
    /// # Errors
    /// Links that the model does not have; gains that are not in 0 to 10000.
    pub fn new(name: &str, config: &CartesianConfig, model: &Model, home: &Kinematics) -> Result<Self, StackError> {
        let frame = |key, link: &str| {
            let wrong =
                |e: crate::model::ModelError| StackError::Link { task: name.to_owned(), key, what: e.to_string() };
            model.frame(link).map_err(wrong)
        };
        for (key, gains) in [("kp", &config.kp), ("kd", &config.kd)] {
            if let Some(&found) = gains.iter().find(|gain| !(0.0..=MAX_GAIN).contains(*gain)) {
                return Err(StackError::Gain { task: name.to_owned(), key, found });
            }
        }
        let link = frame("link", &config.link)?;
        let relative_to = config.relative_to.as_deref().map(|link| frame("relative_to", link)).transpose()?;
        let at = Motion::of(model, home, link);
        let to = relative_to.map_or_else(Motion::world, |frame| Motion::of(model, home, frame));
        let (nan, nv) = (f64::NAN, model.nv());
        Ok(Cartesian {
            link,
            relative_to,
            kp: config.kp.into(),
            kd: config.kd.into(),
            inertia: config.inertia,
            p_des: to.R.transpose() * (at.p - to.p),
            R_des: to.R.transpose() * at.R,
            J_link: DMatrix::from_element(6, nv, nan),
            J_other: DMatrix::from_element(6, nv, nan),
            L: DMatrix::from_element(nv, nv, nan),
            Y: DMatrix::from_element(nv, 6, nan),
        })
    }

    /// Allocates its rows: one dense block of six.
    pub fn rows(model: &Model) -> Rows {
        let mut rows = Rows::new(model.nv(), [(6, (0..model.nv()).collect())]);
        rows.switch(0, true);
        rows
    }

    /// Writes the rows. For the link L and the other link R, p = p_BL - p_BR, all in the axes of R:
    ///
    /// ```text
    /// A = Rᵀ [ J_v,L - J_v,R + [p]x J_w,R ;  J_w,L - J_w,R ]
    /// A vd = K_P e - K_D ẋ - bias,    e = [ p_des - Rᵀ p ; log(R_des (Rᵀ R_WL)ᵀ) ]
    /// bias = Rᵀ [ a_L - a_R - α_R x p - 2 ω_R x ṗ - ω_R x (ω_R x p) ;  α_L - α_R - ω_R x (ω_L - ω_R) ],   ṗ = v_L - v_R - ω_R x p
    /// ```
    /// With `inertia`, the part with the gains is premultiplied by `A M⁻¹ Aᵀ`: Raiola et al. 2020, appendix, eq. (10).
    ///
    /// - `M`: mass matrix, nv x nv.
    /// - `heading`: commanded heading, rad; a reference in the world rotates with it.
    pub fn fill(&mut self, model: &Model, kin: &Kinematics, M: &DMatrix<f64>, heading: f64, rows: &mut Rows) {
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
            rows.A.fixed_view_mut::<3, 1>(0, col).copy_from(&(to_axes * upper));
            rows.A.fixed_view_mut::<3, 1>(3, col).copy_from(&(to_axes * lower));
        }

        let R_des = if self.relative_to.is_some() { self.R_des } else { Rz(heading) * self.R_des };
        let e_o = log(&(R_des * (to_axes * at.R).transpose()));
        let e_p = self.p_des - to_axes * p;
        let (v, w) = (to_axes * v, to_axes * w);
        let mut u = Vector6::zeros();
        for k in 0..3 {
            if self.relative_to.is_some() {
                u[k] = self.kp[k] * e_p[k] - self.kd[k] * v[k];
            }
            u[3 + k] = self.kp[3 + k] * e_o[k] - self.kd[3 + k] * w[k];
        }
        if self.inertia {
            u = self.premultiply(M, &rows.A, &u);
        }
        let (linear, angular) = (to_axes * linear, to_axes * angular);
        for k in 0..3 {
            rows.b[k] = u[k] - linear[k];
            rows.b[3 + k] = u[3 + k] - angular[k];
        }
    }

    /// `A M⁻¹ Aᵀ u = Yᵀ (Y u)` with `L Y = Aᵀ` and the Cholesky factor `M = L Lᵀ`.
    fn premultiply(&mut self, M: &DMatrix<f64>, A: &DMatrix<f64>, u: &Vector6<f64>) -> Vector6<f64> {
        let (L, Y, nv) = (&mut self.L, &mut self.Y, M.nrows());
        for j in 0..nv {
            for i in j..nv {
                let sum = (0..j).fold(M[(i, j)], |sum, k| sum - L[(i, k)] * L[(j, k)]);
                L[(i, j)] = if i == j { sum.sqrt() } else { sum / L[(j, j)] };
            }
        }
        for col in 0..6 {
            for i in 0..nv {
                let sum = (0..i).fold(A[(col, i)], |sum, k| sum - L[(i, k)] * Y[(k, col)]);
                Y[(i, col)] = sum / L[(i, i)];
            }
        }
        let mut out = Vector6::zeros();
        for i in 0..nv {
            let Yu = (0..6).fold(0.0, |sum, col| sum + Y[(i, col)] * u[col]);
            for col in 0..6 {
                out[col] += Y[(i, col)] * Yu;
            }
        }
        out
    }
}
