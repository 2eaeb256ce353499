//! Errors of robot descriptions.

use crate::names::near_list;
use thiserror::Error;

/// Reasons why a description cannot be used. `file` is the name of the TOML file.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DescriptionError {
    /// The text is not TOML, or its table `[robot]` has unknown or missing keys or values of another type.
    #[error("{file}: {reason}")]
    Parse {
        /// Name of the file.
        file: String,
        /// Key, line, what was found and what was expected.
        reason: String,
    },
    /// A name that the URDF, or the description itself, does not have.
    #[error("{file}: {key}: the robot has no {what} \"{name}\"{}", near_list(.near))]
    Unknown {
        /// Name of the file.
        file: String,
        /// For example `robot.contact.wheel_1.link`.
        key: String,
        /// `link`, `joint`, `movable joint`, `contact`, `group` or `posture`.
        what: &'static str,
        /// The name that was not found.
        name: String,
        /// Similar names that exist.
        near: Vec<String>,
    },
    /// A name that occurs twice.
    #[error("{file}: {key}: the name \"{name}\" occurs twice, expected unique names")]
    Duplicate {
        /// Name of the file.
        file: String,
        /// For example `robot.contact`.
        key: String,
        /// The name.
        name: String,
    },
    /// A value outside its range.
    #[error("{file}: {key}: found {found}, expected {expected}")]
    BadValue {
        /// Name of the file.
        file: String,
        /// For example `robot.contact.wheel_1.geometry.wheel.radius`.
        key: String,
        /// The value found.
        found: String,
        /// The range.
        expected: String,
    },
}
