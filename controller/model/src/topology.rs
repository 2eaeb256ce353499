//! Tree of the links of a URDF: resolves names, checks for one root and no loop.

use std::collections::BTreeMap;

use super::error::ModelError;
use super::names::near_names;
use super::read::{RawJoint, RawRobot};

/// Largest number of links that an error names.
const MAX_NAMED: usize = 8;

/// The tree. Links and joints are indices in file order.
pub(super) struct Topology {
    /// Parent and child link of each joint.
    pub(super) ends: Vec<(usize, usize)>,
    /// The joint above each link.
    pub(super) joint_above: Vec<Option<usize>>,
    /// Links in depth-first order from the root; children in the order of their joints.
    pub(super) order: Vec<usize>,
}

impl Topology {
    pub(super) fn of(robot: &RawRobot, file: &str) -> Result<Self, ModelError> {
        let file = || file.to_owned();
        let links = index("link", robot.links.iter().map(|l| (l.name.as_str(), l.line)), file)?;
        index("joint", robot.joints.iter().map(|j| (j.name.as_str(), j.line)), file)?;

        let find = |joint: &RawJoint, role, link: &str| {
            links.get(link).copied().ok_or_else(|| ModelError::MissingLink {
                file: file(),
                line: joint.line,
                joint: joint.name.clone(),
                role,
                link: link.to_owned(),
                near: near_names(link, robot.links.iter().map(|l| l.name.as_str())),
            })
        };
        let mut ends = Vec::with_capacity(robot.joints.len());
        let mut joint_above: Vec<Option<usize>> = vec![None; robot.links.len()];
        let mut joints_below = vec![Vec::new(); robot.links.len()];
        for (j, joint) in robot.joints.iter().enumerate() {
            let (parent, child) = (find(joint, "parent", &joint.parent)?, find(joint, "child", &joint.child)?);
            if let Some(first) = joint_above[child] {
                return Err(ModelError::TwoParents {
                    file: file(),
                    line: joint.line,
                    link: joint.child.clone(),
                    first: robot.joints[first].name.clone(),
                    second: joint.name.clone(),
                });
            }
            ends.push((parent, child));
            joint_above[child] = Some(j);
            joints_below[parent].push(j);
        }

        let names = |keep: &dyn Fn(usize) -> bool| -> Vec<String> {
            let mut names = robot.links.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, link)| link.name.clone());
            let mut named: Vec<String> = names.by_ref().take(MAX_NAMED).collect();
            let more = names.count();
            if more > 0 {
                named.push(format!("and {more} more"));
            }
            named
        };
        let mut roots = (0..robot.links.len()).filter(|&i| joint_above[i].is_none());
        let root = match (roots.next(), roots.next()) {
            (Some(root), None) => root,
            (Some(_), Some(second)) => {
                let (line, links) = (robot.links[second].line, names(&|i| joint_above[i].is_none()));
                return Err(ModelError::SeveralRoots { file: file(), line, links });
            }
            (None, _) if robot.links.is_empty() => {
                return Err(ModelError::NoLinks { file: file() });
            }
            (None, _) => {
                return Err(ModelError::Loop { file: file(), line: robot.links[0].line, links: names(&|_| true) });
            }
        };
        let mut order = Vec::with_capacity(robot.links.len());
        let mut waiting = vec![root];
        while let Some(link) = waiting.pop() {
            order.push(link);
            waiting.extend(joints_below[link].iter().rev().map(|&j| ends[j].1));
        }
        if order.len() < robot.links.len() {
            let mut reached = vec![false; robot.links.len()];
            order.iter().for_each(|&link| reached[link] = true);
            let line = reached.iter().position(|reached| !reached).map_or(0, |first| robot.links[first].line);
            return Err(ModelError::Loop { file: file(), line, links: names(&|i| !reached[i]) });
        }
        Ok(Self { ends, joint_above, order })
    }
}

/// Index of each name; an error for a name that occurs twice.
fn index<'a>(
    what: &'static str,
    names: impl Iterator<Item = (&'a str, usize)>,
    file: impl Fn() -> String,
) -> Result<BTreeMap<&'a str, usize>, ModelError> {
    let mut indices = BTreeMap::new();
    for (i, (name, line)) in names.enumerate() {
        if indices.insert(name, i).is_some() {
            return Err(ModelError::DuplicateName { file: file(), line, what, name: name.to_owned() });
        }
    }
    Ok(indices)
}
