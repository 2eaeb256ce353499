//! Objects of a scenario, and the times at which a link holds one.

use crate::checks::{BadKey, Window, check_range};
use controller::params::exact::{array, optional_array};
use robot_model::Pose;
use serde::Deserialize;

/// Largest number of objects, and of welds.
const MOST: usize = 64;

/// A body beside the robot: a thing to push or to carry, or a fixture such as a wall or a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Unique name, which no link of the robot has. A push can name it in place of a link.
    pub name: String,
    /// Shape; lengths in m.
    pub shape: ObjectShape,
    /// Mass, kg; `None` for a fixture, which does not move.
    pub mass: Option<f64>,
    /// Friction coefficient of its contacts, with ground and robot too.
    pub friction: f64,
    /// Pose of its centre in W at the start.
    pub X_WO: Pose,
}

/// Shape of an object; lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectShape {
    /// Box, by its full edge lengths along its x, y and z.
    Box([f64; 3]),
    /// Cylinder along its z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
}

/// A link holds an object for a limited time.
#[derive(Clone, Debug, PartialEq)]
pub struct Weld {
    /// When it holds.
    pub window: Window,
    /// Link of the robot.
    pub link: String,
    /// Name of the object.
    pub object: String,
    /// Pose at which it is held, in the link.
    pub X_LO: Pose,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ShapeName {
    Box,
    Cylinder,
}

/// An `[[object]]` entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectEntry {
    name: String,
    shape: ShapeName,
    #[serde(default, deserialize_with = "optional_array")]
    size_m: Option<[f64; 3]>,
    radius_m: Option<f64>,
    length_m: Option<f64>,
    mass_kg: Option<f64>,
    friction: Option<f64>,
    #[serde(deserialize_with = "array")]
    position_m: [f64; 3],
    #[serde(default, deserialize_with = "array")]
    rpy_rad: [f64; 3],
}

impl ObjectEntry {
    /// Checks an entry.
    ///
    /// - `friction`: that of the scenario.
    /// - `others`: the objects before it.
    pub(super) fn resolve(self, friction: f64, others: &[Object]) -> Result<Object, BadKey> {
        let bad = |key, found: String, expected: &str| BadKey { key, found, expected: expected.to_owned() };
        let is_new = others.iter().all(|other| other.name != self.name);
        let is_text = (1..=64).contains(&self.name.len()) && !self.name.contains(char::is_control);
        if !is_text || !is_new || others.len() >= MOST {
            let expected = "a unique name of 1 to 64 bytes without control characters, and at most 64 objects";
            return Err(bad("name", format!("{:?}", self.name), expected));
        }
        let shape = match (self.shape, self.size_m, self.radius_m, self.length_m) {
            (ShapeName::Box, Some(size), None, None) => {
                check_range("size_m", &size, 0.001..=100.0)?;
                ObjectShape::Box(size)
            }
            (ShapeName::Cylinder, None, Some(radius), Some(length)) => {
                check_range("radius_m", &[radius], 0.001..=100.0)?;
                check_range("length_m", &[length], 0.001..=100.0)?;
                ObjectShape::Cylinder { radius, length }
            }
            _ => {
                return Err(bad(
                    "shape",
                    "other sizes".to_owned(),
                    "size_m for a box, radius_m and length_m for a cylinder",
                ));
            }
        };
        if let Some(mass) = self.mass_kg {
            check_range("mass_kg", &[mass], 0.001..=10_000.0)?;
        }
        let friction = self.friction.unwrap_or(friction);
        check_range("friction", &[friction], 0.01..=5.0)?;
        let X_WO = pose(self.position_m, self.rpy_rad)?;
        Ok(Object { name: self.name, shape, mass: self.mass_kg, friction, X_WO })
    }
}

/// A `[[weld]]` entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WeldEntry {
    t_s: f64,
    duration_s: f64,
    link: String,
    object: String,
    #[serde(deserialize_with = "array")]
    position_m: [f64; 3],
    #[serde(default, deserialize_with = "array")]
    rpy_rad: [f64; 3],
}

impl WeldEntry {
    pub(super) fn resolve(self, objects: &[Object], number: usize) -> Result<Weld, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        check_range("duration_s", &[self.duration_s], 0.0..=36_000.0)?;
        let can_move = objects.iter().any(|object| object.name == self.object && object.mass.is_some());
        if !can_move || number >= MOST {
            let expected = "the name of an [[object]] with mass_kg, and at most 64 welds".to_owned();
            return Err(BadKey { key: "object", found: format!("{:?}", self.object), expected });
        }
        let X_LO = pose(self.position_m, self.rpy_rad)?;
        Ok(Weld { window: Window::new(self.t_s, self.duration_s), link: self.link, object: self.object, X_LO })
    }
}

fn pose(position_m: [f64; 3], rpy_rad: [f64; 3]) -> Result<Pose, BadKey> {
    check_range("position_m", &position_m, -1000.0..=1000.0)?;
    check_range("rpy_rad", &rpy_rad, -6.3..=6.3)?;
    Ok(Pose::from_xyz_rpy(position_m, rpy_rad))
}
