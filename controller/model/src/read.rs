//! Reads the elements of a URDF. Like other readers it uses the first of repeated elements, ignores materials and unknown elements, and leaves out
//! visual shapes that cannot be read, with a warning.

use nalgebra::{Matrix3, Vector3};

use super::error::{ModelError, ModelWarning};
use super::pose::Pose;
use super::tree::{Inertial, JointKind, Limits, Shape, ShapeKind};
use super::xml::{Document, Element};

/// Largest number of links.
pub(super) const MAX_LINKS: usize = 10_000;
/// Largest number of movable joints: matrices grow with its square.
pub(super) const MAX_MOVABLE: usize = 500;
/// Largest length of a name, bytes.
const MAX_NAME: usize = 200;
/// Largest magnitude of a length, mass, inertia or limit, in SI units: products of a few of them stay far from infinity.
const MAX_NUMBER: f64 = 1e9;

/// A `<link>`.
pub(super) struct RawLink {
    pub(super) name: String,
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
    let whole = Reader { file, element: "the robot".to_owned() };
    let mut robot = RawRobot { name: whole.name(root)?, links: Vec::new(), joints: Vec::new(), warnings: Vec::new() };
    let mut movable = 0;
    for element in root.children() {
        match element.name() {
            "link" => {
                let link = read_link(element, file, &mut robot.warnings)?;
                robot.links.push(link);
            }
            "joint" => {
                let joint = read_joint(element, file)?;
                movable += usize::from(joint.kind != RawKind::Tree(JointKind::Fixed));
                robot.joints.push(joint);
            }
            _ => {}
        }
        for (what, found, limit) in [("links", robot.links.len(), MAX_LINKS), ("movable joints", movable, MAX_MOVABLE)]
        {
            if found > limit {
                return Err(not_urdf(element.line(), format!("more than {limit} {what}")));
            }
        }
    }
    Ok(robot)
}

fn read_link(element: Element, file: &str, warnings: &mut Vec<ModelWarning>) -> Result<RawLink, ModelError> {
    let reader = Reader::new("link", element, file);
    let name = reader.name(element)?;
    let inertial = match element.child("inertial") {
        None => Inertial { X_LC: Pose::identity(), mass: 0.0, I_C: Matrix3::zeros() },
        Some(inertial) => {
            let i = reader.required(inertial, "inertia")?;
            let [xx, yy, zz, xy, xz, yz] = ["ixx", "iyy", "izz", "ixy", "ixz", "iyz"].map(|key| reader.number(i, key));
            let (xx, yy, zz, xy, xz, yz) = (xx?, yy?, zz?, xy?, xz?, yz?);
            reader.all_finite("inertia", &[xx, yy, zz, xy, xz, yz])?;
            let mass = reader.number(reader.required(inertial, "mass")?, "value")?;
            Inertial {
                X_LC: reader.origin(inertial, "inertial origin")?,
                mass: reader.not_negative("mass", mass)?,
                I_C: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            }
        }
    };
    let mut shapes = |what: &'static str| -> Result<Vec<Shape>, ModelError> {
        let mut shapes = Vec::new();
        for element in element.children().filter(|child| child.name() == what) {
            let geometry = element.child("geometry").and_then(|geometry| geometry.children().next());
            let shape = match geometry {
                None => Err(reader.bad(element, format!("<{what}> without a geometry"))),
                Some(geometry) => reader.shape(element, geometry),
            };
            match shape {
                Ok(Some(shape)) => shapes.push(shape),
                // A collision shape with a wrong number would change how the robot touches the ground.
                Err(error) if what == "collision" && geometry.is_some() => return Err(error),
                Ok(None) | Err(_) => ignored(warnings, what, &name, element.line()),
            }
        }
        Ok(shapes)
    };
    let (visuals, collisions) = (shapes("visual")?, shapes("collision")?);
    Ok(RawLink { name, inertial, visuals, collisions })
}

/// Counts a shape that is left out.
fn ignored(warnings: &mut Vec<ModelWarning>, what: &'static str, link: &str, line: usize) {
    for warning in warnings.iter_mut() {
        if let ModelWarning::ShapesIgnored { what: known, more, .. } = warning
            && *known == what
        {
            *more += 1;
            return;
        }
    }
    warnings.push(ModelWarning::ShapesIgnored { what, link: link.to_owned(), line, more: 0 });
}

fn read_joint(element: Element, file: &str) -> Result<RawJoint, ModelError> {
    let reader = Reader::new("joint", element, file);
    let name = reader.name(element)?;
    let unsupported = |found: &str| ModelError::UnsupportedJoint {
        file: file.to_owned(),
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
        Some(dynamics) => (reader.number_or(dynamics, "damping", 0.0)?, reader.number_or(dynamics, "friction", 0.0)?),
    };
    let axis = match (kind, element.child("axis")) {
        (RawKind::Floating | RawKind::Tree(JointKind::Fixed), _) => Vector3::z(),
        (_, None) => Vector3::x(),
        (_, Some(axis)) => reader.unit_axis(reader.numbers(axis, "xyz")?)?,
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
        limits: reader.limits(element, &name, kind)?,
        damping: reader.not_negative("damping", damping)?,
        friction: reader.not_negative("friction", friction)?,
        mimics,
        name,
    })
}

/// Reads parts of one link or joint; errors name the file, the element and the line.
struct Reader<'a> {
    file: &'a str,
    element: String,
}

impl Reader<'_> {
    fn new<'a>(what: &str, element: Element, file: &'a str) -> Reader<'a> {
        let element = match element.attribute("name") {
            Some(name) => format!("{what} \"{}\"", name.chars().take(MAX_NAME).collect::<String>()),
            None => format!("a {what} without a name"),
        };
        Reader { file, element }
    }

    fn bad(&self, at: Element, reason: String) -> ModelError {
        ModelError::BadElement { file: self.file.to_owned(), element: self.element.clone(), line: at.line(), reason }
    }

    fn required<'d>(&self, element: Element<'d>, name: &str) -> Result<Element<'d>, ModelError> {
        element.child(name).ok_or_else(|| self.bad(element, format!("<{}> has no <{name}>", element.name())))
    }

    fn text<'d>(&self, element: Element<'d>, key: &str) -> Result<&'d str, ModelError> {
        element.attribute(key).ok_or_else(|| self.bad(element, format!("<{}> has no attribute {key}", element.name())))
    }

    /// The name of an element. It is limited because messages, files of other formats and TOML keys contain it.
    fn name(&self, element: Element) -> Result<String, ModelError> {
        let name = self.text(element, "name")?;
        if name.len() > MAX_NAME || name.chars().any(char::is_control) {
            let expected = format!("expected at most {MAX_NAME} bytes without control characters");
            return Err(self.bad(element, format!("its name has {} bytes, {expected}", name.len())));
        }
        Ok(name.to_owned())
    }

    fn parsed(&self, element: Element, key: &str, text: &str) -> Result<f64, ModelError> {
        text.parse().map_err(|_| {
            let found: String = text.chars().take(40).collect();
            self.bad(element, format!("{key} of <{}> is \"{found}\", expected a number", element.name()))
        })
    }

    fn number(&self, element: Element, key: &str) -> Result<f64, ModelError> {
        self.parsed(element, key, self.text(element, key)?.trim())
    }

    fn number_or(&self, element: Element, key: &str, default: f64) -> Result<f64, ModelError> {
        if element.attribute(key).is_none() { Ok(default) } else { self.number(element, key) }
    }

    /// Three numbers, separated by spaces.
    fn numbers(&self, element: Element, key: &str) -> Result<[f64; 3], ModelError> {
        let text = self.text(element, key)?;
        let mut parts = text.split_whitespace();
        let mut values = [0.0; 3];
        for value in &mut values {
            let Some(part) = parts.next() else { return Err(self.not_three(element, key)) };
            *value = self.parsed(element, key, part)?;
        }
        if parts.next().is_some() { Err(self.not_three(element, key)) } else { Ok(values) }
    }

    fn not_three(&self, element: Element, key: &str) -> ModelError {
        let found = element.attribute(key).map_or(0, |text| text.split_whitespace().count());
        self.bad(element, format!("{key} of <{}> has {found} numbers, expected 3", element.name()))
    }

    /// The pose of the `<origin>` inside an element; the identity if there is none.
    fn origin(&self, element: Element, quantity: &'static str) -> Result<Pose, ModelError> {
        let (mut xyz, mut rpy) = ([0.0; 3], [0.0; 3]);
        if let Some(origin) = element.child("origin") {
            if origin.attribute("xyz").is_some() {
                xyz = self.numbers(origin, "xyz")?;
            }
            if origin.attribute("rpy").is_some() {
                rpy = self.numbers(origin, "rpy")?;
            } else if origin.attribute("quat_xyzw").is_some() {
                return Err(self.bad(origin, "quat_xyzw is not supported, expected rpy".to_owned()));
            }
        }
        self.all_finite(quantity, &xyz)?;
        self.all_finite(quantity, &rpy)?;
        Ok(Pose::from_xyz_rpy(xyz, rpy))
    }

    /// `None` for a geometry of unknown kind.
    fn shape(&self, element: Element, geometry: Element) -> Result<Option<Shape>, ModelError> {
        let length = |key, quantity| self.positive(quantity, self.number(geometry, key)?);
        let kind = match geometry.name() {
            "box" => {
                let [x, y, z] = self.numbers(geometry, "size")?.map(|size| self.positive("box size", size));
                ShapeKind::Box { size: [x?, y?, z?] }
            }
            "cylinder" => ShapeKind::Cylinder {
                radius: length("radius", "cylinder radius")?,
                length: length("length", "cylinder length")?,
            },
            "capsule" => ShapeKind::Capsule {
                radius: length("radius", "capsule radius")?,
                length: length("length", "capsule length")?,
            },
            "sphere" => ShapeKind::Sphere { radius: length("radius", "sphere radius")? },
            "mesh" => {
                let scale =
                    if geometry.attribute("scale").is_some() { self.numbers(geometry, "scale")? } else { [1.0; 3] };
                self.all_finite("mesh scale", &scale)?;
                ShapeKind::Mesh { filename: self.text(geometry, "filename")?.to_owned(), scale }
            }
            _ => return Ok(None),
        };
        Ok(Some(Shape { X_LS: self.origin(element, "shape origin")?, kind }))
    }

    fn limits(&self, element: Element, joint: &str, kind: RawKind) -> Result<Limits, ModelError> {
        let (RawKind::Tree(kind @ (JointKind::Revolute | JointKind::Prismatic | JointKind::Continuous)), limit) =
            (kind, element.child("limit"))
        else {
            return Ok(Limits::NONE);
        };
        let Some(limit) = limit else {
            return if kind == JointKind::Continuous {
                Ok(Limits::NONE)
            } else {
                Err(ModelError::MissingLimits { file: self.file.to_owned(), joint: joint.to_owned() })
            };
        };
        let effort = self.limit("effort limit", self.number(limit, "effort")?)?;
        let velocity = self.limit("velocity limit", self.number(limit, "velocity")?)?;
        if kind == JointKind::Continuous {
            return Ok(Limits { effort, velocity, ..Limits::NONE });
        }
        let (lower, upper) = (self.number_or(limit, "lower", 0.0)?, self.number_or(limit, "upper", 0.0)?);
        if lower <= upper {
            return Ok(Limits { lower, upper, effort, velocity });
        }
        Err(self.out_of_range("position range", format!("[{lower}, {upper}]"), "lower <= upper"))
    }

    fn out_of_range(&self, quantity: &'static str, found: String, expected: &'static str) -> ModelError {
        ModelError::BadNumber { file: self.file.to_owned(), element: self.element.clone(), quantity, found, expected }
    }

    fn all_finite(&self, quantity: &'static str, values: &[f64]) -> Result<(), ModelError> {
        match values.iter().find(|value| !value.is_finite() || value.abs() > MAX_NUMBER) {
            Some(value) => {
                Err(self.out_of_range(quantity, value.to_string(), "a finite number with a magnitude of at most 1e9"))
            }
            None => Ok(()),
        }
    }

    fn not_negative(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if (0.0..=MAX_NUMBER).contains(&value) {
            Ok(value)
        } else {
            Err(self.out_of_range(quantity, value.to_string(), "a finite number >= 0 and at most 1e9"))
        }
    }

    fn positive(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value > 0.0 && value <= MAX_NUMBER {
            Ok(value)
        } else {
            Err(self.out_of_range(quantity, value.to_string(), "a finite number > 0 and at most 1e9"))
        }
    }

    /// Infinity is allowed: no limit.
    fn limit(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value >= 0.0 { Ok(value) } else { Err(self.out_of_range(quantity, value.to_string(), "a number >= 0")) }
    }

    fn unit_axis(&self, axis: [f64; 3]) -> Result<Vector3<f64>, ModelError> {
        self.all_finite("axis", &axis)?;
        let norm = (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt();
        // Below this length the squares underflow.
        if norm < 1e-100 {
            return Err(self.out_of_range("axis", format!("{axis:?}"), "a vector with a direction"));
        }
        Ok(Vector3::new(axis[0] / norm, axis[1] / norm, axis[2] / norm))
    }
}
