//! Reads numbers, names, poses, shapes and limits of one element of a URDF. Errors name the file, the element and the line.

use nalgebra::Vector3;

use super::error::ModelError;
use super::math::quaternion;
use super::names::MAX_NAME;
use super::pose::Pose;
use super::tree::{JointKind, Limits, Shape, ShapeKind};
use super::xml::Element;

/// Largest magnitude of a length, mass, inertia or limit, in SI units: products of a few of them stay far from infinity.
const MAX_NUMBER: f64 = 1e9;
/// Length below which a vector has no direction: the squares of its components underflow.
const LEAST_NORM: f64 = 1e-100;

/// A URDF.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    /// Name of the file.
    pub(super) file: &'a str,
    /// Whether an orientation may be a quaternion: since version 1.1 of URDF.
    pub(super) quaternions: bool,
}

/// Reads parts of one link or joint; errors name the file, the element and the line.
pub(super) struct Reader<'a> {
    pub(super) source: Source<'a>,
    /// For example `joint "knee"`.
    pub(super) element: String,
}

impl Reader<'_> {
    pub(super) fn new<'a>(what: &str, element: Element, source: Source<'a>) -> Reader<'a> {
        let element = match element.attribute("name") {
            Some(name) => format!("{what} \"{}\"", name.chars().take(MAX_NAME).collect::<String>()),
            None => format!("a {what} without a name"),
        };
        Reader { source, element }
    }

    pub(super) fn bad(&self, at: Element, reason: String) -> ModelError {
        ModelError::BadElement {
            file: self.source.file.to_owned(),
            element: self.element.clone(),
            line: at.line(),
            reason,
        }
    }

    pub(super) fn required<'d>(&self, element: Element<'d>, name: &str) -> Result<Element<'d>, ModelError> {
        element.child(name).ok_or_else(|| self.bad(element, format!("<{}> has no <{name}>", element.name())))
    }

    pub(super) fn text<'d>(&self, element: Element<'d>, key: &str) -> Result<&'d str, ModelError> {
        element.attribute(key).ok_or_else(|| self.bad(element, format!("<{}> has no attribute {key}", element.name())))
    }

    /// The name of an element.
    pub(super) fn name(&self, element: Element) -> Result<String, ModelError> {
        self.name_in(element, "name")
    }

    /// A name in an attribute. It is limited because messages, files of other formats and TOML keys contain it.
    pub(super) fn name_in(&self, element: Element, key: &str) -> Result<String, ModelError> {
        let name = self.text(element, key)?;
        if name.len() > MAX_NAME || name.chars().any(char::is_control) {
            let expected = format!("expected at most {MAX_NAME} bytes without control characters");
            return Err(self.bad(element, format!("its {key} has {} bytes, {expected}", name.len())));
        }
        Ok(name.to_owned())
    }

    pub(super) fn parsed(&self, element: Element, key: &str, text: &str) -> Result<f64, ModelError> {
        text.trim().parse().map_err(|_| {
            let found: String = text.chars().take(40).collect();
            self.bad(element, format!("{key} of <{}> is \"{found}\", expected a number", element.name()))
        })
    }

    pub(super) fn number(&self, element: Element, key: &str) -> Result<f64, ModelError> {
        self.parsed(element, key, self.text(element, key)?)
    }

    pub(super) fn number_or(&self, element: Element, key: &str, default: f64) -> Result<f64, ModelError> {
        if element.attribute(key).is_none() { Ok(default) } else { self.number(element, key) }
    }

    /// Exactly `N` numbers, separated by spaces.
    pub(super) fn numbers<const N: usize>(&self, element: Element, key: &str) -> Result<[f64; N], ModelError> {
        let text = self.text(element, key)?;
        let found = text.split_whitespace().count();
        if found != N {
            return Err(self.bad(element, format!("{key} of <{}> has {found} numbers, expected {N}", element.name())));
        }
        let mut values = [0.0; N];
        for (value, part) in values.iter_mut().zip(text.split_whitespace()) {
            *value = self.parsed(element, key, part)?;
        }
        Ok(values)
    }

    /// The pose of the `<origin>` inside an element; the identity if there is none.
    pub(super) fn origin(&self, element: Element, quantity: &'static str) -> Result<Pose, ModelError> {
        let (mut xyz, mut rpy) = ([0.0; 3], [0.0; 3]);
        if let Some(origin) = element.child("origin") {
            if origin.attribute("xyz").is_some() {
                xyz = self.numbers(origin, "xyz")?;
            }
            if origin.attribute("rpy").is_some() {
                rpy = self.numbers(origin, "rpy")?;
            } else if origin.attribute("quat_xyzw").is_some() {
                if !self.source.quaternions {
                    let reason = "quat_xyzw requires <robot version=\"1.1\"> or later, expected rpy".to_owned();
                    return Err(self.bad(origin, reason));
                }
                let [x, y, z, w] = self.numbers(origin, "quat_xyzw")?;
                self.all_finite(origin, quantity, &[x, y, z, w])?;
                if !(0.5..=2.0).contains(&(w * w + x * x + y * y + z * z)) {
                    let found = format!("{x} {y} {z} {w}");
                    return Err(self.out_of_range(origin, "quat_xyzw", found, "a quaternion of norm 1"));
                }
                self.all_finite(origin, quantity, &xyz)?;
                return Ok(Pose { p: Vector3::from(xyz), R: quaternion::to_rotation([w, x, y, z]) });
            }
            self.all_finite(origin, quantity, &xyz)?;
            self.all_finite(origin, quantity, &rpy)?;
        }
        Ok(Pose::from_xyz_rpy(xyz, rpy))
    }

    /// The shape of a `<visual>` or `<collision>`.
    pub(super) fn shape(&self, element: Element) -> Result<Shape, ModelError> {
        let geometry = self.required(element, "geometry")?;
        let Some(geometry) = geometry.children().next() else {
            return Err(self.bad(geometry, "<geometry> has no shape".to_owned()));
        };
        let length = |key, quantity| self.positive(geometry, quantity, self.number(geometry, key)?);
        let kind = match geometry.name() {
            "box" => {
                let [x, y, z] =
                    self.numbers::<3>(geometry, "size")?.map(|size| self.positive(geometry, "box size", size));
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
                self.all_finite(geometry, "mesh scale", &scale)?;
                ShapeKind::Mesh { filename: self.text(geometry, "filename")?.to_owned(), scale }
            }
            other => {
                let reason = format!("<{other}> is not a shape, expected box, cylinder, capsule, sphere or mesh");
                return Err(self.bad(geometry, reason));
            }
        };
        Ok(Shape { X_LS: self.origin(element, "shape origin")?, kind })
    }

    /// The limits of a movable joint, and its position range if the lower end is above the upper one; the limits then have the two ends exchanged.
    pub(super) fn limits(
        &self,
        element: Element,
        joint: &str,
        kind: JointKind,
    ) -> Result<(Limits, Option<[f64; 2]>), ModelError> {
        let limit = match (kind, element.child("limit")) {
            (JointKind::Fixed, _) | (JointKind::Continuous, None) => return Ok((Limits::NONE, None)),
            (_, Some(limit)) => limit,
            (_, None) => {
                let (file, joint) = (self.source.file.to_owned(), joint.to_owned());
                return Err(ModelError::MissingLimits { file, line: element.line(), joint });
            }
        };
        let effort = self.limit(limit, "effort limit", self.number(limit, "effort")?)?;
        let velocity = self.limit(limit, "velocity limit", self.number(limit, "velocity")?)?;
        if kind == JointKind::Continuous {
            return Ok((Limits { effort, velocity, ..Limits::NONE }, None));
        }
        let (lower, upper) = (self.number_or(limit, "lower", 0.0)?, self.number_or(limit, "upper", 0.0)?);
        if lower.is_nan() || upper.is_nan() {
            let found = format!("[{lower}, {upper}]");
            return Err(self.out_of_range(limit, "position range", found, "two numbers"));
        }
        if lower <= upper {
            return Ok((Limits { lower, upper, effort, velocity }, None));
        }
        Ok((Limits { lower: upper, upper: lower, effort, velocity }, Some([lower, upper])))
    }

    fn out_of_range(&self, at: Element, quantity: &'static str, found: String, expected: &'static str) -> ModelError {
        let (file, element, line) = (self.source.file.to_owned(), self.element.clone(), at.line());
        ModelError::BadNumber { file, line, element, quantity, found, expected }
    }

    pub(super) fn all_finite(&self, at: Element, quantity: &'static str, values: &[f64]) -> Result<(), ModelError> {
        match values.iter().find(|value| !value.is_finite() || value.abs() > MAX_NUMBER) {
            Some(value) => {
                let expected = "a finite number with a magnitude of at most 1e9";
                Err(self.out_of_range(at, quantity, value.to_string(), expected))
            }
            None => Ok(()),
        }
    }

    pub(super) fn not_negative(&self, at: Element, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if (0.0..=MAX_NUMBER).contains(&value) {
            Ok(value)
        } else {
            Err(self.out_of_range(at, quantity, value.to_string(), "a finite number >= 0 and at most 1e9"))
        }
    }

    fn positive(&self, at: Element, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value > 0.0 && value <= MAX_NUMBER {
            Ok(value)
        } else {
            Err(self.out_of_range(at, quantity, value.to_string(), "a finite number > 0 and at most 1e9"))
        }
    }

    /// Infinity is allowed: no limit.
    fn limit(&self, at: Element, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value >= 0.0 { Ok(value) } else { Err(self.out_of_range(at, quantity, value.to_string(), "a number >= 0")) }
    }

    /// The direction of an `<axis>` as a unit vector, and the length that it has in the file.
    pub(super) fn unit_axis(&self, element: Element) -> Result<(Vector3<f64>, f64), ModelError> {
        let axis: [f64; 3] = self.numbers(element, "xyz")?;
        self.all_finite(element, "axis", &axis)?;
        let norm = (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt();
        if norm < LEAST_NORM {
            return Err(self.out_of_range(element, "axis", format!("{axis:?}"), "a vector with a direction"));
        }
        Ok((Vector3::new(axis[0] / norm, axis[1] / norm, axis[2] / norm), norm))
    }
}
