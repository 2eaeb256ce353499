//! Which ticks were late, and why, in sentences: at most one a second.

use lcmtypes::{Timing, channels::Stage};

/// How often it may speak, ns.
const EVERY_NS: i64 = 1_000_000_000;

/// Goes through the TIMING of a run and keeps what is to be told.
#[derive(Debug)]
pub struct Lateness {
    period_ns: i64,
    last: Option<Timing>,
    next_word_ns: i64,
    found: Found,
}

/// What has not been told yet.
#[derive(Debug, Default)]
struct Found {
    late: u64,
    skipped: u64,
    /// The worst tick: how late its command was, ns, when, which, why.
    worst: Option<(i64, i64, i64, String)>,
}

impl Lateness {
    /// For ticks that are due every `period_ns`.
    pub fn new(period_ns: i64) -> Self {
        Lateness { period_ns, last: None, next_word_ns: i64::MIN, found: Found::default() }
    }

    /// Takes the timing of the next tick.
    pub fn see(&mut self, timing: &Timing) {
        let skipped = self.last.as_ref().map_or(0, |last| (timing.deadline_ns - last.deadline_ns) / self.period_ns - 1);
        if skipped > 0 {
            let why = match &self.last {
                Some(last) if last.end_ns > last.deadline_ns => format!("tick {} took too long", last.tick),
                _ => "the thread was not woken".to_owned(),
            };
            self.found.skipped += skipped.cast_unsigned();
            self.note(skipped * self.period_ns, timing, why);
        }
        let late_ns = timing.end_ns - timing.deadline_ns;
        if late_ns > 0 {
            self.found.late += 1;
            self.note(late_ns, timing, why_late(timing, self.period_ns));
        }
        self.last = Some(timing.clone());
    }

    fn note(&mut self, late_ns: i64, timing: &Timing, why: String) {
        if self.found.worst.as_ref().is_none_or(|(worst, ..)| late_ns > *worst) {
            self.found.worst = Some((late_ns, timing.t_ns, timing.tick, why));
        }
    }

    /// What there is to tell, if it is time or the end: time and number of the worst tick, and the sentence.
    pub fn tell(&mut self, at_end: bool) -> Option<(i64, i64, String)> {
        let now_ns = self.last.as_ref()?.t_ns;
        if now_ns < self.next_word_ns && !at_end {
            return None;
        }
        let Found { late, skipped, worst } = std::mem::take(&mut self.found);
        let (late_ns, t_ns, tick, why) = worst?;
        self.next_word_ns = now_ns + EVERY_NS;
        let text = format!(
            "{} missed: {late} late, {skipped} left out; worst by {} us at tick {tick}: {why}",
            if late + skipped == 1 { "1 deadline".to_owned() } else { format!("{} deadlines", late + skipped) },
            late_ns / 1000
        );
        Some((t_ns, tick, text))
    }
}

/// What took the time of a late tick: its wake-up, what was before the first stage, or a stage.
fn why_late(timing: &Timing, period_ns: i64) -> String {
    let Timing { wake_ns, start_ns, end_ns, deadline_ns, stage_ns, .. } = timing;
    let due_ns = deadline_ns - period_ns;
    let mut parts =
        vec![("woken late".to_owned(), wake_ns - due_ns), ("receiving was long".to_owned(), start_ns - wake_ns)];
    for stage in Stage::ALL {
        parts.push((format!("stage {} was long", stage.name()), stage_ns[stage as usize]));
    }
    parts.push(("sending was long".to_owned(), end_ns - start_ns - stage_ns.iter().sum::<i64>()));
    let (what, ns) = parts.into_iter().max_by_key(|(_, ns)| *ns).expect("there are several");
    format!("{what}, {} us", ns / 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    const US: i64 = 1000;

    /// A tick that is due at `due` µs, woken and done so many µs later, most of it in the solver.
    fn timing(tick: i64, due: i64, woken: i64, done: i64) -> Timing {
        let t = |us: i64| (1_000_000 + due + us) * US;
        let mut stage_ns = [US; 6];
        stage_ns[Stage::Qp as usize] = (done - woken - 6) * US;
        let (wake_ns, start_ns, end_ns) = (t(woken), t(woken), t(done));
        Timing { t_ns: wake_ns, tick, wall_ns: 0, wake_ns, start_ns, end_ns, deadline_ns: t(1000), stage_ns }
    }

    fn told(ticks: &[Timing]) -> Option<String> {
        let mut lateness = Lateness::new(1_000_000);
        ticks.iter().for_each(|tick| lateness.see(tick));
        lateness.tell(false).map(|(_, _, text)| text)
    }

    #[test]
    fn ticks_in_time_say_nothing() {
        assert_eq!(told(&[timing(0, 0, 10, 40), timing(1, 1000, 10, 999), timing(2, 2000, 10, 40)]), None);
    }

    #[test]
    fn a_late_tick_is_told_with_what_took_its_time() {
        assert_eq!(
            told(&[timing(0, 0, 10, 40), timing(1, 1000, 700, 1015)]).unwrap(),
            "1 deadline missed: 1 late, 0 left out; worst by 15 us at tick 1: woken late, 700 us"
        );
        assert_eq!(
            told(&[timing(0, 0, 10, 1300), timing(1, 2000, 10, 40)]).unwrap(),
            "2 deadlines missed: 1 late, 1 left out; worst by 1000 us at tick 1: tick 0 took too long"
        );
        assert_eq!(
            told(&[timing(0, 0, 10, 1300)]).unwrap(),
            "1 deadline missed: 1 late, 0 left out; worst by 300 us at tick 0: stage qp was long, 1284 us"
        );
        assert_eq!(
            told(&[timing(0, 0, 10, 40), timing(1, 4000, 10, 40)]).unwrap(),
            "3 deadlines missed: 0 late, 3 left out; worst by 3000 us at tick 1: the thread was not woken"
        );
    }

    #[test]
    fn there_is_at_most_one_sentence_a_second_and_one_at_the_end() {
        let mut lateness = Lateness::new(1_000_000);
        let mut words = 0;
        for tick in 0..2500 {
            lateness.see(&timing(tick, tick * 2000, 10, 1500));
            words += i64::from(lateness.tell(false).is_some());
        }
        assert_eq!(words, 5);
        let (_, tick, text) = lateness.tell(true).unwrap();
        assert!(tick > 2000 && text.contains("deadlines missed"), "{text}");
        assert_eq!(lateness.tell(true), None);
    }
}
