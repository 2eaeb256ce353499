//! Objects beside the robot, and welds, as MJCF.

use super::place;
use crate::scenario::{Object, ObjectShape, Weld};
use robot_model::math::quaternion;
use robot_model::{Pose, xml_escaped};
use std::fmt::Write;

/// Name of the body and of the geom of an object.
pub(crate) fn object_name(object: &str) -> String {
    format!("object {object}")
}

/// Name of a weld.
///
/// - `number`: its place in the scenario.
pub(crate) fn weld_name(number: usize) -> String {
    format!("weld {number}")
}

/// The bodies of the objects. Their friction replaces that of the other geom of a contact (`priority`); of two objects the larger one counts.
///
/// - `conaffinity`: bits of the geoms that collide with them.
pub(super) fn bodies(objects: &[Object], conaffinity: u32) -> String {
    let mut text = String::new();
    for Object { name, shape, mass, friction, X_WO } in objects {
        let name = xml_escaped(&object_name(name));
        let form = match shape {
            ObjectShape::Box([x, y, z]) => format!("type=\"box\" size=\"{} {} {}\"", x / 2.0, y / 2.0, z / 2.0),
            ObjectShape::Cylinder { radius, length } => format!("type=\"cylinder\" size=\"{radius} {}\"", length / 2.0),
        };
        let contact = format!("priority=\"1\" friction=\"{friction} 0.005 0.0001\" rgba=\"0.75 0.55 0.30 1\"");
        let (joint, kind) = match mass {
            Some(mass) => ("<freejoint/>", format!("mass=\"{mass}\" contype=\"1\" conaffinity=\"{conaffinity}\"")),
            None => ("", format!("contype=\"0\" conaffinity=\"{conaffinity}\"")),
        };
        let place = place(X_WO);
        writeln!(
            text,
            "    <body name=\"{name}\" {place}>{joint}<geom name=\"{name}\" {form} {kind} {contact}/></body>"
        )
        .expect("writing to a String never fails");
    }
    text
}

/// The constraints of the welds, which are inactive at the start.
///
/// - `body_of_link`: name of the body of a link, and the pose of the link in it.
pub(super) fn welds(welds: &[Weld], body_of_link: &dyn Fn(&str) -> Option<(String, Pose)>) -> String {
    let mut text = String::new();
    for (number, Weld { link, object, X_LO, .. }) in welds.iter().enumerate() {
        let Some((body, X_BL)) = body_of_link(link) else { continue };
        let X_BO = X_BL.then(X_LO);
        let [w, x, y, z] = quaternion::from_rotation(&X_BO.R);
        let p = X_BO.p;
        writeln!(
            text,
            "    <weld name=\"{}\" body1=\"{}\" body2=\"{}\" relpose=\"{} {} {} {w} {x} {y} {z}\" active=\"false\" solref=\"0.005 1\"/>",
            weld_name(number),
            xml_escaped(&body),
            xml_escaped(&object_name(object)),
            p.x,
            p.y,
            p.z,
        )
        .expect("writing to a String never fails");
    }
    if text.is_empty() { text } else { format!("  <equality>\n{text}  </equality>\n") }
}
