//! The `[[task]]` table of a scenario: requests to the tasks of a Cartesian server.

use crate::checks::{BadKey, check_range, to_ns};
use lcmtypes::{TaskRequest, TaskWaypoint};
use serde::Deserialize;

/// An operation, by its name in a scenario and on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Operation {
    Pose,
    Waypoints,
    Velocity,
    Mode,
    BaseLink,
    Activate,
    Weight,
    Gain,
    Limits,
    Reset,
    Posture,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TaskEntry {
    t_s: f64,
    task: String,
    operation: Operation,
    #[serde(default)]
    name: String,
    #[serde(default)]
    relative: bool,
    #[serde(default)]
    poses: Vec<PoseEntry>,
    #[serde(default)]
    values: Vec<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseEntry {
    #[serde(default)]
    time_s: f64,
    #[serde(default)]
    position_m: [f64; 3],
    #[serde(default = "no_rotation")]
    q_wxyz: [f64; 4],
}

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

impl TaskEntry {
    /// The request, with the time of the scenario.
    pub(crate) fn resolve(self, number: usize) -> Result<TaskRequest, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        let poses: Vec<TaskWaypoint> = self
            .poses
            .iter()
            .map(|pose| TaskWaypoint { time: pose.time_s, position: pose.position_m, q_wxyz: pose.q_wxyz })
            .collect();
        let count = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
        Ok(TaskRequest {
            t_ns: to_ns(self.t_s),
            sender_id: 0,
            request_id: i64::try_from(number).unwrap_or(i64::MAX),
            operation: self.operation as i8,
            task: self.task,
            name: self.name,
            relative: self.relative,
            n: count(poses.len()),
            poses,
            m: count(self.values.len()),
            values: self.values,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_have_the_numbers_of_the_message() {
        for (operation, number) in [
            (Operation::Pose, TaskRequest::POSE),
            (Operation::Waypoints, TaskRequest::WAYPOINTS),
            (Operation::Velocity, TaskRequest::VELOCITY),
            (Operation::Mode, TaskRequest::MODE),
            (Operation::BaseLink, TaskRequest::BASE_LINK),
            (Operation::Activate, TaskRequest::ACTIVATE),
            (Operation::Weight, TaskRequest::WEIGHT),
            (Operation::Gain, TaskRequest::GAIN),
            (Operation::Limits, TaskRequest::LIMITS),
            (Operation::Reset, TaskRequest::RESET),
            (Operation::Posture, TaskRequest::POSTURE),
        ] {
            assert_eq!(operation as i8, number);
        }
    }
}
