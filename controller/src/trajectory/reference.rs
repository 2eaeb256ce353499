//! The reference of a task of any kind: of a pose, of joints, or none.

use crate::error::RestoreError;
use crate::model::Pose;
use crate::trajectory::axes_reference::AxesReference;
use crate::trajectory::error::{ReferenceError, check_length};
use crate::trajectory::pose_filter::PoseLimits;
use crate::trajectory::task_reference::TaskReference;

/// The reference of a task.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// Of a pose, or of a position, for which the orientation is the identity.
    Pose(Box<TaskReference>),
    /// Of joints; they have the angular limits.
    Joints(AxesReference),
    /// Of a task that has none.
    None,
}

impl Reference {
    /// Of a pose: at rest in the identity.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`].
    pub fn of_pose(limits: PoseLimits) -> Result<Self, ReferenceError> {
        Ok(Reference::Pose(Box::new(TaskReference::new(&Pose::identity(), limits)?)))
    }

    /// Of joints: at rest in their goals.
    ///
    /// # Errors
    /// [`ReferenceError::Value`], [`ReferenceError::Limit`].
    pub fn of_joints(goals: &[f64], limits: PoseLimits) -> Result<Self, ReferenceError> {
        Ok(Reference::Joints(AxesReference::new(goals, limits.angular)?))
    }

    /// Replaces the limits.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`]. Nothing changes then.
    pub fn set_limits(&mut self, limits: PoseLimits) -> Result<(), ReferenceError> {
        limits.check()?;
        match self {
            Reference::Pose(reference) => reference.set_limits(limits),
            Reference::Joints(reference) => reference.set_limits(limits.angular),
            Reference::None => Ok(()),
        }
    }

    /// Puts the reference at rest in the present pose. References of joints move from the present positions to their goals.
    ///
    /// - `pose`, `q`: present pose and joint positions of the model, finite.
    pub fn reset(&mut self, pose: &Pose, q: &[f64]) {
        match self {
            Reference::Pose(reference) => reference.reset(pose),
            Reference::Joints(reference) => reference.restart(q),
            Reference::None => {}
        }
    }

    /// Number of numbers of the state.
    pub fn size(&self) -> usize {
        match self {
            Reference::Pose(_) => TaskReference::SIZE,
            Reference::Joints(reference) => reference.size(),
            Reference::None => 0,
        }
    }

    /// Writes the whole state.
    ///
    /// - `numbers`: [`Reference::size`] of them.
    pub fn write(&self, numbers: &mut [f64]) {
        match self {
            Reference::Pose(reference) => reference.write(numbers),
            Reference::Joints(reference) => reference.write(numbers),
            Reference::None => {}
        }
    }

    /// Checks that [`Reference::write`] can have written numbers.
    ///
    /// # Errors
    /// [`RestoreError`].
    pub fn check(&self, numbers: &[f64]) -> Result<(), RestoreError> {
        match self {
            Reference::Pose(_) => TaskReference::read(numbers).map(|_| ()),
            Reference::Joints(reference) => reference.check(numbers),
            Reference::None => Ok(check_length(numbers.len(), 0)?),
        }
    }

    /// Reads the whole state.
    ///
    /// # Errors
    /// As [`Reference::check`]; the state is not changed then.
    pub fn read(&mut self, numbers: &[f64]) -> Result<(), RestoreError> {
        match self {
            Reference::Pose(reference) => **reference = TaskReference::read(numbers)?,
            Reference::Joints(reference) => reference.read(numbers)?,
            Reference::None => check_length(numbers.len(), 0)?,
        }
        Ok(())
    }

    /// Reads the state apart from the limits, which stay as they are.
    ///
    /// # Errors
    /// As [`Reference::check`]; the state is not changed then.
    pub fn read_motion(&mut self, numbers: &[f64]) -> Result<(), RestoreError> {
        match self {
            Reference::Pose(reference) => {
                let limits = *reference.limits();
                **reference = TaskReference::read(numbers)?;
                reference.set_limits(limits)?;
            }
            Reference::Joints(reference) => {
                let limits = *reference.limits();
                reference.read(numbers)?;
                reference.set_limits(limits)?;
            }
            Reference::None => check_length(numbers.len(), 0)?,
        }
        Ok(())
    }
}
