//! Reads the elements of an SRDF. Unknown elements and attributes are ignored.

use super::content::{DisabledCollision, EndEffector, VirtualJoint, VirtualKind};
use super::error::{SrdfError, SrdfWarning};
use crate::error::ModelError;
use crate::fields::{Reader, Source};
use crate::xml::{Document, Element};

/// Largest number of groups.
const MAX_GROUPS: usize = 200;
/// Largest number of elements inside all groups.
const MAX_MEMBERS: usize = 10_000;
/// Elements beside `<disable_collisions>` that change which collisions are checked.
const OTHER_COLLISIONS: [&str; 3] = ["disable_default_collisions", "enable_collisions", "disable_collision"];

/// Something with the line of its element, from 1.
pub(super) struct At<T> {
    pub(super) line: usize,
    pub(super) value: T,
}

/// An element inside a `<group>`.
pub(super) enum Member {
    Joint(String),
    Link(String),
    Chain { base: String, tip: String },
    Group(String),
}

/// A `<group>`.
pub(super) struct RawGroup {
    pub(super) name: String,
    pub(super) members: Vec<At<Member>>,
}

/// A `<group_state>`.
pub(super) struct RawState {
    pub(super) name: String,
    /// Empty if the file gives none.
    pub(super) group: String,
    pub(super) joints: Vec<At<RawPosition>>,
}

/// A `<joint>` of a `<group_state>`.
pub(super) struct RawPosition {
    pub(super) joint: String,
    /// Its numbers, finite; several for the joint between the world and the base.
    pub(super) values: Vec<f64>,
}

/// An SRDF before its names are checked.
pub(super) struct RawSrdf {
    pub(super) name: String,
    pub(super) groups: Vec<At<RawGroup>>,
    pub(super) states: Vec<At<RawState>>,
    pub(super) disabled: Vec<At<DisabledCollision>>,
    pub(super) virtual_joints: Vec<At<VirtualJoint>>,
    pub(super) end_effectors: Vec<At<EndEffector>>,
    pub(super) passive_joints: Vec<At<String>>,
    pub(super) warnings: Vec<SrdfWarning>,
}

/// Reads a text; `file` is used in messages only.
pub(super) fn read(text: &str, file: &str) -> Result<RawSrdf, SrdfError> {
    let not_srdf = |line: usize, reason: String| SrdfError::NotSrdf { file: file.to_owned(), line, reason };
    let document = Document::parse(text).map_err(|error| not_srdf(error.line, error.reason))?;
    let root = document.root();
    if root.name() != "robot" {
        return Err(not_srdf(root.line(), format!("the outermost element is <{}>, expected <robot>", root.name())));
    }
    let source = Source { file, quaternions: false };
    let mut srdf = RawSrdf {
        name: Reader { source, element: "the robot".to_owned() }.name(root)?,
        groups: Vec::new(),
        states: Vec::new(),
        disabled: Vec::new(),
        virtual_joints: Vec::new(),
        end_effectors: Vec::new(),
        passive_joints: Vec::new(),
        warnings: Vec::new(),
    };
    let mut members = 0;
    for element in root.children() {
        let (name, line) = (element.name(), element.line());
        let reader = match element.attribute("name") {
            Some(_) => Reader::new(name, element, source),
            None => Reader { source, element: format!("<{name}>") },
        };
        match name {
            "group" => {
                let group = read_group(&reader, element)?;
                members += group.members.len();
                srdf.groups.push(At { line, value: group });
            }
            "group_state" => srdf.states.push(At { line, value: read_state(&reader, element)? }),
            "disable_collisions" => {
                let links = [reader.name_in(element, "link1")?, reader.name_in(element, "link2")?];
                let reason = optional(&reader, element, "reason")?;
                srdf.disabled.push(At { line, value: DisabledCollision { links, reason } });
            }
            "virtual_joint" => srdf.virtual_joints.push(At { line, value: read_virtual_joint(&reader, element)? }),
            "end_effector" => {
                let (name, parent_link) = (reader.name(element)?, reader.name_in(element, "parent_link")?);
                let group = optional(&reader, element, "group")?;
                srdf.end_effectors.push(At { line, value: EndEffector { name, parent_link, group } });
            }
            "passive_joint" => srdf.passive_joints.push(At { line, value: reader.name(element)? }),
            _ if OTHER_COLLISIONS.contains(&name) => not_read(&mut srdf.warnings, name, line),
            _ => {}
        }
        for (what, found, limit) in
            [("groups", srdf.groups.len(), MAX_GROUPS), ("elements inside groups", members, MAX_MEMBERS)]
        {
            if found > limit {
                return Err(not_srdf(line, format!("more than {limit} {what}")));
            }
        }
    }
    Ok(srdf)
}

fn read_group(reader: &Reader, element: Element) -> Result<RawGroup, ModelError> {
    let mut members = Vec::new();
    for child in element.children() {
        let value = match child.name() {
            "joint" => Member::Joint(reader.name(child)?),
            "link" => Member::Link(reader.name(child)?),
            "group" => Member::Group(reader.name(child)?),
            "chain" => {
                Member::Chain { base: reader.name_in(child, "base_link")?, tip: reader.name_in(child, "tip_link")? }
            }
            _ => continue,
        };
        members.push(At { line: child.line(), value });
    }
    Ok(RawGroup { name: reader.name(element)?, members })
}

fn read_state(reader: &Reader, element: Element) -> Result<RawState, ModelError> {
    let mut joints = Vec::new();
    for child in element.children().filter(|child| child.name() == "joint") {
        let numbers = reader.text(child, "value")?.split_whitespace();
        let values = numbers.map(|number| reader.parsed(child, "value", number)).collect::<Result<Vec<f64>, _>>()?;
        reader.all_finite(child, "value", &values)?;
        joints.push(At { line: child.line(), value: RawPosition { joint: reader.name(child)?, values } });
    }
    Ok(RawState { name: reader.name(element)?, group: optional(reader, element, "group")?, joints })
}

fn read_virtual_joint(reader: &Reader, element: Element) -> Result<VirtualJoint, ModelError> {
    let kind = match reader.text(element, "type")? {
        "fixed" => VirtualKind::Fixed,
        "planar" => VirtualKind::Planar,
        "floating" => VirtualKind::Floating,
        found => return Err(reader.bad(element, format!("type is \"{found}\", expected fixed, planar or floating"))),
    };
    Ok(VirtualJoint { name: reader.name(element)?, kind, child_link: reader.name_in(element, "child_link")? })
}

/// An attribute of names; empty if there is none.
fn optional(reader: &Reader, element: Element, key: &str) -> Result<String, ModelError> {
    if element.attribute(key).is_none() { Ok(String::new()) } else { reader.name_in(element, key) }
}

/// One warning for all elements of a name.
fn not_read(warnings: &mut Vec<SrdfWarning>, name: &str, line: usize) {
    let is_same = |warning: &SrdfWarning| matches!(warning, SrdfWarning::NotRead { element, .. } if element == name);
    if !warnings.iter().any(is_same) {
        warnings.push(SrdfWarning::NotRead { line, element: name.to_owned() });
    }
}
