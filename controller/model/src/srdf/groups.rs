//! The joints of each group of an SRDF.

use super::content::SrdfGroup;
use super::error::{LISTED, SrdfError, SrdfWarning};
use super::lookup::Lookup;
use super::read::{At, Member, RawGroup};
use std::collections::BTreeSet;

/// Which joints of a URDF a group has; index as in [`UrdfTree::joints`](crate::UrdfTree::joints).
type Joints = Vec<bool>;

/// The groups with at least one movable joint.
pub(super) fn groups(lookup: &mut Lookup, raw: &[At<RawGroup>], file: &str) -> Result<Vec<SrdfGroup>, SrdfError> {
    let mut seen = BTreeSet::new();
    if let Some(At { line, value }) = raw.iter().find(|group| !seen.insert(&group.value.name)) {
        let (file, name) = (file.to_owned(), value.name.clone());
        return Err(SrdfError::DuplicateGroup { file, line: *line, name });
    }
    let mut joints = Vec::with_capacity(raw.len());
    let mut chains = Vec::with_capacity(raw.len());
    // For each group, the groups inside.
    let mut inside = Vec::with_capacity(raw.len());
    for At { value: group, .. } in raw {
        let (own, chain) = own_joints(lookup, group);
        let mut groups = Vec::new();
        for At { line, value } in &group.members {
            if let Member::Group(name) = value {
                groups.extend(lookup.group(name, *line));
            }
        }
        joints.push(own);
        chains.push(chain.filter(|_| groups.is_empty()));
        inside.push(groups);
    }
    let order = inside_first(&inside).map_err(|groups| SrdfError::GroupLoop {
        file: file.to_owned(),
        line: raw[groups[0]].line,
        groups: groups.iter().map(|&group| raw[group].value.name.clone()).collect(),
    })?;
    for group in order {
        for &other in &inside[group] {
            let added = joints[other].clone();
            add(&mut joints[group], &added);
        }
    }
    let groups = raw.iter().zip(&joints).zip(chains).map(|((group, joints), chain)| SrdfGroup {
        name: group.value.name.clone(),
        joints: names(lookup, joints),
        chain,
    });
    Ok(groups.filter(|group| !group.joints.is_empty()).collect())
}

/// The joints of a group without those of the groups inside, and the ends of its chain if that has all of them.
fn own_joints(lookup: &mut Lookup, group: &RawGroup) -> (Joints, Option<[String; 2]>) {
    let mut listed = vec![false; lookup.tree.joints.len()];
    for At { line, value } in &group.members {
        let joint = match value {
            Member::Joint(name) => lookup.joint(name, *line),
            Member::Link(name) => lookup.link(name, *line).and_then(|link| lookup.tree.links[link].parent_joint),
            Member::Chain { .. } | Member::Group(_) => None,
        };
        if let Some(joint) = joint.filter(|&joint| lookup.is_movable(joint)) {
            listed[joint] = true;
        }
    }
    let mut joints = listed.clone();
    let mut chains = Vec::new();
    for At { line, value } in &group.members {
        let Member::Chain { base, tip } = value else { continue };
        let (Some(first), Some(last)) = (lookup.link(base, *line), lookup.link(tip, *line)) else { continue };
        let (of_chain, is_below) = path(lookup, first, last);
        let others: Joints = of_chain.iter().zip(&listed).map(|(of_chain, listed)| *of_chain && !listed).collect();
        if listed.contains(&true) && others.contains(&true) {
            let (group, tip, mut joints) = (group.name.clone(), tip.clone(), names(lookup, &others));
            let more = joints.len().saturating_sub(LISTED);
            joints.truncate(LISTED);
            lookup.warnings.push(SrdfWarning::ChainHasOthers { group, line: *line, tip, joints, more });
        }
        add(&mut joints, &of_chain);
        chains.push((of_chain, is_below.then(|| [base.clone(), tip.clone()])));
    }
    let chain = match &mut chains[..] {
        [(of_chain, ends)] if *of_chain == joints => ends.take(),
        _ => None,
    };
    (joints, chain)
}

/// The movable joints between two links, and whether `last` is below `first` or the same.
fn path(lookup: &Lookup, first: usize, last: usize) -> (Joints, bool) {
    let tree = lookup.tree;
    let mut is_above_first = vec![false; tree.links.len()];
    let mut at = Some(first);
    while let Some(link) = at {
        is_above_first[link] = true;
        at = tree.links[link].parent_joint.map(|joint| tree.joints[joint].parent);
    }
    let mut joints = vec![false; tree.joints.len()];
    // Adds the joints from a link upward to the first link at which it stops, and returns that.
    let mut climb = |mut link: usize, stops: &dyn Fn(usize) -> bool| {
        while let Some(joint) = tree.links[link].parent_joint.filter(|_| !stops(link)) {
            joints[joint] = lookup.is_movable(joint);
            link = tree.joints[joint].parent;
        }
        link
    };
    let common = climb(last, &|link| is_above_first[link]);
    climb(first, &|link| link == common);
    (joints, common == first)
}

/// All groups, each after the groups inside it.
///
/// # Errors
/// Groups that contain each other, the first one repeated at the end.
fn inside_first(inside: &[Vec<usize>]) -> Result<Vec<usize>, Vec<usize>> {
    let mut is_done = vec![false; inside.len()];
    let mut order = Vec::with_capacity(inside.len());
    while order.len() < inside.len() {
        let before = order.len();
        for (group, groups) in inside.iter().enumerate() {
            if !is_done[group] && groups.iter().all(|&other| is_done[other]) {
                is_done[group] = true;
                order.push(group);
            }
        }
        if order.len() == before {
            return Err(loop_of(inside, &is_done));
        }
    }
    Ok(order)
}

/// A loop among the groups that are not done: each of them contains another one.
fn loop_of(inside: &[Vec<usize>], is_done: &[bool]) -> Vec<usize> {
    let mut visited: Vec<usize> = Vec::new();
    let mut at = is_done.iter().position(|is_done| !is_done);
    while let Some(group) = at {
        if let Some(first) = visited.iter().position(|&other| other == group) {
            visited.push(group);
            return visited.split_off(first);
        }
        visited.push(group);
        at = inside[group].iter().copied().find(|&other| !is_done[other]);
    }
    visited
}

fn add(joints: &mut Joints, others: &Joints) {
    joints.iter_mut().zip(others).for_each(|(has, other)| *has |= other);
}

fn names(lookup: &Lookup, joints: &Joints) -> Vec<String> {
    let has = lookup.tree.joints.iter().zip(joints).filter(|(_, has)| **has);
    has.map(|(joint, _)| joint.name.clone()).collect()
}
