//! The reference of one Cartesian task: pose and twist of the distal link d relative to the base link b, in the axes of b.
//!
//! | mode | the reference moves |
//! |---|---|
//! | Position | to the pose of the last command, or through way-points |
//! | Velocity | with the last twist command; without a command for 0.2 s it is brought to rest |
//!
//! Everything passes [`MovingPose`]: the reference is continuous and within the limits, except where it is set to a pose by [`TaskReference::reset`],
//! [`TaskReference::set_mode`] and [`TaskReference::set_base_link`]. Way-points within the limits are reached at their times; beyond the limits the
//! reference lags, and ends in the last way-point later. A motion that starts while the reference moves lags in the same way at first.
//!
//! Source: Laurenzi 2020, section 4.2. The choices that it leaves open:
//!
//! - a pose command ends a motion through way-points;
//! - a command that does not belong to the mode is rejected;
//! - a change of the base link also ends the motion to a pose: the reference rests where it was.
//!
//! A task of the centre of mass uses the same type, with the identity as orientation.

use crate::model::Pose;
use crate::trajectory::error::{ReferenceError, check_finite};
use crate::trajectory::pose_filter::{MovingPose, PoseGoal, PoseLimits};
use crate::trajectory::waypoints::{Progress, Waypoint, Waypoints};
use nalgebra::Vector6;

/// Time after which a twist command is no longer valid, ns.
pub const TWIST_TIMEOUT_NS: i64 = 200_000_000;
/// Time of a twist command that was never given.
pub(super) const NEVER_NS: i64 = i64::MIN;

/// Control mode of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Follows poses and way-points.
    Position,
    /// Follows twists.
    Velocity,
}

impl Mode {
    /// All modes, in the order of their numbers.
    pub const ALL: [Mode; 2] = [Mode::Position, Mode::Velocity];

    /// Name for messages to people.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Position => "Position",
            Mode::Velocity => "Velocity",
        }
    }
}

/// The reference, and the commands that it follows.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskReference {
    pub(super) mode: Mode,
    /// The reference.
    pub(super) motion: MovingPose,
    /// Where the motion ends in mode Position without way-points.
    pub(super) goal: PoseGoal,
    pub(super) waypoints: Waypoints,
    /// Last twist command, m/s and rad/s, and its time.
    pub(super) twist: Vector6<f64>,
    pub(super) t_twist_ns: i64,
    pub(super) limits: PoseLimits,
}

impl TaskReference {
    /// At rest in a pose, in mode Position.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`].
    pub fn new(pose: &Pose, limits: PoseLimits) -> Result<Self, ReferenceError> {
        limits.check()?;
        let goal = PoseGoal::of(pose);
        Ok(TaskReference {
            mode: Mode::Position,
            motion: MovingPose::at_rest(&goal),
            goal,
            waypoints: Waypoints::default(),
            twist: Vector6::zeros(),
            t_twist_ns: NEVER_NS,
            limits,
        })
    }

    /// Present mode.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Present limits.
    pub fn limits(&self) -> &PoseLimits {
        &self.limits
    }

    /// The reference with velocity and acceleration.
    pub fn motion(&self) -> &MovingPose {
        &self.motion
    }

    /// How far a motion through way-points has come; `None` if there is none.
    pub fn progress(&self) -> Option<Progress> {
        self.waypoints.progress()
    }

    /// Commands a pose `X_bd`.
    ///
    /// # Errors
    /// [`ReferenceError::Mode`] outside mode Position; [`ReferenceError::Value`]. Nothing changes then.
    pub fn set_pose(&mut self, goal: &PoseGoal) -> Result<(), ReferenceError> {
        self.expect_mode(Mode::Position)?;
        self.goal = goal.checked()?;
        self.waypoints.stop();
        Ok(())
    }

    /// Commands a motion through way-points, from the present reference. It replaces the present motion.
    ///
    /// # Errors
    /// [`ReferenceError::Mode`] outside mode Position; the errors of [`Waypoints::start`]. Nothing changes then.
    pub fn set_waypoints(&mut self, points: &[Waypoint]) -> Result<(), ReferenceError> {
        self.expect_mode(Mode::Position)?;
        self.waypoints.start(self.motion.goal(), points)?;
        self.goal = self.waypoints.points[points.len() - 1].pose;
        Ok(())
    }

    /// Commands a twist of d relative to b, in the axes of b; it is valid for 0.2 s.
    ///
    /// - `twist`: linear velocity, m/s, then angular velocity, rad/s.
    ///
    /// # Errors
    /// [`ReferenceError::Mode`] outside mode Velocity; [`ReferenceError::Value`]. Nothing changes then.
    pub fn set_velocity(&mut self, twist: &Vector6<f64>, now_ns: i64) -> Result<(), ReferenceError> {
        self.expect_mode(Mode::Velocity)?;
        check_finite("velocity", twist.as_slice())?;
        (self.twist, self.t_twist_ns) = (*twist, now_ns);
        Ok(())
    }

    /// Replaces the limits. A motion that is outside the new ones comes back inside as fast as they allow.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`]. Nothing changes then.
    pub fn set_limits(&mut self, limits: PoseLimits) -> Result<(), ReferenceError> {
        limits.check()?;
        self.limits = limits;
        Ok(())
    }

    /// Changes the mode. From Velocity to Position the reference is put at rest in the pose of the model. From Position to Velocity it continues and is
    /// brought to rest.
    ///
    /// - `model`: present pose `X_bd` of the model, finite.
    pub fn set_mode(&mut self, mode: Mode, model: &Pose) {
        match (self.mode, mode) {
            (Mode::Position, Mode::Velocity) => self.waypoints.stop(),
            (Mode::Velocity, Mode::Position) => self.reset(model),
            (Mode::Position, Mode::Position) | (Mode::Velocity, Mode::Velocity) => {}
        }
        self.mode = mode;
    }

    /// Changes the base link from b to c: `T_cd = T_Wc⁻¹ T_Wb T_bd`, at rest.
    ///
    /// - `X_cb`: pose of b in c, from the references of both; finite.
    pub fn set_base_link(&mut self, X_cb: &Pose) {
        self.reset(&X_cb.then(&self.motion.pose()));
    }

    /// Puts the reference at rest in a pose; every motion ends.
    ///
    /// - `pose`: finite.
    pub fn reset(&mut self, pose: &Pose) {
        let pose = PoseGoal::of(pose);
        self.motion = MovingPose::at_rest(&pose);
        self.goal = pose;
        self.waypoints.stop();
        (self.twist, self.t_twist_ns) = (Vector6::zeros(), NEVER_NS);
    }

    /// Advances the reference, and returns pose and twist: linear velocity, m/s, then angular velocity, rad/s.
    ///
    /// - `dt`: duration of the step, s.
    /// - `now_ns`: time at the end of the step, in the clock of [`TaskReference::set_velocity`].
    pub fn update(&mut self, dt: f64, now_ns: i64) -> (Pose, Vector6<f64>) {
        match self.mode {
            Mode::Position => {
                let target = self.waypoints.step(dt).unwrap_or_else(|| MovingPose::at_rest(&self.goal));
                self.motion.follow(&target, &self.limits, dt);
            }
            Mode::Velocity => {
                let is_valid = now_ns.saturating_sub(self.t_twist_ns) < TWIST_TIMEOUT_NS;
                let twist = if is_valid { self.twist } else { Vector6::zeros() };
                self.motion.follow_twist(&twist, &self.limits, dt);
            }
        }
        (self.motion.pose(), self.motion.twist())
    }

    fn expect_mode(&self, expected: Mode) -> Result<(), ReferenceError> {
        if self.mode == expected {
            return Ok(());
        }
        Err(ReferenceError::Mode { found: self.mode.name(), expected: expected.name() })
    }
}
