//! Highest step, deepest hole and largest push that a trotting robot survives.

use crate::bench::{Bench, RunSpec};
use crate::experiment::Experiment;
use crate::limit_search::{Sweep, Tried, largest};
use crate::row::Row;
use analysis::figures::Curves;

pub(super) const HYQ: Experiment = Experiment {
    id: "limits",
    title: "the highest step, the deepest hole and the largest push that are survived",
    published: "no number",
    robot: "hyq",
    seeds: 4,
    minutes: 8.0,
    run,
};

pub(super) const ANYMAL_B: Experiment = Experiment {
    id: "limits_anymal_b",
    title: "the same limits of another robot, with a third of the mass",
    robot: "anymal_b",
    ..HYQ
};

/// Number of phases of the stride at which the robot is pushed. A push may be survived in most phases and not in one of them.
const PHASES: i64 = 12;
/// Stride of the trot of both robots, s: 0.25 s of swing, duty factor 0.55.
const STRIDE: f64 = 0.25 / 0.45;

/// Searches the four limits; each must be at least the first value of its search.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let walk = "[{ t_s = 0.0, mode = \"stand\" }, { t_s = 1.0, mode = \"walk\" }, { t_s = 2.0, v_x = 0.25 }, { t_s = 13.0, v_x = 0.0 }]";
    // The step is 0.8 m ahead; at 1.6 m the hind legs have climbed it too.
    let steps = RunSpec::of("flat_trot")
        .named("steps")
        .with("duration_s", "14.0")
        .with("operator", walk)
        .with("noise", "{ velocity = 0.01, orientation = 0.001, gyro = 0.002 }")
        .with("terrain", "{ kind = \"steps\", step_height_m = 0.02, step_length_m = 5.0, flat_radius_m = 0.8, extent_m = [12.0, 4.0] }");
    let push = RunSpec::of("flat_trot")
        .named("push")
        .with("duration_s", "8.0")
        .with("operator", "[{ t_s = 0.0, mode = \"stand\" }, { t_s = 1.0, mode = \"walk\" }]")
        .with("push", "[{ t_s = 4.0, duration_s = 0.2, force_W = [0.0, 0.0, 0.0] }]");
    let hole = RunSpec::of("flat_trot")
        .named("hole")
        .with("duration_s", "8.0")
        .with("operator", walk)
        .with("floor", "[{ t_s = 4.0, leg = \"LF\", height_m = 0.0 }]");
    // Each seed pushes a twelfth of a stride later.
    let later = |seed: i64| {
        let phase = f64::from(seed.rem_euclid(PHASES) as i32) / PHASES as f64;
        ("push[0].t_s".to_owned(), format!("{:.4}", 4.0 + STRIDE * phase))
    };
    // Each seed lowers the floor of another foot, diagonal pairs first.
    let foot =
        |seed: i64| ("floor[0].leg".to_owned(), format!("{:?}", ["LF", "RH", "RF", "LH"][seed.rem_euclid(4) as usize]));
    let sweeps = [
        (
            "highest step up",
            "m",
            Sweep {
                spec: steps,
                key: "terrain.step_height_m",
                from: 0.02,
                to: 0.3,
                step: 0.01,
                min_displacement: 1.6,
                seeds: bench.seeds(),
                vary: None,
            },
        ),
        (
            "deepest hole under any one foot",
            "m",
            Sweep {
                spec: hole,
                key: "floor[0].height_m",
                from: -0.02,
                to: -0.3,
                step: -0.01,
                min_displacement: 0.0,
                seeds: bench.seeds(),
                vary: Some(&foot),
            },
        ),
        (
            "largest push from the side, 0.2 s",
            "N",
            Sweep {
                spec: push.clone().named("push_side"),
                key: "push[0].force_W[1]",
                from: 50.0,
                to: 3250.0,
                step: 25.0,
                min_displacement: 0.0,
                seeds: bench.consecutive_seeds(PHASES),
                vary: Some(&later),
            },
        ),
        (
            "largest push from behind, 0.2 s",
            "N",
            Sweep {
                spec: push.named("push_behind"),
                key: "push[0].force_W[0]",
                from: 50.0,
                to: 3250.0,
                step: 25.0,
                min_displacement: 0.0,
                seeds: bench.consecutive_seeds(PHASES),
                vary: Some(&later),
            },
        ),
    ];
    let mut rows = Vec::new();
    for (name, unit, sweep) in &sweeps {
        let (limit, tried) = largest(bench, sweep)?;
        rows.push(Row::info(*name, limit.abs(), unit).at_least(sweep.from.abs()));
        if limit == sweep.to {
            bench.note(format!(
                "{name}: the last value tried, {} {unit}, is survived; the limit is beyond it",
                limit.abs()
            ));
        }
        let points: Vec<(f64, f64)> =
            tried.iter().map(|Tried { value, survived }| (*value, 100.0 * survived)).collect();
        let curves = Curves {
            x: format!("{name} [{unit}]"),
            y: "seeds that survive [%]".to_owned(),
            logarithmic: false,
            series: vec![(bench.robot().to_owned(), points)],
            limit: None,
        };
        let file = name.split(',').next().unwrap_or(name).replace(' ', "_");
        bench.write(&curves.figure(&file))?;
    }
    Ok(rows)
}
