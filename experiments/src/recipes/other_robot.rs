//! A4: A2, A3 and the speed experiment on another robot.

use super::shared::parameters;
use super::{base_motion, gait_speeds, rough_terrain};
use crate::bench::{Bench, count};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::table::{Column, Table};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A4",
    title: "A2, A3 and speed on another robot, and the parameters that differ",
    published: "\"a slight tuning of the gains of the postural and of the trunk orientation tasks\"",
    robot: "anymal_b",
    seeds: 20,
    minutes: 5.0,
    run,
};

/// Runs the three experiments, and lists the parameters outside `[robot]` that differ from HyQ's.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let (hyq, other) = (parameters("hyq", None)?, parameters(bench.robot(), None)?);
    let differing: Vec<_> = hyq.iter().filter(|(key, value)| other.get(*key) != Some(value)).collect();
    let mut table =
        Table::new([Column::left("parameters that differ"), Column::right("hyq"), Column::right(bench.robot())]);
    for (key, value) in &differing {
        table.row([key.as_str(), value.as_str(), other.get(*key).map_or("-", String::as_str)]);
    }
    bench.note(table.to_string());
    let mut rows = base_motion::table3(bench, "A2: ", &|spec| spec)?;
    rows.extend(rough_terrain::rough(bench, "A3: ", &|spec| spec)?);
    rows.extend(gait_speeds::speeds(bench, "speed: ")?);
    rows.push(Row::info("parameters that differ from HyQ's", count(differing.len()), ""));
    Ok(rows)
}
