//! Rows that several experiments have.

use crate::bench::{Bench, Sample, count, mean};
use crate::row::Row;
use analysis::table::{Column, Table};
use controller::params::key_values;
use drivers::DriverError;
use drivers::robot_files::RobotFiles;
use std::collections::BTreeMap;

/// The preset with the parameters of the paper.
pub(super) const PRINTED: &str = "printed";

/// The row that counts falls and safe states; passes without any.
pub(super) fn falls<T>(name: &str, samples: &[Sample<T>]) -> Row {
    let fallen = samples.iter().filter(|sample| sample.failed()).count();
    Row::info(format!("{name}falls in {} runs", samples.len()), count(fallen), "").exactly(0.0)
}

/// Commanded and true forward speed, averaged over the samples; passes if they differ by at most 5 %.
pub(super) fn speed<T>(name: &str, samples: &[Sample<T>]) -> Vec<Row> {
    let forward = |of: fn(&Sample<T>) -> Option<[f64; 2]>| mean(samples.iter().filter_map(of).map(|v| v[0]));
    let commanded = forward(|s| s.metrics.locomotion.commanded_velocity);
    let realised = forward(|s| s.metrics.locomotion.true_velocity);
    vec![
        Row::info(format!("{name}commanded forward speed, mean"), commanded, "m/s"),
        Row::info(format!("{name}true forward speed, mean"), realised, "m/s"),
        Row::info(format!("{name}off by"), 100.0 * (realised - commanded).abs() / commanded.abs(), "%").at_most(5.0),
    ]
}

/// Every parameter outside `[robot]`, by its dotted key.
pub(super) fn parameters(robot: &str, preset: Option<&str>) -> anyhow::Result<BTreeMap<String, String>> {
    let mut table: toml::Table = RobotFiles::find_changed(robot, preset, &[], &[])?.1.parse()?;
    table.remove("robot");
    Ok(key_values(&table).into_iter().collect())
}

/// Lists the parameters of the bench's robot that differ from those of its preset `printed`. A robot without this preset has no list.
pub(super) fn note_departures(bench: &Bench) -> anyhow::Result<()> {
    let printed = match parameters(bench.robot(), Some(PRINTED)) {
        Ok(printed) => printed,
        Err(error) if matches!(error.downcast_ref(), Some(DriverError::UnknownPreset { .. })) => return Ok(()),
        Err(error) => return Err(error),
    };
    let mut table = Table::new([Column::left("parameter"), Column::right("printed"), Column::right("here")]);
    for (key, value) in &parameters(bench.robot(), None)? {
        if let Some(of_paper) = printed.get(key).filter(|of_paper| *of_paper != value) {
            table.row([key.as_str(), of_paper.as_str(), value.as_str()]);
        }
    }
    bench.note(format!("Parameters that are not the paper's; `--preset {PRINTED}` sets all of them:\n{table}"));
    Ok(())
}
