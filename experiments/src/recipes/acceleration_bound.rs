//! A11: bound of the joint accelerations, and overshoot of the foot at the end of a swing.

use super::touchdown::state;
use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;
use analysis::figures::Curves;
use analysis::stats::Distribution;
use lcmtypes::LegState;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A11",
    title: "bound of the joint accelerations and overshoot of the foot at touchdown, with lagging drives",
    published: "500 rad/s2; too low a bound overshoots",
    robot: "hyq",
    seeds: 1,
    minutes: 1.0,
    run,
};

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let bounds = [50.0, 100.0, 150.0, 200.0, 300.0, 500.0];
    let spec = |bound: f64| {
        let spec = RunSpec::of("flat_trot").named(format!("bound_{bound}")).with("drives", "{ lag_s = 0.005 }");
        spec.set("wbc.qdd_max", format!("{bound:.1}"))
    };
    let samples = bench.all_with("bounds", bounds.map(spec).to_vec(), overshoots)?;
    let mut rows = Vec::new();
    let [mut medians, mut highest] = [const { Vec::new() }; 2];
    for (bound, sample) in bounds.iter().zip(&samples) {
        let of = Distribution::of(sample.measured.iter().map(|metres| 1e3 * metres));
        let row = |what: &str, value, unit| Row::info(format!("{bound} rad/s2: {what}"), value, unit);
        let value = |p: fn(&Distribution) -> f64| of.as_ref().map_or(f64::NAN, p);
        rows.push(row("overshoot, median", value(|d| d.p50), "mm"));
        rows.push(row("overshoot, p99", value(|d| d.p99), "mm"));
        rows.push(row("fell", count(usize::from(sample.failed())), ""));
        medians.push((*bound, value(|d| d.p50)));
        highest.push((*bound, value(|d| d.p99)));
    }
    let of = |point: Option<&(f64, f64)>| point.map_or(f64::NAN, |point| point.1);
    let gain = of(medians.first()) - of(medians.last());
    rows.push(Row::info("overshoot at 50 less that at 500 rad/s2, median", gain, "mm").at_least(0.0));
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

/// For each swing, the largest distance of the foot below its reference while the reference descends and the foot has no contact, m.
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
