//! Limits of a joint's drive that depend on its speed.

use super::bodies::JointInfo;
use serde::{Deserialize, Serialize};

/// Limits of a drive, in addition to the effort of the URDF. A missing limit is infinite.
///
/// They reduce only the torque in the direction of the motion: a drive can brake with its full effort at any speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveLimits {
    /// Largest mechanical power, W.
    #[serde(default = "unlimited", skip_serializing_if = "is_unlimited")]
    pub power: f64,
    /// Speed up to which the full effort is available, rad/s or m/s. From there to `no_load_velocity` it decreases linearly to 0.
    #[serde(default = "unlimited", skip_serializing_if = "is_unlimited")]
    pub rated_velocity: f64,
    /// Speed at which the drive has no torque left, rad/s or m/s.
    #[serde(default = "unlimited", skip_serializing_if = "is_unlimited")]
    pub no_load_velocity: f64,
}

fn unlimited() -> f64 {
    f64::INFINITY
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde requires")]
fn is_unlimited(x: &f64) -> bool {
    *x == f64::INFINITY
}

impl Default for DriveLimits {
    fn default() -> Self {
        DriveLimits { power: f64::INFINITY, rated_velocity: f64::INFINITY, no_load_velocity: f64::INFINITY }
    }
}

impl DriveLimits {
    /// Largest torque in the direction of the motion, N m or N: between 0 and `effort`.
    ///
    /// - `speed`: magnitude of the joint velocity.
    fn driving(&self, effort: f64, speed: f64) -> f64 {
        let mut limit = effort;
        if self.power < f64::INFINITY && limit * speed > self.power {
            limit = self.power / speed;
        }
        if speed >= self.no_load_velocity {
            return 0.0;
        }
        if speed > self.rated_velocity && self.no_load_velocity < f64::INFINITY && effort < f64::INFINITY {
            let left = (self.no_load_velocity - speed) / (self.no_load_velocity - self.rated_velocity);
            limit = limit.min(effort * left);
        }
        limit
    }
}

impl JointInfo {
    /// Smallest and largest torque of the drive at the joint velocity `qd`, N m or N. The smallest is at most 0, the largest at least 0.
    #[inline]
    pub fn torque_range(&self, qd: f64) -> (f64, f64) {
        let driving = self.drive.driving(self.effort, qd.abs());
        if qd >= 0.0 { (-self.effort, driving) } else { (-driving, self.effort) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_driving_torque_follows_power_and_speed_and_the_braking_torque_is_the_effort() {
        let drive = DriveLimits { power: 300.0, rated_velocity: 6.0, no_load_velocity: 10.0 };
        for (speed, expected) in
            [(0.0, 100.0), (3.0, 100.0), (5.0, 60.0), (8.0, 37.5), (9.0, 25.0), (10.0, 0.0), (50.0, 0.0)]
        {
            assert_eq!(drive.driving(100.0, speed), expected, "{speed}");
        }
        assert_eq!(DriveLimits::default().driving(100.0, 1e6), 100.0);
        assert_eq!(DriveLimits::default().driving(f64::INFINITY, 0.0), f64::INFINITY);
        let sudden = DriveLimits { rated_velocity: f64::INFINITY, no_load_velocity: 10.0, ..DriveLimits::default() };
        assert_eq!((sudden.driving(100.0, 9.0), sudden.driving(100.0, 10.0)), (100.0, 0.0));
        let powered = DriveLimits { power: 300.0, ..DriveLimits::default() };
        assert_eq!((powered.driving(f64::INFINITY, 0.0), powered.driving(f64::INFINITY, 3.0)), (f64::INFINITY, 100.0));
    }
}
