//! Pose of a link relative to the world or to another link, at velocity level.
//!
//! ```text
//! A v = ẋ_des + k e,    e = [ p_des - p ; k_o log(R_des Rᵀ) ]          in the axes of the other link, or of the task's own link
//! ```
//! `A` is the Jacobian of the relative motion. Only the joints between the two links have columns, and the base if the other link is the world. The orientation
//! error is the full angle. Source: Laurenzi 2020, eqs. (5.22)-(5.24) and section 2.4, with the error "desired minus actual".

use crate::math::log;
use crate::model::{FrameId, Kinematics, Model, for_each_relative_column};
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{Matrix3, Vector3, Vector6};

/// The task: six rows, m/s and rad/s. Its options may change between ticks.
pub struct RelativePose {
    /// The controlled link.
    pub link: FrameId,
    /// The other link; `None` for the world.
    pub relative_to: Option<FrameId>,
    /// Gain k, 1/s.
    pub gain: f64,
    /// Factor `k_o` of the orientation error; 1 by default.
    pub orientation_gain: f64,
    /// Whether error and rows are in the axes of the controlled link. The reference stays in the axes of the other link.
    pub local: bool,
    /// Joints whose columns stay 0, by velocity index.
    pub disabled: Vec<usize>,
    nv: usize,
}

/// Reference, in the axes of the other link or of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePoseReference {
    /// Position, m.
    pub p: Vector3<f64>,
    /// Orientation.
    pub R: Matrix3<f64>,
    /// Linear and angular velocity, m/s and rad/s.
    pub twist: Vector6<f64>,
}

impl RelativePose {
    /// - `relative_to`: the other link; `None` for the world.
    /// - `gain`: 1/s.
    pub fn new(of: &Structure<'_>, link: FrameId, relative_to: Option<FrameId>, gain: f64) -> Self {
        let nv = of.model.nv();
        RelativePose { link, relative_to, gain, orientation_gain: 1.0, local: false, disabled: Vec::new(), nv }
    }

    /// Pose of the link in the axes of the other link, or of the world: position, m, and orientation.
    pub fn pose(&self, model: &Model, kin: &Kinematics) -> (Vector3<f64>, Matrix3<f64>) {
        let R = kin.R_WF(model, self.link);
        match self.relative_to {
            None => (kin.p_WF(model, self.link), R),
            Some(other) => {
                let to_axes = kin.R_WF(model, other).transpose();
                (to_axes * (kin.p_BF_W(model, self.link) - kin.p_BF_W(model, other)), to_axes * R)
            }
        }
    }
}

impl Task for RelativePose {
    type Reference = RelativePoseReference;

    fn size(&self) -> usize {
        6
    }

    /// One block of six; it has memory for all columns.
    fn rows(&self) -> Rows {
        Rows::new(self.nv, [(6, (0..self.nv).collect())])
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &RelativePoseReference, rows: &mut Rows) {
        let ModelState { model, kin, .. } = *state;
        let (p, R) = self.pose(model, kin);
        let from_other = if self.local { R.transpose() } else { Matrix3::identity() };
        let from_W = match (self.local, self.relative_to) {
            (true, _) => kin.R_WF(model, self.link).transpose(),
            (false, Some(other)) => kin.R_WF(model, other).transpose(),
            (false, None) => Matrix3::identity(),
        };
        let chain = (self.link, self.relative_to);
        rows.restart(0);
        for_each_relative_column(model, kin, chain, &kin.p_BF_W(model, self.link), |col, linear, angular| {
            if !self.disabled.contains(&col) {
                let (linear, angular) = (from_W * linear, from_W * angular);
                let column = rows.add_column(0, col);
                column[..3].copy_from_slice(linear.as_slice());
                column[3..].copy_from_slice(angular.as_slice());
            }
        });
        let (e_p, e_o) = (reference.p - p, log(&(reference.R * R.transpose())) * self.orientation_gain);
        let part = |first: usize, e: Vector3<f64>| {
            from_other * (reference.twist.fixed_rows::<3>(first).into_owned() + e * self.gain)
        };
        rows.b.rows_mut(0, 3).copy_from(&part(0, e_p));
        rows.b.rows_mut(3, 3).copy_from(&part(3, e_o));
    }
}
