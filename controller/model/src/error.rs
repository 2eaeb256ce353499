//! Errors and warnings of robot descriptions and of requests to a model.

use super::names::near_list;
use thiserror::Error;

/// Reasons why a model cannot be built or evaluated. `file` is the name of the source.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The text is not well-formed XML, not a URDF, or exceeds a limit on size, nesting, links or joints.
    #[error("{file}: not a URDF: line {line}: {reason}")]
    NotUrdf {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// An element is not valid URDF.
    #[error("{file}: in {element}: line {line}: {reason}")]
    BadElement {
        /// Name of the source.
        file: String,
        /// For example `joint "knee"`.
        element: String,
        /// Line, from 1.
        line: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// The file defines no link.
    #[error("{file}: no link found, expected at least one")]
    NoLinks {
        /// Name of the source.
        file: String,
    },
    /// Two links or two joints share a name.
    #[error("{file}: line {line}: two {what}s have the name \"{name}\", expected unique names")]
    DuplicateName {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that does not exist.
    #[error("{file}: line {line}: joint \"{joint}\": its {role} link \"{link}\" does not exist{}", near_list(.near))]
    MissingLink {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The name that was not found.
        link: String,
        /// Similar names that exist.
        near: Vec<String>,
    },
    /// A link is the child of two joints.
    #[error(
        "{file}: line {line}: link \"{link}\" is the child of joints \"{first}\" and \"{second}\", expected one parent"
    )]
    TwoParents {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The link.
        link: String,
        /// The joint that came first in the file.
        first: String,
        /// The other joint.
        second: String,
    },
    /// More than one link has no parent.
    #[error("{file}: line {line}: links {links:?} have no parent joint, expected one root")]
    SeveralRoots {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The links without a parent, in file order.
        links: Vec<String>,
    },
    /// Links that form a loop.
    #[error("{file}: line {line}: links {links:?} form a loop, expected a tree")]
    Loop {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The links that cannot be reached from the root, in file order.
        links: Vec<String>,
    },
    /// A joint type that the model does not support.
    #[error(
        "{file}: line {line}: joint \"{joint}\" has type \"{found}\", expected fixed, revolute, continuous, prismatic, or floating above the base"
    )]
    UnsupportedJoint {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The joint.
        joint: String,
        /// The type found.
        found: String,
    },
    /// A floating joint that is not the only movable connection of the robot to the world.
    #[error(
        "{file}: line {line}: joint \"{joint}\" has type \"floating\", but joint \"{other}\" also moves, and not below it; a floating joint is supported only between the world and the base"
    )]
    FloatingInside {
        /// Name of the source.
        file: String,
        /// Line of the floating joint, from 1.
        line: usize,
        /// The floating joint.
        joint: String,
        /// A movable joint that is not below it, or the floating joint above it.
        other: String,
    },
    /// The total mass is not finite, or zero with a floating base.
    #[error(
        "{file}: robot \"{robot}\": total mass is {found} kg, expected a finite number, greater than 0 for a floating base"
    )]
    BadMass {
        /// Name of the source.
        file: String,
        /// Name of the robot.
        robot: String,
        /// Total mass, kg.
        found: f64,
    },
    /// More movable joints than the dynamics are computed for: matrices grow with the square of their number.
    #[error("robot \"{robot}\" has {found} movable joints, expected at most {limit}")]
    TooManyJoints {
        /// Name of the robot.
        robot: String,
        /// Number of movable joints.
        found: usize,
        /// Largest number.
        limit: usize,
    },
    /// A revolute or prismatic joint without a usable `<limit>`.
    #[error(
        "{file}: line {line}: joint \"{joint}\" has no limits, expected <limit> with lower, upper, effort and velocity"
    )]
    MissingLimits {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// The joint.
        joint: String,
    },
    /// A number outside its range.
    #[error("{file}: line {line}: {element}: {quantity} is {found}, expected {expected}")]
    BadNumber {
        /// Name of the source.
        file: String,
        /// Line, from 1.
        line: usize,
        /// For example `link "trunk"`.
        element: String,
        /// For example `mass`.
        quantity: &'static str,
        /// The value found.
        found: String,
        /// The range.
        expected: &'static str,
    },
    /// A joint that cannot move the robot: its accelerations would be infinite, or it has no torque or speed.
    #[error("robot \"{robot}\": joint \"{joint}\" moves link \"{link}\": {quantity} is {found}, expected {expected}")]
    CannotRun {
        /// Name of the robot.
        robot: String,
        /// The joint.
        joint: String,
        /// The link that it moves.
        link: String,
        /// For example `effort limit`.
        quantity: &'static str,
        /// The value found.
        found: f64,
        /// The range.
        expected: &'static str,
    },
    /// A name that the model does not have.
    #[error("robot \"{robot}\" has no {what} \"{name}\"{}", near_list(.near))]
    Unknown {
        /// Name of the robot.
        robot: String,
        /// `joint` or `link`.
        what: &'static str,
        /// The requested name.
        name: String,
        /// Similar names that exist.
        near: Vec<String>,
    },
    /// A state without a value for a joint, or with a non-finite value.
    #[error("state: {key}: found {found}, expected {expected}")]
    BadState {
        /// For example `q.lf_haa_joint`.
        key: String,
        /// Value found.
        found: String,
        /// Value expected.
        expected: &'static str,
    },
}

/// Unusual properties of a robot description. The model can still be used.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ModelWarning {
    /// A movable body has no mass: the mass matrix may be singular.
    #[error(
        "link \"{link}\", moved by joint \"{joint}\", and the links fixed to it have no mass: the mass matrix may be singular"
    )]
    MasslessBody {
        /// The link.
        link: String,
        /// The joint that moves it.
        joint: String,
    },
    /// No mass distribution has the principal moments of inertia of a body.
    #[error(
        "body of link \"{link}\": principal moments of inertia {moments:?} kg m², expected each positive and at most the sum of the others"
    )]
    ImplausibleInertia {
        /// First link of the body.
        link: String,
        /// Principal moments, ascending, kg m².
        moments: [f64; 3],
    },
    /// A movable joint whose effort or velocity limit is zero.
    #[error("joint \"{joint}\": {quantity} limit is 0: the joint cannot move")]
    ZeroLimit {
        /// The joint.
        joint: String,
        /// `effort` or `velocity`.
        quantity: &'static str,
    },
    /// Shapes that cannot be read. One warning for all of a file: it may have many.
    #[error("link \"{link}\": line {line}: {reason}; the <{what}> is ignored{}", and_more(*.more))]
    ShapesIgnored {
        /// `visual` or `collision`.
        what: &'static str,
        /// Link of the first one.
        link: String,
        /// Line of the first one, from 1.
        line: usize,
        /// Why the first one cannot be read.
        reason: String,
        /// Number of further ones in the file.
        more: usize,
    },
    /// An `<inertial>` without a mass, or without a complete inertia: both count as zero. One warning for all of a file.
    #[error("link \"{link}\": line {line}: <inertial> has no complete <{lacks}>, which counts as zero{}", and_more(*.more))]
    IncompleteInertial {
        /// Link of the first one.
        link: String,
        /// Line of the first one, from 1.
        line: usize,
        /// `mass` (the whole element then counts as zero) or `inertia`.
        lacks: &'static str,
        /// Number of further ones in the file.
        more: usize,
    },
    /// An axis whose length is not 1. One warning for all of a file.
    #[error("joint \"{joint}\": line {line}: the axis has length {length}, expected 1; it is normalized{}", and_more(*.more))]
    AxisNormalized {
        /// Joint of the first one.
        joint: String,
        /// Line of the first one, from 1.
        line: usize,
        /// Length of the first one.
        length: f64,
        /// Number of further ones in the file.
        more: usize,
    },
    /// A position range whose lower end is above its upper end.
    #[error("joint \"{joint}\": line {line}: lower limit {lower} is above upper limit {upper}; they are exchanged")]
    RangeReversed {
        /// The joint.
        joint: String,
        /// Line of the joint, from 1.
        line: usize,
        /// Lower limit in the file, rad or m.
        lower: f64,
        /// Upper limit in the file, rad or m.
        upper: f64,
    },
    /// The parent link of the floating joint and what is fixed to it: they represent the world.
    #[error(
        "link \"{link}\", the parent of the floating joint \"{joint}\", represents the world; it is ignored with the links fixed to it ({links} links, {mass} kg); the child link is the base"
    )]
    WorldIgnored {
        /// The parent link.
        link: String,
        /// The floating joint.
        joint: String,
        /// Number of links that are ignored.
        links: usize,
        /// Their mass, kg.
        mass: f64,
    },
    /// A `<mimic>` element, which the model ignores.
    #[error("joint \"{joint}\" mimics joint \"{leader}\": `mimic` is ignored, the joint is free and actuated")]
    MimicIgnored {
        /// The joint.
        joint: String,
        /// The joint that it mimics.
        leader: String,
    },
}

fn and_more(more: usize) -> String {
    if more == 0 { String::new() } else { format!(", and {more} more") }
}
