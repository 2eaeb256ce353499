//! Poses of the trunk, speeds and changes of the gait that the controller accepts: the robot must not fall. Commands beyond the limits are followed in part.

use super::shared::{self, falls};
use crate::bench::{Bench, RunSpec, Sample, mean};
use crate::experiment::Experiment;
use crate::limit_search::toml_float;
use crate::row::Row;
use analysis::Run;

pub(super) const HYQ: Experiment = Experiment {
    id: "walking_limits",
    title: "poses, speeds and gait changes at and beyond the limits",
    published: "no number",
    robot: "hyq",
    seeds: 1,
    minutes: 12.0,
    run,
};

pub(super) const ANYMAL_B: Experiment =
    Experiment { id: "walking_limits_anymal_b", title: "the same limits of another robot", robot: "anymal_b", ..HYQ };

/// Roll, pitch (rad) and height (m) of the corners: a pose that a user combines, and the limits of each.
const CORNERS: [[f64; 3]; 2] = [[0.2, 0.2, 0.1], [0.35, 0.35, 0.12]];
/// Duration of a run with a pose, s.
const DURATION_S: f64 = 10.0;
/// A walk begins.
const WALK: &str = "{ t_s = 1.0, mode = \"walk\" }";

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for gait in ["stand", "crawl", "trot"] {
        let poses = corners();
        let specs = poses.iter().map(|corner| pose(gait, *corner)).collect();
        let samples = bench.all_with(&format!("corners, {gait}"), specs, reached)?;
        rows.push(falls(&format!("{gait}, 16 corners of roll, pitch and height: "), &samples));
        let parts = samples.iter().zip(&poses).take(8).flat_map(|(sample, wanted)| {
            [0, 1, 2].map(|k| if sample.failed() { f64::NAN } else { sample.measured[k] / wanted[k] })
        });
        let least = least(parts);
        let name = format!("{gait}, least reached part of a component of 0.2 rad, 0.2 rad, 0.1 m");
        rows.push(Row::info(name, least, "").at_least(0.6));
    }
    for (gait, v_x) in [("crawl", 0.1), ("trot", 0.5)] {
        let samples = bench.all(&format!("speeds, {gait}"), speeds(gait))?;
        rows.push(falls(&format!("{gait}, 60 s at each speed: "), &samples));
        let one = bench.one(speed(gait, "at", &format!("v_x = {v_x:?}"), 30.0))?;
        rows.extend(pace(gait, v_x, &one));
    }
    let samples = bench.all("gait changes", changes())?;
    rows.push(falls("gait changes each 0.5, 1 and 1.7 s, and from trot to crawl at speed: ", &samples));
    Ok(rows)
}

/// The least value; NaN if one is NaN.
fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, |least, value| if least.is_nan() || least <= value { least } else { value })
}

/// Speed of a walk with a commanded forward velocity that must be followed: nearly all of it, and by the robot within 5 %.
fn pace(gait: &str, v_x: f64, sample: &Sample) -> Vec<Row> {
    let followed = sample.metrics.locomotion.commanded_velocity.map_or(f64::NAN, |v| v[0]);
    let mut rows = shared::speed(&format!("{gait}: "), std::slice::from_ref(sample));
    // The mean includes the first second of the walk, without a velocity, and the acceleration.
    rows.push(Row::info(format!("{gait}: followed part of {v_x:?} m/s"), followed / v_x, "").at_least(0.9));
    rows
}

/// Roll, pitch and height of the 16 corners: all signs of the first size, then of the second.
fn corners() -> Vec<[f64; 3]> {
    let signs = |corner: usize| [0, 1, 2].map(|bit| if corner & (1 << bit) == 0 { 1.0 } else { -1.0 });
    let of = |size: [f64; 3]| (0..8).map(move |corner| [0, 1, 2].map(|k| signs(corner)[k] * size[k]));
    CORNERS.into_iter().flat_map(of).collect()
}

fn pose(gait: &str, [roll, pitch, height]: [f64; 3]) -> RunSpec {
    let start = if gait == "crawl" { "crawl" } else { "trot" };
    let walk = if gait == "stand" { String::new() } else { format!("{WALK}, ") };
    let operator = format!(
        "[{{ t_s = 0.0, mode = \"stand\", gait = \"{start}\" }}, {walk}{{ t_s = 2.0, roll = {roll:?}, pitch = {pitch:?}, height_offset = \
         {height:?} }}]"
    );
    let spec = RunSpec::of("flat_trot").named(format!("pose_{gait}_{roll}_{pitch}_{height}"));
    spec.with("operator", operator).with("duration_s", toml_float(DURATION_S))
}

/// Roll, pitch (rad) and change of the height (m) in the last second of a run.
fn reached(run: &Run) -> [f64; 3] {
    let poses = |from: f64, to: f64| {
        let of = move |k: usize| {
            let ticks = run.ticks.iter().filter(move |tick| (from..to).contains(&tick.t_s));
            mean(
                ticks
                    .filter_map(|tick| tick.truth.as_ref())
                    .map(move |truth| [truth.rpy[0], truth.rpy[1], truth.p_WB[2]][k]),
            )
        };
        [of(0), of(1), of(2)]
    };
    let (before, after) = (poses(1.9, 2.0), poses(DURATION_S - 1.0, DURATION_S));
    [after[0], after[1], after[2] - before[2]]
}

/// Walks of 60 s at several parts of the largest accepted speeds, and beyond them.
fn speeds(gait: &str) -> Vec<RunSpec> {
    let keys = [
        "v_x = 0.1",
        "v_x = 0.3",
        "v_x = -0.6",
        "v_y = 0.6",
        "yaw_rate = 0.8",
        "v_x = 0.4, v_y = -0.4, yaw_rate = -0.8",
    ];
    (0..).zip(keys).map(|(i, keys)| speed(gait, &i.to_string(), keys, 62.0)).collect()
}

fn speed(gait: &str, name: &str, keys: &str, duration_s: f64) -> RunSpec {
    let operator = format!("[{{ t_s = 0.0, mode = \"stand\", gait = \"{gait}\" }}, {WALK}, {{ t_s = 2.0, {keys} }}]");
    let spec = RunSpec::of("flat_trot").named(format!("speed_{gait}_{name}"));
    spec.with("operator", operator).with("duration_s", toml_float(duration_s))
}

/// Changes between the gaits at a constant period, and one from a fast trot to a crawl.
fn changes() -> Vec<RunSpec> {
    let mut specs = Vec::new();
    for (period_s, v_x) in [(0.5, 0.1), (1.0, 0.1), (1.0, 0.3), (1.7, 0.3), (100.0, 0.6)] {
        let mut operator = format!("[{{ t_s = 0.0, mode = \"stand\" }}, {WALK}, {{ t_s = 1.5, v_x = {v_x:?} }}");
        let (mut t_s, mut gait) = (f64::clamp(period_s, 2.0, 5.0), "crawl");
        while t_s < 60.0 {
            operator += &format!(", {{ t_s = {t_s:?}, gait = \"{gait}\" }}");
            t_s += period_s;
            gait = if gait == "crawl" { "trot" } else { "crawl" };
        }
        let spec = RunSpec::of("flat_trot").named(format!("changes_{}_{}", toml_float(period_s), toml_float(v_x)));
        specs.push(spec.with("operator", operator + "]").with("duration_s", "62.0"));
    }
    specs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_values_with_nan_is_nan() {
        assert_eq!(least([2.0, 0.5, 3.0].into_iter()), 0.5);
        assert!(least([0.5, f64::NAN, 3.0].into_iter()).is_nan());
    }

    #[test]
    fn corners_have_all_signs() {
        let corners = corners();
        for (size, corners) in CORNERS.iter().zip(corners.chunks(8)) {
            for (i, corner) in corners.iter().enumerate() {
                assert_eq!(corner.map(f64::abs), *size);
                assert!(corners.iter().skip(i + 1).all(|other| other != corner));
            }
        }
        assert_eq!(corners.len(), 16);
    }
}
