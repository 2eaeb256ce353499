//! The counter that messages carry, and what it says is missing.

use lcm_idl::Type;
use lcm_idl::ast::{FieldType, Primitive};
use std::collections::VecDeque;

/// Gaps that are kept with their places: the first ones.
const KEPT: usize = 1000;

/// Later gaps that are remembered for as long as a late message may still fill them.
const OPEN: usize = 256;

/// Name of the counter that stands behind the time in a type: `seq` or `tick`.
pub(crate) fn counter(ty: Type<'_>) -> Option<&'static str> {
    let [time, second, ..] = &ty.def().fields[..] else { return None };
    let integer = |field: &lcm_idl::ast::Field| {
        field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    let named = ["seq", "tick"].into_iter().find(|name| **name == *second.name);
    named.filter(|_| integer(time) && integer(second) && *time.name == *"t_ns")
}

/// The second `int64_t` of a message, behind fingerprint and time.
#[inline]
pub(crate) fn second_integer(message: &[u8]) -> Option<i64> {
    message.get(16..24)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}

/// Messages that a counter says are missing.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// First number that is missing.
    pub first: i64,
    /// Last number that is missing.
    pub last: i64,
    /// Time of the message behind the gap, ns.
    pub t_ns: i64,
}

impl Gap {
    /// How many are missing.
    pub fn missing(&self) -> u64 {
        self.last.abs_diff(self.first).saturating_add(1)
    }
}

/// Follows the numbers of one channel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Numbers {
    count: u64,
    lowest: i64,
    highest: i64,
    missing: u64,
    gaps: Vec<Gap>,
    /// Gaps behind those, the newest.
    open: VecDeque<Gap>,
    /// Numbers that came although an equal one had come.
    pub duplicates: u64,
    /// Numbers that filled a gap.
    pub late: u64,
    /// Times that the counter began anew.
    pub restarts: u64,
}

impl Numbers {
    pub fn add(&mut self, number: i64, t_ns: i64) {
        self.count += 1;
        if self.count == 1 {
            (self.lowest, self.highest) = (number, number);
        } else if let Some(beyond) = number.checked_sub(self.highest).filter(|beyond| *beyond > 0) {
            if beyond > 1 {
                self.missing = self.missing.saturating_add(beyond as u64 - 1);
                self.miss(Gap { first: self.highest + 1, last: number - 1, t_ns });
            }
            self.highest = number;
        } else if number < self.lowest || number == 0 && self.highest > 0 {
            // A number below all of a run is the first of another run.
            self.restarts += 1;
            (self.lowest, self.highest) = (number, number);
        } else if self.fill(number) {
            self.late += 1;
            self.missing -= 1;
        } else {
            self.duplicates += 1;
        }
    }

    fn miss(&mut self, gap: Gap) {
        if self.gaps.len() < KEPT {
            self.gaps.push(gap);
            return;
        }
        if self.open.len() == OPEN {
            self.open.pop_front();
        }
        self.open.push_back(gap);
    }

    /// Takes a number out of what is missing; whether it was there.
    fn fill(&mut self, number: i64) -> bool {
        let holds = |gap: &Gap| (gap.first..=gap.last).contains(&number);
        if let Some(place) = self.open.iter().rposition(holds) {
            let [before, behind] = without(self.open[place].clone(), number);
            self.open.remove(place);
            behind.into_iter().chain(before).for_each(|part| self.open.insert(place, part));
            return true;
        }
        let Some(place) = self.gaps.iter().rposition(holds) else { return false };
        let parts = without(self.gaps[place].clone(), number);
        self.gaps.splice(place..=place, parts.into_iter().flatten());
        true
    }

    /// Numbers that are missing, whether the counter counts every message or not.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// What is missing. `None` if the counter does not count every message: a channel that comes in every tenth tick has lost
    /// nothing, and only most of a sequence is a sequence.
    pub fn lost(&self) -> Option<u64> {
        (self.missing < self.count).then_some(self.missing)
    }

    /// Where it is missing, if it is.
    pub fn gaps(&self) -> &[Gap] {
        if self.lost().is_some() { &self.gaps } else { &[] }
    }
}

/// What is left of a gap in front of a number and behind it.
fn without(gap: Gap, number: i64) -> [Option<Gap>; 2] {
    let before = Gap { last: number.saturating_sub(1), ..gap.clone() };
    let behind = Gap { first: number.saturating_add(1), ..gap };
    [before, behind].map(|part| Some(part).filter(|part| part.first <= part.last))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(numbers: &[i64]) -> Numbers {
        let mut all = Numbers::default();
        for (t_ns, &number) in (0..).zip(numbers) {
            all.add(number, t_ns);
        }
        all
    }

    #[test]
    fn what_is_missing_is_named() {
        let n = of(&[5, 6, 9, 10, 12]);
        assert_eq!(n.lost(), Some(3));
        assert_eq!(n.gaps(), [Gap { first: 7, last: 8, t_ns: 2 }, Gap { first: 11, last: 11, t_ns: 4 }]);
    }

    #[test]
    fn what_comes_late_is_not_lost_and_what_comes_twice_is_told() {
        let n = of(&[0, 1, 5, 3, 3, 6, 7]);
        assert_eq!((n.lost(), n.late, n.duplicates, n.restarts), (Some(2), 1, 1, 0));
        let gaps: Vec<_> = n.gaps().iter().map(|gap| (gap.first, gap.last)).collect();
        assert_eq!(gaps, [(2, 2), (4, 4)]);
    }

    #[test]
    fn a_counter_that_begins_anew_has_lost_nothing() {
        let n = of(&[0, 1, 2, 0, 1, 2]);
        assert_eq!((n.lost(), n.duplicates, n.restarts), (Some(0), 0, 1));
    }

    #[test]
    fn every_tenth_tick_is_no_loss() {
        assert_eq!(of(&[0, 10, 20, 30]).lost(), None);
    }

    #[test]
    fn late_numbers_are_known_however_many_gaps_came_before() {
        // Every third number is missing, 2000 times; the last one missing comes after all.
        let mut all: Vec<i64> = (0..6000).filter(|n| n % 3 != 1).collect();
        all.push(5998);
        let n = of(&all);
        assert_eq!((n.lost(), n.late, n.duplicates), (Some(1999), 1, 0));
        assert_eq!(n.gaps().len(), KEPT);
        assert_eq!(n.gaps()[0].first, 1);
    }

    #[test]
    fn extreme_numbers_do_not_overflow() {
        assert_eq!(of(&[i64::MIN, i64::MAX, i64::MIN, 0, i64::MAX]).lost(), Some(0));
    }
}
