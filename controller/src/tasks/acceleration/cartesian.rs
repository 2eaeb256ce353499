//! Cartesian task: the pose of a link, in the world or relative to another link of the robot.

use crate::math::log;
use crate::model::{Kinematics, Model};
use crate::params::exact::array;
use crate::stack::{ModelState, Rows, StackError, Task};
use crate::tasks::relative_motion::RelativeMotion;
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
    motion: RelativeMotion,
    nv: usize,
    kp: Vector6<f64>,
    kd: Vector6<f64>,
    inertia: bool,
    home: PoseReference,
    L: DMatrix<f64>,
    Y: DMatrix<f64>,
}

/// Reference of a Cartesian task, in the axes of the other link or of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseReference {
    /// Position, m. Not used in the world: the position of the robot is unknown.
    pub p: Vector3<f64>,
    /// Orientation.
    pub R: Matrix3<f64>,
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
        let (nan, nv) = (f64::NAN, model.nv());
        let mut motion = RelativeMotion::new(model, link, relative_to);
        let at_home = motion.update(model, home, &mut DMatrix::from_element(6, nv, nan));
        Ok(Cartesian {
            motion,
            nv,
            kp: config.kp.into(),
            kd: config.kd.into(),
            inertia: config.inertia,
            home: PoseReference { p: at_home.p, R: at_home.R },
            L: DMatrix::from_element(nv, nv, nan),
            Y: DMatrix::from_element(nv, 6, nan),
        })
    }

    /// The pose in the nominal posture.
    pub fn home(&self) -> PoseReference {
        self.home
    }

    /// Whether the reference is a pose in the world.
    pub fn in_world(&self) -> bool {
        self.motion.in_world()
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

impl Task for Cartesian {
    type Reference = PoseReference;

    fn size(&self) -> usize {
        6
    }

    /// One dense block of six.
    fn rows(&self) -> Rows {
        let mut rows = Rows::new(self.nv, [(6, (0..self.nv).collect())]);
        rows.switch(0, true);
        rows
    }

    /// Writes the rows, in the axes of the other link or of the world:
    ///
    /// ```text
    /// A vd = K_P e - K_D ẋ - bias,    e = [ p_des - p ; log(R_des Rᵀ) ]          A, p, R, ẋ, bias: of the relative motion
    /// ```
    /// With `inertia`, the part with the gains is premultiplied by `A M⁻¹ Aᵀ`: Raiola et al. 2020, appendix, eq. (10).
    fn update(&mut self, state: &ModelState<'_>, reference: &PoseReference, rows: &mut Rows) {
        let at = self.motion.update(state.model, state.kin, &mut rows.A);
        let e_o = log(&(reference.R * at.R.transpose()));
        let e_p = reference.p - at.p;
        let mut u = Vector6::zeros();
        for k in 0..3 {
            if !self.motion.in_world() {
                u[k] = self.kp[k] * e_p[k] - self.kd[k] * at.v[k];
            }
            u[3 + k] = self.kp[3 + k] * e_o[k] - self.kd[3 + k] * at.w[k];
        }
        if self.inertia {
            u = self.premultiply(state.M, &rows.A, &u);
        }
        for k in 0..3 {
            rows.b[k] = u[k] - at.linear_bias[k];
            rows.b[3 + k] = u[3 + k] - at.angular_bias[k];
        }
    }
}
