//! The stack file of the controller `cartesian_ik`: tasks, priorities, constraints, gains and limits as TOML.

use crate::error::LoadError;
use crate::qp::hierarchy::Selective;
use crate::stack::{Formula, is_name};
use crate::trajectory::{Limits, PoseLimits};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest number of tasks, and of joints in a list.
const MOST: usize = 64;

/// A stack file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StackFile {
    /// Tasks, levels and constraints, as in [`crate::stack`]. Constraints: `joint_limits`, `self_collision`, or the name of a task whose rows hold exactly.
    pub formula: String,
    /// λ of every level.
    #[serde(default = "regularization")]
    pub regularization: f64,
    /// What the model state follows.
    #[serde(default)]
    pub feedback: Feedback,
    /// Limits of the joints.
    #[serde(default)]
    pub limits: JointLimitsFile,
    /// Of the constraint `self_collision`.
    #[serde(default)]
    pub self_collision: SelfCollisionFile,
    /// Damping of small singular values on every level; without it only λ damps.
    #[serde(default)]
    pub selective: Option<Selective>,
    /// Tasks by name.
    #[serde(default, rename = "task")]
    pub tasks: BTreeMap<String, TaskFile>,
}

fn regularization() -> f64 {
    1e-6
}

/// What the model state follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Feedback {
    /// The solution alone, integrated.
    #[default]
    Model,
    /// The measured joint positions.
    Measured,
}

/// Limits of all joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JointLimitsFile {
    /// Fraction of the velocity limits of the URDF.
    pub velocity: f64,
    /// Acceleration, rad/s² or m/s².
    pub acceleration: f64,
}

impl Default for JointLimitsFile {
    fn default() -> Self {
        JointLimitsFile { velocity: 1.0, acceleration: f64::INFINITY }
    }
}

/// The kinds of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskType {
    /// Pose of `link` relative to `base_link`, six rows.
    Cartesian,
    /// Position of the centre of mass in the world, three rows.
    Com,
    /// Joint positions.
    Posture,
    /// Joint velocities, kept small.
    MinimumVelocity,
    /// The `axis` of `link` points to a point, two rows; the reference is the point in the axes of `base_link`.
    Gaze,
    /// No angular momentum about the centre of mass, three rows.
    AngularMomentum,
    /// Joints move towards smaller gravity torques.
    MinimumEffort,
    /// The joints between `base_link` and `link` move towards a larger manipulability.
    Manipulability,
}

impl TaskType {
    /// Name, as in a stack file.
    pub fn name(self) -> &'static str {
        [
            "cartesian",
            "com",
            "posture",
            "minimum_velocity",
            "gaze",
            "angular_momentum",
            "minimum_effort",
            "manipulability",
        ][self as usize]
    }

    /// Whether a task of this type has a link, and one that it is relative to.
    fn has_link(self) -> bool {
        matches!(self, TaskType::Cartesian | TaskType::Gaze | TaskType::Manipulability)
    }
}

/// A task of a stack file. Keys that its type does not have must be absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskFile {
    /// Kind.
    #[serde(rename = "type")]
    pub kind: TaskType,
    /// The controlled link; `cartesian`, `gaze`, `manipulability`.
    pub link: Option<String>,
    /// The axis that points to the reference, in the axes of the link; `gaze`.
    #[serde(default)]
    pub axis: Option<[f64; 3]>,
    /// The link that the reference is relative to; `cartesian`, `gaze`, `manipulability`.
    #[serde(default = "world")]
    pub base_link: String,
    /// Whether rows and error are in the axes of the controlled link; `cartesian`.
    #[serde(default)]
    pub local: bool,
    /// Name of a posture of the robot; `posture`.
    pub posture: Option<String>,
    /// Gain, 1/s.
    #[serde(default = "gain")]
    pub gain: f64,
    /// Factor of the orientation error; `cartesian`.
    #[serde(default = "one")]
    pub orientation_gain: f64,
    /// Weight: one number, or one for each row.
    #[serde(default)]
    pub weight: WeightFile,
    /// Whether the task takes part from the start.
    #[serde(default = "yes")]
    pub active: bool,
    /// Limits of the reference.
    #[serde(default)]
    pub limits: ReferenceLimits,
    /// The only joints that the task moves.
    #[serde(default)]
    pub enabled_joints: Vec<String>,
    /// Joints that the task does not move.
    #[serde(default)]
    pub disabled_joints: Vec<String>,
}

fn world() -> String {
    WORLD.to_owned()
}

fn gain() -> f64 {
    10.0
}

fn one() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

/// The name of the world as a base link.
pub const WORLD: &str = "world";

/// A weight of a stack file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WeightFile {
    /// Of all rows.
    One(f64),
    /// Of each row.
    Each(Vec<f64>),
}

impl Default for WeightFile {
    fn default() -> Self {
        WeightFile::One(1.0)
    }
}

/// Limits of a reference, which lags behind the request. Without limits the task follows the request at once. Joints of a posture have the angular limits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReferenceLimits {
    /// Linear velocity on each axis, m/s.
    pub velocity: f64,
    /// Linear acceleration on each axis, m/s².
    pub acceleration: f64,
    /// Angular velocity, rad/s.
    pub angular_velocity: f64,
    /// Angular acceleration, rad/s².
    pub angular_acceleration: f64,
    /// Linear jerk on each axis, m/s³.
    pub jerk: f64,
    /// Angular jerk, rad/s³.
    pub angular_jerk: f64,
}

impl Default for ReferenceLimits {
    fn default() -> Self {
        ReferenceLimits::of([f64::INFINITY; 6])
    }
}

impl ReferenceLimits {
    /// Names of the numbers, in their order.
    const NAMES: [&str; 6] =
        ["velocity", "acceleration", "angular_velocity", "angular_acceleration", "jerk", "angular_jerk"];

    fn of(numbers: [f64; 6]) -> Self {
        let [velocity, acceleration, angular_velocity, angular_acceleration, jerk, angular_jerk] = numbers;
        ReferenceLimits { velocity, acceleration, angular_velocity, angular_acceleration, jerk, angular_jerk }
    }

    fn to_array(self) -> [f64; 6] {
        let ReferenceLimits { velocity, acceleration, angular_velocity, angular_acceleration, jerk, angular_jerk } =
            self;
        [velocity, acceleration, angular_velocity, angular_acceleration, jerk, angular_jerk]
    }

    /// From the values of a request: four numbers, or six with those of jerk; `None` for another number of them.
    pub fn of_values(values: &[f64]) -> Option<Self> {
        match *values {
            [v, a, w, al] => Some(ReferenceLimits::of([v, a, w, al, f64::INFINITY, f64::INFINITY])),
            [v, a, w, al, j, j_angular] => Some(ReferenceLimits::of([v, a, w, al, j, j_angular])),
            _ => None,
        }
    }

    /// For the reference of a pose.
    pub fn of_pose(self) -> PoseLimits {
        PoseLimits {
            linear: Limits { v: self.velocity, a: self.acceleration, j: self.jerk },
            angular: Limits { v: self.angular_velocity, a: self.angular_acceleration, j: self.angular_jerk },
        }
    }
}

/// An error of a stack file.
pub(super) fn wrong(what: impl Into<String>) -> LoadError {
    LoadError::StackFile { what: what.into() }
}

impl StackFile {
    /// Reads and checks a stack file, apart from what depends on the robot.
    ///
    /// # Errors
    /// The text is not TOML of the format, a number is out of range, a name of the formula is unknown, or a task is not in the formula.
    pub fn parse(text: &str) -> Result<(Self, Formula), LoadError> {
        let file: StackFile = toml::from_str(text).map_err(|error| wrong(error.to_string()))?;
        let formula = Formula::parse(&file.formula)?;
        file.check()?;
        Ok((file, formula))
    }

    fn check(&self) -> Result<(), LoadError> {
        if self.tasks.len() > MOST {
            return Err(wrong(format!("{} tasks, expected at most {MOST}", self.tasks.len())));
        }
        let positive = |key: &str, x: f64| {
            if x > 0.0 { Ok(()) } else { Err(wrong(format!("{key} is {x}, expected a positive number"))) }
        };
        let finite = |key: &str, x: f64| {
            let what = || format!("{key} is {x}, expected a number from 0 to 1e9");
            if (0.0..=1e9).contains(&x) { Ok(()) } else { Err(wrong(what())) }
        };
        finite("regularization", self.regularization)?;
        positive("limits.acceleration", self.limits.acceleration)?;
        if !(self.limits.velocity > 0.0 && self.limits.velocity <= 1.0) {
            return Err(wrong(format!(
                "limits.velocity is {}, expected more than 0 and at most 1",
                self.limits.velocity
            )));
        }
        let SelfCollisionFile { margin, threshold, gain, pairs } = self.self_collision;
        finite("self_collision.margin", margin)?;
        positive("self_collision.threshold", threshold - margin)?;
        finite("self_collision.gain", gain)?;
        if !(1..=100).contains(&pairs) {
            return Err(wrong(format!("self_collision.pairs is {pairs}, expected 1 to 100")));
        }
        if let Some(Selective { threshold, .. }) = self.selective
            && !(threshold > 0.0 && threshold < 1.0)
        {
            return Err(wrong(format!("selective.threshold is {threshold}, expected a number between 0 and 1")));
        }
        for (name, task) in &self.tasks {
            let key = |key: &str| format!("task.{name}.{key}");
            if !is_name(name) || name.len() > 32 || [JOINT_LIMITS, SELF_COLLISION].contains(&name.as_str()) {
                return Err(wrong(format!("task \"{name}\": expected another name of 1 to 32 letters, digits and _")));
            }
            finite(&key("gain"), task.gain)?;
            finite(&key("orientation_gain"), task.orientation_gain)?;
            match &task.weight {
                WeightFile::One(weight) => weight_of(&key("weight"), *weight)?,
                WeightFile::Each(weights) => {
                    weights.iter().try_for_each(|weight| weight_of(&key("weight"), *weight))?;
                }
            }
            for (field, x) in ReferenceLimits::NAMES.iter().zip(task.limits.to_array()) {
                positive(&key(&format!("limits.{field}")), x)?;
            }
            let is_cartesian = task.kind == TaskType::Cartesian;
            let absent = [
                ("link", task.link.is_some() && !task.kind.has_link()),
                ("base_link", task.base_link != WORLD && !task.kind.has_link()),
                ("axis", task.axis.is_some() && task.kind != TaskType::Gaze),
                ("local", task.local && !is_cartesian),
                ("posture", task.posture.is_some() && task.kind != TaskType::Posture),
            ];
            if let Some((found, _)) = absent.iter().find(|(_, is_wrong)| *is_wrong) {
                return Err(wrong(format!("{}: a task of type {} has no such key", key(found), task.kind.name())));
            }
            if task.kind.has_link() && task.link.is_none() {
                return Err(wrong(format!("{}: missing", key("link"))));
            }
            if task.kind == TaskType::Gaze {
                let size = task.axis.map_or(0.0, |axis| axis.iter().fold(0.0, |sum, x| sum + x * x)).sqrt();
                // False for NaN too.
                if !(1e-3..=1e3).contains(&size) {
                    return Err(wrong(format!("{}: expected a direction, three numbers", key("axis"))));
                }
            }
            if !task.enabled_joints.is_empty() && !task.disabled_joints.is_empty() {
                return Err(wrong(format!("task.{name}: expected enabled_joints or disabled_joints, not both")));
            }
        }
        Ok(())
    }
}

/// The constraint of the joints' limits.
pub const JOINT_LIMITS: &str = "joint_limits";
/// The constraint that links do not touch each other.
pub const SELF_COLLISION: &str = "self_collision";

/// Parameters of the constraint `self_collision`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SelfCollisionFile {
    /// Smallest distance of two links, m.
    pub margin: f64,
    /// Distance from which on a pair of links is watched, m.
    pub threshold: f64,
    /// Rate at which a distance may approach the smallest one, 1/s.
    pub gain: f64,
    /// Largest number of pairs that are watched at once.
    pub pairs: usize,
}

impl Default for SelfCollisionFile {
    fn default() -> Self {
        SelfCollisionFile { margin: 0.01, threshold: 0.1, gain: 5.0, pairs: 10 }
    }
}

fn weight_of(key: &str, weight: f64) -> Result<(), LoadError> {
    if (1e-9..=1e9).contains(&weight) {
        return Ok(());
    }
    Err(wrong(format!("{key} is {weight}, expected a number from 1e-9 to 1e9")))
}
