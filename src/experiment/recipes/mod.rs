//! The experiments of Raiola et al. 2020, as recipes. Numbers as in the list of the paper's experiments, A1 to A12; the others are ours.

mod feet;
mod limits;
mod programs;
mod sensing;
mod walks;

use super::Experiment;
use super::bench::{Sample, count, mean};
use super::table::Row;

/// Every experiment that can be run.
pub const ALL: &[Experiment] = &[
    Experiment {
        id: "A1",
        title: "time of a tick under the weighted stack S1 and the hierarchical S3, on the same states",
        published: "S1 830 us, S3 1180 us, with qpOASES on an i5 of 3.1 GHz",
        robot: "hyq",
        seeds: 1,
        minutes: 2.0,
        run: programs::solve_time,
    },
    Experiment {
        id: "A2",
        title: "flat ground, crawl, trot after 15 s, while base orientation and height change (Figure 9, Table 3)",
        published: "Table 3; compared by rms, which is the same however the mean is read",
        robot: "hyq",
        seeds: 1,
        minutes: 0.5,
        run: walks::base_motion,
    },
    Experiment {
        id: "A3",
        title: "rough terrain, blind, omnidirectional",
        published: "no number: \"ruins and cobble-stones\", step height 0.1 m",
        robot: "hyq",
        seeds: 20,
        minutes: 4.0,
        run: walks::rough_terrain,
    },
    Experiment {
        id: "A4",
        title: "A2, A3 and speed on another robot, and the parameters that differ",
        published: "\"a slight tuning of the gains of the postural and of the trunk orientation tasks\"",
        robot: "anymal_b",
        seeds: 20,
        minutes: 5.0,
        run: walks::port,
    },
    Experiment {
        id: "A5",
        title: "2 Hz trot and orientation references, with noisy sensors, lagging drives and a push (Figure 10)",
        published: "orientation error 0.0101 rad in the mean, 0.0102 rad std, on the real HyQ",
        robot: "hyq",
        seeds: 5,
        minutes: 1.5,
        run: sensing::real_robot,
    },
    Experiment {
        id: "A6",
        title: "haptic touchdown: floors that drop and rise, forces that are not there",
        published: "threshold 50 N along the terrain normal, ignored in the first half of the swing",
        robot: "hyq",
        seeds: 1,
        minutes: 1.0,
        run: feet::touchdown,
    },
    Experiment {
        id: "A7",
        title: "torques with the true and with random base positions and velocities",
        published: "x_b = 0 and its rate = 0 change nothing (section 2.4.1)",
        robot: "hyq",
        seeds: 1,
        minutes: 1.0,
        run: sensing::base_place,
    },
    Experiment {
        id: "A8",
        title: "height of the base from the stance feet, on flat ground and on a ramp of 10 degrees",
        published: "eqs. (16)-(17), no number",
        robot: "hyq",
        seeds: 1,
        minutes: 1.0,
        run: sensing::height,
    },
    Experiment {
        id: "A9",
        title: "torques of the weighted stack against the hierarchical one, by the ratio of its weights",
        published: "weights that differ by 1e3 or more mimic priorities (footnote 10)",
        robot: "hyq",
        seeds: 1,
        minutes: 1.0,
        run: programs::weights,
    },
    Experiment {
        id: "A10",
        title: "the stack against impedance control in closed form, at random configurations",
        published: "appendix A, eqs. (4), (10), (17), no number",
        robot: "hyq",
        seeds: 1,
        minutes: 0.1,
        run: programs::equivalences,
    },
    Experiment {
        id: "A11",
        title: "bound of the joint accelerations and overshoot of the foot at touchdown, with lagging drives",
        published: "500 rad/s2; too low a bound overshoots",
        robot: "hyq",
        seeds: 1,
        minutes: 1.0,
        run: feet::acceleration_bound,
    },
    Experiment {
        id: "A12",
        title: "crawl with and without force ramps and residual load of the leg opposite to the swing",
        published: "discussion: without them the opposite leg unloads and the robot tips; least force 20 N",
        robot: "hyq",
        seeds: 3,
        minutes: 3.0,
        run: walks::control_authority,
    },
    Experiment {
        id: "speed",
        title: "commanded and true velocity, trot and crawl, forward, sideways and turning",
        published: "no number; eqs. (19)-(21) as printed go at 0.89 (trot) and 0.40 (crawl) of the command",
        robot: "hyq",
        seeds: 1,
        minutes: 1.5,
        run: walks::speed_of_gaits,
    },
    Experiment {
        id: "posture",
        title: "no terrain estimator, no task for roll and pitch of the trunk: the posture adapts",
        published: "section 3.4, no number",
        robot: "hyq",
        seeds: 10,
        minutes: 3.0,
        run: walks::posture_alone,
    },
    Experiment {
        id: "limits",
        title: "the highest step, the deepest hole and the largest push that are survived",
        published: "no number",
        robot: "hyq",
        seeds: 4,
        minutes: 4.0,
        run: limits::limits,
    },
    Experiment {
        id: "limits_anymal_b",
        title: "the same of another robot, which weighs a third",
        published: "no number",
        robot: "anymal_b",
        seeds: 4,
        minutes: 4.0,
        run: limits::limits,
    },
];

/// A row that counts falls, and wants none.
fn falls<T>(name: &str, samples: &[Sample<T>]) -> Row {
    let fallen = samples.iter().filter(|sample| sample.failed()).count();
    Row::noted(format!("{name}falls in {} runs", samples.len()), count(fallen), "").exactly(0.0)
}

/// Commanded and true forward speed, means over the samples; good within 5 %.
fn speed<T>(name: &str, samples: &[Sample<T>]) -> Vec<Row> {
    let forward = |of: fn(&Sample<T>) -> Option<[f64; 2]>| mean(samples.iter().filter_map(of).map(|v| v[0]));
    let commanded = forward(|s| s.metrics.locomotion.commanded_velocity);
    let realised = forward(|s| s.metrics.locomotion.true_velocity);
    vec![
        Row::noted(format!("{name}commanded forward speed, mean"), commanded, "m/s"),
        Row::noted(format!("{name}true forward speed, mean"), realised, "m/s"),
        Row::noted(format!("{name}off by"), 100.0 * (realised - commanded).abs() / commanded.abs(), "%").at_most(5.0),
    ]
}
