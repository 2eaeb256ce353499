//! Way-points with times: a motion from pose to pose that is at rest in each of them.

use crate::math::quaternion::{conjugate, from_rotation_vector, normalized, product, to_rotation_vector};
use crate::trajectory::error::ReferenceError;
use crate::trajectory::limiter::Axis;
use crate::trajectory::pose_filter::{MovingPose, PoseGoal};
use nalgebra::Vector3;

/// Largest number of way-points.
pub const MAX_WAYPOINTS: usize = 32;

/// A pose and the time at which it is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Time since the start of the motion, s.
    pub t: f64,
    /// The pose.
    pub pose: PoseGoal,
}

impl Waypoint {
    /// Fills the places of an array that are not used.
    const UNUSED: Waypoint = Waypoint { t: 0.0, pose: PoseGoal::IDENTITY };
}

/// How far a motion has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Index of the way-point to which the motion goes, from 0.
    pub segment: usize,
    /// Elapsed part of the segment's time, 0 to 1.
    pub fraction: f64,
}

/// The motion through the way-points.
///
/// Between the poses 0 and 1, with `x` the elapsed part of the segment's duration `T`:
///
/// ```text
/// p = p_0 + s (p_1 - p_0),   R = R_0 exp(s log(R_0ᵀ R_1)),   s = 10 x³ - 15 x⁴ + 6 x⁵
/// ṡ = 30 x² (1 - x)² / T,    s̈ = 60 x (1 - x) (1 - 2 x) / T²
/// ```
/// Source: Laurenzi 2020, section 4.2, with the quintic polynomial as time law.
#[derive(Clone, Debug, PartialEq)]
pub struct Waypoints {
    /// Way-points; only the first `count` are used.
    pub points: [Waypoint; MAX_WAYPOINTS],
    /// Number of way-points; 0 if there is no motion.
    pub count: usize,
    /// Pose in which the motion starts.
    pub from: PoseGoal,
    /// Time since the start, s.
    pub elapsed: f64,
}

impl Default for Waypoints {
    fn default() -> Self {
        Waypoints { points: [Waypoint::UNUSED; MAX_WAYPOINTS], count: 0, from: PoseGoal::IDENTITY, elapsed: 0.0 }
    }
}

impl Waypoints {
    /// Starts a motion, which replaces the present one.
    ///
    /// # Errors
    /// [`ReferenceError::Count`], [`ReferenceError::Time`] if the times are not finite, positive and increasing, [`ReferenceError::Waypoint`] for an
    /// invalid pose. Nothing changes then.
    pub fn start(&mut self, from: PoseGoal, points: &[Waypoint]) -> Result<(), ReferenceError> {
        if points.is_empty() || points.len() > MAX_WAYPOINTS {
            return Err(ReferenceError::Count { found: points.len(), max: MAX_WAYPOINTS });
        }
        let mut checked = [Waypoint::UNUSED; MAX_WAYPOINTS];
        let mut before = 0.0;
        for (index, (to, point)) in checked.iter_mut().zip(points).enumerate() {
            if !(point.t > before && point.t.is_finite()) {
                return Err(ReferenceError::Time { index, found: point.t, before });
            }
            let pose = point.pose.checked().map_err(|error| ReferenceError::Waypoint { index, error })?;
            *to = Waypoint { t: point.t, pose };
            before = point.t;
        }
        *self = Waypoints { points: checked, count: points.len(), from, elapsed: 0.0 };
        Ok(())
    }

    /// Ends the motion.
    pub fn stop(&mut self) {
        *self = Waypoints::default();
    }

    /// How far the motion has come; `None` if there is none.
    pub fn progress(&self) -> Option<Progress> {
        let segment = self.points[..self.count].iter().position(|point| self.elapsed < point.t)?;
        let begin = if segment == 0 { 0.0 } else { self.points[segment - 1].t };
        let fraction = (self.elapsed - begin) / (self.points[segment].t - begin);
        Some(Progress { segment, fraction })
    }

    /// Where the motion is `dt` later; at the time of the last way-point the motion ends there. `None` if there is no motion.
    pub fn step(&mut self, dt: f64) -> Option<MovingPose> {
        let last = self.count.checked_sub(1)?;
        self.elapsed += dt;
        let Some(Progress { segment, fraction: x }) = self.progress() else {
            let end = MovingPose::at_rest(&self.points[last].pose);
            self.stop();
            return Some(end);
        };
        let (t_0, from) = match segment {
            0 => (0.0, self.from),
            _ => (self.points[segment - 1].t, self.points[segment - 1].pose),
        };
        let Waypoint { t: t_1, pose: to } = self.points[segment];
        let (duration, y) = (t_1 - t_0, 1.0 - x);
        let s = Axis {
            p: x * x * x * (10.0 + x * (6.0 * x - 15.0)),
            v: 30.0 * x * x * y * y / duration,
            a: 60.0 * x * y * (y - x) / (duration * duration),
        };
        let along = |way: f64| Axis { p: way * s.p, v: way * s.v, a: way * s.a };
        let axes = std::array::from_fn(|i| {
            let Axis { p, v, a } = along(to.p[i] - from.p[i]);
            Axis { p: from.p[i] + p, v, a }
        });
        // In the axes of the base link, in which the axis of the rotation is constant too: R_0 exp(s φ) = exp(s R_0 φ) R_0.
        let way = Vector3::from(to_rotation_vector(product(to.q, conjugate(from.q))));
        let q = normalized(product(from_rotation_vector((way * s.p).into()), from.q));
        Some(MovingPose { axes, q, w: way * s.v, al: way * s.a })
    }
}
