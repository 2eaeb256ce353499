//! Commanded and true velocity, one direction at a time; averaged over the whole walk, its start included.

use super::shared::falls;
use crate::bench::{Bench, RunSpec};
use crate::experiment::Experiment;
use crate::row::Row;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "speed",
    title: "commanded and true velocity, trot and crawl, forward, sideways and turning",
    published: "no number; eqs. (19)-(21) as printed reach 0.89 (trot) and 0.40 (crawl) of the command",
    robot: "hyq",
    seeds: 1,
    minutes: 1.5,
    run: |bench| speeds(bench, ""),
};

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
    /// Name, key of the scenario, unit.
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

    fn spec(&self) -> RunSpec {
        let Walk { gait, duration_s, direction, speed } = self;
        let (name, key, _) = direction.names();
        let operator = format!(
            "[{{ t_s = 0.0, mode = \"stand\", gait = \"{gait}\" }}, {{ t_s = 1.0, mode = \"walk\" }}, {{ t_s = 2.5, {key} = {speed:.2} }}]"
        );
        let spec = RunSpec::of("flat_trot").named(format!("{gait}_{name}")).with("operator", operator);
        spec.with("duration_s", format!("{duration_s:.1}"))
    }
}

/// Judges the difference between commanded and true velocity of each walk.
pub(super) fn speeds(bench: &Bench, prefix: &str) -> anyhow::Result<Vec<Row>> {
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
        let row = |what, value, unit| Row::info(format!("{prefix}{gait}, {direction}: {what}"), value, unit);
        rows.push(row("commanded", commanded, unit));
        rows.push(row("true", realised, unit));
        rows.push(row("off by", 100.0 * (realised / commanded - 1.0).abs(), "%").at_most(5.0));
    }
    Ok(rows)
}
