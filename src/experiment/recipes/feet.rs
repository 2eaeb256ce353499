//! A6, A11: what feet do at the end of a swing.

use super::falls;
use crate::experiment::bench::{Bench, Spec, count};
use crate::experiment::table::Row;
use analysis::Run;
use analysis::figures::Curves;
use analysis::run::Tick;
use analysis::stats::Distribution;
use lcmtypes::LegState;

/// What a log says of landings besides its metrics.
#[derive(Default)]
struct Landings {
    /// Downward speed of a foot at its first contact in the second half of a swing, m/s.
    speed: Vec<f64>,
    /// Swings in whose first half a contact was felt that was none.
    felt_in_swing_up: usize,
    /// Of these, swings that ended in the first half.
    landed_in_swing_up: usize,
}

/// Median delay below 10 ms, no touchdown without contact, none in the first half of a swing.
pub fn touchdown(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let scenarios = ["flat_trot", "rough_trot", "moving_floor"];
    let samples = bench.all_with("touchdowns", scenarios.map(Spec::of).to_vec(), landings)?;
    let mut rows = vec![falls("", &samples)];
    for (scenario, sample) in scenarios.iter().zip(&samples) {
        let Some(contact) = &sample.metrics.contact else { continue };
        let (of, found) = (&contact.touchdowns, &sample.found);
        let noted = |what: &str, value, unit| Row::noted(format!("{scenario}: {what}"), value, unit);
        rows.push(noted("touchdowns", count(usize::try_from(of.count)?), ""));
        let delay = |p: fn(&Distribution) -> f64| of.delay_ms.as_ref().map_or(f64::NAN, p);
        rows.push(noted("delay, median", delay(|d| d.p50), "ms").at_most(10.0));
        rows.push(noted("delay, p99", delay(|d| d.p99), "ms"));
        rows.push(noted("false touchdowns", count(usize::try_from(of.false_count)?), "").exactly(0.0));
        rows.push(noted("swings with a false contact in swing-up", count(found.felt_in_swing_up), ""));
        rows.push(noted("touchdowns in swing-up", count(found.landed_in_swing_up), "").exactly(0.0));
        let speed = Distribution::of(found.speed.iter().copied()).map_or(f64::NAN, |d| d.p50);
        rows.push(noted("foot's downward speed at contact, median", speed, "m/s"));
    }
    Ok(rows)
}

fn landings(run: &Run) -> Landings {
    let mut all = Landings::default();
    for leg in 0..4 {
        let (mut felt, mut touched) = (false, false);
        for pair in run.ticks.windows(3) {
            let [old, before, now] = pair else { continue };
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
            let ends_up = was == LegState::STATE_SWING_UP && is != LegState::STATE_SWING_UP;
            if ends_up {
                all.felt_in_swing_up += usize::from(felt);
                all.landed_in_swing_up += usize::from(is == LegState::STATE_STANCE);
                felt = false;
            }
        }
    }
    all
}

fn state(tick: &Tick, leg: usize) -> Option<i8> {
    tick.legs.as_ref().map(|legs| legs.state[leg])
}

/// How far the foot is below its reference at most, in the second half of a swing.
pub fn acceleration_bound(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let bounds = [50.0, 100.0, 150.0, 200.0, 300.0, 500.0];
    let spec = |bound: f64| {
        let spec = Spec::of("flat_trot").named(format!("bound_{bound}")).with("drives", "{ lag_s = 0.005 }");
        spec.set("wbc.qdd_max", format!("{bound:.1}"))
    };
    let samples = bench.all_with("bounds", bounds.map(spec).to_vec(), overshoots)?;
    let mut rows = Vec::new();
    let [mut medians, mut highest] = [const { Vec::new() }; 2];
    for (bound, sample) in bounds.iter().zip(&samples) {
        let of = Distribution::of(sample.found.iter().map(|metres| 1e3 * metres));
        let noted = |what: &str, value, unit| Row::noted(format!("{bound} rad/s2: {what}"), value, unit);
        let value = |p: fn(&Distribution) -> f64| of.as_ref().map_or(f64::NAN, p);
        rows.push(noted("overshoot, median", value(|d| d.p50), "mm"));
        rows.push(noted("overshoot, p99", value(|d| d.p99), "mm"));
        rows.push(noted("fell", count(usize::from(sample.failed())), ""));
        medians.push((*bound, value(|d| d.p50)));
        highest.push((*bound, value(|d| d.p99)));
    }
    let (Some(lowest), Some(tuned)) = (medians.first(), medians.last()) else { return Ok(rows) };
    let gain = lowest.1 - tuned.1;
    rows.push(Row::noted("overshoot at 50 less that at 500 rad/s2, median", gain, "mm").at_least(0.0));
    let curves = Curves {
        x: "bound of the joint accelerations [rad/s\u{b2}]".to_owned(),
        y: "overshoot [mm]".to_owned(),
        logarithmic: false,
        series: vec![("median of the swings".to_owned(), medians), ("99th percentile".to_owned(), highest)],
        limit: None,
    };
    bench.write(&curves.figure("overshoot"))?;
    Ok(rows)
}

/// Of each swing, the largest distance of a foot below its reference while it goes down, m.
fn overshoots(run: &Run) -> Vec<f64> {
    let mut largest = Vec::new();
    for leg in 0..4 {
        let mut swing: Option<f64> = None;
        for tick in run.ticks.iter().filter(|tick| tick.balances()) {
            if state(tick, leg) == Some(LegState::STATE_SWING_DOWN) {
                let below = tick.legs.as_ref().zip(tick.truth.as_ref()).map(|(legs, truth)| {
                    let flies = !truth.contact[leg];
                    if flies { legs.p_BF_H_des[leg][2] - truth.p_BF_H(leg)[2] } else { 0.0 }
                });
                swing = below.map(|below| swing.map_or(below, |most| most.max(below))).or(swing);
            } else {
                largest.extend(swing.take());
            }
        }
    }
    largest
}
