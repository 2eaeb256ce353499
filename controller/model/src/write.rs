//! Writes a tree of links as URDF text.

use std::fmt::Write;

use nalgebra::Matrix3;

use super::pose::Pose;
use super::tree::{Inertial, Joint, JointKind, Link, Shape, ShapeKind, UrdfTree};
use crate::math::atan2;

impl UrdfTree {
    /// The tree as URDF text. Meshes and colours are left out, so that the text refers to no other file.
    ///
    /// - `head`: lines of a comment at the top.
    ///
    /// [`UrdfTree::parse`] reads the same tree back, except for meshes, unused visual shapes and the rounding of angles. The joints keep their order.
    pub fn to_urdf(&self, head: &[String]) -> String {
        let mut text = String::from("<?xml version=\"1.0\"?>\n<!--\n");
        for line in head {
            // Two hyphens would end the comment.
            text += &format!("  {}\n", line.replace("--", "- -"));
        }
        text += &format!("-->\n<robot name=\"{}\">\n", xml_escaped(&self.name));
        for link in &self.links {
            write_link(&mut text, link);
        }
        for joint in &self.joints {
            self.write_joint(&mut text, joint);
        }
        text + "</robot>\n"
    }

    fn write_joint(&self, text: &mut String, joint: &Joint) {
        let Joint { name, kind, parent, child, X_PC, axis, limits, damping, friction } = joint;
        let link = |index: usize| xml_escaped(&self.links[index].name);
        line(text, 2, format_args!("<joint name=\"{}\" type=\"{}\">", xml_escaped(name), kind.name()));
        line(text, 4, format_args!("{}", origin(X_PC)));
        line(text, 4, format_args!("<parent link=\"{}\"/>", link(*parent)));
        line(text, 4, format_args!("<child link=\"{}\"/>", link(*child)));
        if *kind != JointKind::Fixed {
            line(text, 4, format_args!("<axis xyz=\"{} {} {}\"/>", axis.x, axis.y, axis.z));
            let range = match kind {
                JointKind::Continuous => String::new(),
                _ => format!(" lower=\"{}\" upper=\"{}\"", limits.lower, limits.upper),
            };
            let (effort, velocity) = (limits.effort, limits.velocity);
            line(text, 4, format_args!("<limit{range} effort=\"{effort}\" velocity=\"{velocity}\"/>"));
            if *damping != 0.0 || *friction != 0.0 {
                line(text, 4, format_args!("<dynamics damping=\"{damping}\" friction=\"{friction}\"/>"));
            }
        }
        line(text, 2, format_args!("</joint>"));
    }
}

fn write_link(text: &mut String, link: &Link) {
    let Link { name, parent_joint: _, inertial, visuals, collisions } = link;
    line(text, 2, format_args!("<link name=\"{}\">", xml_escaped(name)));
    let Inertial { X_LC, mass, I_C: I } = inertial;
    if *mass != 0.0 || *I != Matrix3::zeros() {
        line(text, 4, format_args!("<inertial>"));
        line(text, 6, format_args!("{}", origin(X_LC)));
        line(text, 6, format_args!("<mass value=\"{mass}\"/>"));
        let [xx, yy, zz] = [I[(0, 0)], I[(1, 1)], I[(2, 2)]];
        let [xy, xz, yz] = [I[(0, 1)], I[(0, 2)], I[(1, 2)]];
        let products = format!("ixy=\"{xy}\" ixz=\"{xz}\" iyz=\"{yz}\"");
        line(text, 6, format_args!("<inertia ixx=\"{xx}\" iyy=\"{yy}\" izz=\"{zz}\" {products}/>"));
        line(text, 4, format_args!("</inertial>"));
    }
    // Without collision shapes, a link collides with its visual ones.
    let primitive = |shape: &&Shape| !matches!(shape.kind, ShapeKind::Mesh { .. });
    let shapes = if collisions.iter().any(|shape| primitive(&shape)) { collisions } else { visuals };
    for Shape { X_LS, kind } in shapes {
        let geometry = match kind {
            ShapeKind::Box { size: [x, y, z] } => format!("<box size=\"{x} {y} {z}\"/>"),
            ShapeKind::Cylinder { radius, length } => format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>"),
            ShapeKind::Capsule { radius, length } => format!("<capsule radius=\"{radius}\" length=\"{length}\"/>"),
            ShapeKind::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
            ShapeKind::Mesh { .. } => continue,
        };
        line(text, 4, format_args!("<collision>"));
        line(text, 6, format_args!("{}", origin(X_LS)));
        line(text, 6, format_args!("<geometry>{geometry}</geometry>"));
        line(text, 4, format_args!("</collision>"));
    }
    line(text, 2, format_args!("</link>"));
}

fn line(text: &mut String, indent: usize, line: std::fmt::Arguments) {
    writeln!(text, "{:indent$}{line}", "").expect("writing to a String never fails");
}

/// An `<origin>`, with `R = Rz(yaw) Ry(pitch) Rx(roll)`.
fn origin(X: &Pose) -> String {
    let R = &X.R;
    // Without atan2 of both, a pitch near a right angle would be inaccurate.
    let pitch = atan2(-R[(2, 0)], (R[(0, 0)] * R[(0, 0)] + R[(1, 0)] * R[(1, 0)]).sqrt());
    let [roll, yaw] = if R[(0, 0)].abs() + R[(1, 0)].abs() < 1e-9 {
        // Only the sum or difference of roll and yaw is defined.
        [0.0, atan2(-R[(0, 1)], R[(1, 1)])]
    } else {
        [atan2(R[(2, 1)], R[(2, 2)]), atan2(R[(1, 0)], R[(0, 0)])]
    };
    format!("<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>", X.p.x, X.p.y, X.p.z)
}

/// Escapes the characters of a text that end or break an attribute value in double quotes.
pub fn xml_escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;")
}
