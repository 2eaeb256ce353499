//! The state of a [`TaskReference`] as numbers for a message, bit for bit.

use crate::error::RestoreError;
use crate::trajectory::error::{ReferenceError, check_finite, check_length};
use crate::trajectory::limiter::{Axis, Limits};
use crate::trajectory::pose_filter::{MovingPose, PoseGoal, PoseLimits};
use crate::trajectory::task_reference::{Mode, TaskReference};
use crate::trajectory::waypoints::{MAX_WAYPOINTS, Waypoint, Waypoints};
use nalgebra::Vector6;

/// Numbers of a pose.
const POSE: usize = 7;
/// A number of a time is less than this: half of 64 bits.
const HALF: i64 = 1 << 32;

impl TaskReference {
    /// Number of numbers of the state.
    pub const SIZE: usize = 4 + 9 + 4 + 6 + POSE + (POSE + 1) * MAX_WAYPOINTS + POSE + 1 + 6 + 6;

    /// Writes the whole state.
    ///
    /// - `numbers`: [`TaskReference::SIZE`] of them.
    #[expect(clippy::cast_precision_loss, reason = "small numbers, and halves of a time")]
    pub fn write(&self, numbers: &mut [f64]) {
        let mut copy = self.clone();
        let head = [
            Mode::ALL.iter().position(|mode| *mode == self.mode).expect("ALL has every mode") as f64,
            self.waypoints.count as f64,
            self.t_twist_ns.div_euclid(HALF) as f64,
            self.t_twist_ns.rem_euclid(HALF) as f64,
        ];
        let mut rest = numbers.iter_mut();
        for (from, to) in head.into_iter().zip(rest.by_ref()) {
            *to = from;
        }
        copy.for_each(&mut |x| *rest.next().expect("SIZE counts every number") = *x);
    }

    /// The state that numbers describe.
    ///
    /// # Errors
    /// [`RestoreError`] for numbers that [`TaskReference::write`] cannot have written.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be integers in range")]
    pub fn read(numbers: &[f64]) -> Result<Self, RestoreError> {
        check_length(numbers.len(), Self::SIZE)?;
        let [mode, count, high, low] = [numbers[0], numbers[1], numbers[2], numbers[3]];
        integer("mode", mode, 0, Mode::ALL.len() as i64 - 1)?;
        integer("waypoints.count", count, 0, MAX_WAYPOINTS as i64)?;
        integer("t_twist_ns", high, -HALF / 2, HALF / 2 - 1)?;
        integer("t_twist_ns", low, 0, HALF - 1)?;
        let mut read = TaskReference {
            mode: Mode::ALL[mode as usize],
            motion: MovingPose::at_rest(&PoseGoal::IDENTITY),
            goal: PoseGoal::IDENTITY,
            waypoints: Waypoints { count: count as usize, ..Waypoints::default() },
            twist: Vector6::zeros(),
            t_twist_ns: high as i64 * HALF + low as i64,
            limits: PoseLimits { linear: Limits::NONE, angular: Limits::NONE },
        };
        let mut rest = numbers[4..].iter();
        read.for_each(&mut |x| *x = *rest.next().expect("SIZE counts every number"));
        read.check()?;
        Ok(read)
    }

    /// Calls `visit` with each floating-point number of the state, in the order of the snapshot.
    fn for_each(&mut self, visit: &mut impl FnMut(&mut f64)) {
        let TaskReference { mode: _, motion, goal, waypoints, twist, t_twist_ns: _, limits } = self;
        let MovingPose { axes, q, w, al } = motion;
        for Axis { p, v, a } in axes {
            [p, v, a].into_iter().for_each(&mut *visit);
        }
        let Waypoints { points, count: _, from, elapsed } = waypoints;
        q.iter_mut().chain(w.iter_mut()).chain(al.iter_mut()).for_each(&mut *visit);
        for PoseGoal { p, q } in [goal, from] {
            p.iter_mut().chain(q).for_each(&mut *visit);
        }
        for Waypoint { t, pose: PoseGoal { p, q } } in points {
            visit(t);
            p.iter_mut().chain(q).for_each(&mut *visit);
        }
        visit(elapsed);
        twist.iter_mut().for_each(&mut *visit);
        let PoseLimits { linear, angular } = limits;
        for Limits { v, a, j } in [linear, angular] {
            [v, a, j].into_iter().for_each(&mut *visit);
        }
    }

    /// Checks the numbers as the commands do that set them.
    fn check(&self) -> Result<(), ReferenceError> {
        let MovingPose { axes, w, al, .. } = &self.motion;
        for Axis { v, a, .. } in axes {
            check_finite("velocity", &[*v, *a])?;
        }
        check_finite("velocity", &[w.x, w.y, w.z, al.x, al.y, al.z])?;
        check_finite("velocity", self.twist.as_slice())?;
        self.motion.goal().checked()?;
        self.goal.checked()?;
        let Waypoints { points, count, from, elapsed } = &self.waypoints;
        check_finite("time", &[*elapsed])?;
        if *count > 0 {
            Waypoints::default().start(from.checked()?, &points[..*count])?;
        }
        self.limits.check()
    }
}

/// Checks a number of an enumeration or a count.
fn integer(field: &'static str, found: f64, first: i64, last: i64) -> Result<(), RestoreError> {
    #[expect(clippy::cast_possible_truncation, reason = "saturates, and is only for the message")]
    let rounded = found as i64;
    #[expect(clippy::cast_precision_loss, reason = "compared with the number")]
    if rounded as f64 != found || !(first..=last).contains(&rounded) {
        return Err(RestoreError::Value { field, found: rounded, last });
    }
    Ok(())
}
