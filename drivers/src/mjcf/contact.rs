//! Contacts of a robot as shapes of the simulator.
//!
//! A wheel is an ellipsoid: a cylinder on a plane has up to six contacts that jump from step to step, an ellipsoid has one.

use nalgebra::{Matrix3, Vector3};
use robot_model::math::norm;
use robot_model::{Contact, ContactGeometry, Link, Pose, RobotDescription, ShapeKind, UrdfTree};

/// Radius of a contact that is a point, m: MuJoCo needs a size above 0.
const LEAST_RADIUS: f64 = 1e-3;
/// Thickness of a sole, m.
const SOLE_THICKNESS: f64 = 0.02;
/// Half of the width of a wheel without a cylinder in the URDF, as a fraction of its radius.
const WHEEL_WIDTH: f64 = 0.2;

/// Contact bit of objects for the chains of contacts with their own floor. MuJoCo has 31 bits without that of the sign.
pub(super) const OBJECT_BIT: u32 = 1 << 30;
/// Largest number of contacts with their own floor: bit 0 is for all other contacts, the last one for objects.
pub(crate) const MOST_FLOORS: usize = 29;

/// For each contact, the bit that it shares with its own floor; `None` without one.
///
/// # Errors
/// The number of floors, if it exceeds [`MOST_FLOORS`].
pub(crate) fn floor_bits(own_floor: &[bool]) -> Result<Vec<Option<u32>>, usize> {
    let found = own_floor.iter().filter(|own| **own).count();
    if found > MOST_FLOORS {
        return Err(found);
    }
    let mut bits = (0..MOST_FLOORS).map(|floor| 2 << floor);
    Ok(own_floor.iter().map(|own| if *own { bits.next() } else { None }).collect())
}

/// The contact of a link.
pub(crate) fn contact_of_link<'a>(robot: &'a RobotDescription, link: &str) -> Option<&'a Contact> {
    robot.contacts.iter().find(|contact| contact.link == link)
}

/// For each link, the first contact that it or a descendant has, of those that count.
pub(crate) fn of_subtree(
    tree: &UrdfTree,
    robot: &RobotDescription,
    counts: &dyn Fn(usize) -> bool,
) -> Vec<Option<usize>> {
    let of_link =
        |link: &Link| (0..robot.contacts.len()).find(|&at| counts(at) && robot.contacts[at].link == link.name);
    let mut carried: Vec<Option<usize>> = tree.links.iter().map(of_link).collect();
    // Parents come before their children.
    for link in (0..tree.links.len()).rev() {
        if let Some(joint) = tree.links[link].parent_joint {
            let (of_child, parent) = (carried[link], &mut carried[tree.joints[joint].parent]);
            *parent = match (*parent, of_child) {
                (Some(a), Some(b)) => Some(a.min(b)),
                (a, b) => a.or(b),
            };
        }
    }
    carried
}

/// Attributes for type and size of the shape of a contact, and its pose in the link.
pub(super) fn contact_shape(geometry: &ContactGeometry, link: &Link) -> (String, Pose) {
    match geometry {
        ContactGeometry::Point { radius } | ContactGeometry::Hand { radius } => {
            let radius = if *radius > 0.0 { *radius } else { LEAST_RADIUS };
            (format!("type=\"sphere\" size=\"{radius}\""), Pose::identity())
        }
        ContactGeometry::Wheel { radius, axis } => {
            let half = half_width(*radius, link);
            let X_LS = Pose { p: Vector3::zeros(), R: z_along(&Vector3::from(*axis)) };
            (format!("type=\"ellipsoid\" size=\"{radius} {radius} {half}\""), X_LS)
        }
        ContactGeometry::Sole { x, y } => {
            let [half_x, half_y] = [x, y].map(|[low, high]| (high - low) / 2.0);
            let middle = Vector3::new((x[0] + x[1]) / 2.0, (y[0] + y[1]) / 2.0, SOLE_THICKNESS / 2.0);
            let form = format!("type=\"box\" size=\"{half_x} {half_y} {}\"", SOLE_THICKNESS / 2.0);
            (form, Pose { p: middle, R: Matrix3::identity() })
        }
    }
}

/// Half of the width of a wheel, m: that of the cylinder of the link, else a fraction of the radius.
fn half_width(radius: f64, link: &Link) -> f64 {
    let width = link.collisions.iter().chain(&link.visuals).find_map(|shape| match shape.kind {
        ShapeKind::Cylinder { length, .. } => Some(length / 2.0),
        _ => None,
    });
    width.unwrap_or(WHEEL_WIDTH * radius)
}

/// A rotation of which the z axis is a unit vector.
fn z_along(z: &Vector3<f64>) -> Matrix3<f64> {
    let other = if z.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
    let x = other - z * other.dot(z);
    let x = x / norm(&x);
    Matrix3::from_columns(&[x, z.cross(&x), *z])
}

/// A contact in the simulation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactPoint {
    pub geometry: ContactGeometry,
    /// Half of the width of a wheel, m.
    half_width: f64,
}

impl ContactPoint {
    pub fn new(contact: &Contact, tree: &UrdfTree) -> Self {
        let link = tree.links.iter().find(|link| link.name == contact.link);
        let half_width = match (contact.geometry, link) {
            (ContactGeometry::Wheel { radius, .. }, Some(link)) => half_width(radius, link),
            _ => 0.0,
        };
        ContactPoint { geometry: contact.geometry, half_width }
    }

    /// Distance of the lowest point of the contact from the origin of its link along -z of W, m.
    ///
    /// - `R_WL`: orientation of the link.
    pub fn depth(&self, R_WL: &Matrix3<f64>) -> f64 {
        match self.geometry {
            ContactGeometry::Point { radius } | ContactGeometry::Hand { radius } => radius,
            ContactGeometry::Wheel { radius, axis } => {
                let along = (R_WL * Vector3::from(axis)).z;
                (radius * radius * (1.0 - along * along) + self.half_width * self.half_width * along * along).sqrt()
            }
            ContactGeometry::Sole { x, y } => {
                let corner = |x: f64, y: f64| -(R_WL * Vector3::new(x, y, 0.0)).z;
                x.iter().flat_map(|&x| y.map(|y| corner(x, y))).fold(f64::NEG_INFINITY, f64::max)
            }
        }
    }

    /// Whether the robot stands on contacts of this kind.
    pub fn is_foot(&self) -> bool {
        !matches!(self.geometry, ContactGeometry::Hand { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_contacts_with_their_own_floor_take_a_bit() {
        let mut own_floor = vec![false; 40];
        (own_floor[31], own_floor[36]) = (true, true);
        let bits = floor_bits(&own_floor).unwrap();
        assert_eq!((bits[31], bits[36], bits.iter().flatten().count()), (Some(2), Some(4), 2));
        let all = floor_bits(&[true; MOST_FLOORS]).unwrap();
        let union = all.iter().flatten().fold(1 | OBJECT_BIT, |union, bit| union | bit);
        assert_eq!((union, union.count_ones()), (u32::MAX >> 1, 31));
        assert_eq!(floor_bits(&[true; MOST_FLOORS + 1]), Err(30));
    }
}
