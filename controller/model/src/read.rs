//! Reads the elements of a URDF. Like other readers it uses the first of repeated elements, ignores materials and unknown elements such as
//! `<transmission>` and `<gazebo>`, and leaves out shapes that cannot be read, with a warning.

use nalgebra::{Matrix3, Vector3};

use super::error::{ModelError, ModelWarning};
use super::fields::{Reader, Source};
use super::pose::Pose;
use super::tree::{Inertial, JointKind, Limits, Shape};
use super::xml::{Document, Element};

/// Largest number of links, and of movable joints.
pub(super) const MAX_LINKS: usize = 10_000;
/// Deviation of the length of an `<axis>` from 1 that is attributed to rounding in the file.
const AXIS_ROUNDING: f64 = 1e-5;

/// A `<link>`.
pub(super) struct RawLink {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) inertial: Inertial,
    pub(super) visuals: Vec<Shape>,
    pub(super) collisions: Vec<Shape>,
}

/// Type of a joint in the file. [`UrdfTree`](super::tree::UrdfTree) has no floating joint.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum RawKind {
    Tree(JointKind),
    Floating,
}

/// A `<joint>`.
pub(super) struct RawJoint {
    pub(super) name: String,
    pub(super) line: usize,
    pub(super) kind: RawKind,
    pub(super) parent: String,
    pub(super) child: String,
    pub(super) X_PC: Pose,
    pub(super) axis: Vector3<f64>,
    pub(super) limits: Limits,
    pub(super) damping: f64,
    pub(super) friction: f64,
    pub(super) mimics: Option<String>,
}

/// A URDF before its links are connected.
pub(super) struct RawRobot {
    pub(super) name: String,
    pub(super) links: Vec<RawLink>,
    pub(super) joints: Vec<RawJoint>,
    pub(super) warnings: Vec<ModelWarning>,
}

/// Reads a text; `file` is used in messages only.
pub(super) fn read(text: &str, file: &str) -> Result<RawRobot, ModelError> {
    let not_urdf = |line: usize, reason: String| ModelError::NotUrdf { file: file.to_owned(), line, reason };
    let document = Document::parse(text).map_err(|error| not_urdf(error.line, error.reason))?;
    let root = document.root();
    if root.name() != "robot" {
        return Err(not_urdf(root.line(), format!("the outermost element is <{}>, expected <robot>", root.name())));
    }
    let source = Source { file, quaternions: matches!(root.attribute("version"), Some("1.1" | "1.2")) };
    let whole = Reader { source, element: "the robot".to_owned() };
    let mut robot = RawRobot { name: whole.name(root)?, links: Vec::new(), joints: Vec::new(), warnings: Vec::new() };
    for element in root.children() {
        match element.name() {
            "link" => {
                let link = read_link(element, source, &mut robot.warnings)?;
                robot.links.push(link);
            }
            "joint" => {
                let joint = read_joint(element, source, &mut robot.warnings)?;
                robot.joints.push(joint);
            }
            _ => {}
        }
        for (what, found) in [("links", robot.links.len()), ("joints", robot.joints.len())] {
            if found > MAX_LINKS {
                return Err(not_urdf(element.line(), format!("more than {MAX_LINKS} {what}")));
            }
        }
    }
    Ok(robot)
}

fn read_link(element: Element, source: Source, warnings: &mut Vec<ModelWarning>) -> Result<RawLink, ModelError> {
    let reader = Reader::new("link", element, source);
    let name = reader.name(element)?;
    let inertial = match element.child("inertial") {
        None => no_inertial(),
        Some(inertial) => read_inertial(&reader, inertial, &name, warnings)?,
    };
    let mut shapes = |what: &'static str| {
        let mut shapes = Vec::new();
        for element in element.children().filter(|child| child.name() == what) {
            match reader.shape(element) {
                Ok(shape) => shapes.push(shape),
                Err(error) => ignored(warnings, what, &name, error),
            }
        }
        shapes
    };
    let (visuals, collisions) = (shapes("visual"), shapes("collision"));
    Ok(RawLink { name, line: element.line(), inertial, visuals, collisions })
}

fn no_inertial() -> Inertial {
    Inertial { X_LC: Pose::identity(), mass: 0.0, I_C: Matrix3::zeros() }
}

/// Like Pinocchio, takes a missing `<mass>` as a link without inertial, and a missing or incomplete `<inertia>` as zero, with a warning. A number that
/// cannot be read is an error.
fn read_inertial(
    reader: &Reader,
    element: Element,
    link: &str,
    warnings: &mut Vec<ModelWarning>,
) -> Result<Inertial, ModelError> {
    let mut lacks = |what| {
        let lacks_more = warnings.iter_mut().find_map(|warning| match warning {
            ModelWarning::IncompleteInertial { more, .. } => Some(more),
            _ => None,
        });
        match lacks_more {
            Some(more) => *more += 1,
            None => {
                let (link, line) = (link.to_owned(), element.line());
                warnings.push(ModelWarning::IncompleteInertial { link, line, lacks: what, more: 0 });
            }
        }
    };
    let Some(mass) = element.child("mass").filter(|mass| mass.attribute("value").is_some()) else {
        lacks("mass");
        return Ok(no_inertial());
    };
    const KEYS: [&str; 6] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"];
    let mut I = [0.0; 6];
    match element.child("inertia").filter(|inertia| KEYS.iter().all(|key| inertia.attribute(key).is_some())) {
        None => lacks("inertia"),
        Some(inertia) => {
            for (entry, key) in I.iter_mut().zip(KEYS) {
                *entry = reader.number(inertia, key)?;
            }
            reader.all_finite(inertia, "inertia", &I)?;
        }
    }
    let [xx, yy, zz, xy, xz, yz] = I;
    Ok(Inertial {
        X_LC: reader.origin(element, "inertial origin")?,
        mass: reader.not_negative(mass, "mass", reader.number(mass, "value")?)?,
        I_C: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    })
}

/// Counts a shape that is left out.
fn ignored(warnings: &mut Vec<ModelWarning>, what: &'static str, link: &str, error: ModelError) {
    for warning in warnings.iter_mut() {
        if let ModelWarning::ShapesIgnored { what: known, more, .. } = warning
            && *known == what
        {
            *more += 1;
            return;
        }
    }
    let (line, reason) = match error {
        ModelError::BadElement { line, reason, .. } => (line, reason),
        ModelError::BadNumber { line, quantity, found, expected, .. } => {
            (line, format!("{quantity} is {found}, expected {expected}"))
        }
        other => (0, other.to_string()),
    };
    warnings.push(ModelWarning::ShapesIgnored { what, link: link.to_owned(), line, reason, more: 0 });
}

fn read_joint(element: Element, source: Source, warnings: &mut Vec<ModelWarning>) -> Result<RawJoint, ModelError> {
    let reader = Reader::new("joint", element, source);
    let name = reader.name(element)?;
    let unsupported = |found: &str| ModelError::UnsupportedJoint {
        file: source.file.to_owned(),
        line: element.line(),
        joint: name.clone(),
        found: found.to_owned(),
    };
    let kind = match reader.text(element, "type")? {
        "fixed" => RawKind::Tree(JointKind::Fixed),
        "revolute" => RawKind::Tree(JointKind::Revolute),
        "continuous" => RawKind::Tree(JointKind::Continuous),
        "prismatic" => RawKind::Tree(JointKind::Prismatic),
        "floating" => RawKind::Floating,
        found @ ("planar" | "spherical") => return Err(unsupported(found)),
        found => {
            return Err(
                reader.bad(element, format!("type is \"{found}\", expected fixed, revolute, continuous or prismatic"))
            );
        }
    };
    let link = |role| Ok::<_, ModelError>(reader.text(reader.required(element, role)?, "link")?.to_owned());
    let (damping, friction) = match element.child("dynamics") {
        None => (0.0, 0.0),
        Some(dynamics) => {
            let friction =
                |key, quantity| reader.not_negative(dynamics, quantity, reader.number_or(dynamics, key, 0.0)?);
            (friction("damping", "damping")?, friction("friction", "friction")?)
        }
    };
    let axis = match (kind, element.child("axis")) {
        (RawKind::Floating | RawKind::Tree(JointKind::Fixed), _) => Vector3::z(),
        (_, None) => Vector3::x(),
        (_, Some(axis)) => {
            let (unit, length) = reader.unit_axis(axis)?;
            if (length - 1.0).abs() > AXIS_ROUNDING {
                normalized(warnings, &name, axis.line(), length);
            }
            unit
        }
    };
    let limits = match kind {
        RawKind::Floating => Limits::NONE,
        RawKind::Tree(kind) => {
            let (limits, reversed) = reader.limits(element, &name, kind)?;
            warnings.extend(reversed.map(|[lower, upper]| {
                let (joint, line) = (name.clone(), element.line());
                ModelWarning::RangeReversed { joint, line, lower, upper }
            }));
            limits
        }
    };
    let mimics = match element.child("mimic") {
        None => None,
        Some(mimic) => Some(reader.text(mimic, "joint")?.to_owned()),
    };
    Ok(RawJoint {
        kind,
        parent: link("parent")?,
        child: link("child")?,
        X_PC: reader.origin(element, "origin")?,
        axis,
        limits,
        damping,
        friction,
        mimics,
        name,
        line: element.line(),
    })
}

/// Counts an axis whose length is not 1.
fn normalized(warnings: &mut Vec<ModelWarning>, joint: &str, line: usize, length: f64) {
    for warning in warnings.iter_mut() {
        if let ModelWarning::AxisNormalized { more, .. } = warning {
            *more += 1;
            return;
        }
    }
    warnings.push(ModelWarning::AxisNormalized { joint: joint.to_owned(), line, length, more: 0 });
}
