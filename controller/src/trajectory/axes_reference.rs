//! References of independent coordinates, each within its own limits: the joints of a robot, or the three coordinates of the centre of mass.

use crate::error::RestoreError;
use crate::trajectory::error::{ReferenceError, check_finite};
use crate::trajectory::limiter::{Axis, Limits};

/// Numbers of one coordinate in a snapshot.
const NUMBERS: usize = 7;

/// One coordinate: state, goal and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Coordinate {
    axis: Axis,
    goal: f64,
    limits: Limits,
}

/// The references of n coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct AxesReference {
    coordinates: Vec<Coordinate>,
}

impl AxesReference {
    /// At rest.
    ///
    /// - `p`, `limits`: position and limits of each coordinate.
    ///
    /// # Errors
    /// [`ReferenceError::Length`] if the lengths differ; [`ReferenceError::Value`], [`ReferenceError::Limit`].
    pub fn new(p: &[f64], limits: &[Limits]) -> Result<Self, ReferenceError> {
        expect_length(limits.len(), p.len())?;
        check_finite("position", p)?;
        limits.iter().try_for_each(Limits::check)?;
        let coordinate =
            |(p, limits): (&f64, &Limits)| Coordinate { axis: Axis::at_rest(*p), goal: *p, limits: *limits };
        Ok(AxesReference { coordinates: p.iter().zip(limits).map(coordinate).collect() })
    }

    /// Number of coordinates.
    pub fn size(&self) -> usize {
        self.coordinates.len()
    }

    /// Replaces all goals.
    ///
    /// # Errors
    /// [`ReferenceError::Length`], [`ReferenceError::Value`]. Nothing changes then.
    pub fn set_goals(&mut self, goals: &[f64]) -> Result<(), ReferenceError> {
        expect_length(goals.len(), self.size())?;
        check_finite("goal", goals)?;
        for (coordinate, goal) in self.coordinates.iter_mut().zip(goals) {
            coordinate.goal = *goal;
        }
        Ok(())
    }

    /// Replaces the limits of all coordinates.
    ///
    /// # Errors
    /// [`ReferenceError::Length`], [`ReferenceError::Limit`]. Nothing changes then.
    pub fn set_limits(&mut self, limits: &[Limits]) -> Result<(), ReferenceError> {
        expect_length(limits.len(), self.size())?;
        limits.iter().try_for_each(Limits::check)?;
        for (coordinate, limits) in self.coordinates.iter_mut().zip(limits) {
            coordinate.limits = *limits;
        }
        Ok(())
    }

    /// Puts the references at rest in positions, which are their goals.
    ///
    /// # Errors
    /// [`ReferenceError::Length`], [`ReferenceError::Value`]. Nothing changes then.
    pub fn reset(&mut self, p: &[f64]) -> Result<(), ReferenceError> {
        self.set_goals(p)?;
        for Coordinate { axis, goal, .. } in &mut self.coordinates {
            *axis = Axis::at_rest(*goal);
        }
        Ok(())
    }

    /// Advances the references by `dt`, s.
    pub fn update(&mut self, dt: f64) {
        for Coordinate { axis, goal, limits } in &mut self.coordinates {
            *axis = axis.step_to(*goal, limits, dt);
        }
    }

    /// The references.
    pub fn axes(&self) -> impl Iterator<Item = &Axis> {
        self.coordinates.iter().map(|coordinate| &coordinate.axis)
    }

    /// Whether all references rest in their goals.
    pub fn is_at_goal(&self) -> bool {
        self.coordinates.iter().all(|Coordinate { axis, goal, .. }| axis.p == *goal && axis.v == 0.0)
    }

    /// Number of numbers of the state.
    pub fn numbers(&self) -> usize {
        NUMBERS * self.size()
    }

    /// Writes the whole state; the length of `numbers` is [`AxesReference::numbers`].
    pub fn write(&self, numbers: &mut [f64]) {
        for (coordinate, numbers) in self.coordinates.iter().zip(numbers.chunks_exact_mut(NUMBERS)) {
            let Coordinate { axis: Axis { p, v, a }, goal, limits: Limits { v: v_max, a: a_max, j: j_max } } =
                *coordinate;
            numbers.copy_from_slice(&[p, v, a, goal, v_max, a_max, j_max]);
        }
    }

    /// Reads the whole state.
    ///
    /// # Errors
    /// [`RestoreError::Reference`] for numbers that [`AxesReference::write`] cannot have written; the state is not changed then.
    pub fn read(&mut self, numbers: &[f64]) -> Result<(), RestoreError> {
        expect_length(numbers.len(), self.numbers())?;
        for numbers in numbers.chunks_exact(NUMBERS) {
            check_finite("position", &numbers[..4]).map_err(ReferenceError::from)?;
            Limits { v: numbers[4], a: numbers[5], j: numbers[6] }.check()?;
        }
        for (coordinate, numbers) in self.coordinates.iter_mut().zip(numbers.chunks_exact(NUMBERS)) {
            *coordinate = Coordinate {
                axis: Axis { p: numbers[0], v: numbers[1], a: numbers[2] },
                goal: numbers[3],
                limits: Limits { v: numbers[4], a: numbers[5], j: numbers[6] },
            };
        }
        Ok(())
    }
}

fn expect_length(found: usize, expected: usize) -> Result<(), ReferenceError> {
    if found == expected { Ok(()) } else { Err(ReferenceError::Length { found, expected }) }
}
