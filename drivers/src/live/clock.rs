//! The monotonic clock, and sleep until a time on it.

use nix::errno::Errno;
use nix::sys::time::TimeSpec;
use nix::time::{ClockId, ClockNanosleepFlags, clock_gettime, clock_nanosleep};

const NS_PER_S: i64 = 1_000_000_000;

/// Monotonic time, ns: the clock of a live run, shared by all processes of a machine.
pub fn now_ns() -> i64 {
    nanoseconds(ClockId::CLOCK_MONOTONIC)
}

/// Wall clock, ns since the Unix epoch.
pub fn wall_ns() -> i64 {
    nanoseconds(ClockId::CLOCK_REALTIME)
}

/// Sleeps until the monotonic clock reaches `t_ns`. Returns at once if it has.
pub fn sleep_until(t_ns: i64) {
    let until = TimeSpec::new(t_ns.div_euclid(NS_PER_S), t_ns.rem_euclid(NS_PER_S));
    // A signal interrupts the sleep; the time is absolute, so the sleep is resumed without error.
    while clock_nanosleep(ClockId::CLOCK_MONOTONIC, ClockNanosleepFlags::TIMER_ABSTIME, &until) == Err(Errno::EINTR) {}
}

fn nanoseconds(clock: ClockId) -> i64 {
    // Both clocks exist on every Linux.
    clock_gettime(clock).map_or(0, |t| t.tv_sec() * NS_PER_S + t.tv_nsec())
}

/// Times at which ticks are due: every `period_ns`, `phase_ns` after the whole multiples of the period on the monotonic clock.
///
/// Processes of one machine with the same period stay synchronized: a driver at phase 0 has measured when a controller at half a period wakes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickSchedule {
    /// Time between two ticks, ns.
    pub period_ns: i64,
    /// Time after the whole multiples of the period, ns.
    pub phase_ns: i64,
}

impl TickSchedule {
    /// First tick after `now_ns`.
    pub fn after(self, now_ns: i64) -> i64 {
        let since = (now_ns - self.phase_ns).rem_euclid(self.period_ns);
        now_ns - since + self.period_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sleep_ends_at_or_after_its_time() {
        let until = now_ns() + 2_000_000;
        sleep_until(until);
        assert!(now_ns() >= until);
        sleep_until(until - NS_PER_S);
    }

    #[test]
    fn after_a_late_tick_the_period_is_the_true_one_again() {
        let schedule = TickSchedule { period_ns: 1000, phase_ns: 300 };
        // A tick that was due at 5300 ends 7 periods later; the ticks in between are skipped, none is made up for.
        let next = schedule.after(5300 + 7123);
        assert_eq!((next, schedule.after(next), schedule.after(next + 400)), (13_300, 14_300, 14_300));
    }

    #[test]
    fn ticks_are_whole_periods_apart_and_keep_their_phase() {
        let schedule = TickSchedule { period_ns: 1000, phase_ns: 400 };
        assert_eq!([0, 399, 400, 401, 1399, 1400].map(|now| schedule.after(now)), [400, 400, 1400, 1400, 1400, 2400]);
        assert_eq!(TickSchedule { period_ns: 1000, phase_ns: 0 }.after(5999), 6000);
    }
}
