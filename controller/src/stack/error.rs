//! What can be wrong with a stack.

/// Why a stack cannot be used. Columns count characters of `stack.formula` from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StackError {
    /// The text is no formula.
    #[error("stack.formula, column {column}: found {found}, expected {expected}")]
    Syntax {
        /// Where.
        column: usize,
        /// What stands there.
        found: String,
        /// What could.
        expected: &'static str,
    },
    /// A weight that is not a positive number.
    #[error("stack.formula, column {column}: weight of {task} is {found}, expected a positive number")]
    Weight {
        /// Where.
        column: usize,
        /// Task that it is for.
        task: String,
        /// Its value.
        found: f64,
    },
    /// No task of this name.
    #[error("stack.formula, column {column}: unknown task \"{task}\", known: {known}")]
    UnknownTask {
        /// Where.
        column: usize,
        /// Name as given.
        task: String,
        /// Names there are.
        known: String,
    },
    /// No constraint of this name.
    #[error("stack.formula, column {column}: unknown constraint \"{constraint}\", known: {known}")]
    UnknownConstraint {
        /// Where.
        column: usize,
        /// Name as given.
        constraint: String,
        /// Names there are.
        known: String,
    },
    /// A constraint stands twice.
    #[error("stack.formula, column {column}: constraint {constraint} stands twice")]
    ConstraintTwice {
        /// Where it stands again.
        column: usize,
        /// Its name.
        constraint: &'static str,
    },
    /// A constraint without which the solution would mean nothing.
    #[error("stack.formula: constraint {constraint} is missing, add `<< {constraint}`")]
    ConstraintMissing {
        /// Its name.
        constraint: &'static str,
    },
    /// A row outside a task.
    #[error("stack.formula, column {column}: row {row} of {task}, expected 0 to {last}")]
    RowOutside {
        /// Where the task stands.
        column: usize,
        /// Its name.
        task: String,
        /// The row.
        row: usize,
        /// Last row of the task.
        last: usize,
    },
    /// A row of a task stands twice.
    #[error("stack.formula, column {column}: row {row} of {task} stands twice, first at column {first}")]
    RowTwice {
        /// Where it stands again.
        column: usize,
        /// Where it stands first.
        first: usize,
        /// The task.
        task: String,
        /// The row.
        row: usize,
    },
    /// No row of a task can change anything.
    #[error(
        "stack.formula, column {column}: {task} on level {level} can never act: in the nominal posture none of its {rows} rows \
         is left free by the constraints and the levels above"
    )]
    NeverActs {
        /// Where.
        column: usize,
        /// The task.
        task: String,
        /// Its level, from 1.
        level: usize,
        /// Rows it has in the formula.
        rows: usize,
    },
    /// A task of one's own has the name of a built-in one, or one that a formula cannot spell.
    #[error("stack.tasks.{task}: {what}")]
    TaskName {
        /// Its name.
        task: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A link that the robot does not have.
    #[error("stack.tasks.{task}.{key}: {what}")]
    Link {
        /// The task.
        task: String,
        /// Key in it.
        key: &'static str,
        /// What the model says.
        what: String,
    },
    /// A gain out of range.
    #[error("stack.tasks.{task}.{key}: found {found}, expected a number that is not negative")]
    Gain {
        /// The task.
        task: String,
        /// Key in it.
        key: &'static str,
        /// The gain.
        found: f64,
    },
}
