//! What the rows of tasks and constraints are written for, and what they are computed from.

use super::{Rows, Variables};
use crate::contact::{Contact, ContactLoad, ContactState};
use crate::model::{Kinematics, Model};
use crate::qp::Qp;
use nalgebra::{DMatrix, DVector};

/// Physical level of a row: which variables it constrains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PhysicalLevel {
    /// Generalized velocities.
    Velocity,
    /// Generalized accelerations, and forces if the row relates the two.
    Acceleration,
    /// Contact forces, and torques as a function of forces and accelerations.
    Force,
}

impl PhysicalLevel {
    /// Name in errors.
    pub fn name(self) -> &'static str {
        ["velocity", "acceleration", "force"][self as usize]
    }
}

/// What a task or a constraint is built from.
#[derive(Clone, Copy)]
pub struct Structure<'a> {
    /// Rigid-body model.
    pub model: &'a Model,
    /// Contacts, in the order of their force variables.
    pub contacts: &'a [Contact],
    /// Variables of the program.
    pub variables: &'a Variables,
}

/// The robot in a tick.
#[derive(Clone, Copy)]
pub struct ModelState<'a> {
    /// Rigid-body model.
    pub model: &'a Model,
    /// Contacts.
    pub contacts: &'a [Contact],
    /// Variables of the program.
    pub variables: &'a Variables,
    /// Joint positions, nj, rad or m.
    pub q: &'a [f64],
    /// Joint velocities, nj, rad/s or m/s.
    pub qd: &'a [f64],
    /// Kinematics at base pose, `q` and `qd`.
    pub kin: &'a Kinematics,
    /// Mass matrix, nv x nv. Tasks of the velocity level do not read it.
    pub M: &'a DMatrix<f64>,
    /// Bias force, nv. Tasks of the velocity level do not read it.
    pub h: &'a DVector<f64>,
    /// State of each contact.
    pub at: &'a [ContactState],
    /// What each contact may carry.
    pub loads: &'a [ContactLoad],
}

/// A task: rows `A x = b`, whatever fills its reference.
pub trait Task: Send {
    /// What the controller asks for in a tick.
    type Reference: ?Sized;

    /// Number of rows.
    fn size(&self) -> usize;

    /// Allocates its rows.
    fn rows(&self) -> Rows;

    /// Writes the rows of a tick and switches every block on or off. Does not allocate.
    fn update(&mut self, state: &ModelState<'_>, reference: &Self::Reference, rows: &mut Rows);
}

/// Number of rows of a constraint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Rows `A x = b`.
    pub equalities: usize,
    /// Rows `C x ≤ d`.
    pub inequalities: usize,
}

/// The place of a constraint in a program.
pub struct ConstraintRows<'a> {
    /// The program.
    pub qp: &'a mut Qp,
    /// Its first equality row.
    pub equality: usize,
    /// Its first inequality row.
    pub inequality: usize,
}

impl ConstraintRows<'_> {
    /// Moves to the rows after those of a constraint.
    pub fn advance(&mut self, size: Size) {
        self.equality += size.equalities;
        self.inequality += size.inequalities;
    }
}

/// A constraint: equality rows, inequality rows and bounds of variables.
pub trait Constraint: Send {
    /// Number of its rows.
    fn size(&self) -> Size;

    /// Marks, in a program of zeros without bounds, the elements of its rows that can be non-zero by 1, and the bounds that it can set by ±1.
    fn pattern(&self, rows: &mut ConstraintRows<'_>);

    /// Writes its rows and bounds of a tick: every element that [`Constraint::pattern`] marks. Does not allocate.
    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>);

    /// Names of its equality rows, then of its inequality rows.
    fn names(&self) -> [Vec<String>; 2];
}

/// The elements of a program that can be non-zero, for the rows of constraints in order.
///
/// - `columns`: number of leading variables that the tasks may couple.
pub fn pattern(constraints: &[Box<dyn Constraint>], variables: &Variables, columns: usize) -> Qp {
    let mut total = Size::default();
    for size in constraints.iter().map(|constraint| constraint.size()) {
        total.equalities += size.equalities;
        total.inequalities += size.inequalities;
    }
    let mut qp = Qp::zeros(variables.len(), total.equalities, total.inequalities);
    qp.H.view_mut((0, 0), (columns, columns)).fill(1.0);
    let mut rows = ConstraintRows { qp: &mut qp, equality: 0, inequality: 0 };
    for constraint in constraints {
        constraint.pattern(&mut rows);
        rows.advance(constraint.size());
    }
    qp
}

/// Writes the rows and bounds of constraints in a tick, in the order of [`pattern`].
pub fn update_all(constraints: &mut [Box<dyn Constraint>], state: &ModelState<'_>, qp: &mut Qp) {
    let mut rows = ConstraintRows { qp, equality: 0, inequality: 0 };
    for constraint in constraints {
        constraint.update(state, &mut rows);
        rows.advance(constraint.size());
    }
}
