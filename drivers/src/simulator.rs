//! What a controller's other side must be able to do, whichever engine computes it.

use crate::DriverError;
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use std::collections::BTreeMap;

/// A simulated robot on its ground. Positions of a joint follow the order of the URDF, feet the order of the robot's TOML.
///
/// One turn: `robot_state` (and `ground_truth`) at time t, `apply` the command, `step` to t + period. Forces, torques and
/// accelerations are those of the last interval, since they are constant on it and unknown for the next one.
pub trait Simulator: Send {
    /// Names of the actuated joints.
    fn joints(&self) -> &[String];

    /// Time that a step takes, ns.
    fn period_ns(&self) -> i64;

    /// Puts the robot at rest at the origin, heading along x, feet on the ground, no command, no push; the first step lets it go.
    /// Joints that `posture` leaves out are at 0 or the limit next to it.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot lacks.
    fn reset(&mut self, posture: &BTreeMap<String, f64>) -> Result<(), DriverError>;

    /// Writes what the sensors read.
    fn robot_state(&self, t_ns: i64, seq: i64, state: &mut RobotState);

    /// Writes what no controller may read.
    fn ground_truth(&self, t_ns: i64, truth: &mut GroundTruth);

    /// Takes a command, which holds until the next one. The joint loop `tau + kp (q_des - q) + kd (qd_des - qd)`, limited to
    /// the effort, is closed anew in every step; idle is no torque, damping is `-kd qd`.
    ///
    /// # Errors
    /// A command of the wrong size, with an unknown mode or a number that is none; the last one then still holds.
    fn apply(&mut self, command: &RobotCommand) -> Result<(), DriverError>;

    /// Goes on by one period.
    ///
    /// # Errors
    /// [`DriverError::Diverged`]: the state is no longer finite.
    fn step(&mut self) -> Result<(), DriverError>;

    /// Adds a force (N) and a torque (N m), both in W, on the centre of mass of the body that carries a link (none = the base).
    /// They act in every step until [`Simulator::clear_pushes`].
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a link that the robot lacks.
    fn add_push(&mut self, link: Option<&str>, f_W: [f64; 3], tau_W: [f64; 3]) -> Result<(), DriverError>;

    /// Joint torques that hold a force of the ground on a foot (N, in W), `-Jᵀ f`, N m: what torque sensors read of it. Feet in the order
    /// of the robot's TOML.
    fn torque_of_touch(&self, foot: usize, f_W: [f64; 3]) -> Vec<f64>;

    /// Takes every push away.
    fn clear_pushes(&mut self);

    /// Whether the base is lower over the ground than a standing one may be, or more tilted than allowed.
    fn fallen(&self) -> bool;

    /// Whether the base is more tilted than allowed: a robot that sits is low, and has not fallen.
    fn tipped(&self) -> bool;
}
