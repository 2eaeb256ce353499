//! Links and joints of a robot as its log describes them: enough to name joints, weigh the robot and draw it as sticks.
//!
//! A URDF is read for what these need, element by element; whatever else stands in it is passed over.

use crate::math::{Mat3, Vec3, add, mul, rotate, rotation_about, rotation_of_rpy};

/// A robot as sticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    /// Joints in the order of the file, fixed ones included.
    pub joints: Vec<Joint>,
    /// Sum of the masses of all links, kg.
    pub mass_kg: f64,
}

/// A joint and where it stands in its parent link.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// What the file calls its type: `revolute`, `continuous`, `prismatic`, `fixed`, …
    pub kind: String,
    /// Link that carries it.
    pub parent: String,
    /// Link that it carries.
    pub child: String,
    /// Origin in the parent link, m.
    pub xyz: Vec3,
    /// Orientation in the parent link, rad.
    pub rpy: Vec3,
    /// Axis in its own frame.
    pub axis: Vec3,
    /// Largest torque (N m) or force (N), where the file says.
    pub effort: Option<f64>,
}

impl Joint {
    fn movable(&self) -> bool {
        matches!(self.kind.as_str(), "revolute" | "continuous" | "prismatic")
    }
}

impl Skeleton {
    /// Reads a URDF; `None` if no joint is found in it.
    pub fn parse(urdf: &str) -> Option<Self> {
        let mut joints: Vec<Joint> = Vec::new();
        let (mut mass_kg, mut inside_joint) = (0.0, false);
        for tag in tags(urdf) {
            let (name, rest) = tag.split_once(|c: char| c.is_whitespace() || c == '/').unwrap_or((tag, ""));
            let text = |key: &str| attribute(rest, key).unwrap_or_default().to_owned();
            match (name, inside_joint.then(|| joints.last_mut()).flatten()) {
                // A transmission names joints without a type: it says nothing of where they are.
                ("joint", _) if attribute(rest, "type").is_some() => {
                    let (name, kind) = (text("name"), text("type"));
                    let (parent, child) = (String::new(), String::new());
                    joints.push(Joint {
                        name,
                        kind,
                        parent,
                        child,
                        xyz: [0.0; 3],
                        rpy: [0.0; 3],
                        axis: [1.0, 0.0, 0.0],
                        effort: None,
                    });
                    inside_joint = !tag.ends_with('/');
                }
                // The end tag: its name begins with the slash that the split took.
                ("", _) if tag.starts_with("/joint") => inside_joint = false,
                ("mass", None) => mass_kg += text("value").trim().parse().unwrap_or(0.0),
                ("parent", Some(joint)) => joint.parent = text("link"),
                ("child", Some(joint)) => joint.child = text("link"),
                ("origin", Some(joint)) => {
                    joint.xyz = three(&text("xyz")).unwrap_or(joint.xyz);
                    joint.rpy = three(&text("rpy")).unwrap_or(joint.rpy);
                }
                ("axis", Some(joint)) => joint.axis = three(&text("xyz")).unwrap_or(joint.axis),
                ("limit", Some(joint)) => joint.effort = text("effort").trim().parse().ok().filter(|&e| e > 0.0),
                _ => {}
            }
        }
        (!joints.is_empty()).then_some(Self { joints, mass_kg })
    }

    /// Joints that move, in the order of the file: those of every message.
    pub fn movable(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().filter(|joint| joint.movable())
    }

    /// Sticks from each joint to those that hang on its link, in the frame of the base, m, for positions of the movable joints.
    /// Those on the base link itself start at its origin.
    pub fn sticks(&self, q: &[f64]) -> Vec<(Vec3, Vec3)> {
        let mut positions = q.iter();
        let q_of: Vec<f64> = self
            .joints
            .iter()
            .map(|joint| if joint.movable() { positions.next().copied().unwrap_or(0.0) } else { 0.0 })
            .collect();
        let is_child = |link: &str| self.joints.iter().any(|joint| joint.child == link);
        let roots: Vec<&str> = self.joints.iter().map(|j| j.parent.as_str()).filter(|link| !is_child(link)).collect();
        let mut sticks = Vec::new();
        let Some(&root) = roots.first() else { return sticks };
        // Depth first from the root; a chain can be no longer than the list of joints, so a circle in a broken file ends.
        let identity = rotation_of_rpy([0.0; 3]);
        let mut open: Vec<(&str, Vec3, Mat3, usize)> = vec![(root, [0.0; 3], identity, 0)];
        while let Some((link, p, r, depth)) = open.pop() {
            for (joint, &q) in self.joints.iter().zip(&q_of).filter(|(joint, _)| joint.parent == link) {
                let place = add(p, rotate(&r, joint.xyz));
                let frame = mul(&r, &rotation_of_rpy(joint.rpy));
                sticks.push((p, place));
                let (place, frame) = match joint.kind.as_str() {
                    "prismatic" => (add(place, rotate(&frame, joint.axis.map(|x| x * q))), frame),
                    _ => (place, mul(&frame, &rotation_about(joint.axis, q))),
                };
                if depth < self.joints.len() {
                    open.push((&joint.child, place, frame, depth + 1));
                }
            }
        }
        sticks
    }
}

/// What stands between `<` and `>`, comments and declarations apart.
fn tags(xml: &str) -> impl Iterator<Item = &str> {
    let mut rest = xml;
    std::iter::from_fn(move || {
        loop {
            rest = &rest[rest.find('<')? + 1..];
            if let Some(comment) = rest.strip_prefix("!--") {
                rest = &comment[comment.find("-->")? + 3..];
                continue;
            }
            let end = rest.find('>')?;
            let tag = &rest[..end];
            rest = &rest[end + 1..];
            if !tag.starts_with(['?', '!']) {
                return Some(tag);
            }
        }
    })
}

/// Value of an attribute, in either kind of quotes.
fn attribute<'a>(tag: &'a str, key: &str) -> Option<&'a str> {
    let mut rest = tag;
    loop {
        let (name, after) = rest.split_once('=')?;
        let after = after.trim_start();
        let quote = after.chars().next().filter(|c| matches!(c, '"' | '\''))?;
        let (value, tail) = after[1..].split_once(quote)?;
        if name.trim().trim_start_matches('/').trim() == key {
            return Some(value);
        }
        rest = tail;
    }
}

fn three(text: &str) -> Option<Vec3> {
    let numbers: Vec<f64> = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEG: &str = r#"<?xml version="1.0"?><!-- <joint name="not" type="this"> --><robot name="r">
        <link name="base"><inertial><mass value="2.5"/></inertial></link>
        <joint name='hip' type='revolute'><origin xyz="0 0.2 0" rpy="0 0 0"/><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/></joint>
        <link name="thigh"><inertial><mass value='1.5'/></inertial></link>
        <joint name="foot" type="fixed"><origin xyz="0 0 -0.4"/><parent link="thigh"/><child link="toe"/></joint>
        <transmission><joint name="hip"/></transmission></robot>"#;

    #[test]
    fn joints_and_mass_are_read() {
        let skeleton = Skeleton::parse(LEG).unwrap();
        assert_eq!(skeleton.mass_kg, 4.0);
        assert_eq!(skeleton.joints.iter().map(|j| j.name.as_str()).collect::<Vec<_>>(), ["hip", "foot"]);
        assert_eq!(skeleton.movable().count(), 1);
        assert_eq!(Skeleton::parse("no robot < here"), None);
    }

    /// A thigh of 0.4 m that hangs down swings backward by a quarter turn about +y.
    #[test]
    fn a_quarter_turn_lifts_the_foot() {
        let sticks = Skeleton::parse(LEG).unwrap().sticks(&[std::f64::consts::FRAC_PI_2]);
        let (hip, foot) = sticks[1];
        assert_eq!(hip, [0.0, 0.2, 0.0]);
        for (found, expected) in foot.into_iter().zip([-0.4, 0.2, 0.0]) {
            assert!((found - expected).abs() < 1e-15, "{foot:?}");
        }
    }
}
