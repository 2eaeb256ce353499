//! References of tasks as functions of time: from what an operator or a planner requests to a continuous reference within limits.
//!
//! | module | contents |
//! |---|---|
//! | [`limiter`] | one coordinate: the next position, velocity and acceleration within limits of velocity, acceleration and jerk |
//! | [`pose_filter`] | a pose: three translations and the rotation to the target |
//! | [`waypoints`] | way-points with times, at rest in each |
//! | [`task_reference`] | the reference of a Cartesian task: modes Position and Velocity, change of the base link |
//! | [`axes_reference`] | independent coordinates: joints |
//! | [`mod@reference`] | the reference of a task of any kind |
//!
//! Everything is computed from the present state in each tick; no plan is stored. Therefore targets and limits may change at any tick. The state is
//! plain numbers, which [`TaskReference::write`] and [`AxesReference::write`] put into a snapshot bit for bit. Nothing here allocates in a tick.
//!
//! Semantics: Laurenzi 2020, section 4.2, and [`task_reference`] for what it leaves open.

pub mod approach;
pub mod axes_reference;
pub mod error;
pub mod limiter;
pub mod pose_filter;
pub mod reference;
mod rotation_filter;
mod snapshot;
pub mod task_reference;
mod velocity_profile;
pub mod waypoints;

pub use axes_reference::AxesReference;
pub use error::{ReferenceError, ValueError};
pub use limiter::{Axis, Limits};
pub use pose_filter::{MovingPose, PoseGoal, PoseLimits};
pub use reference::Reference;
pub use task_reference::{Mode, TaskReference};
pub use waypoints::{MAX_WAYPOINTS, Progress, Waypoint, Waypoints};
