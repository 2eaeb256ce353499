//! Tasks of the paper that are not in the default stack: tracking, contact forces, falls and time of a tick, beside the default.

use super::shared::falls;
use super::solve_time;
use crate::bench::{Bench, RunSpec, mean};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::states::States;
use analysis::Run;
use analysis::stats::Distribution;
use analysis::table::{Column, Table};
use analysis::tables::{TrackingRow, tracking_rows};
use controller::stack::{Basis, S1};
use controller::tasks::force::net_wrench;
use nalgebra::Vector3;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "tasks",
    title: "A2 with the tasks of the paper that are not in the default stack",
    published: "no number; sections 2.2, 4.1 and 6, Table 3 for the tracking",
    robot: "hyq",
    seeds: 3,
    minutes: 6.0,
    run,
};

/// A stack to compare: its name, its tasks, and parameters.
struct Variant {
    name: &'static str,
    tasks: &'static str,
    set: &'static [(&'static str, &'static str)],
}

/// The default stack first.
const VARIANTS: &[Variant] = &[
    Variant { name: "default", tasks: "1e6 contact + 1e3 trunk + posture", set: &[] },
    Variant {
        name: "Cartesian swing",
        tasks: "1e6 contact + 1e3 trunk + swing + posture",
        set: &[
            ("swing.inertia", "false"),
            ("swing.kp", "[1200.0, 1200.0, 1200.0]"),
            ("swing.kd", "[60.0, 60.0, 60.0]"),
        ],
    },
    Variant {
        name: "Cartesian swing with inertia",
        tasks: "1e6 contact + 1e3 trunk + swing + posture",
        set: &[("swing.inertia", "true")],
    },
    Variant { name: "cone center", tasks: "1e6 contact + 1e3 trunk + posture + 1e-3 cone_center", set: &[] },
    Variant { name: "internal forces", tasks: "1e6 contact + 1e3 trunk + posture + 0.1 internal_forces", set: &[] },
    Variant { name: "relative feet", tasks: "1e6 relative_feet + 1e3 trunk + posture", set: &[] },
];

/// What a log of a variant shows.
#[derive(Default)]
struct Measured {
    /// Distance of a swinging foot from its reference, m.
    foot_error: Vec<f64>,
    /// Tangential divided by normal force of a standing foot with more than [`LOADED`].
    ratio: Vec<f64>,
    /// Norm of the forces without net force and moment, N.
    internal: Vec<f64>,
    /// Speed of a standing foot along the ground, m/s.
    slip: Vec<f64>,
}

/// Smallest vertical force of a foot whose force ratio is measured, N.
const LOADED: f64 = 50.0;

/// Measurements of all runs of a variant.
struct Outcome {
    name: &'static str,
    tracking: f64,
    foot: Option<Distribution>,
    tick: Option<Distribution>,
    ratio: Option<Distribution>,
    internal: Option<Distribution>,
    slip: Option<Distribution>,
}

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let trot = bench.one(RunSpec::of("flat_trot"))?;
    let states = States::read(&trot.log)?;
    let (mut rows, mut outcomes) = (Vec::new(), Vec::new());
    for variant in VARIANTS {
        let (falls, outcome) = outcome(bench, &states, variant)?;
        rows.push(falls);
        outcomes.push(outcome);
    }
    let Some(default) = outcomes.first() else { return Ok(rows) };
    for o in &outcomes {
        let row = |what: &str, value, unit| Row::info(format!("{}: {what}", o.name), value, unit);
        rows.push(row("tracking in A2, rms / that of Table 3, mean", o.tracking, "").published(1.0).at_most(1.0));
        let of = |of: &Option<Distribution>, value: fn(&Distribution) -> f64| of.as_ref().map_or(f64::NAN, value);
        rows.push(row("swing-foot error, mean", 1e3 * of(&o.foot, |d| d.mean), "mm"));
        rows.push(row("swing-foot error, p99", 1e3 * of(&o.foot, |d| d.p99), "mm"));
        let ratio = of(&o.ratio, |d| d.mean);
        let judged = row("tangential / normal force in A2, mean", ratio, "");
        rows.push(if o.name == "cone center" { judged.at_most(of(&default.ratio, |d| d.mean)) } else { judged });
        rows.push(row("tangential / normal force in A2, p99", of(&o.ratio, |d| d.p99), ""));
        let judged = row("internal force in A2, mean", of(&o.internal, |d| d.mean), "N");
        rows.push(if o.name == "internal forces" { judged.at_most(of(&default.internal, |d| d.mean)) } else { judged });
        rows.push(row("speed of a standing foot in A2, mean", 1e3 * of(&o.slip, |d| d.mean), "mm/s"));
        rows.push(row("whole tick, median", of(&o.tick, |d| d.p50), "us"));
        let ratio = of(&o.tick, |d| d.p50) / of(&default.tick, |d| d.p50);
        rows.push(row("whole tick, median / that of the default", ratio, "").at_most(2.0));
    }
    let mut table = Table::new([Column::left("stack"), Column::left("tasks"), Column::left("parameters")]);
    for Variant { name, tasks, set } in VARIANTS {
        let set: Vec<String> = set.iter().map(|(key, value)| format!("{key}={value}")).collect();
        table.row([(*name).to_owned(), (*tasks).to_owned(), set.join(" ")]);
    }
    bench.note(table.to_string());
    Ok(rows)
}

/// The default stack with the tasks of a variant.
fn formula(tasks: &str) -> String {
    let constraints = S1.split_once("<<").map_or("", |(_, constraints)| constraints);
    format!("{tasks} <<{constraints}")
}

/// A2 and rough terrain, and the time of a tick on the states of a trot.
fn outcome(bench: &Bench, states: &States, variant: &Variant) -> anyhow::Result<(Row, Outcome)> {
    let Variant { name, tasks, set } = variant;
    let formula = formula(tasks);
    let change = |scenario: &str| {
        let label: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let spec = RunSpec::of(scenario).named(format!("{scenario}_{label}")).set("stack.formula", &formula);
        set.iter().fold(spec, |spec, (key, value)| spec.set(key, value)).discard_log()
    };
    let mut specs = vec![change("base_motion")];
    specs.extend(bench.seeds().map(|seed| change("rough_track").seed(seed)));
    let samples = bench.all_with(name, specs, measure)?;
    let flat = &samples[0];
    let times = solve_time::time(bench, states, name, &formula, set)?;
    let outcome = Outcome {
        name,
        tracking: if flat.failed() {
            f64::NAN
        } else {
            mean(tracking_rows(&flat.metrics).iter().filter_map(TrackingRow::rms_ratio))
        },
        foot: Distribution::of(flat.measured.foot_error.iter().copied()),
        tick: times.tick,
        ratio: Distribution::of(flat.measured.ratio.iter().copied()),
        internal: Distribution::of(flat.measured.internal.iter().copied()),
        slip: Distribution::of(flat.measured.slip.iter().copied()),
    };
    Ok((falls(&format!("{name}: "), &samples), outcome))
}

fn measure(run: &Run) -> Measured {
    let (mut measured, mut net) = (Measured::default(), Basis::new(12, 6));
    for tick in run.ticks.iter().filter(|tick| tick.balances()) {
        let (Some(truth), Some(legs)) = (&tick.truth, &tick.legs) else { continue };
        for leg in (0..4).filter(|leg| tick.swings(*leg)) {
            let (des, is) = (legs.p_BF_H_des[leg], truth.p_BF_H(leg));
            measured.foot_error.push((0..3).map(|k| (des[k] - is[k]) * (des[k] - is[k])).sum::<f64>().sqrt());
        }
        let stands = |leg: usize| tick.stands(leg) == Some(true) && truth.f_F_W[leg][2] > LOADED;
        for leg in (0..4).filter(|leg| stands(*leg)) {
            let [x, y, z] = truth.f_F_W[leg];
            measured.ratio.push(x.hypot(y) / z);
            measured.slip.extend(truth.slip_speed(leg));
        }
        let feet = [0, 1, 2, 3].map(|leg| stands(leg).then(|| Vector3::from(truth.p_WF[leg])));
        net_wrench(&mut net, &[3; 4], &feet);
        let mut forces: Vec<f64> =
            (0..12).map(|i| if feet[i / 3].is_some() { truth.f_F_W[i / 3][i % 3] } else { 0.0 }).collect();
        for row in 0..6 {
            let along: f64 = (0..12).map(|i| net.at(row, i) * forces[i]).sum();
            forces.iter_mut().enumerate().for_each(|(i, f)| *f -= along * net.at(row, i));
        }
        measured.internal.push(forces.iter().map(|f| f * f).sum::<f64>().sqrt());
    }
    measured
}
