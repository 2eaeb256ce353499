//! Why no parameter file can be derived from a URDF.

use crate::error::LoadError;
use crate::model::ModelError;
use crate::model::srdf::SrdfError;
use crate::params::ParamsError;

/// Why no parameter file can be derived from a URDF.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotInitError {
    /// The URDF is invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The SRDF is invalid.
    #[error(transparent)]
    Srdf(#[from] SrdfError),
    /// Fewer than four chains of movable joints.
    #[error(
        "found {} chains of movable joints, expected the four legs of a quadruped: {}", chains.len(),
        if chains.is_empty() { "none".to_owned() } else { list(chains) }
    )]
    TooFewLegs {
        /// Joints of each chain, base first.
        chains: Vec<Vec<String>>,
    },
    /// A position for a joint that is a leg's or that the robot does not have.
    #[error("--fix {joint}: expected a movable joint outside of the legs: {}", if others.is_empty() { "there is none".to_owned() } else { others.join(", ") })]
    Fix {
        /// The joint.
        joint: String,
        /// The joints that can be fixed.
        others: Vec<String>,
    },
    /// A leg without exactly three movable joints.
    #[error("leg with joints {}: found {} joints, expected 3", joints.join(", "), joints.len())]
    JointsOfLeg {
        /// Its joints, base first.
        joints: Vec<String>,
    },
    /// A leg joint that does not rotate.
    #[error("leg joint {joint} is prismatic, expected a revolute joint")]
    Prismatic {
        /// The joint.
        joint: String,
    },
    /// A leg without a foot link.
    #[error(
        "the leg of joint {joint} ends in link {link}, whose origin is on the axis of that joint; add a link for the foot at the contact point"
    )]
    NoFoot {
        /// Last joint of the leg.
        joint: String,
        /// Last link of the leg.
        link: String,
    },
    /// Two legs in the same corner of the body.
    #[error(
        "the legs of {first} and {second} are both {corner}; in the root link, x must point forward and y to the left"
    )]
    SameCorner {
        /// A foot link.
        first: String,
        /// The other foot link.
        second: String,
        /// `left front`, `right front`, `left hind` or `right hind`.
        corner: &'static str,
    },
    /// No posture within the joint limits puts a foot below its hip.
    #[error("{foot} cannot be placed {depth:.3} m below its hip with joints {} within their limits", joints.join(", "))]
    OutOfReach {
        /// Foot link.
        foot: String,
        /// Joints of its leg, base first.
        joints: Vec<String>,
        /// Distance from hip to ground, m.
        depth: f64,
    },
    /// The name of the robot is no file name.
    #[error("robot name \"{found}\": expected letters, digits, _ and -")]
    Name {
        /// The name.
        found: String,
    },
    /// The derived parameters are invalid.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// No controller can be built with the derived parameters.
    #[error("the derived parameters do not fit the robot: {source}")]
    Unusable {
        /// The error.
        source: Box<LoadError>,
    },
}

fn list(chains: &[Vec<String>]) -> String {
    chains.iter().map(|joints| format!("({})", joints.join(", "))).collect::<Vec<_>>().join(", ")
}
