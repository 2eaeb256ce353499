//! Rows that several experiments have.

use crate::bench::{Sample, count, mean};
use crate::row::Row;

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
