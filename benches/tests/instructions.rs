//! The guard against slowing down: instructions of a replay of a golden log, counted by valgrind's callgrind, against the stored ones.
//!
//! Instructions are no time, but they are the same in every run (to 3 parts in 100 000) and on a busy machine, so a slow-down shows in the
//! change that makes it. Two numbers, each per tick: the controller's step alone, and all of the replay: reading, decoding, the step,
//! comparing, and a share of building the controller. A change that means it stores new ones: `make guard ACCEPT=1`.
//!
//! The stored numbers are those of the build that `make test` makes; an incremental one, cut into other pieces, counts 0.6 % more.
#![allow(clippy::unwrap_used, missing_docs)]

use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;
use std::process::Command;

/// Part by which a count may be above the stored one.
const MARGIN: f64 = 0.02;
const STEP: &str = "<controller::quadruped::controller::Quadruped as controller::interface::Controller>::step_probed";
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Instructions per tick, and the compiler that they were stored with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Counts {
    toolchain: String,
    step: u64,
    replay: u64,
}

#[test]
fn a_replay_takes_no_more_instructions_than_it_did() {
    let stored_at = Path::new(ROOT).join("benches/instructions.json");
    let counted = count();
    if std::env::var_os("ACCEPT").is_some() {
        std::fs::write(&stored_at, serde_json::to_string_pretty(&counted).unwrap() + "\n").unwrap();
        tell(&format!("instructions: stored {counted:?}"));
        return;
    }
    let stored = serde_json::from_str(&std::fs::read_to_string(&stored_at).unwrap()).unwrap();
    match judge(&counted, &stored) {
        Ok(text) => tell(&text),
        Err(text) => panic!("{text}"),
    }
}

#[test]
fn a_slow_down_and_another_compiler_are_told_apart() {
    let stored = Counts { toolchain: "rustc 1".to_owned(), step: 100_000, replay: 200_000 };
    assert!(judge(&stored, &stored).is_ok());
    assert!(judge(&Counts { step: 101_999, ..stored.clone() }, &stored).is_ok());
    let slower = judge(&Counts { replay: 206_000, ..stored.clone() }, &stored).unwrap_err();
    assert!(slower.contains("replay: 206000 instructions a tick, 3.0 % more than the stored 200000"), "{slower}");
    let faster = judge(&Counts { step: 90_000, ..stored.clone() }, &stored).unwrap();
    assert!(
        faster.contains("step: 90000 instructions a tick, 10.0 % fewer") && faster.contains("ACCEPT=1"),
        "{faster}"
    );
    let other = judge(&Counts { toolchain: "rustc 2".to_owned(), ..stored.clone() }, &stored).unwrap_err();
    assert!(other.contains("rustc 1") && other.contains("rustc 2"), "{other}");
}

/// What is to be told, or why it is wrong.
fn judge(counted: &Counts, stored: &Counts) -> Result<String, String> {
    const STORE: &str = "store the new numbers by `make guard ACCEPT=1`";
    if counted.toolchain != stored.toolchain {
        return Err(format!(
            "stored with {}, counted with {}: if that is meant, {STORE}",
            stored.toolchain, counted.toolchain
        ));
    }
    let (mut text, mut worse) = (Vec::new(), false);
    for (what, counted, stored) in [("step", counted.step, stored.step), ("replay", counted.replay, stored.replay)] {
        let change = counted as f64 / stored as f64 - 1.0;
        let than = if change < 0.0 { "fewer" } else { "more" };
        let percent = 100.0 * change.abs();
        text.push(format!("{what}: {counted} instructions a tick, {percent:.1} % {than} than the stored {stored}"));
        worse |= change > MARGIN;
        if change < -MARGIN {
            text.push(format!("keep the gain: {STORE}"));
        }
    }
    if worse {
        text.push(format!("find what has become slower, or, if that is meant, {STORE}"));
        return Err(text.join("\n"));
    }
    Ok(text.join("\n"))
}

/// Replays the log under callgrind.
fn count() -> Counts {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("callgrind.out");
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", &format!("--callgrind-out-file={}", out.display())])
        .args([env!("CARGO_BIN_EXE_bench"), "one", "replay", "logs/golden/flat_trot.mcap", "1"])
        .current_dir(ROOT)
        .env_clear()
        .env("PATH", std::env::var_os("PATH").unwrap_or_default())
        .output()
        .expect("valgrind can be started: scripts/setup.sh installs it");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let line: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    let ticks = line["calls"].as_u64().unwrap();
    let profile = std::fs::read_to_string(&out).unwrap();
    let rustc = Command::new("rustc").arg("--version").output().unwrap();
    Counts {
        toolchain: String::from_utf8(rustc.stdout).unwrap().trim().to_owned(),
        step: within(&profile, STEP) / ticks,
        replay: totals(&profile) / ticks,
    }
}

/// Instructions of a function and all that it calls: what its callers say of their calls.
///
/// `cfn=(ID) NAME` names the callee, the name only where it stands first; the line after `calls=` ends with what the calls took.
fn within(profile: &str, function: &str) -> u64 {
    let id = profile
        .lines()
        .filter_map(|line| line.strip_prefix("fn=").or_else(|| line.strip_prefix("cfn=")))
        .find_map(|name| name.strip_suffix(function)?.strip_suffix(' '))
        .unwrap_or_else(|| panic!("{function} is not in the profile"));
    let (mut of_function, mut sum) = (false, 0);
    let mut lines = profile.lines();
    while let Some(line) = lines.next() {
        if let Some(callee) = line.strip_prefix("cfn=") {
            of_function = callee.split(' ').next() == Some(id);
        } else if line.starts_with("calls=") {
            let taken = lines.next().and_then(|line| line.rsplit(' ').next()).unwrap().parse::<u64>().unwrap();
            sum += if of_function { taken } else { 0 };
        }
    }
    sum
}

fn totals(profile: &str) -> u64 {
    profile.lines().find_map(|line| line.strip_prefix("totals: ")).unwrap().trim().parse().unwrap()
}

/// Past the test harness, which swallows what `eprintln` prints in a test that passes.
fn tell(text: &str) {
    std::io::stderr().write_all(format!("{text}\n").as_bytes()).unwrap();
}
