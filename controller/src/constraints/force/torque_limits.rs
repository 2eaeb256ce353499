//! Limits of the joint torques: what the drive of a joint can do at the measured velocity, softened by the slack `s` of the program.
//!
//! ```text
//! tau = M vd + h - Jᵀ F at the joints,   least - s ≤ tau ≤ most + s
//! (M vd - Jᵀ F)_j - s ≤ most_j - h_j         -(M vd - Jᵀ F)_j - s ≤ h_j - least_j
//! ```
//! First the rows of the largest torques, then those of the smallest. An infinite limit has a row of zeros.

use crate::contact::{FORCE_UNIT, columns};
use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};

struct OfJoint {
    name: String,
    /// Columns of the mass matrix in which the row of the joint may be non-zero.
    motion: Vec<usize>,
    /// Contacts whose force acts on the joint.
    contacts: Vec<usize>,
    /// Variables of its two rows.
    variables: Vec<usize>,
}

/// The constraint.
pub struct TorqueLimits {
    joints: Vec<OfJoint>,
    n_base: usize,
    slack_unit: f64,
}

impl TorqueLimits {
    /// For all joints.
    ///
    /// - `slack_unit`: unit of the slack variable, N m or N.
    pub fn new(of: &Structure<'_>, slack_unit: f64) -> Self {
        let (model, nb) = (of.model, of.model.nv_base());
        // Two joints are coupled by the mass matrix if a link is moved by both.
        let moved: Vec<Vec<usize>> = model.frames().map(|(frame, _)| columns(model, frame)).collect();
        let of_joint = |j: usize| {
            let col = nb + j;
            let together = |other: &usize| moved.iter().any(|by| by.contains(&col) && by.contains(other));
            let motion: Vec<usize> = (0..model.nv()).filter(|other| *other < nb || together(other)).collect();
            let acts = |i: &usize| of.contacts[*i].columns.contains(&col);
            let contacts: Vec<usize> = (0..of.contacts.len()).filter(acts).collect();
            let forces = contacts.iter().flat_map(|i| of.variables.force(*i));
            let variables = motion.iter().copied().chain(forces).chain(of.variables.slack()).collect();
            OfJoint { name: model.joints[j].name.clone(), motion, contacts, variables }
        };
        TorqueLimits { joints: (0..model.nj()).map(of_joint).collect(), n_base: nb, slack_unit }
    }
}

impl Constraint for TorqueLimits {
    fn size(&self) -> Size {
        Size { equalities: 0, inequalities: 2 * self.joints.len() }
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        for (j, joint) in self.joints.iter().enumerate() {
            for &col in &joint.variables {
                rows.qp.C[(rows.inequality + j, col)] = 1.0;
                rows.qp.C[(rows.inequality + self.joints.len() + j, col)] = 1.0;
            }
        }
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        let (nj, qp) = (self.joints.len(), &mut *rows.qp);
        for (j, OfJoint { motion, contacts, .. }) in self.joints.iter().enumerate() {
            let (upper, lower) = (rows.inequality + j, rows.inequality + nj + j);
            let (least, most) = state.model.joints[j].torque_range(state.qd[j]);
            let (above, below) = (most.is_finite(), least.is_finite());
            let mut write = |col: usize, value: f64| {
                qp.C[(upper, col)] = if above { value } else { 0.0 };
                qp.C[(lower, col)] = if below { -value } else { 0.0 };
            };
            let own = self.n_base + j;
            for &col in motion {
                write(col, state.M[(own, col)]);
            }
            for &contact in contacts {
                for (k, col) in state.variables.force(contact).enumerate() {
                    let there = if state.loads[contact].active { state.at[contact].J[(k, own)] } else { 0.0 };
                    write(col, -there * FORCE_UNIT);
                }
            }
            let h = state.h[own];
            for (row, limited, side) in [(upper, above, most - h), (lower, below, h - least)] {
                qp.d[row] = if limited { side } else { 1.0 };
                if let Some(slack) = state.variables.slack() {
                    qp.C[(row, slack)] = if limited { -self.slack_unit } else { 0.0 };
                }
            }
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        let of =
            |side: &str| self.joints.iter().map(|joint| format!("{side} torque of {}", joint.name)).collect::<Vec<_>>();
        [Vec::new(), [of("largest"), of("smallest")].concat()]
    }
}
