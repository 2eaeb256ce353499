//! A6: touchdown detection on floors that drop and rise, with false contact forces during the swing.

use super::shared::falls;
use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;
use analysis::run::Tick;
use analysis::stats::Distribution;
use lcmtypes::LegState;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A6",
    title: "touchdown detection on floors that drop and rise, with false contact forces",
    published: "threshold 50 N along the terrain normal, ignored in the first half of the swing",
    robot: "hyq",
    seeds: 1,
    minutes: 1.0,
    run,
};

/// Landings of a log, as far as its metrics do not contain them.
#[derive(Default)]
struct Landings {
    /// Downward speed of a foot at its first contact in the second half of a swing, m/s.
    speed: Vec<f64>,
    /// Swings in whose first half a contact was detected that did not exist.
    felt_in_swing_up: usize,
    /// Swings that ended in their first half.
    landed_in_swing_up: usize,
}

/// Judges the median delay (below 10 ms), touchdowns without contact, and touchdowns in the first half of a swing.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let scenarios = ["flat_trot", "rough_trot", "moving_floor", "moving_floor_crawl"];
    let samples = bench.all_with("touchdowns", scenarios.map(RunSpec::of).to_vec(), landings)?;
    let mut rows = vec![falls("", &samples)];
    for (scenario, sample) in scenarios.iter().zip(&samples) {
        let (touchdowns, landings) = (sample.metrics.contact.as_ref().map(|of| &of.touchdowns), &sample.measured);
        let row = |what: &str, value, unit| Row::info(format!("{scenario}: {what}"), value, unit);
        let counted = |n: Option<u64>| n.and_then(|n| usize::try_from(n).ok()).map_or(f64::NAN, count);
        let delays = touchdowns.and_then(|of| of.delay_ms.as_ref());
        let delay = |p: fn(&Distribution) -> f64| delays.map_or(f64::NAN, p);
        rows.push(row("touchdowns", counted(touchdowns.map(|of| of.count)), ""));
        rows.push(row("delay, median", delay(|d| d.p50), "ms").at_most(10.0));
        rows.push(row("delay, p99", delay(|d| d.p99), "ms"));
        rows.push(row("false touchdowns", counted(touchdowns.map(|of| of.false_count)), "").exactly(0.0));
        rows.push(row("swings with a false contact in swing-up", count(landings.felt_in_swing_up), ""));
        rows.push(row("touchdowns in swing-up", count(landings.landed_in_swing_up), "").exactly(0.0));
        let speed = Distribution::of(landings.speed.iter().copied()).map_or(f64::NAN, |d| d.p50);
        rows.push(row("foot's downward speed at contact, median", speed, "m/s"));
    }
    Ok(rows)
}

fn landings(run: &Run) -> Landings {
    let mut all = Landings::default();
    for leg in 0..4 {
        let (mut felt, mut touched) = (false, false);
        for window in run.ticks.windows(3) {
            let [old, before, now] = window else { continue };
            let (Some(was), Some(is)) = (state(before, leg), state(now, leg)) else { continue };
            match is {
                LegState::STATE_SWING_UP => {
                    let truth = now.truth.as_ref().is_some_and(|truth| truth.contact[leg]);
                    felt |= !truth && now.contact.as_ref().is_some_and(|found| found.contact[leg]);
                    touched = false;
                }
                LegState::STATE_SWING_DOWN | LegState::STATE_REACH => {
                    let touches = now.truth.as_ref().is_some_and(|truth| truth.contact[leg]);
                    if touches && !touched {
                        let z = |tick: &Tick| tick.truth.as_ref().map(|truth| truth.p_WF[leg][2]);
                        all.speed.extend(z(old).zip(z(before)).map(|(z0, z1)| (z0 - z1) / run.period_s()));
                    }
                    touched |= touches;
                }
                _ => {}
            }
            let swing_up_ends = was == LegState::STATE_SWING_UP && is != LegState::STATE_SWING_UP;
            if swing_up_ends {
                all.felt_in_swing_up += usize::from(felt);
                all.landed_in_swing_up += usize::from(is == LegState::STATE_STANCE);
                felt = false;
            }
        }
    }
    all
}

/// State of a leg, a constant of [`LegState`].
pub(super) fn state(tick: &Tick, leg: usize) -> Option<i8> {
    tick.legs.as_ref().map(|legs| legs.state[leg])
}
