//! Bounds the memory of a run: of a long log, every second, fourth, eighth, ... tick is kept.
//!
//! A report of ten minutes at 1 kHz uses every tick. Beyond [`MAX_TICKS`], the step between the kept ticks doubles each time that they become too many, so that
//! they stay evenly spaced, and memory is the same for any length. Ticks in which the mode or the fault changes are always kept.

use super::joints::Rows;
use super::read::{Gathered, period_ns};
use super::{Status, Tick};

/// Ticks in memory at most.
const MAX_TICKS: usize = 600_000;

/// New ticks between two rounds.
const ROUND: usize = 50_000;

/// Latest ticks that are not thinned out yet: messages of them may still come.
const LATEST: usize = 2000;

/// State of the thinning.
#[derive(Default)]
pub(super) struct Thinning {
    /// Step between kept ticks, in control periods; 0: every tick is kept.
    pub step: i64,
    /// Control period, ns, from the first ticks.
    pub period_ns: i64,
    /// Ticks before this index are thinned out.
    done: usize,
    /// Messages of ticks that were thinned out.
    pub scratch: Tick,
}

impl Thinning {
    /// Whether the tick at this time is thinned out already.
    pub fn is_past(&self, ticks: &[Tick], t_ns: i64) -> bool {
        self.step > 0 && self.done > 0 && ticks.get(self.done - 1).is_some_and(|last| t_ns <= last.t_ns)
    }
}

impl Gathered {
    /// Called before a tick is added.
    pub(super) fn bound_memory(&mut self) {
        if self.ticks.is_empty() {
            // Ground truth and joint states alone.
            if self.truth.len() >= MAX_TICKS {
                keep_every_second(&mut self.truth);
            }
            if self.raw.0.len() >= MAX_TICKS {
                keep_every_second(&mut self.raw.0);
                self.raw.1.keep(self.raw.0.iter_mut().map(|(_, row)| row));
            }
            return;
        }
        let is_full = self.ticks.len() >= MAX_TICKS;
        let is_due = self.thinning.step > 0 && self.ticks.len() - self.thinning.done >= ROUND;
        if !is_full && !is_due {
            return;
        }
        if is_full {
            if self.thinning.step == 0 {
                self.thinning.period_ns = period_ns(&self.ticks).max(1);
                self.thinning.step = 1;
            }
            self.thinning.step *= 2;
            self.thinning.done = 0;
        }
        self.thin(LATEST);
    }

    /// Thins out the ticks since the last round, except the `latest` ones.
    pub(super) fn thin(&mut self, latest: usize) {
        let end = self.ticks.len().saturating_sub(latest);
        let (begin, step) = (self.thinning.done, self.thinning.step);
        if step == 0 || begin >= end {
            return;
        }
        let (t0_ns, period_ns) = (self.ticks[0].t_ns, self.thinning.period_ns);
        let state = |status: &Option<Status>| status.map(|status| (status.mode, status.fault));
        let mut before = begin.checked_sub(1).and_then(|last| state(&self.ticks[last].status));
        let (mut index, mut kept, mut changes_left) = (0, 0, ROUND / 8);
        self.ticks.retain(|tick| {
            index += 1;
            if !(begin..end).contains(&(index - 1)) {
                return true;
            }
            let now = state(&tick.status);
            let changes = now.is_some() && now != before;
            before = now.or(before);
            let number = tick.t_ns.saturating_sub(t0_ns).saturating_add(period_ns / 2) / period_ns;
            let is_change = changes && changes_left > 0;
            changes_left -= usize::from(is_change);
            let keep = number % step == 0 || is_change;
            kept += usize::from(keep);
            keep
        });
        self.thinning.done = begin + kept;
        for side in [0, 1] {
            let ticks = self.ticks.iter_mut().chain(&mut self.stray);
            let rows = ticks.filter_map(|tick| tick.joint_rows[side].as_mut());
            if side == 0 { self.joints.measured.keep(rows) } else { self.joints.commanded.keep(rows) }
        }
        // Ground truth and joint states are used at the nearest tick.
        let last_ns = self.ticks.get(self.thinning.done.saturating_sub(1)).map_or(i64::MIN, |tick| tick.t_ns);
        let ticks = &self.ticks;
        let is_near = |t_ns: i64| {
            let after = ticks.partition_point(|tick| tick.t_ns < t_ns);
            let near =
                |index: usize| ticks.get(index).is_some_and(|tick| tick.t_ns.abs_diff(t_ns) <= period_ns as u64 / 2);
            t_ns > last_ns || near(after) || after.checked_sub(1).is_some_and(near)
        };
        self.truth.retain(|truth| is_near(truth.t_ns));
        if self.raw.0.len() > 2 * LATEST {
            self.raw.0.retain(|(t_ns, _)| is_near(*t_ns));
            self.raw.1.keep(self.raw.0.iter_mut().map(|(_, row)| row));
        }
    }
}

fn keep_every_second<T>(values: &mut Vec<T>) {
    let mut index = 0;
    values.retain(|_| {
        index += 1;
        index % 2 == 1
    });
}

impl Rows {
    /// Keeps the rows with these numbers, and renumbers them.
    fn keep<'a>(&mut self, rows: impl Iterator<Item = &'a mut u32>) {
        let width = self.width();
        let mut rows: Vec<&mut u32> = rows.collect();
        rows.sort_unstable_by_key(|row| **row);
        let mut last = None;
        let mut count = 0_u32;
        for row in rows {
            let from = *row as usize;
            if last != Some(from) {
                if from != count as usize {
                    self.values.copy_within(from * width..(from + 1) * width, count as usize * width);
                }
                count += 1;
                last = Some(from);
            }
            *row = count - 1;
        }
        self.values.truncate(count as usize * width);
    }
}
