//! The controller as the paper prints it beside ours, and the effect of each departure.

use super::residual_load::opposite_loads;
use super::sensor_noise::orientation_errors;
use super::shared::{PRINTED, falls, parameters, speed};
use super::{base_motion, rough_terrain};
use crate::bench::{Bench, RunSpec, Sample, count, mean};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::figures::Bars;
use analysis::stats::ErrorStats;
use analysis::table::{Column, Table};
use analysis::tables::tracking_rows;
use std::collections::BTreeMap;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "raiola_as_printed",
    title: "A2, A3, A5 and A12 with the controller as printed and with ours, and with each departure added alone and removed alone",
    published: "Table 3; orientation error 0.0101 rad in the mean, 0.0102 rad std; no falls; minimum force 20 N",
    robot: "hyq",
    seeds: 10,
    minutes: 25.0,
    run,
};

/// Number of seeds of each variant of the ablation.
const ABLATION_SEEDS: i64 = 3;

/// Parameters in which our controller departs from the printed one, for one reason.
struct Departure {
    name: &'static str,
    keys: &'static [&'static str],
}

const DEPARTURES: &[Departure] = &[
    Departure { name: "trot at 4 Hz", keys: &["gait.trot.swing_frequency"] },
    Departure { name: "crawl at 3 Hz, duty 0.88", keys: &["gait.crawl.duty", "gait.crawl.swing_frequency"] },
    Departure { name: "sway of the crawl", keys: &["gait.crawl.sway"] },
    Departure { name: "step of half a stance", keys: &["foothold.step_rule"] },
    Departure { name: "frozen foothold", keys: &["foothold.freeze_fraction"] },
    Departure { name: "speed trim", keys: &["foothold.speed_trim_gain"] },
    Departure { name: "swing from rest", keys: &["swing.start_from_rest"] },
    Departure { name: "inertia in contact forces", keys: &["contact.inertia_compensation"] },
    Departure { name: "capture point", keys: &["recovery.capture_point"] },
    Departure { name: "search after lost contact", keys: &["recovery.lost_contact_time"] },
    Departure { name: "slow height integral", keys: &["trunk.height_gain"] },
    Departure { name: "stance damping", keys: &["posture.stance_kd"] },
    Departure {
        name: "stance sweep",
        keys: &["posture.stance_sweep", "posture.blend_time_constant", "posture.max_stance_lead"],
    },
    Departure { name: "feed-forward", keys: &["posture.feed_forward"] },
    Departure { name: "friction margin", keys: &["wbc.friction"] },
    Departure { name: "torque limits", keys: &["stack.formula"] },
];

/// A controller to compare: its name, and how it changes a run.
struct Variant<'a> {
    name: String,
    change: Box<dyn Fn(RunSpec) -> RunSpec + 'a>,
}

impl<'a> Variant<'a> {
    /// The printed controller or ours, with the values of `from` for the keys of a departure.
    fn new(printed: bool, departure: Option<(&'a Departure, &'a BTreeMap<String, String>)>) -> Self {
        let base = if printed { "printed" } else { "ours" };
        let name = match departure {
            Some((departure, _)) => format!("{base} {} {}", if printed { "with" } else { "without" }, departure.name),
            None => base.to_owned(),
        };
        let label: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let change = move |spec: RunSpec| {
            let named = format!("{}_{label}", spec.name);
            let mut spec = spec.named(named);
            if printed {
                spec = spec.preset(PRINTED);
            }
            if let Some((departure, from)) = departure {
                for key in departure.keys {
                    spec = spec.set(key, &from[*key]);
                }
            }
            spec
        };
        Variant { name, change: Box::new(change) }
    }
}

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for printed in [true, false] {
        rows.extend(of_the_paper(bench, &Variant::new(printed, None))?);
    }
    rows.extend(walk_at_2_hz(bench)?);
    rows.extend(ablation(bench)?);
    Ok(rows)
}

/// A2, A3, A5 and A12 of one controller, judged by the published values.
fn of_the_paper(bench: &Bench, variant: &Variant) -> anyhow::Result<Vec<Row>> {
    let of = |what: &str| format!("{}, {what}: ", variant.name);
    let mut rows = base_motion::table3(bench, &of("A2"), &variant.change)?;
    let discarded = |spec: RunSpec| (variant.change)(spec).discard_log();
    rows.extend(rough_terrain::rough(bench, &of("A3"), &discarded)?);
    let specs = |scenario: &str| bench.seeds().map(|seed| discarded(RunSpec::of(scenario)).seed(seed)).collect();
    let trots = bench.all_with(&of("A5"), specs("noisy_trot"), orientation_errors)?;
    let error = |value: fn(&ErrorStats) -> f64| mean(trots.iter().filter_map(|s| s.measured.as_ref()).map(value));
    let row = |what: &str, value, limit| {
        Row::info(format!("{}{what}", of("A5")), value, "rad").published(limit).at_most(limit)
    };
    rows.push(row("orientation error, mean", error(|e| e.mean), 0.0101));
    rows.push(row("orientation error, std", error(|e| e.std), 0.0102));
    rows.push(falls(&of("A5"), &trots));
    let crawls = bench.all_with(&of("A12"), specs("noisy_crawl"), opposite_loads)?;
    let least = crawls.iter().flat_map(|s| s.measured.iter().copied()).fold(f64::NAN, f64::min);
    rows.push(Row::info(format!("{}least opposite force", of("A12")), least, "N").published(20.0).at_least(20.0));
    rows.push(falls(&of("A12"), &crawls));
    Ok(rows)
}

/// The fewest departures with which swings at 2 Hz walk at the commanded speed. With none the robot falls at 0.2 m/s in 6 s, because eq. (19) moves the
/// footholds by 1.6 times the distance of the base until mid-stance. With the step rule alone it does not fall, and walks at a quarter of the command;
/// the sweep and the gain make up for the speed.
const AT_2_HZ: [(&str, &str); 3] =
    [("foothold.step_rule", "\"half_stance\""), ("posture.stance_sweep", "true"), ("gait.trot.velocity_gain", "1.5")];

/// Swings at 2 Hz with the printed controller and [`AT_2_HZ`]: 60 s on flat ground at 0.2 m/s, with the noise and the drives of A5, and A5 itself.
fn walk_at_2_hz(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let operator =
        "[{ t_s = 0.0, mode = \"stand\", gait = \"trot\" }, { t_s = 1.0, mode = \"walk\" }, { t_s = 3.0, v_x = 0.2 }]";
    let of = |name: &str| {
        let spec = RunSpec::of("noisy_trot").named(name).preset(PRINTED).discard_log();
        AT_2_HZ.iter().fold(spec, |spec, (key, value)| spec.set(key, value))
    };
    let walk = of("walk_2_hz").with("operator", operator).with("push", "[]").with("duration_s", "63.0");
    let mut rows = Vec::new();
    for (name, spec) in [("trot at 2 Hz for 60 s", walk), ("A5 at 2 Hz", of("a5_2_hz"))] {
        let specs = bench.consecutive_seeds(10).map(|seed| spec.clone().seed(seed)).collect();
        let samples = bench.all_with(name, specs, orientation_errors)?;
        rows.push(falls(&format!("{name}: "), &samples));
        rows.extend(speed(&format!("{name}: "), &samples));
        let sideways = mean(samples.iter().filter_map(|s| s.metrics.locomotion.true_velocity).map(|v| v[1].abs()));
        // 5 % of the forward command; no sideways velocity is commanded.
        rows.push(Row::info(format!("{name}: true sideways speed, mean"), sideways, "m/s").at_most(0.01));
        let errors = || samples.iter().filter_map(|s| s.measured.as_ref());
        let row = |what, value| Row::info(format!("{name}: orientation error, {what}"), value, "rad");
        rows.push(row("mean", mean(errors().map(|e| e.mean))).published(0.0101).at_most(0.0101));
        rows.push(row("std", mean(errors().map(|e| e.std))).published(0.0102).at_most(0.0102));
    }
    let changes: Vec<String> = AT_2_HZ.iter().map(|(key, value)| format!("--set {key}={value}")).collect();
    bench.note(format!("trot at 2 Hz: --preset {PRINTED} {}", changes.join(" ")));
    Ok(rows)
}

/// What a variant of the ablation does: falls and safe states of all runs, tracking in A2, speed in A2 and A3.
struct Outcome {
    name: String,
    /// Runs that fail, of all runs, for A2, A3, A5, A12.
    failed: [(usize, usize); 4],
    /// Mean over roll, pitch, yaw, height and the feet of rms / published rms, in A2; NaN after a fall.
    tracking: f64,
    /// True divided by commanded forward speed, in the runs of A2 and A3 without a fall.
    speed: f64,
}

impl Outcome {
    fn failed_percent(&self) -> f64 {
        let (failed, all) = self.failed.iter().fold((0, 0), |(f, n), (failed, all)| (f + failed, n + all));
        100.0 * count(failed) / count(all)
    }
}

/// Every departure added alone to the printed controller and removed alone from ours.
fn ablation(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let (ours, printed) = (parameters(bench.robot(), None)?, parameters(bench.robot(), Some(PRINTED))?);
    let mut outcomes = Vec::new();
    for (is_printed, from) in [(true, &ours), (false, &printed)] {
        outcomes.push(outcome(bench, &Variant::new(is_printed, None))?);
        for departure in DEPARTURES {
            outcomes.push(outcome(bench, &Variant::new(is_printed, Some((departure, from))))?);
        }
    }
    let right = ["A2", "A3", "A5", "A12", "tracking", "speed"].map(Column::right);
    let mut table = Table::new([Column::left("controller")].into_iter().chain(right));
    for o in &outcomes {
        let falls = o.failed.map(|(failed, all)| format!("{failed}/{all}"));
        let cells =
            [o.tracking, o.speed].map(|value| if value.is_nan() { "-".to_owned() } else { format!("{value:.2}") });
        table.row([o.name.clone()].into_iter().chain(falls).chain(cells));
    }
    bench.note(format!(
        "Falls and safe states of all runs; tracking: rms in A2 divided by that of Table 3, mean of its rows; speed: true divided by commanded.\n{table}"
    ));
    let (with, without) = outcomes.split_at(1 + DEPARTURES.len());
    let names = std::iter::once("no departure").chain(DEPARTURES.iter().map(|d| d.name));
    let values = with.iter().zip(without).map(|(with, without)| vec![with.failed_percent(), without.failed_percent()]);
    let bars = Bars {
        label: "runs of A2, A3, A5 and A12 with a fall or safe state (%)".to_owned(),
        end: 100.0,
        series: vec!["added to the printed controller".to_owned(), "removed from ours".to_owned()],
        rows: names.map(str::to_owned).zip(values).collect(),
    };
    bench.write(&bars.figure("raiola_as_printed", "Effect of each departure"))?;
    let row = |o: &Outcome| Row::info(format!("{}: runs that fail", o.name), o.failed_percent(), "%");
    Ok(outcomes.iter().map(row).collect())
}

fn outcome(bench: &Bench, variant: &Variant) -> anyhow::Result<Outcome> {
    let spec = |scenario: &str| {
        let spec = (variant.change)(RunSpec::of(scenario)).discard_log();
        let name = format!("ablation_{}", spec.name);
        spec.named(name)
    };
    let seeds = |scenario: &'static str| bench.consecutive_seeds(ABLATION_SEEDS).map(move |seed| (scenario, seed));
    let mut specs = vec![spec("base_motion")];
    specs.extend(
        ["rough_track", "noisy_trot", "noisy_crawl"]
            .into_iter()
            .flat_map(seeds)
            .map(|(name, seed)| spec(name).seed(seed)),
    );
    let samples = bench.all(&variant.name, specs)?;
    let of = |range: std::ops::Range<usize>| {
        let of_scenario = &samples[range];
        (of_scenario.iter().filter(|s| s.failed()).count(), of_scenario.len())
    };
    let whole = |sample: &&Sample| !sample.failed();
    let tracking =
        samples[..1].iter().filter(whole).flat_map(|s| tracking_rows(&s.metrics)).filter_map(|row| row.rms_ratio());
    let speed = |s: &Sample| Some(s.metrics.locomotion.true_velocity?[0] / s.metrics.locomotion.commanded_velocity?[0]);
    Ok(Outcome {
        name: variant.name.clone(),
        failed: [of(0..1), of(1..4), of(4..7), of(7..10)],
        tracking: mean(tracking),
        speed: mean(samples[..4].iter().filter(whole).filter_map(speed)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_departures_are_exactly_the_parameters_that_are_not_printed() {
        let (ours, printed) = (parameters("hyq", None).unwrap(), parameters("hyq", Some(PRINTED)).unwrap());
        let differing: Vec<&str> = ours.keys().filter(|key| ours[*key] != printed[*key]).map(String::as_str).collect();
        let mut listed: Vec<&str> = DEPARTURES.iter().flat_map(|d| d.keys.iter().copied()).collect();
        listed.sort_unstable();
        assert_eq!(differing, listed);
    }
}
