//! Writes the simulator's model of a robot on its ground as MJCF text, from [`UrdfTree`].
//!
//! MuJoCo's own URDF import is not used: it welds the root to the world and loses its mass, rejects helper links without mass, and
//! creates no actuators. In the text written here, links connected by fixed joints are one body with the sum of their inertias
//! ([`LinkGroups`]), a free joint carries the root of a robot without a fixed base, contacts have the shapes of the description ([`contact`]), and each
//! joint has a motor limited to its effort. The bodies of a robot collide with the ground, so that a fallen robot lies on it, and with objects, but not
//! with each other. Meshes are not read: a body that has only meshes receives a shape from joint to joint ([`robot_model::with_shapes`]).

mod bodies;
pub(crate) mod contact;
pub(crate) mod object;

use crate::scenario::{Object, Weld};
use crate::terrain::{HEIGHT_QUANTUM, HeightField, Terrain};
use bodies::{Bodies, Body};
use contact::{contact_of_link, contact_shape};
use robot_model::{
    Base, Joint, JointKind, LinkGroups, Pose, RobotDescription, Shape, ShapeKind, UrdfTree, xml_escaped,
};
use std::fmt::Write;

/// Control period, s.
pub const TIME_STEP_S: f64 = 0.001;

/// End of the height field's element; the heights are inserted before it.
const END_OF_FIELD: &str = "/></asset>";

/// The model as text, and the mapping of links to bodies.
#[derive(Clone, Debug)]
pub(crate) struct Mjcf {
    /// MJCF, without the heights of the ground.
    pub text: String,
    /// For each link of the tree, the name of its body.
    pub body_of_link: Vec<String>,
    /// For each link of the tree, its pose in its body.
    pub X_BL: Vec<Pose>,
    /// Mass of all links and objects, kg.
    pub total_mass: f64,
}

/// Writes the model. A contact with a bit in `own_floor` stands on a plane of its own, a body named by [`floor_name`].
///
/// - `time_step_s`: physics time step, s.
/// - `own_floor`: for each contact of the robot, the contact bit of its own floor; see [`contact::floor_bits`].
/// - `objects`, `welds`: those of the scenario. The robot has the links of the welds.
pub(crate) fn write(
    tree: &UrdfTree,
    robot: &RobotDescription,
    terrain: &Terrain,
    friction: f64,
    time_step_s: f64,
    own_floor: &[Option<u32>],
    (objects, welds): (&[Object], &[Weld]),
) -> Mjcf {
    let bodies = Bodies::new(tree);
    let contact_of_subtree = contact::of_subtree(tree, robot, &|contact| own_floor[contact].is_some());
    // The chain of a contact with its own floor does not have bit 1, so that it does not collide with the ground.
    let has_both = !objects.is_empty() && own_floor.iter().any(Option::is_some);
    let object_bit = if has_both { contact::OBJECT_BIT } else { 0 };
    let mut writer = Writer {
        tree,
        robot,
        bodies: &bodies,
        friction,
        time_step_s,
        own_floor,
        object_bit,
        contact_of_subtree,
        text: String::new(),
    };
    writer.head(terrain);
    writer.bodies();
    writer.text.push_str(&object::bodies(objects, 1 | object_bit));
    writer.line(2, format_args!("</worldbody>"));
    writer.text.push_str(&object::welds(welds, &|link| {
        let at = tree.links.iter().position(|other| other.name == link)?;
        let LinkGroups { first_links, body_of_link, X_BL } = &bodies.groups;
        Some((body_name(&tree.links[first_links[body_of_link[at]]].name), X_BL[at]))
    }));
    writer.tail();
    let LinkGroups { first_links, body_of_link, X_BL } = &bodies.groups;
    let body_of_link = body_of_link.iter().map(|&body| body_name(&tree.links[first_links[body]].name)).collect();
    let X_BL = X_BL.clone();
    let of_robot: f64 = tree.links.iter().map(|link| link.inertial.mass).sum();
    let total_mass = of_robot + objects.iter().filter_map(|object| object.mass).sum::<f64>();
    Mjcf { text: writer.text, body_of_link, X_BL, total_mass }
}

/// Heights of a field as MuJoCo stores them: row by row from the smallest y, scaled so that the lowest point is 0 and the highest 1.
pub(crate) fn elevation(field: &HeightField) -> impl Iterator<Item = f32> {
    let low = field.min_count();
    let range = f64::from((field.max_count() - low).max(1));
    field.counts.iter().map(move |count| (f64::from(count - low) / range) as f32)
}

/// The text with the heights of the ground. A simulation sets the heights after loading instead, because MuJoCo needs seconds to parse them.
pub(crate) fn with_elevation(text: &str, terrain: &Terrain) -> String {
    let Some(field) = terrain.field() else { return text.to_owned() };
    // In the text, the row with the largest y comes first.
    let rows = field.counts.chunks(field.columns).rev();
    let rows: Vec<String> = rows
        .map(|row| row.iter().map(|count| (count - field.min_count()).to_string()).collect::<Vec<_>>().join(" "))
        .collect();
    text.replacen(END_OF_FIELD, &format!(" elevation=\"\n{}\"{END_OF_FIELD}", rows.join("\n")), 1)
}

/// Name of a link's body: a link may have a name that MuJoCo reserves, such as `world`.
pub(crate) fn body_name(link: &str) -> String {
    format!("link {link}")
}

/// Name of the site of an IMU; its sensors have this name with `_orientation`, `_gyro`, `_accelerometer`.
pub(crate) fn imu_name(imu: &str) -> String {
    format!("imu {imu}")
}

/// Name of the geom of a contact.
pub(crate) fn contact_name(contact: &str) -> String {
    format!("contact {contact}")
}

/// Name of the body of a contact's own floor.
pub(crate) fn floor_name(contact: &str) -> String {
    format!("floor under {contact}")
}

struct Writer<'a> {
    tree: &'a UrdfTree,
    robot: &'a RobotDescription,
    bodies: &'a Bodies,
    friction: f64,
    time_step_s: f64,
    own_floor: &'a [Option<u32>],
    /// Contact bit of objects for the chains of contacts with their own floor, 0 if there are none.
    object_bit: u32,
    /// See [`contact::of_subtree`].
    contact_of_subtree: Vec<Option<usize>>,
    text: String,
}

impl Writer<'_> {
    fn line(&mut self, indent: usize, line: std::fmt::Arguments) {
        writeln!(self.text, "{:indent$}{line}", "").expect("writing to a String never fails");
    }

    /// Writes options and ground. Robot geoms collide with the ground only: their contype matches its conaffinity. MuJoCo uses the
    /// larger friction of two geoms, so both have the same.
    fn head(&mut self, terrain: &Terrain) {
        let Self { robot, friction, time_step_s, .. } = *self;
        self.line(0, format_args!("<mujoco model=\"{}\">", xml_escaped(&robot.name)));
        self.line(2, format_args!("<compiler angle=\"radian\" autolimits=\"false\"/>"));
        self.line(
            2,
            format_args!(
                "<option timestep=\"{time_step_s}\" gravity=\"0 0 -{}\" integrator=\"implicitfast\" solver=\"Newton\" cone=\"elliptic\" \
                 impratio=\"10\" tolerance=\"1e-10\"><flag autoreset=\"disable\"/></option>",
                robot_model::GRAVITY
            ),
        );
        self.line(2, format_args!("<visual><global offwidth=\"1280\" offheight=\"720\"/></visual>"));
        self.line(2, format_args!("<default>"));
        let contact = format!("condim=\"3\" friction=\"{friction} 0.005 0.0001\" solref=\"0.01 1\"");
        self.line(
            4,
            format_args!("<geom contype=\"1\" conaffinity=\"0\" mass=\"0\" {contact} rgba=\"0.30 0.33 0.38 1\"/>"),
        );
        self.line(4, format_args!("<default class=\"visual\"><geom contype=\"0\" group=\"1\"/></default>"));
        self.line(
            4,
            format_args!(
                "<default class=\"ground\"><geom contype=\"0\" conaffinity=\"1\" rgba=\"0.62 0.60 0.56 1\"/></default>"
            ),
        );
        self.line(2, format_args!("</default>"));
        self.asset(terrain);
        self.line(2, format_args!("<worldbody>"));
        self.line(
            4,
            format_args!("<light directional=\"true\" pos=\"0 0 5\" dir=\"-0.4 0.3 -1\" castshadow=\"true\"/>"),
        );
        let plane = terrain.plane_height();
        self.line(
            4,
            format_args!("<geom name=\"plane\" class=\"ground\" type=\"plane\" pos=\"0 0 {plane}\" size=\"0 0 1\"/>"),
        );
        for (contact, bit) in robot.contacts.iter().zip(self.own_floor) {
            let Some(bit) = bit else { continue };
            let name = xml_escaped(&floor_name(&contact.name));
            let plane = format!("type=\"plane\" size=\"0 0 1\" conaffinity=\"{bit}\" rgba=\"0 0 0 0\"");
            self.line(4, format_args!("<body name=\"{name}\" mocap=\"true\"><geom class=\"ground\" {plane}/></body>"));
        }
        if let Some(field) = terrain.field() {
            let height = f64::from(field.min_count()) * HEIGHT_QUANTUM;
            self.line(
                4,
                format_args!(
                    "<geom name=\"field\" class=\"ground\" type=\"hfield\" hfield=\"field\" pos=\"0 0 {height}\"/>"
                ),
            );
        }
    }

    fn asset(&mut self, terrain: &Terrain) {
        let Some(field) = terrain.field() else { return };
        let [half_x, half_y] = field.half_size();
        let height = f64::from((field.max_count() - field.min_count()).max(1)) * HEIGHT_QUANTUM;
        let (rows, columns) = (field.rows, field.columns);
        let size = format!("nrow=\"{rows}\" ncol=\"{columns}\" size=\"{half_x} {half_y} {height} 0.5\"");
        self.line(2, format_args!("<asset><hfield name=\"field\" {size}{END_OF_FIELD}"));
    }

    /// Writes all bodies, depth first, without recursion: a chain of joints may be long.
    fn bodies(&mut self) {
        let mut open = Vec::new();
        let mut waiting = vec![(0, 0)];
        while let Some((body, depth)) = waiting.pop() {
            self.close(&mut open, depth);
            self.body(body, 4 + 2 * depth);
            open.push(body);
            waiting.extend(self.bodies.list[body].children.iter().rev().map(|&child| (child, depth + 1)));
        }
        self.close(&mut open, 0);
    }

    /// Closes the elements of open bodies down to a depth.
    fn close(&mut self, open: &mut Vec<usize>, depth: usize) {
        while open.len() > depth {
            open.pop();
            self.line(4 + 2 * open.len(), format_args!("</body>"));
        }
    }

    /// Writes a body, without its children and without the end of its element.
    fn body(&mut self, index: usize, indent: usize) {
        let Bodies { groups, list } = self.bodies;
        let body = &list[index];
        let first_link = &self.tree.links[groups.first_links[index]];
        let joint = first_link.parent_joint.map(|joint| &self.tree.joints[joint]);
        let X_PB = joint.map_or(Pose::identity(), |joint| groups.X_BL[joint.parent].then(&joint.X_PC));
        self.line(
            indent,
            format_args!("<body name=\"{}\" {}>", xml_escaped(&body_name(&first_link.name)), place(&X_PB)),
        );
        match joint {
            None if self.robot.base == Base::Fixed => {}
            None => self.line(indent + 2, format_args!("<freejoint/>")),
            Some(joint) => self.line(indent + 2, format_args!("{}", joint_element(joint))),
        }
        self.inertial(body, indent + 2);
        for &link in &body.links {
            self.link(link, indent + 2);
        }
    }

    fn inertial(&mut self, body: &Body, indent: usize) {
        let (mass, c, I) = body.inertial();
        self.line(
            indent,
            format_args!(
                "<inertial pos=\"{} {} {}\" mass=\"{mass}\" fullinertia=\"{} {} {} {} {} {}\"/>",
                c.x,
                c.y,
                c.z,
                I[(0, 0)],
                I[(1, 1)],
                I[(2, 2)],
                I[(0, 1)],
                I[(0, 2)],
                I[(1, 2)]
            ),
        );
    }

    /// Writes sensors and shapes of a link. A link with a contact has the shape of the contact, whatever shapes the URDF has. A link without collision
    /// shapes collides with its visual shapes.
    fn link(&mut self, index: usize, indent: usize) {
        let link = &self.tree.links[index];
        let X_BL = &self.bodies.groups.X_BL[index];
        let floor = self.floor_of(index).map_or(String::new(), |bit| format!(" contype=\"{}\"", bit | self.object_bit));
        let robot = self.robot;
        for imu in robot.imus.iter().filter(|imu| imu.link == link.name) {
            let name = xml_escaped(&imu_name(&imu.name));
            self.line(indent, format_args!("<site name=\"{name}\" {} size=\"0.01\" group=\"4\"/>", place(X_BL)));
        }
        if let Some(contact) = contact_of_link(robot, &link.name) {
            let name = xml_escaped(&contact_name(&contact.name));
            let (form, X_LS) = contact_shape(&contact.geometry, link);
            let place = place(&X_BL.then(&X_LS));
            self.line(indent, format_args!("<geom name=\"{name}\" {form} {place}{floor} rgba=\"0.10 0.10 0.11 1\"/>"));
            return;
        }
        let geoms = |shapes: &[Shape]| shapes.iter().filter_map(|shape| geom(X_BL, shape)).collect::<Vec<_>>();
        let (collisions, visuals) = (geoms(&link.collisions), geoms(&link.visuals));
        let (collisions, visuals) = match (collisions.is_empty(), collisions == visuals) {
            (true, _) => (visuals, Vec::new()),
            (false, true) => (collisions, Vec::new()),
            (false, false) => (collisions, visuals),
        };
        let hidden = if visuals.is_empty() { "" } else { " group=\"3\"" };
        for geom in collisions {
            self.line(indent, format_args!("<geom {geom}{hidden}{floor}/>"));
        }
        for geom in visuals {
            self.line(indent, format_args!("<geom class=\"visual\" {geom}/>"));
        }
    }

    /// Contact bit of the floor of the contact at the end of a link's chain; the link collides with this floor instead of the ground.
    fn floor_of(&self, link: usize) -> Option<u32> {
        self.own_floor[self.contact_of_subtree[link].filter(|_| self.bodies.groups.body_of_link[link] != 0)?]
    }

    fn tail(&mut self) {
        self.line(2, format_args!("<actuator>"));
        let joints = self.tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
        for (joint, described) in joints.zip(&self.robot.joints) {
            let effort = described.effort.unwrap_or(joint.limits.effort);
            let limit = if effort.is_finite() {
                format!(" ctrllimited=\"true\" ctrlrange=\"-{effort} {effort}\"")
            } else {
                String::new()
            };
            let name = xml_escaped(&joint.name);
            self.line(4, format_args!("<motor name=\"{name}\" joint=\"{name}\"{limit}/>"));
        }
        self.line(2, format_args!("</actuator>"));
        self.line(2, format_args!("<sensor>"));
        for imu in &self.robot.imus {
            let name = xml_escaped(&imu_name(&imu.name));
            self.line(4, format_args!("<framequat name=\"{name}_orientation\" objtype=\"site\" objname=\"{name}\"/>"));
            self.line(4, format_args!("<gyro name=\"{name}_gyro\" site=\"{name}\"/>"));
            self.line(4, format_args!("<accelerometer name=\"{name}_accelerometer\" site=\"{name}\"/>"));
        }
        self.line(2, format_args!("</sensor>"));
        self.line(0, format_args!("</mujoco>"));
    }
}

fn joint_element(joint: &Joint) -> String {
    let kind = if joint.kind == JointKind::Prismatic { "slide" } else { "hinge" };
    let [x, y, z]: [f64; 3] = joint.axis.into();
    let limits = joint.limits;
    let range = if limits.lower.is_finite() && limits.upper.is_finite() {
        format!(" limited=\"true\" range=\"{} {}\"", limits.lower, limits.upper)
    } else {
        String::new()
    };
    format!(
        "<joint name=\"{}\" type=\"{kind}\" axis=\"{x} {y} {z}\"{range} damping=\"{}\" frictionloss=\"{}\"/>",
        xml_escaped(&joint.name),
        joint.damping,
        joint.friction
    )
}

/// Attributes for position and orientation; the orientation is given by the x and y axes, so that nothing is converted.
fn place(X: &Pose) -> String {
    let R = &X.R;
    let axes = [R[(0, 0)], R[(1, 0)], R[(2, 0)], R[(0, 1)], R[(1, 1)], R[(2, 1)]].map(|x| x.to_string()).join(" ");
    format!("pos=\"{} {} {}\" xyaxes=\"{axes}\"", X.p.x, X.p.y, X.p.z)
}

/// Attributes of a primitive shape; `None` for a mesh. A long cylinder becomes the capsule inside it: one contact per end instead
/// of up to four, and no edge that extends beyond a foot.
fn geom(X_BL: &Pose, shape: &Shape) -> Option<String> {
    let form = match shape.kind {
        ShapeKind::Box { size: [x, y, z] } => format!("type=\"box\" size=\"{} {} {}\"", x / 2.0, y / 2.0, z / 2.0),
        ShapeKind::Cylinder { radius, length } if length > 2.0 * radius => {
            format!("type=\"capsule\" size=\"{radius} {}\"", length / 2.0 - radius)
        }
        ShapeKind::Cylinder { radius, length } => format!("type=\"cylinder\" size=\"{radius} {}\"", length / 2.0),
        ShapeKind::Capsule { radius, length } => format!("type=\"capsule\" size=\"{radius} {}\"", length / 2.0),
        ShapeKind::Sphere { radius } => format!("type=\"sphere\" size=\"{radius}\""),
        ShapeKind::Mesh { .. } => return None,
    };
    Some(format!("{form} {}", place(&X_BL.then(&shape.X_LS))))
}
