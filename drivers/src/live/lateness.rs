//! Late and skipped ticks, summarized in at most one sentence per second.

use lcmtypes::Timing;

/// Shortest time between two reports, ns.
const EVERY_NS: i64 = 1_000_000_000;

/// Evaluates the TIMING of a run.
#[derive(Debug)]
pub struct Lateness {
    period_ns: i64,
    /// Names of the stages.
    stages: Vec<String>,
    last: Option<Timing>,
    next_report_ns: i64,
    unreported: Unreported,
}

/// Late and skipped ticks since the last report.
#[derive(Debug, Default)]
struct Unreported {
    late: u64,
    skipped: u64,
    /// The tick with the largest delay.
    worst: Option<Worst>,
}

#[derive(Debug)]
struct Worst {
    delay_ns: i64,
    t_ns: i64,
    tick: i64,
    why: String,
}

impl Lateness {
    /// For ticks that are due every `period_ns`, with the names of their stages.
    pub fn new(period_ns: i64, stages: &[String]) -> Self {
        Lateness {
            period_ns,
            stages: stages.to_vec(),
            last: None,
            next_report_ns: i64::MIN,
            unreported: Unreported::default(),
        }
    }

    /// Takes the timing of the next tick.
    pub fn add(&mut self, timing: &Timing) {
        let skipped = self.last.as_ref().map_or(0, |last| (timing.deadline_ns - last.deadline_ns) / self.period_ns - 1);
        if skipped > 0 {
            let why = match &self.last {
                Some(last) if last.end_ns > last.deadline_ns => format!("tick {} took too long", last.tick),
                _ => "the thread was not scheduled".to_owned(),
            };
            self.unreported.skipped += skipped.cast_unsigned();
            self.note(skipped * self.period_ns, timing, why);
        }
        let late_ns = timing.end_ns - timing.deadline_ns;
        if late_ns > 0 {
            self.unreported.late += 1;
            self.note(late_ns, timing, longest_part(timing, self.period_ns, &self.stages));
        }
        self.last = Some(timing.clone());
    }

    fn note(&mut self, delay_ns: i64, timing: &Timing, why: String) {
        if self.unreported.worst.as_ref().is_none_or(|worst| delay_ns > worst.delay_ns) {
            self.unreported.worst = Some(Worst { delay_ns, t_ns: timing.t_ns, tick: timing.tick, why });
        }
    }

    /// Time and tick of the worst delay, and a sentence, if ticks were late or skipped since the last report and a second has passed.
    /// `at_end`: report without waiting.
    pub fn report(&mut self, at_end: bool) -> Option<(i64, i64, String)> {
        let now_ns = self.last.as_ref()?.t_ns;
        if now_ns < self.next_report_ns && !at_end {
            return None;
        }
        let Unreported { late, skipped, worst } = std::mem::take(&mut self.unreported);
        let Worst { delay_ns, t_ns, tick, why } = worst?;
        self.next_report_ns = now_ns + EVERY_NS;
        let text = format!(
            "{} missed: {late} late, {skipped} skipped; largest delay {} us at tick {tick}: {why}",
            if late + skipped == 1 { "1 deadline".to_owned() } else { format!("{} deadlines", late + skipped) },
            delay_ns / 1000
        );
        Some((t_ns, tick, text))
    }
}

/// The part of a late tick that took longest: its wake-up, receiving, a stage, or sending.
fn longest_part(timing: &Timing, period_ns: i64, stages: &[String]) -> String {
    let Timing { wake_ns, start_ns, end_ns, deadline_ns, stage_ns, .. } = timing;
    let due_ns = deadline_ns - period_ns;
    let mut parts = vec![("wake-up".to_owned(), wake_ns - due_ns), ("receiving".to_owned(), start_ns - wake_ns)];
    parts.extend(stages.iter().zip(stage_ns).map(|(stage, ns)| (format!("stage {stage}"), *ns)));
    parts.push(("sending".to_owned(), end_ns - start_ns - stage_ns.iter().sum::<i64>()));
    let (what, ns) = parts.into_iter().max_by_key(|(_, ns)| *ns).expect("there are several parts");
    format!("{what} took {} us", ns / 1000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::channels::Stage;

    fn lateness() -> Lateness {
        Lateness::new(1_000_000, &Stage::NAMES.map(str::to_owned))
    }

    const US: i64 = 1000;

    /// A tick that is due at `due` µs; it wakes and ends so many µs later, with most of the time in the solver.
    fn timing(tick: i64, due: i64, woken: i64, done: i64) -> Timing {
        let t = |us: i64| (1_000_000 + due + us) * US;
        let mut stage_ns = vec![US; Stage::ALL.len()];
        stage_ns[Stage::Qp as usize] = (done - woken - 6) * US;
        let (wake_ns, start_ns, end_ns) = (t(woken), t(woken), t(done));
        let (deadline_ns, n_stages) = (t(1000), 6);
        Timing { t_ns: wake_ns, tick, wall_ns: 0, wake_ns, start_ns, end_ns, deadline_ns, n_stages, stage_ns }
    }

    /// Late ticks, skipped ticks, delay in us and tick of the worst delay, and whether the reason contains `why`.
    fn check(ticks: &[Timing], counts: Option<(u64, u64, i64, i64)>, why: &str) {
        let mut lateness = self::lateness();
        ticks.iter().for_each(|tick| lateness.add(tick));
        let Unreported { late, skipped, worst } = &lateness.unreported;
        let found = worst.as_ref().map(|worst| (*late, *skipped, worst.delay_ns / US, worst.tick));
        assert_eq!(found, counts);
        assert!(worst.as_ref().is_none_or(|worst| worst.why.contains(why)), "{worst:?}");
        assert_eq!(lateness.report(false).map(|(_, tick, _)| tick), counts.map(|(.., tick)| tick));
    }

    #[test]
    fn ticks_in_time_are_not_reported() {
        check(&[timing(0, 0, 10, 40), timing(1, 1000, 10, 999), timing(2, 2000, 10, 40)], None, "");
    }

    #[test]
    fn a_late_tick_is_reported_with_its_longest_part() {
        check(&[timing(0, 0, 10, 40), timing(1, 1000, 700, 1015)], Some((1, 0, 15, 1)), "wake-up took 700 us");
        check(&[timing(0, 0, 10, 1300), timing(1, 2000, 10, 40)], Some((1, 1, 1000, 1)), "tick 0");
        check(&[timing(0, 0, 10, 1300)], Some((1, 0, 300, 0)), "qp took 1284 us");
        check(&[timing(0, 0, 10, 40), timing(1, 4000, 10, 40)], Some((0, 3, 3000, 1)), "not scheduled");
    }

    #[test]
    fn there_is_at_most_one_report_per_second_and_one_at_the_end() {
        let mut lateness = self::lateness();
        let mut reports = 0;
        for tick in 0..2500 {
            lateness.add(&timing(tick, tick * 2000, 10, 1500));
            reports += i64::from(lateness.report(false).is_some());
        }
        assert_eq!(reports, 5);
        let (_, tick, _) = lateness.report(true).unwrap();
        assert!(tick > 2000, "{tick}");
        assert_eq!(lateness.report(true), None);
    }
}
