//! Finds the names of an SRDF in the URDF and among its groups, and collects those that do not exist.

use super::error::{LISTED, SrdfWarning};
use super::read::RawSrdf;
use crate::error::ModelWarning;
use crate::names::near_names;
use crate::tree::{JointKind, UrdfTree};
use std::collections::{BTreeMap, BTreeSet};

/// Names of a URDF and of the groups of an SRDF.
pub(super) struct Lookup<'a> {
    pub(super) tree: &'a UrdfTree,
    links: BTreeMap<&'a str, usize>,
    joints: BTreeMap<&'a str, usize>,
    groups: BTreeMap<&'a str, usize>,
    /// Names of the joint between the world and the base, which is no joint of a model.
    base_joints: BTreeSet<&'a str>,
    pub(super) warnings: Vec<SrdfWarning>,
    /// Kind and name of each name in a warning.
    unknown: BTreeSet<(&'static str, String)>,
}

impl<'a> Lookup<'a> {
    pub(super) fn new(raw: &'a RawSrdf, tree: &'a UrdfTree) -> Self {
        let positions = raw.states.iter().flat_map(|state| &state.value.joints);
        // Positions of the base are written for a joint that no element declares, too.
        let of_base = positions.filter(|position| position.value.values.len() > 1);
        let of_world = tree.warnings.iter().filter_map(|warning| match warning {
            ModelWarning::WorldIgnored { joint, .. } => Some(joint.as_str()),
            _ => None,
        });
        let virtual_joints = raw.virtual_joints.iter().map(|joint| joint.value.name.as_str());
        Lookup {
            tree,
            links: tree.links.iter().enumerate().map(|(at, link)| (link.name.as_str(), at)).collect(),
            joints: tree.joints.iter().enumerate().map(|(at, joint)| (joint.name.as_str(), at)).collect(),
            groups: raw.groups.iter().enumerate().map(|(at, group)| (group.value.name.as_str(), at)).collect(),
            base_joints: virtual_joints
                .chain(of_world)
                .chain(of_base.map(|position| position.value.joint.as_str()))
                .collect(),
            warnings: Vec::new(),
            unknown: BTreeSet::new(),
        }
    }

    /// Index of a link in [`UrdfTree::links`]; `None` with a warning if there is none.
    pub(super) fn link(&mut self, name: &str, line: usize) -> Option<usize> {
        let found = self.links.get(name).copied();
        if found.is_none() {
            self.warn("link", name, line);
        }
        found
    }

    /// Index of a joint in [`UrdfTree::joints`]; `None`, with a warning if it is not the joint between the world and the base.
    pub(super) fn joint(&mut self, name: &str, line: usize) -> Option<usize> {
        let found = self.joints.get(name).copied();
        if found.is_none() && !self.base_joints.contains(name) {
            self.warn("joint", name, line);
        }
        found
    }

    /// The same for a joint that must be movable.
    pub(super) fn movable_joint(&mut self, name: &str, line: usize) -> Option<usize> {
        let found = self.joints.get(name).copied().filter(|&joint| self.is_movable(joint));
        if found.is_none() && !self.base_joints.contains(name) {
            self.warn("movable joint", name, line);
        }
        found
    }

    /// Index of a group in the file; `None` for an empty name, or with a warning if there is none.
    pub(super) fn group(&mut self, name: &str, line: usize) -> Option<usize> {
        let found = self.groups.get(name).copied();
        if found.is_none() && !name.is_empty() {
            self.warn("group", name, line);
        }
        found
    }

    pub(super) fn is_movable(&self, joint: usize) -> bool {
        self.tree.joints[joint].kind != JointKind::Fixed
    }

    /// Adds a name to the warning of its kind.
    fn warn(&mut self, kind: &'static str, name: &str, line: usize) {
        if !self.unknown.insert((kind, name.to_owned())) {
            return;
        }
        for warning in &mut self.warnings {
            if let SrdfWarning::Unknown { what, names, more, .. } = warning
                && *what == kind
            {
                if names.len() < LISTED {
                    names.push(name.to_owned())
                } else {
                    *more += 1
                }
                return;
            }
        }
        let near = match kind {
            "link" => near_names(name, self.links.keys().copied()),
            "group" => near_names(name, self.groups.keys().copied()),
            _ => near_names(
                name,
                self.joints.iter().filter(|(_, joint)| self.is_movable(**joint)).map(|(name, _)| *name),
            ),
        };
        self.warnings.push(SrdfWarning::Unknown { what: kind, line, names: vec![name.to_owned()], more: 0, near });
    }
}
