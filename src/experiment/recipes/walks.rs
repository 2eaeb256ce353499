//! A2, A3, A4, A12: walks, and how they went.

use super::{falls, speed};
use crate::experiment::bench::{Bench, Spec, count, mean};
use crate::experiment::table::Row;
use crate::robot::RobotFiles;
use analysis::Run;
use analysis::figures::{FigureSpec, Kind, Named, draw};
use analysis::tables::tracking_rows;
use controller::stack::S1;
use std::collections::BTreeMap;

/// Every rms of the paper's Table 3, and its Figure 9.
pub fn base_motion(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    table3(bench, "")
}

fn table3(bench: &Bench, prefix: &str) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one_with(Spec::of("base_motion"), |run| {
        draw(&FigureSpec::new(Kind::Figure9), &[(Named("run".to_owned()), run)])
    })?;
    let mut rows = Vec::new();
    for row in tracking_rows(&sample.metrics) {
        let (Some(measured), Some(published)) = (row.measured, row.published) else { continue };
        let noted = |what, value| Row::noted(format!("{prefix}{}, {what}", row.name), value, row.unit);
        rows.push(noted("rms", measured.rms).published(published.rms()).at_most(published.rms()));
        rows.push(noted("mean |e|", measured.mean_abs).published(published.mean));
        rows.push(noted("std", measured.std).published(published.std));
    }
    if let Ok(figure) = &sample.found {
        bench.write(figure)?;
    }
    rows.push(falls(prefix, std::slice::from_ref(&sample)));
    rows.extend(speed(prefix, std::slice::from_ref(&sample)));
    Ok(rows)
}

/// No fall with any seed, and the speed that was asked for.
pub fn rough_terrain(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    rough(bench, "")
}

fn rough(bench: &Bench, prefix: &str) -> anyhow::Result<Vec<Row>> {
    let specs = bench.seeds().map(|seed| Spec::of("rough_track").seed(seed)).collect();
    let samples = bench.all("rough terrain", specs)?;
    let mut rows = vec![falls(prefix, &samples)];
    rows.push(Row::noted(format!("{prefix}way, mean"), mean(samples.iter().map(|s| s.summary.distance_m)), "m"));
    rows.extend(speed(prefix, &samples));
    let tilt = samples.iter().filter_map(|s| s.metrics.safety.max_tilt_rad).fold(0.0, f64::max);
    rows.push(Row::noted(format!("{prefix}largest tilt of any seed"), tilt, "rad"));
    Ok(rows)
}

/// A2 and A3, and what differs from HyQ in the parameters beside the robot's own names and posture.
pub fn port(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let (hyq, other) = (parameters("hyq")?, parameters(bench.robot())?);
    let differing: Vec<_> = hyq.iter().filter(|(key, value)| other.get(*key) != Some(value)).collect();
    let width = differing.iter().map(|(key, _)| key.len()).max().unwrap_or(0);
    let mut note = format!("{:<width$}  {:>10}  {:>10}", "parameters that differ", "hyq", bench.robot());
    for (key, value) in &differing {
        let value_there = other.get(*key).map_or("-", String::as_str);
        note += &format!("\n{key:<width$}  {value:>10}  {value_there:>10}");
    }
    bench.note(note);
    let mut rows = table3(bench, "A2: ")?;
    rows.extend(rough(bench, "A3: ")?);
    rows.extend(speeds(bench, "speed: ")?);
    rows.push(Row::noted("parameters that differ from HyQ's", count(differing.len()), ""));
    Ok(rows)
}

/// Every parameter but those of `[robot]`, by its dotted key.
fn parameters(robot: &str) -> anyhow::Result<BTreeMap<String, String>> {
    fn collect(prefix: &str, value: &toml::Value, into: &mut BTreeMap<String, String>) {
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    collect(&format!("{prefix}.{key}"), value, into);
                }
            }
            value => drop(into.insert(prefix.trim_start_matches('.').to_owned(), value.to_string())),
        }
    }
    let mut table: toml::Table = RobotFiles::find_with_params(robot)?.1.parse()?;
    table.remove("robot");
    let mut all = BTreeMap::new();
    collect("", &toml::Value::Table(table), &mut all);
    Ok(all)
}

/// Without terrain estimator and without the trunk's roll and pitch: the posture alone brings the base parallel to what the feet stand on.
pub fn posture_alone(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let spec = |scenario: &str| {
        let formula = S1.replace("trunk", "trunk[2]");
        let spec = Spec::of(scenario).named(format!("{scenario}_posture")).set("terrain.estimator", "false");
        spec.set("stack.formula", format!("{formula:?}"))
    };
    let scenarios = ["flat_trot", "flat_crawl", "base_motion", "slope", "rough_trot"];
    let samples = bench.all("posture alone", scenarios.map(spec).to_vec())?;
    let mut rows = Vec::new();
    for (scenario, sample) in scenarios.iter().zip(&samples) {
        rows.push(falls(&format!("{scenario}: "), std::slice::from_ref(sample)));
        // On a slope the base goes with the ground, which no reference knows.
        if *scenario != "slope" {
            for row in
                tracking_rows(&sample.metrics).into_iter().filter(|row| ["roll", "pitch"].contains(&row.name.as_str()))
            {
                let rms = row.measured.map_or(f64::NAN, |measured| measured.rms);
                rows.push(Row::noted(format!("{scenario}: {}, rms", row.name), rms, row.unit));
            }
        }
        if scenario.starts_with("flat") {
            rows.extend(speed(&format!("{scenario}: "), std::slice::from_ref(sample)));
        }
    }
    let tracks =
        bench.all("posture alone, rough", bench.seeds().map(|seed| spec("rough_track").seed(seed)).collect())?;
    rows.push(falls("rough_track: ", &tracks));
    Ok(rows)
}

/// Force on the leg opposite to the swing, and falls, with ramps and residual load and without, at two swing frequencies.
pub fn control_authority(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (on, label) in [(true, "ramps and residual load"), (false, "neither")] {
        for frequency in [2.0, 1.0] {
            let spec = |seed| {
                let mut spec =
                    Spec::of("noisy_crawl").named(format!("crawl_{frequency}_{}", if on { "on" } else { "off" }));
                spec = spec.set("gait.crawl.swing_frequency", format!("{frequency:.1}"));
                // A stride of 1 Hz swings takes 5 s, and the legs are no longer: half the speed.
                spec = spec.with("operator[2].v_x", if frequency < 1.5 { "0.04" } else { "0.08" });
                if !on {
                    spec = spec.set("gait.crawl.ramp", "0.0").set("gait.crawl.residual_load", "0.0");
                }
                spec.seed(seed)
            };
            let samples =
                bench.all_with(&format!("crawl, {label}"), bench.seeds().map(spec).collect(), opposite_loads)?;
            let mut loads: Vec<f64> = samples.iter().flat_map(|s| s.found.iter().copied()).collect();
            loads.sort_by(f64::total_cmp);
            let name = |what| format!("{frequency} Hz, {label}: {what}");
            let least = Row::noted(name("least opposite force"), loads.first().copied().unwrap_or(f64::NAN), "N");
            let tips = 100.0 * count(samples.iter().filter(|s| s.failed()).count()) / count(samples.len());
            let tips = Row::noted(name("runs that tip over"), tips, "%");
            rows.push(if on { least.at_least(20.0) } else { least });
            let low = loads.get(loads.len() / 20).copied().unwrap_or(f64::NAN);
            rows.push(Row::noted(name("opposite force, 5th percentile of swings"), low, "N"));
            rows.push(if on { tips.exactly(0.0) } else { tips });
        }
    }
    Ok(rows)
}

/// Of each swing of a crawl, the least true vertical force on the leg opposite to it while it is up, N.
fn opposite_loads(run: &Run) -> Vec<f64> {
    let mut least = Vec::new();
    for leg in 0..4 {
        let mut swing: Option<f64> = None;
        for tick in run.ticks.iter().filter(|tick| tick.balances()) {
            match (&tick.truth, tick.swings(leg)) {
                (Some(truth), true) => {
                    let load = truth.f_F_W[3 - leg][2];
                    swing = Some(swing.map_or(load, |least| least.min(load)));
                }
                (_, true) => {}
                (_, false) => least.extend(swing.take()),
            }
        }
    }
    least
}

/// A walk in one direction.
struct Walk {
    gait: &'static str,
    duration_s: f64,
    direction: Direction,
    speed: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Direction {
    Forward,
    Sideways,
    Turning,
}

impl Direction {
    /// In words, key of the scenario, unit.
    fn names(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Direction::Forward => ("forward", "v_x", "m/s"),
            Direction::Sideways => ("sideways", "v_y", "m/s"),
            Direction::Turning => ("turning", "yaw_rate", "rad/s"),
        }
    }
}

impl Walk {
    fn all() -> Vec<Walk> {
        use Direction::{Forward, Sideways, Turning};
        let trot = [(Forward, 0.3), (Sideways, 0.1), (Turning, 0.3)].map(|of| ("trot", 15.0, of));
        let crawl = [(Forward, 0.1), (Sideways, 0.03), (Turning, 0.05)].map(|of| ("crawl", 30.0, of));
        let walk = |(gait, duration_s, (direction, speed))| Walk { gait, duration_s, direction, speed };
        trot.into_iter().chain(crawl).map(walk).collect()
    }

    fn spec(&self) -> Spec {
        let Walk { gait, duration_s, direction, speed } = self;
        let (name, key, _) = direction.names();
        let operator = format!(
            "[{{ t_s = 0.0, mode = \"stand\", gait = \"{gait}\" }}, {{ t_s = 1.0, mode = \"walk\" }}, {{ t_s = 2.5, {key} = {speed:.2} }}]"
        );
        let spec = Spec::of("flat_trot").named(format!("{gait}_{name}")).with("operator", operator);
        spec.with("duration_s", format!("{duration_s:.1}"))
    }
}

/// One direction at a time: means over the whole walk, its beginning included.
pub fn speed_of_gaits(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    speeds(bench, "")
}

fn speeds(bench: &Bench, prefix: &str) -> anyhow::Result<Vec<Row>> {
    let walks = Walk::all();
    let samples = bench.all("speeds", walks.iter().map(Walk::spec).collect())?;
    let mut rows = vec![falls(prefix, &samples)];
    for (Walk { gait, direction, .. }, sample) in walks.iter().zip(&samples) {
        let way = &sample.metrics.locomotion;
        let (commanded, realised) = match direction {
            Direction::Turning => (way.commanded_yaw_rate, way.true_yaw_rate),
            Direction::Forward => (way.commanded_velocity.map(|v| v[0]), way.true_velocity.map(|v| v[0])),
            Direction::Sideways => (way.commanded_velocity.map(|v| v[1]), way.true_velocity.map(|v| v[1])),
        };
        let (commanded, realised) = (commanded.unwrap_or(f64::NAN), realised.unwrap_or(f64::NAN));
        let (direction, _, unit) = direction.names();
        let noted = |what, value, unit| Row::noted(format!("{prefix}{gait}, {direction}: {what}"), value, unit);
        rows.push(noted("commanded", commanded, unit));
        rows.push(noted("true", realised, unit));
        let off = noted("off by", 100.0 * (realised / commanded - 1.0).abs(), "%");
        rows.push(off.at_most(5.0));
    }
    Ok(rows)
}
