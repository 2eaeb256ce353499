//! Position of the centre of mass in the world or relative to a link, at velocity level.
//!
//! ```text
//! A v = v_des + k (p_des - p)          in the axes of the link or of the world
//! ```
//! Relative to a link, `A` is the Jacobian of the centre of mass minus that of the point of the link at the same place: a motion of the base does not enter.
//! Source: Laurenzi 2020, eqs. (5.22)-(5.24) with the centre of mass as the distal point, and section 2.4.

use crate::model::{FrameId, com, com_jacobian, for_each_relative_column, p_BC_W};
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{Matrix3, Vector3};

/// The task: three rows, m/s. Its options may change between ticks.
pub struct CenterOfMass {
    /// Link in whose axes the position is given; `None`, the default, for the world.
    pub relative_to: Option<FrameId>,
    /// Gain k, 1/s.
    pub gain: f64,
    /// Joints whose columns stay 0, by velocity index.
    pub disabled: Vec<usize>,
    nv: usize,
}

impl CenterOfMass {
    /// In the world.
    ///
    /// - `gain`: 1/s.
    pub fn new(of: &Structure<'_>, gain: f64) -> Self {
        CenterOfMass { relative_to: None, gain, disabled: Vec::new(), nv: of.model.nv() }
    }
}

impl Task for CenterOfMass {
    /// Position and velocity, m and m/s.
    type Reference = (Vector3<f64>, Vector3<f64>);

    fn size(&self) -> usize {
        3
    }

    /// One dense block of three.
    fn rows(&self) -> Rows {
        let mut rows = Rows::new(self.nv, [(3, (0..self.nv).collect())]);
        rows.switch(0, true);
        rows
    }

    fn update(&mut self, state: &ModelState<'_>, (p_des, v_des): &Self::Reference, rows: &mut Rows) {
        let ModelState { model, kin, .. } = *state;
        com_jacobian(model, kin, &mut rows.A);
        let mut p = com(kin);
        if let Some(other) = self.relative_to {
            let c = p_BC_W(kin);
            rows.A.columns_mut(0, model.nv_base()).fill(0.0);
            for_each_relative_column(model, kin, (other, Some(model.base_frame())), &c, |col, linear, _| {
                for k in 0..3 {
                    rows.A[(k, col)] -= linear[k];
                }
            });
            let to_axes: Matrix3<f64> = kin.R_WF(model, other).transpose();
            for col in model.nv_base()..self.nv {
                let turned = to_axes * rows.A.fixed_view::<3, 1>(0, col);
                rows.A.set_column(col, &turned);
            }
            p = to_axes * (c - kin.p_BF_W(model, other));
        }
        for &col in &self.disabled {
            rows.A.column_mut(col).fill(0.0);
        }
        rows.b.copy_from(&(v_des + (p_des - p) * self.gain));
    }
}
