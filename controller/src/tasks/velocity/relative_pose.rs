//! Pose of a link relative to the world or to another link, at velocity level.
//!
//! ```text
//! A v = ẋ_des + k e,    e = [ p_des - p ; log(R_des Rᵀ) ]          in the axes of the other link
//! ```
//! `A` is the Jacobian of the relative motion. Source: Laurenzi 2020, eqs. (5.22)-(5.24) and section 2.4, with the error "desired minus actual".

use crate::math::log;
use crate::model::FrameId;
use crate::stack::{ModelState, Rows, Structure, Task};
use crate::tasks::relative_motion::RelativeMotion;
use nalgebra::{Matrix3, Vector3, Vector6};

/// The task: six rows, m/s and rad/s.
pub struct RelativePose {
    motion: RelativeMotion,
    nv: usize,
    gain: f64,
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
        RelativePose { motion: RelativeMotion::new(of.model, link, relative_to), nv: of.model.nv(), gain }
    }
}

impl Task for RelativePose {
    type Reference = RelativePoseReference;

    fn size(&self) -> usize {
        6
    }

    fn rows(&self) -> Rows {
        let mut rows = Rows::new(self.nv, [(6, (0..self.nv).collect())]);
        rows.switch(0, true);
        rows
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &RelativePoseReference, rows: &mut Rows) {
        let mut at = self.motion.update(state.model, state.kin, &mut rows.A);
        if self.motion.in_world() {
            at.p += state.kin.base().p_WB;
        }
        let (e_p, e_o) = (reference.p - at.p, log(&(reference.R * at.R.transpose())));
        for k in 0..3 {
            rows.b[k] = reference.twist[k] + self.gain * e_p[k];
            rows.b[3 + k] = reference.twist[3 + k] + self.gain * e_o[k];
        }
    }
}
