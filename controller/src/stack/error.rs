//! Errors of a stack of tasks.

use crate::model::near_list;

/// Reasons why a stack is invalid. Columns count the characters of `stack.formula` from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StackError {
    /// Syntax error.
    #[error("stack.formula, column {column}: found {found}, expected {expected}")]
    Syntax {
        /// Position.
        column: usize,
        /// Text found there.
        found: String,
        /// Text expected there.
        expected: &'static str,
    },
    /// A weight out of its range.
    #[error("stack.formula, column {column}: weight of {task} is {found}, expected 1e-9 to 1e9")]
    Weight {
        /// Position.
        column: usize,
        /// Its task.
        task: String,
        /// Its value.
        found: f64,
    },
    /// No task of this name.
    #[error("stack.formula, column {column}: unknown task \"{task}\", known: {known}{}", near_list(.near))]
    UnknownTask {
        /// Position.
        column: usize,
        /// The unknown name.
        task: Box<str>,
        /// Known names.
        known: Box<str>,
        /// Those similar to the unknown name.
        near: Box<[String]>,
    },
    /// No constraint of this name.
    #[error("stack.formula, column {column}: unknown constraint \"{constraint}\", known: {known}{}", near_list(.near))]
    UnknownConstraint {
        /// Position.
        column: usize,
        /// The unknown name.
        constraint: Box<str>,
        /// Known names.
        known: Box<str>,
        /// Those similar to the unknown name.
        near: Box<[String]>,
    },
    /// A constraint occurs twice.
    #[error("stack.formula, column {column}: constraint {constraint} occurs twice")]
    ConstraintTwice {
        /// Position of the second occurrence.
        column: usize,
        /// Its name.
        constraint: String,
    },
    /// Rows that cannot be written in the variables of the program.
    #[error(
        "stack.formula, column {column}: {name} has rows of the {level} level, which the variables of this controller do not have"
    )]
    Level {
        /// Position.
        column: usize,
        /// Name of the task or the constraint.
        name: String,
        /// Its level.
        level: &'static str,
    },
    /// A mandatory constraint is missing: without it the solution is physically meaningless.
    #[error("stack.formula: constraint {constraint} is missing, add `<< {constraint}`")]
    ConstraintMissing {
        /// Its name.
        constraint: &'static str,
    },
    /// A row number that the task does not have.
    #[error("stack.formula, column {column}: row {row} of {task}, expected 0 to {last}")]
    RowOutside {
        /// Position of the task.
        column: usize,
        /// Its name.
        task: String,
        /// The row.
        row: usize,
        /// Last row of the task.
        last: usize,
    },
    /// A row of a task occurs twice.
    #[error("stack.formula, column {column}: row {row} of {task} occurs twice, first at column {first}")]
    RowTwice {
        /// Position of the second occurrence.
        column: usize,
        /// Position of the first occurrence.
        first: usize,
        /// The task.
        task: String,
        /// The row.
        row: usize,
    },
    /// A task has no effect.
    #[error(
        "stack.formula, column {column}: {task} on level {level} has no effect: in the nominal posture, on all feet or in a trot, all of its {rows} rows \
         are determined by the constraints and the levels above"
    )]
    NeverActs {
        /// Position.
        column: usize,
        /// The task.
        task: String,
        /// Its level, from 1.
        level: usize,
        /// Rows it has in the formula.
        rows: usize,
    },
    /// A user-defined task has the name of a built-in task, or a name that a formula cannot contain.
    #[error("stack.tasks.{task}: {what}")]
    TaskName {
        /// Its name.
        task: String,
        /// The reason.
        what: &'static str,
    },
    /// A link that the robot does not have.
    #[error("stack.tasks.{task}.{key}: {what}")]
    Link {
        /// The task.
        task: String,
        /// Key in its parameters.
        key: &'static str,
        /// Error of the model.
        what: String,
    },
    /// A chain with too few joints for the number of rows of its Jacobian.
    #[error("stack.tasks.{task}: {found} joints move link {link}, expected at least {needed}")]
    ShortChain {
        /// The task.
        task: String,
        /// Link at the end of the chain.
        link: String,
        /// Joints of the chain.
        found: usize,
        /// Rows of the Jacobian.
        needed: usize,
    },
    /// A gain out of range.
    #[error("stack.tasks.{task}.{key}: found {found}, expected 0 to 10000")]
    Gain {
        /// The task.
        task: String,
        /// Key in its parameters.
        key: &'static str,
        /// The gain.
        found: f64,
    },
}
