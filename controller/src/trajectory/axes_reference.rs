//! References of independent coordinates with the same limits: the joints of a robot.

use crate::error::RestoreError;
use crate::trajectory::error::{ReferenceError, check_finite, check_length};
use crate::trajectory::limiter::{Axis, Limits};

/// Numbers of one coordinate in a snapshot; those of the limits come after the last coordinate.
const NUMBERS: usize = 4;

/// The references of n coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct AxesReference {
    axes: Vec<Axis>,
    goals: Vec<f64>,
    limits: Limits,
}

impl AxesReference {
    /// At rest.
    ///
    /// - `p`: position of each coordinate.
    ///
    /// # Errors
    /// [`ReferenceError::Value`], [`ReferenceError::Limit`].
    pub fn new(p: &[f64], limits: Limits) -> Result<Self, ReferenceError> {
        check_finite("position", p)?;
        limits.check()?;
        Ok(AxesReference { axes: p.iter().copied().map(Axis::at_rest).collect(), goals: p.to_vec(), limits })
    }

    /// Replaces all goals.
    ///
    /// # Errors
    /// [`ReferenceError::Length`], [`ReferenceError::Value`]. Nothing changes then.
    pub fn set_goals(&mut self, goals: &[f64]) -> Result<(), ReferenceError> {
        check_length(goals.len(), self.goals.len())?;
        check_finite("goal", goals)?;
        self.goals.copy_from_slice(goals);
        Ok(())
    }

    /// Present limits of each coordinate.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Replaces the limits. A motion that is outside the new ones comes back inside as fast as they allow.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`]. Nothing changes then.
    pub fn set_limits(&mut self, limits: Limits) -> Result<(), ReferenceError> {
        limits.check()?;
        self.limits = limits;
        Ok(())
    }

    /// Puts the references at rest in positions, from which they move to their goals.
    ///
    /// - `p`: finite, one for each coordinate.
    pub fn restart(&mut self, p: &[f64]) {
        for (axis, p) in self.axes.iter_mut().zip(p) {
            *axis = Axis::at_rest(*p);
        }
    }

    /// Advances the references by `dt`, s.
    pub fn update(&mut self, dt: f64) {
        for (axis, goal) in self.axes.iter_mut().zip(&self.goals) {
            *axis = axis.follow(&Axis::at_rest(*goal), &self.limits, dt);
        }
    }

    /// The references.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Number of numbers of the state.
    pub fn size(&self) -> usize {
        NUMBERS * self.axes.len() + 3
    }

    /// Writes the whole state.
    ///
    /// - `numbers`: [`AxesReference::size`] of them.
    pub fn write(&self, numbers: &mut [f64]) {
        let (coordinates, limits) = numbers.split_at_mut(NUMBERS * self.axes.len());
        for ((axis, goal), numbers) in self.axes.iter().zip(&self.goals).zip(coordinates.chunks_exact_mut(NUMBERS)) {
            let Axis { p, v, a } = *axis;
            numbers.copy_from_slice(&[p, v, a, *goal]);
        }
        let Limits { v, a, j } = self.limits;
        limits.copy_from_slice(&[v, a, j]);
    }

    /// Checks that [`AxesReference::write`] can have written numbers.
    ///
    /// # Errors
    /// [`RestoreError::Reference`].
    pub fn check(&self, numbers: &[f64]) -> Result<(), RestoreError> {
        check_length(numbers.len(), self.size())?;
        let (coordinates, limits) = numbers.split_at(NUMBERS * self.axes.len());
        check_finite("position", coordinates).map_err(ReferenceError::from)?;
        Ok(Limits { v: limits[0], a: limits[1], j: limits[2] }.check()?)
    }

    /// Reads the whole state.
    ///
    /// # Errors
    /// As [`AxesReference::check`]; the state is not changed then.
    pub fn read(&mut self, numbers: &[f64]) -> Result<(), RestoreError> {
        self.check(numbers)?;
        let (coordinates, limits) = numbers.split_at(NUMBERS * self.axes.len());
        let goals = self.goals.iter_mut();
        for ((axis, goal), numbers) in self.axes.iter_mut().zip(goals).zip(coordinates.chunks_exact(NUMBERS)) {
            *axis = Axis { p: numbers[0], v: numbers[1], a: numbers[2] };
            *goal = numbers[3];
        }
        self.limits = Limits { v: limits[0], a: limits[1], j: limits[2] };
        Ok(())
    }
}
