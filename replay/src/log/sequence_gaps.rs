//! Sequence numbers in messages (`seq`, `tick`), and the gaps, duplicates and restarts that they show.

use lcm_idl::Type;
use lcm_idl::ast::{FieldType, Primitive};
use lcmtypes::{Event, Message, ParameterChange, RequestReply};
use std::collections::VecDeque;

/// Gaps that are listed with their position: the first ones of a channel.
const MAX_LISTED: usize = 1000;

/// Later gaps that are remembered, so that late messages can still fill them.
const MAX_RECENT: usize = 256;

/// Types with a tick that is no sequence number: several messages can have one tick, or none (-1).
const NOT_NUMBERED: [&str; 3] = [Event::TYPE, RequestReply::TYPE, ParameterChange::TYPE];

/// Name of a type's sequence number, `seq` or `tick`: the second field, an `int64_t` after `int64_t t_ns`. `None` if the type has none.
pub(crate) fn sequence_field(ty: Type<'_>) -> Option<&'static str> {
    if NOT_NUMBERED.contains(&ty.name()) {
        return None;
    }
    let [time, second, ..] = &ty.def().fields[..] else { return None };
    let integer = |field: &lcm_idl::ast::Field| {
        field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    let named = ["seq", "tick"].into_iter().find(|name| **name == *second.name);
    named.filter(|_| integer(time) && integer(second) && *time.name == *"t_ns")
}

/// The sequence number of an encoded message: the big-endian `int64_t` after the fingerprint and `t_ns`. The caller has checked the type
/// with [`sequence_field`].
#[inline]
pub(crate) fn sequence_number(message: &[u8]) -> Option<i64> {
    message.get(16..24)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}

/// A range of missing sequence numbers.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// First missing number.
    pub first: i64,
    /// Last missing number.
    pub last: i64,
    /// Log time of the message after the gap, ns.
    pub t_ns: i64,
}

impl Gap {
    /// Count of missing numbers.
    pub fn missing(&self) -> u64 {
        self.last.abs_diff(self.first).saturating_add(1)
    }
}

/// Tracks the sequence numbers of one channel.
#[derive(Debug, Clone, Default)]
pub(crate) struct SequenceTracker {
    count: u64,
    lowest: i64,
    highest: i64,
    missing: u64,
    /// The first [`MAX_LISTED`] gaps.
    gaps: Vec<Gap>,
    /// The latest [`MAX_RECENT`] of the gaps after those.
    recent: VecDeque<Gap>,
    /// Numbers that were received more than once.
    pub duplicates: u64,
    /// Numbers that arrived out of order and filled a gap.
    pub late: u64,
    /// Restarts of the sequence, as after a restart of the sender.
    pub restarts: u64,
}

impl SequenceTracker {
    pub fn add(&mut self, number: i64, t_ns: i64) {
        self.count += 1;
        if self.count == 1 {
            (self.lowest, self.highest) = (number, number);
        } else if let Some(step) = number.checked_sub(self.highest).filter(|step| *step > 0) {
            if step > 1 {
                self.missing = self.missing.saturating_add(step as u64 - 1);
                self.add_gap(Gap { first: self.highest + 1, last: number - 1, t_ns });
            }
            self.highest = number;
        } else if number < self.lowest || number == 0 && self.highest > 0 {
            // A number below all numbers of a sequence starts another sequence.
            self.restarts += 1;
            (self.lowest, self.highest) = (number, number);
        } else if self.fill(number) {
            self.late += 1;
            self.missing -= 1;
        } else {
            self.duplicates += 1;
        }
    }

    fn add_gap(&mut self, gap: Gap) {
        if self.gaps.len() < MAX_LISTED {
            self.gaps.push(gap);
            return;
        }
        if self.recent.len() == MAX_RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(gap);
    }

    /// Removes a number from the gaps; `false` if no gap contains it.
    fn fill(&mut self, number: i64) -> bool {
        let holds = |gap: &Gap| (gap.first..=gap.last).contains(&number);
        if let Some(index) = self.recent.iter().rposition(holds) {
            let [before, after] = without(self.recent[index].clone(), number);
            self.recent.remove(index);
            after.into_iter().chain(before).for_each(|part| self.recent.insert(index, part));
            return true;
        }
        let Some(index) = self.gaps.iter().rposition(holds) else { return false };
        let parts = without(self.gaps[index].clone(), number);
        self.gaps.splice(index..=index, parts.into_iter().flatten());
        true
    }

    /// Lost messages. `None` if at least as many numbers are missing as present: such a channel is published at a divided rate (for
    /// example every tenth tick) and has lost nothing.
    pub fn lost(&self) -> Option<u64> {
        (self.missing < self.count).then_some(self.missing)
    }

    /// The first [`MAX_LISTED`] gaps; empty if [`SequenceTracker::lost`] is `None`.
    pub fn gaps(&self) -> &[Gap] {
        if self.lost().is_some() { &self.gaps } else { &[] }
    }
}

/// The parts of a gap before and after a number in it.
fn without(gap: Gap, number: i64) -> [Option<Gap>; 2] {
    let before = Gap { last: number.saturating_sub(1), ..gap.clone() };
    let after = Gap { first: number.saturating_add(1), ..gap };
    [before, after].map(|part| Some(part).filter(|part| part.first <= part.last))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(numbers: &[i64]) -> SequenceTracker {
        let mut tracker = SequenceTracker::default();
        for (t_ns, &number) in (0..).zip(numbers) {
            tracker.add(number, t_ns);
        }
        tracker
    }

    #[test]
    fn gaps_are_listed_with_their_time() {
        let n = track(&[5, 6, 9, 10, 12]);
        assert_eq!(n.lost(), Some(3));
        assert_eq!(n.gaps(), [Gap { first: 7, last: 8, t_ns: 2 }, Gap { first: 11, last: 11, t_ns: 4 }]);
    }

    #[test]
    fn late_messages_are_not_lost_and_duplicates_are_counted() {
        let n = track(&[0, 1, 5, 3, 3, 6, 7]);
        assert_eq!((n.lost(), n.late, n.duplicates, n.restarts), (Some(2), 1, 1, 0));
        let gaps: Vec<_> = n.gaps().iter().map(|gap| (gap.first, gap.last)).collect();
        assert_eq!(gaps, [(2, 2), (4, 4)]);
    }

    #[test]
    fn a_restarted_sequence_has_lost_nothing() {
        let n = track(&[0, 1, 2, 0, 1, 2]);
        assert_eq!((n.lost(), n.duplicates, n.restarts), (Some(0), 0, 1));
    }

    #[test]
    fn the_tick_of_an_event_is_no_sequence_number() {
        let types = lcmtypes::types();
        let field = |name: &str| sequence_field(types.by_name(name).unwrap());
        for name in NOT_NUMBERED {
            assert_eq!(field(name), None, "{name}");
        }
        assert_eq!((field("hoofprint.robot_state_t"), field("hoofprint.timing_t")), (Some("seq"), Some("tick")));
    }

    #[test]
    fn every_tenth_tick_is_no_loss() {
        assert_eq!(track(&[0, 10, 20, 30]).lost(), None);
    }

    #[test]
    fn late_numbers_are_recognized_after_many_gaps() {
        // Every third number is missing, 2000 times; the last missing one arrives at the end.
        let mut all: Vec<i64> = (0..6000).filter(|n| n % 3 != 1).collect();
        all.push(5998);
        let n = track(&all);
        assert_eq!((n.lost(), n.late, n.duplicates), (Some(1999), 1, 0));
        assert_eq!(n.gaps().len(), MAX_LISTED);
        assert_eq!(n.gaps()[0].first, 1);
    }

    #[test]
    fn extreme_numbers_do_not_overflow() {
        assert_eq!(track(&[i64::MIN, i64::MAX, i64::MIN, 0, i64::MAX]).lost(), Some(0));
    }
}
