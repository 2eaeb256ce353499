//! The simulator's model of a robot on its ground, as MJCF text, made from what our own URDF reader says.
//!
//! MuJoCo's URDF import welds the root to the world and loses its mass, refuses helper links without mass, and makes no actuators.
//! So the text is written here: links that do not move against each other are one body with their summed inertia, a free
//! joint carries the root, feet are spheres, and one motor a joint is limited to its effort. Trunk and legs touch the ground,
//! so that a fallen robot lies on it, but not each other. No mesh is read.

use crate::DriverError;
use crate::terrain::{HEIGHT_QUANTUM, HeightField, Terrain};
use controller::model::{Joint, JointKind, Pose, Shape, ShapeKind, UrdfTree};
use controller::params::RobotConfig;
use controller::quadruped::leg::Leg;
use nalgebra::{Matrix3, Vector3};
use std::fmt::Write;

/// Physics time step, s.
pub const TIME_STEP_S: f64 = 0.001;

/// Name of the IMU's site; its sensors are this name with `_orientation`, `_gyro`, `_accelerometer`.
pub(crate) const IMU: &str = "imu";

/// A moving body without mass (a helper link) gets so little that nothing else notices, kg and kg m².
const PLACEHOLDER_MASS: f64 = 1e-6;
const PLACEHOLDER_INERTIA: f64 = 1e-9;

/// What the heights are put before.
const END_OF_FIELD: &str = "/></asset>";

/// The text, and where the links went.
#[derive(Clone, Debug)]
pub(crate) struct Mjcf {
    pub text: String,
    /// For each link of the tree: name of the body that carries it.
    pub body_of_link: Vec<String>,
    /// Mass of all bodies, kg: that of the tree.
    pub total_mass: f64,
}

/// Writes the model; the feet with `own_floor` stand on planes of their own, bodies named by [`floor_name`].
///
/// # Errors
/// [`DriverError::Unknown`] for a foot or IMU link that the tree lacks.
pub(crate) fn write(
    tree: &UrdfTree,
    robot: &RobotConfig,
    terrain: &Terrain,
    friction: f64,
    own_floor: [bool; 4],
) -> Result<Mjcf, DriverError> {
    for (key, link) in robot.feet.iter().map(|foot| ("robot.feet", foot)).chain([("robot.imu_link", &robot.imu_link)]) {
        link_index(tree, key, link)?;
    }
    let bodies = Bodies::new(tree);
    let mut writer = Writer { tree, robot, bodies: &bodies, friction, own_floor, text: String::new() };
    writer.head(terrain);
    writer.body(0, 4);
    writer.tail();
    let body_of_link = bodies.of_link.iter().map(|&body| tree.links[bodies.list[body].carrier].name.clone()).collect();
    Ok(Mjcf { text: writer.text, body_of_link, total_mass: tree.links.iter().map(|link| link.inertial.mass).sum() })
}

/// Heights of a field as MuJoCo keeps them: row by row from the smallest y, lowest point 0, highest 1.
pub(crate) fn elevation(field: &HeightField) -> impl Iterator<Item = f32> {
    let low = field.min_count();
    let range = f64::from((field.max_count() - low).max(1));
    field.counts.iter().map(move |count| (f64::from(count - low) / range) as f32)
}

/// The text with the heights of the ground in it. A simulation fills them in afterwards: MuJoCo takes seconds to read them.
pub(crate) fn with_elevation(text: &str, terrain: &Terrain) -> String {
    let Some(field) = terrain.field() else { return text.to_owned() };
    // As text, the row of the largest y comes first.
    let rows = field.counts.chunks(field.columns).rev();
    let rows: Vec<String> = rows
        .map(|row| row.iter().map(|count| (count - field.min_count()).to_string()).collect::<Vec<_>>().join(" "))
        .collect();
    text.replacen(END_OF_FIELD, &format!(" elevation=\"\n{}\"{END_OF_FIELD}", rows.join("\n")), 1)
}

/// Whether a link is `foot` or carries it.
pub(crate) fn carries(tree: &UrdfTree, link: usize, foot: &str) -> bool {
    tree.links[link].name == foot
        || tree.joints.iter().filter(|joint| joint.parent == link).any(|joint| carries(tree, joint.child, foot))
}

/// Name of the body of a foot's own floor; feet LF RF LH RH.
pub(crate) fn floor_name(foot: usize) -> String {
    format!("floor under {}", Leg::ALL[foot].name())
}

/// Kind of contact between a foot and its own floor; 1 is that of everything else.
fn floor_bit(foot: usize) -> u32 {
    2 << foot
}

/// Place of a link in the tree.
pub(crate) fn link_index(tree: &UrdfTree, wanted_by: &str, name: &str) -> Result<usize, DriverError> {
    let names = || tree.links.iter().map(|link| &link.name);
    names().position(|link| link == name).ok_or_else(|| DriverError::Unknown {
        wanted_by: wanted_by.to_owned(),
        what: "link",
        name: name.to_owned(),
        known: names().cloned().collect(),
    })
}

/// Links grouped into bodies.
struct Bodies {
    /// Parents before children; 0 is the root.
    list: Vec<Body>,
    /// Body of each link.
    of_link: Vec<usize>,
    /// Pose of each link in its body.
    X_BL: Vec<Pose>,
}

/// Links that do not move against each other. Its frame is that of its first link, the carrier.
struct Body {
    carrier: usize,
    children: Vec<usize>,
    mass: f64,
    /// First moment, kg m, and inertia about the origin of the body, kg m².
    moment: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Bodies {
    fn new(tree: &UrdfTree) -> Self {
        let mut bodies = Bodies { list: Vec::new(), of_link: Vec::new(), X_BL: Vec::new() };
        for (index, link) in tree.links.iter().enumerate() {
            let joint = link.parent_joint.map(|joint| &tree.joints[joint]);
            let (body, X_BL) = match joint {
                Some(Joint { kind: JointKind::Fixed, parent, X_PC, .. }) => {
                    (bodies.of_link[*parent], bodies.X_BL[*parent].then(X_PC))
                }
                _ => (bodies.begin(index, joint), Pose::identity()),
            };
            bodies.list[body].add(&X_BL.then(&link.inertial.X_LC), link.inertial.mass, &link.inertial.I_C);
            bodies.of_link.push(body);
            bodies.X_BL.push(X_BL);
        }
        bodies
    }

    fn begin(&mut self, carrier: usize, joint: Option<&Joint>) -> usize {
        let body = self.list.len();
        if let Some(joint) = joint {
            self.list[self.of_link[joint.parent]].children.push(body);
        }
        self.list.push(Body {
            carrier,
            children: Vec::new(),
            mass: 0.0,
            moment: Vector3::zeros(),
            inertia: Matrix3::zeros(),
        });
        body
    }
}

impl Body {
    /// Adds a mass whose centre and inertia axes are at `X_BC`.
    fn add(&mut self, X_BC: &Pose, mass: f64, I_C: &Matrix3<f64>) {
        self.mass += mass;
        self.moment += mass * X_BC.p;
        self.inertia += X_BC.R * I_C * X_BC.R.transpose() + steiner(mass, &X_BC.p);
    }
}

/// Inertia about the origin of a point mass at `p`.
fn steiner(mass: f64, p: &Vector3<f64>) -> Matrix3<f64> {
    mass * (Matrix3::identity() * p.dot(p) - p * p.transpose())
}

struct Writer<'a> {
    tree: &'a UrdfTree,
    robot: &'a RobotConfig,
    bodies: &'a Bodies,
    friction: f64,
    own_floor: [bool; 4],
    text: String,
}

impl Writer<'_> {
    fn line(&mut self, indent: usize, line: std::fmt::Arguments) {
        writeln!(self.text, "{:indent$}{line}", "").expect("writing to a String never fails");
    }

    /// Options and ground. A robot geom touches the ground and nothing else: contype of one against conaffinity of the other.
    /// MuJoCo takes the larger friction of two geoms, so both carry the same.
    fn head(&mut self, terrain: &Terrain) {
        let Self { robot, friction, .. } = *self;
        self.line(0, format_args!("<mujoco model=\"{}\">", escape(&robot.name)));
        self.line(2, format_args!("<compiler angle=\"radian\" autolimits=\"false\"/>"));
        self.line(
            2,
            format_args!(
                "<option timestep=\"{TIME_STEP_S}\" gravity=\"0 0 -{}\" integrator=\"implicitfast\" solver=\"Newton\" cone=\"elliptic\" \
                 impratio=\"10\" tolerance=\"1e-10\"><flag autoreset=\"disable\"/></option>",
                controller::model::GRAVITY
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
        let own_floor = self.own_floor;
        for foot in (0..4).filter(|&foot| own_floor[foot]) {
            let (name, bit) = (floor_name(foot), floor_bit(foot));
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

    fn body(&mut self, index: usize, indent: usize) {
        let Bodies { list, of_link, X_BL } = self.bodies;
        let body = &list[index];
        let carrier = &self.tree.links[body.carrier];
        let joint = carrier.parent_joint.map(|joint| &self.tree.joints[joint]);
        let X_PB = joint.map_or(Pose::identity(), |joint| X_BL[joint.parent].then(&joint.X_PC));
        self.line(indent, format_args!("<body name=\"{}\" {}>", escape(&carrier.name), place(&X_PB)));
        match joint {
            None => self.line(indent + 2, format_args!("<freejoint/>")),
            Some(joint) => self.line(indent + 2, format_args!("{}", joint_element(joint))),
        }
        self.inertial(body, indent + 2);
        for (link, _) in of_link.iter().enumerate().filter(|(_, body)| **body == index) {
            self.link(link, indent + 2);
        }
        for &child in &body.children {
            self.body(child, indent + 2);
        }
        self.line(indent, format_args!("</body>"));
    }

    fn inertial(&mut self, body: &Body, indent: usize) {
        let (mass, c, I) = if body.mass > PLACEHOLDER_MASS {
            let c = body.moment / body.mass;
            (body.mass, c, body.inertia - steiner(body.mass, &c))
        } else {
            (PLACEHOLDER_MASS, Vector3::zeros(), Matrix3::identity() * PLACEHOLDER_INERTIA)
        };
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

    /// Shapes of a link. A foot is its sphere, whatever the URDF draws; a link without collision shapes collides as it looks.
    fn link(&mut self, index: usize, indent: usize) {
        let link = &self.tree.links[index];
        let X_BL = &self.bodies.X_BL[index];
        let floor = self.floor_of(index).map_or(String::new(), |foot| format!(" contype=\"{}\"", floor_bit(foot)));
        if link.name == self.robot.imu_link {
            self.line(indent, format_args!("<site name=\"{IMU}\" {} size=\"0.01\" group=\"4\"/>", place(X_BL)));
        }
        if self.robot.feet.contains(&link.name) {
            let radius = self.robot.foot_radius;
            let name = escape(&link.name);
            self.line(
                indent,
                format_args!(
                    "<geom name=\"{name}\" type=\"sphere\" {} size=\"{radius}\"{floor} rgba=\"0.10 0.10 0.11 1\"/>",
                    place(X_BL)
                ),
            );
            return;
        }
        let geoms = |shapes: &[Shape]| shapes.iter().filter_map(|shape| geom(X_BL, shape)).collect::<Vec<_>>();
        let (felt, seen) = (geoms(&link.collisions), geoms(&link.visuals));
        let (felt, seen) = match (felt.is_empty(), felt == seen) {
            (true, _) => (seen, Vec::new()),
            (false, true) => (felt, Vec::new()),
            (false, false) => (felt, seen),
        };
        let hidden = if seen.is_empty() { "" } else { " group=\"3\"" };
        for geom in felt {
            self.line(indent, format_args!("<geom {geom}{hidden}{floor}/>"));
        }
        for geom in seen {
            self.line(indent, format_args!("<geom class=\"visual\" {geom}/>"));
        }
    }

    /// Foot whose own floor a link touches instead of the ground: that of its leg.
    fn floor_of(&self, link: usize) -> Option<usize> {
        let of_leg = |&foot: &usize| self.own_floor[foot] && carries(self.tree, link, &self.robot.feet[foot]);
        (0..4).filter(|_| self.bodies.of_link[link] != 0).find(of_leg)
    }

    fn tail(&mut self) {
        self.line(2, format_args!("</worldbody>"));
        self.line(2, format_args!("<actuator>"));
        for joint in self.tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed) {
            let effort = joint.limits.effort;
            let limit = if effort.is_finite() {
                format!(" ctrllimited=\"true\" ctrlrange=\"-{effort} {effort}\"")
            } else {
                String::new()
            };
            let name = escape(&joint.name);
            self.line(4, format_args!("<motor name=\"{name}\" joint=\"{name}\"{limit}/>"));
        }
        self.line(2, format_args!("</actuator>"));
        self.line(2, format_args!("<sensor>"));
        self.line(4, format_args!("<framequat name=\"{IMU}_orientation\" objtype=\"site\" objname=\"{IMU}\"/>"));
        self.line(4, format_args!("<gyro name=\"{IMU}_gyro\" site=\"{IMU}\"/>"));
        self.line(4, format_args!("<accelerometer name=\"{IMU}_accelerometer\" site=\"{IMU}\"/>"));
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
        escape(&joint.name),
        joint.damping,
        joint.friction
    )
}

/// Position and orientation attributes: the axes x and y of the frame, which need no conversion.
fn place(X: &Pose) -> String {
    let R = &X.R;
    let axes = [R[(0, 0)], R[(1, 0)], R[(2, 0)], R[(0, 1)], R[(1, 1)], R[(2, 1)]].map(|x| x.to_string()).join(" ");
    format!("pos=\"{} {} {}\" xyaxes=\"{axes}\"", X.p.x, X.p.y, X.p.z)
}

/// Attributes of a primitive, none for a mesh. A long cylinder becomes the capsule inside it: one clean contact an end
/// instead of up to four, and no edge that reaches beyond a foot.
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

fn escape(name: &str) -> String {
    name.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;")
}
