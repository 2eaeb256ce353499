//! Errors and warnings of SRDFs.

use crate::error::ModelError;
use crate::names::near_list;
use thiserror::Error;

/// Most names that a warning lists.
pub(super) const LISTED: usize = 8;

/// Reasons why an SRDF is not read. `file` is the name of the file.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SrdfError {
    /// The text is not well-formed XML, not an SRDF, or exceeds a limit on size, nesting, groups or their elements.
    #[error("{file}: not an SRDF: line {line}: {reason}")]
    NotSrdf {
        /// Name of the file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What was found and what was expected.
        reason: String,
    },
    /// An element lacks an attribute, or an attribute has another form.
    #[error(transparent)]
    Element(#[from] ModelError),
    /// Two groups share a name.
    #[error("{file}: line {line}: two groups have the name \"{name}\", expected unique names")]
    DuplicateGroup {
        /// Name of the file.
        file: String,
        /// Line of the second one, from 1.
        line: usize,
        /// The name.
        name: String,
    },
    /// Groups that contain each other.
    #[error("{file}: line {line}: groups contain each other, expected no loop: {}", groups.join(" > "))]
    GroupLoop {
        /// Name of the file.
        file: String,
        /// Line of the first group, from 1.
        line: usize,
        /// The loop; its first group is repeated at the end.
        groups: Vec<String>,
    },
}

/// Parts of an SRDF that are left out, or that are probably a mistake.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SrdfWarning {
    /// The SRDF names another robot.
    #[error("the SRDF is of robot \"{srdf}\", the URDF of robot \"{urdf}\"")]
    RobotName {
        /// Name in the SRDF.
        srdf: String,
        /// Name in the URDF.
        urdf: String,
    },
    /// Names that do not exist. One warning for all of a kind: variants of a robot share an SRDF, which then has many.
    #[error("line {line}: unknown {what}: {}; elements with this name are left out{}", listed(.names, *.more), near_list(.near))]
    Unknown {
        /// `link`, `movable joint` or `group`.
        what: &'static str,
        /// Line of the first one, from 1.
        line: usize,
        /// The first of the names, each once.
        names: Vec<String>,
        /// Number of further ones.
        more: usize,
        /// Names similar to the first one.
        near: Vec<String>,
    },
    /// A group that lists joints, and has a chain with others.
    #[error(
        "line {line}: group \"{group}\" lists joints, and its chain to \"{tip}\" has others: {}; the group has both",
        listed(.joints, *.more)
    )]
    ChainHasOthers {
        /// The group.
        group: String,
        /// Line of the chain, from 1.
        line: usize,
        /// Last link of the chain.
        tip: String,
        /// The first joints of the chain that are not listed.
        joints: Vec<String>,
        /// Number of further ones.
        more: usize,
    },
    /// A pair of a link and itself.
    #[error("line {line}: disabled collision of link \"{link}\" with itself; it is left out")]
    SameLink {
        /// Line, from 1.
        line: usize,
        /// The link.
        link: String,
    },
    /// An element that changes which collisions are checked, and is not read.
    #[error("line {line}: <{element}> is not read: only <disable_collisions> is")]
    NotRead {
        /// Line of the first one, from 1.
        line: usize,
        /// Name of the element.
        element: String,
    },
}

/// Names in quotation marks, and the number of further ones.
fn listed(names: &[String], more: usize) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
    quoted.join(", ") + &if more == 0 { String::new() } else { format!(" and {more} more") }
}
