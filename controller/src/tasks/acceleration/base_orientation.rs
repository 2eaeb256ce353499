//! Orientation of the base: `wd = K_P e_o + K_D (w_des - w)`, `e_o = log(R_des Rᵀ)`, in W axes. Source: Raiola et al. 2020, eq. (8).

use crate::math::log;
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{Matrix3, Vector3};

/// The task: three rows, rad/s².
pub struct BaseOrientation {
    nv: usize,
    /// Orientation error of the last update, rotation vector in W, rad.
    pub e_o_W: Vector3<f64>,
    /// Right side of the last update, rad/s².
    pub wd: Vector3<f64>,
}

/// Reference of the base's orientation.
#[derive(Clone, Copy, Debug)]
pub struct OrientationReference {
    /// Orientation.
    pub R_WB: Matrix3<f64>,
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
    /// Stiffness about the axes of W, 1/s².
    pub kp: [f64; 3],
    /// Damping about the axes of W, 1/s.
    pub kd: [f64; 3],
    /// Whether the task has rows.
    pub active: bool,
}

impl BaseOrientation {
    /// For a floating base.
    pub fn new(of: &Structure<'_>) -> Self {
        let nan = Vector3::from_element(f64::NAN);
        BaseOrientation { nv: of.model.nv(), e_o_W: nan, wd: nan }
    }
}

impl Task for BaseOrientation {
    type Reference = OrientationReference;

    fn size(&self) -> usize {
        3
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, 3..6)
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &OrientationReference, rows: &mut Rows) {
        let base = state.kin.base();
        self.e_o_W = log(&(reference.R_WB * base.R_WB.transpose()));
        let e_w = reference.w_WB_W - base.w_WB_W;
        for k in 0..3 {
            self.wd[k] = reference.kp[k] * self.e_o_W[k] + reference.kd[k] * e_w[k];
            rows.switch(k, reference.active);
            if reference.active {
                rows.A[(k, 3 + k)] = 1.0;
                rows.b[k] = self.wd[k];
            }
        }
    }
}
