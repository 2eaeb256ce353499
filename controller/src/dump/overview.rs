//! Overview of a tick: typed values, from which a screen is laid out for any kind of robot.

use super::Quantity;
use crate::qp::{NamedViolation, QpStatus};

/// Summary of a tick. What the tick did not compute is empty or `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overview {
    /// Gait, if the controller has one.
    pub gait: Option<GaitSummary>,
    /// Contacts of the robot with the ground.
    pub contacts: Vec<ContactSummary>,
    /// Base: a few numbers, vectors and names, the most important first.
    pub base: Vec<Quantity>,
    /// Levels of the stack of tasks, the most important first.
    pub levels: Vec<LevelSummary>,
    /// If a level has no solution: the constraints that contradict each other, the most violated first.
    pub conflict: Option<Vec<NamedViolation>>,
}

/// Gait of a legged robot.
#[derive(Clone, Debug, PartialEq)]
pub struct GaitSummary {
    /// Its name.
    pub name: String,
    /// Time in the gait cycle, s.
    pub clock: f64,
}

/// One contact. Forces are vertical components in W, N.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactSummary {
    /// Name of the leg or link.
    pub name: String,
    /// Planned phase.
    pub phase: Option<Phase>,
    /// Time in the phase, s; `None` also if it is infinite.
    pub t_phase: Option<f64>,
    /// The estimator detects contact.
    pub in_contact: Option<bool>,
    /// Estimated force.
    pub f_z_est: Option<f64>,
    /// Force that the quadratic program computed.
    pub f_z_qp: Option<f64>,
    /// Lower and upper bound of that force.
    pub f_z_bounds: Option<[f64; 2]>,
    /// Reference of the contact point from the origin of B, in H (yaw-aligned base frame), m.
    pub p_des: Option<[f64; 3]>,
}

/// Phase of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Phase {
    /// Name, such as `SwingUp`.
    pub name: &'static str,
    /// Kind of phase.
    pub kind: PhaseKind,
}

/// Kind of a contact phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhaseKind {
    /// The contact is planned to carry load.
    Stance,
    /// The contact point moves as planned.
    Swing,
    /// Not as planned: for example, the swing time is over without contact.
    Unplanned,
}

/// One level of the stack of tasks.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelSummary {
    /// Result of the solver; `None` if the level was not solved because a level above it has no solution.
    pub status: Option<QpStatus>,
    /// Iterations of the solver.
    pub iterations: u32,
    /// Number of active inequality rows and bounds.
    pub n_active: usize,
    /// Tasks of the level.
    pub terms: Vec<TermSummary>,
    /// Names of the active inequality rows and bounds.
    pub active: Vec<String>,
}

impl LevelSummary {
    /// Name of the result: that of [`QpStatus`], or `NotRun`.
    pub fn status_name(&self) -> &'static str {
        self.status.map_or("NotRun", QpStatus::name)
    }
}

/// One task of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct TermSummary {
    /// Name of the task.
    pub task: String,
    /// Weight of its squared error.
    pub weight: f64,
    /// Norm of `A x - b` over its rows: m/s², rad/s² or N.
    pub residual: f64,
}
