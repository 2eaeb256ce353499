//! One file per experiment. Identifiers A1 to A12 follow the list of the paper's experiments (Raiola et al. 2020); the others are ours.

mod acceleration_bound;
mod base_height;
mod base_motion;
mod base_position;
mod equivalences;
mod gait_speeds;
mod limits;
mod other_robot;
mod posture_alone;
mod residual_load;
mod rough_terrain;
mod sensor_noise;
mod solve_time;
mod stack_weights;
mod touchdown;

use crate::bench::{Sample, count, mean};
use crate::{Experiment, Row};

/// Every experiment, in the order in which `all` runs them.
pub const ALL: &[Experiment] = &[
    solve_time::EXPERIMENT,
    base_motion::EXPERIMENT,
    rough_terrain::EXPERIMENT,
    other_robot::EXPERIMENT,
    sensor_noise::EXPERIMENT,
    touchdown::EXPERIMENT,
    base_position::EXPERIMENT,
    base_height::EXPERIMENT,
    stack_weights::EXPERIMENT,
    equivalences::EXPERIMENT,
    acceleration_bound::EXPERIMENT,
    residual_load::EXPERIMENT,
    gait_speeds::EXPERIMENT,
    posture_alone::EXPERIMENT,
    limits::HYQ,
    limits::ANYMAL_B,
];

/// The row that counts falls and safe states; passes without any.
fn falls<T>(name: &str, samples: &[Sample<T>]) -> Row {
    let fallen = samples.iter().filter(|sample| sample.failed()).count();
    Row::info(format!("{name}falls in {} runs", samples.len()), count(fallen), "").exactly(0.0)
}

/// Commanded and true forward speed, averaged over the samples; passes if they differ by at most 5 %.
fn speed<T>(name: &str, samples: &[Sample<T>]) -> Vec<Row> {
    let forward = |of: fn(&Sample<T>) -> Option<[f64; 2]>| mean(samples.iter().filter_map(of).map(|v| v[0]));
    let commanded = forward(|s| s.metrics.locomotion.commanded_velocity);
    let realised = forward(|s| s.metrics.locomotion.true_velocity);
    vec![
        Row::info(format!("{name}commanded forward speed, mean"), commanded, "m/s"),
        Row::info(format!("{name}true forward speed, mean"), realised, "m/s"),
        Row::info(format!("{name}off by"), 100.0 * (realised - commanded).abs() / commanded.abs(), "%").at_most(5.0),
    ]
}
