//! Interface of a simulated robot, independent of the physics engine.

use crate::DriverError;
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use std::collections::BTreeMap;

/// A simulated robot on its ground. Joints are in URDF order, feet in the order of the robot's TOML file.
///
/// One cycle: `robot_state` (and `ground_truth`) at time t, `apply` the command, `step` to t + period. Forces, torques and
/// accelerations are those of the last interval: they are constant within it, and those of the next one are not known yet.
pub trait Simulator: Send {
    /// Names of the actuated joints.
    fn joints(&self) -> &[String];

    /// Simulated time of a step, ns.
    fn period_ns(&self) -> i64;

    /// Places the robot at rest at the origin, heading along x, feet on the ground, without command and pushes.
    ///
    /// - `posture`: joint positions, rad; joints that it does not contain are at 0, or at the limit closest to 0.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot does not have.
    fn reset(&mut self, posture: &BTreeMap<String, f64>) -> Result<(), DriverError>;

    /// Writes the sensor measurements.
    fn robot_state(&self, t_ns: i64, seq: i64, state: &mut RobotState);

    /// Writes the true state. No controller may read it.
    fn ground_truth(&self, t_ns: i64, truth: &mut GroundTruth);

    /// Sets the command for the following steps, until the next call. In torque mode each step applies
    /// `tau + kp (q_des - q) + kd (qd_des - qd)`, limited to the effort; idle applies no torque, damping applies `-kd qd`.
    ///
    /// # Errors
    /// A command of the wrong size, with an unknown mode or a non-finite value. The previous command then stays active.
    fn apply(&mut self, command: &RobotCommand) -> Result<(), DriverError>;

    /// Simulates one period.
    ///
    /// # Errors
    /// [`DriverError::Diverged`]: the state is not finite.
    fn step(&mut self) -> Result<(), DriverError>;

    /// Adds a force (N) and a torque (N m), both in W, at the centre of mass of the body of a link or of an object (`None`: the base).
    /// They act in every step until [`Simulator::clear_pushes`].
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a link that the robot does not have.
    fn add_push(&mut self, link: Option<&str>, f_W: [f64; 3], tau_W: [f64; 3]) -> Result<(), DriverError>;

    /// Joint torques that balance a contact force on a foot, `-Jᵀ f`, N m, as torque sensors read it.
    ///
    /// - `foot`: index in the order of the robot's TOML file.
    /// - `f_W`: force on the foot, in W, N.
    fn torque_of_touch(&self, foot: usize, f_W: [f64; 3]) -> Vec<f64>;

    /// Removes all pushes.
    fn clear_pushes(&mut self);

    /// Whether the base is lower above the ground than allowed for a standing robot, or tilted more than allowed.
    fn fallen(&self) -> bool;

    /// Whether the centre of mass of the base is below the ground: its shapes do not touch the ground, and no run of it is a success.
    fn below_ground(&self) -> bool;

    /// Whether the base is tilted more than allowed. Use it for a robot that sits or lies, which is low without having fallen.
    fn tipped(&self) -> bool;
}
