//! Checks the names of an SRDF against the URDF, and leaves out what names something that does not exist.

use super::content::{DisabledCollision, GroupState, Srdf};
use super::error::{SrdfError, SrdfWarning};
use super::groups::groups;
use super::lookup::Lookup;
use super::read::{At, RawSrdf, RawState};
use crate::error::ModelError;
use crate::tree::UrdfTree;
use std::collections::{BTreeMap, BTreeSet};

pub(super) fn resolve(raw: &RawSrdf, file: &str, tree: &UrdfTree) -> Result<Srdf, SrdfError> {
    let mut lookup = Lookup::new(raw, tree);
    if raw.name != tree.name {
        let (srdf, urdf) = (raw.name.clone(), tree.name.clone());
        lookup.warnings.push(SrdfWarning::RobotName { srdf, urdf });
    }
    lookup.warnings.extend(raw.warnings.iter().cloned());
    let groups = groups(&mut lookup, &raw.groups, file)?;
    let states = raw.states.iter().map(|state| read_state(&mut lookup, state, file)).collect::<Result<_, _>>()?;
    let disabled_collisions = disabled(&mut lookup, &raw.disabled);
    let virtual_joints = with_link(&mut lookup, &raw.virtual_joints, |joint| &joint.child_link);
    for At { line, value } in &raw.end_effectors {
        lookup.group(&value.group, *line);
    }
    let end_effectors = with_link(&mut lookup, &raw.end_effectors, |end| &end.parent_link);
    let mut passive = vec![false; tree.joints.len()];
    for At { line, value } in &raw.passive_joints {
        if let Some(joint) = lookup.movable_joint(value, *line) {
            passive[joint] = true;
        }
    }
    let passive = tree.joints.iter().zip(passive).filter(|(_, is_passive)| *is_passive);
    Ok(Srdf {
        name: raw.name.clone(),
        groups,
        states,
        disabled_collisions,
        virtual_joints,
        end_effectors,
        passive_joints: passive.map(|(joint, _)| joint.name.clone()).collect(),
        warnings: lookup.warnings,
    })
}

fn read_state(lookup: &mut Lookup, raw: &At<RawState>, file: &str) -> Result<GroupState, SrdfError> {
    let RawState { name, group, joints: positions } = &raw.value;
    lookup.group(group, raw.line);
    let mut joints = BTreeMap::new();
    for At { line, value } in positions {
        let joint = &value.joint;
        let bad = |reason: String| {
            let (file, element) = (file.to_owned(), format!("group_state \"{name}\""));
            ModelError::BadElement { file, element, line: *line, reason }
        };
        if value.values.is_empty() {
            return Err(bad(format!("value of joint \"{joint}\" is empty, expected a number")).into());
        }
        if lookup.movable_joint(joint, *line).is_none() {
            continue;
        }
        let &[q] = &value.values[..] else {
            let found = value.values.len();
            return Err(bad(format!("value of joint \"{joint}\" has {found} numbers, expected 1")).into());
        };
        if joints.insert(joint.clone(), q).is_some() {
            return Err(bad(format!("joint \"{joint}\" occurs twice")).into());
        }
    }
    Ok(GroupState { name: name.clone(), group: group.clone(), joints })
}

/// The pairs of links that exist and differ, each once.
fn disabled(lookup: &mut Lookup, raw: &[At<DisabledCollision>]) -> Vec<DisabledCollision> {
    let (mut seen, mut pairs) = (BTreeSet::new(), Vec::with_capacity(raw.len()));
    for At { line, value } in raw {
        let [first, second] = value.links.each_ref().map(|link| lookup.link(link, *line));
        let (Some(first), Some(second)) = (first, second) else { continue };
        if first == second {
            let [link, _] = value.links.clone();
            lookup.warnings.push(SrdfWarning::SameLink { line: *line, link });
        } else if seen.insert([first.min(second), first.max(second)]) {
            pairs.push(value.clone());
        }
    }
    pairs
}

/// The elements whose link exists.
fn with_link<T: Clone>(lookup: &mut Lookup, raw: &[At<T>], link: impl Fn(&T) -> &String) -> Vec<T> {
    let known = raw.iter().filter(|At { line, value }| lookup.link(link(value), *line).is_some());
    known.map(|element| element.value.clone()).collect()
}
