//! The robot walks over stones with every seed, and on flat ground with errors within the published ones.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof};
use serde_json::Value;

const SEEDS: std::ops::Range<i64> = 1..11;

/// Commanded distance of rough_trot, m, summed from second to second like the summary's.
///
/// 6 s of 0.3, 3 s of (0.2, 0.1), 3 s of 0.25, 3 s of (0.2, -0.1), 1 s of 0.3 m/s: 1.8 + 0.671 + 0.75 + 0.671 + 0.3.
const COMMANDED_M: f64 = 4.192;

#[test]
fn twenty_seconds_of_omnidirectional_trot_over_stones_of_2_to_4_cm_without_a_fall_for_every_seed() {
    let folder = folder("rough");
    let run = |seed: i64| -> Value {
        let log = folder.join(format!("{seed}.mcap"));
        let scenario = "--robot hyq --scenario scenarios/rough_trot.toml --seconds 20";
        let ran = hoof(&format!("sim {scenario} --seed {seed} --log {} --json", log.display()));
        if seed == SEEDS.start {
            let report = hoof(&format!("replay {} --jobs 2 --json", log.display())).exits(0).json();
            assert_eq!((&report["identical"], &report["ticks"]), (&Value::Bool(true), &20_000.into()));
        }
        std::fs::remove_file(log).unwrap();
        ran.json()
    };
    // Two runs at a time, each in its own process: more would not be faster.
    let (odd, even): (Vec<i64>, Vec<i64>) = SEEDS.partition(|seed| seed % 2 == 1);
    let runs: Vec<Value> = std::thread::scope(|scope| {
        let other = scope.spawn(|| even.into_iter().map(run).collect::<Vec<_>>());
        let mut runs: Vec<Value> = odd.into_iter().map(run).collect();
        runs.extend(other.join().unwrap());
        runs
    });
    assert_eq!(runs.len(), 10);
    let fell: Vec<&Value> = runs.iter().filter(|run| run["fell"] != false || !run["safe_state"].is_null()).collect();
    assert!(fell.is_empty(), "{fell:#?}");
    for run in &runs {
        assert_eq!((&run["ticks"], &run["sim_seconds"]), (&20_000.into(), &20.0.into()));
        let distance = run["distance_m"].as_f64().unwrap();
        assert!((0.75..1.25).contains(&(distance / COMMANDED_M)), "seed {}: {distance} m", run["seed"]);
    }
    let distances: std::collections::BTreeSet<String> = runs.iter().map(|run| run["distance_m"].to_string()).collect();
    assert_eq!(distances.len(), 10, "two seeds gave the same distance");
}

#[test]
fn on_flat_ground_every_tracking_error_is_within_the_published_one() {
    let folder = folder("flat");
    let log = folder.join("flat.mcap");
    let run = hoof(&format!("sim --robot hyq --scenario scenarios/flat_trot.toml --log {} --json", log.display()));
    let run = run.exits(0).json();
    assert_eq!(run["fell"], false);
    let out = folder.join("report");
    let report = hoof(&format!("report {} --out {} --json", log.display(), out.display())).exits(0).json();
    let tracking = &report["metrics"]["tracking"];
    for (quantity, published) in analysis::tables::PUBLISHED_TRACKING {
        let error = match quantity.split_once(' ') {
            Some((leg, axis)) => {
                let feet = tracking["feet"].as_array().unwrap();
                &feet.iter().find(|foot| foot["leg"] == leg).unwrap()[axis]
            }
            None => &tracking[quantity],
        };
        let rms = error["rms"].as_f64().unwrap();
        assert!(rms > 0.0 && rms <= published.rms(), "{quantity}: rms {rms}, published {}", published.rms());
    }
    assert_eq!(report["metrics"]["locomotion"]["distance_m"], run["distance_m"], "the report and `hoof sim` agree");
    let written: Value = serde_json::from_slice(&std::fs::read(out.join("metrics.json")).unwrap()).unwrap();
    assert_eq!(written, report["metrics"]);
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains("<svg"));
}
