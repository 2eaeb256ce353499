//! Named ranges of the optimization vector.

use super::PhysicalLevel;
use std::ops::Range;

/// Which range of the optimization vector `x` has which meaning.
///
/// ```text
/// x = [motion; F_1; ...; F_k; s]
/// ```
/// `motion`: generalized accelerations `vd`, or velocities `v` in a velocity-level program, nv. `F_i`: force of contact `i` in units of
/// [`FORCE_UNIT`](crate::contact::FORCE_UNIT), 3 or 6 numbers. `s`: one slack, if the program has one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variables {
    nv: usize,
    velocities: bool,
    forces: Vec<Range<usize>>,
    slack: Option<usize>,
}

impl Variables {
    /// Variables of a program of accelerations and forces.
    ///
    /// - `nv`: number of generalized velocities.
    /// - `force_sizes`: number of force variables of each contact, in the order of the contacts.
    /// - `slack`: whether there is a slack.
    pub fn new(nv: usize, force_sizes: impl IntoIterator<Item = usize>, slack: bool) -> Self {
        let mut end = nv;
        let forces = force_sizes
            .into_iter()
            .map(|size| {
                let start = end;
                end += size;
                start..end
            })
            .collect();
        Variables { nv, velocities: false, forces, slack: slack.then_some(end) }
    }

    /// Variables of a program of generalized velocities.
    pub fn velocities(nv: usize) -> Self {
        Variables { velocities: true, ..Self::new(nv, [], false) }
    }

    /// Whether rows of a physical level can be written in these variables.
    pub fn expresses(&self, level: PhysicalLevel) -> bool {
        match level {
            PhysicalLevel::Velocity => self.velocities,
            PhysicalLevel::Acceleration => !self.velocities,
            PhysicalLevel::Force => !self.forces.is_empty(),
        }
    }

    /// Generalized accelerations or velocities.
    pub fn motion(&self) -> Range<usize> {
        0..self.nv
    }

    /// Force of a contact, by the number of the contact.
    pub fn force(&self, contact: usize) -> Range<usize> {
        self.forces[contact].clone()
    }

    /// Forces of all contacts.
    pub fn forces(&self) -> Range<usize> {
        self.nv..self.forces.last().map_or(self.nv, |last| last.end)
    }

    /// Number of contacts.
    pub fn contacts(&self) -> usize {
        self.forces.len()
    }

    /// The slack.
    pub fn slack(&self) -> Option<usize> {
        self.slack
    }

    /// Number of variables.
    pub fn len(&self) -> usize {
        self.forces().end + usize::from(self.slack.is_some())
    }

    /// Whether there are no variables.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ranges_follow_each_other_and_cover_the_vector() {
        let variables = Variables::new(34, [6, 3, 6], true);
        let ranges = [variables.motion(), variables.force(0), variables.force(1), variables.force(2)];
        assert_eq!(ranges, [0..34, 34..40, 40..43, 43..49]);
        assert_eq!((variables.forces(), variables.slack(), variables.len()), (34..49, Some(49), 50));
        let motion = Variables::new(7, [], false);
        assert_eq!((motion.forces(), motion.slack(), motion.len(), motion.contacts()), (7..7, None, 7, 0));
    }
}
