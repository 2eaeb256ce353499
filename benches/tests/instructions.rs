//! Guard against slow-downs: counts the instructions of a replay of a golden log with valgrind's callgrind and compares them with stored counts.
//!
//! The number of instructions is not a time, but it is the same in every run (within 0.003 %) and on a loaded machine, so a slow-down is
//! noticed in the change that causes it. Two counts per tick: the component's step (unpacking of the delivered messages and the controller's
//! step), and the complete replay (reading, decoding, step,
//! comparison, and a share of building the controller). For an intended change, store new counts with `make guard ACCEPT=1`.
//!
//! The stored counts are those of the build of `make test`; an incremental build has other codegen units and counts 0.6 % more.
#![allow(clippy::unwrap_used, missing_docs)]

use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;
use std::process::Command;

/// Largest relative increase over the stored count.
const MARGIN: f64 = 0.02;
const STEP: &str = "controller::runtime::component::Component::step_probed";
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Instructions per tick, and the compiler of the build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Counts {
    toolchain: String,
    step: u64,
    replay: u64,
}

#[test]
fn a_replay_takes_no_more_instructions_than_stored() {
    let stored_at = Path::new(ROOT).join("benches/instructions.json");
    let counted = count();
    if std::env::var_os("ACCEPT").is_some() {
        std::fs::write(&stored_at, serde_json::to_string_pretty(&counted).unwrap() + "\n").unwrap();
        print(&format!("instructions: stored {counted:?}"));
        return;
    }
    let stored = serde_json::from_str(&std::fs::read_to_string(&stored_at).unwrap()).unwrap();
    match judge(&counted, &stored) {
        Ok(text) => print(&text),
        Err(text) => panic!("{text}"),
    }
}

#[test]
fn a_slow_down_and_another_compiler_are_reported() {
    let stored = Counts { toolchain: "rustc 1".to_owned(), step: 100_000, replay: 200_000 };
    assert!(judge(&stored, &stored).is_ok());
    assert!(judge(&Counts { step: 101_999, ..stored.clone() }, &stored).is_ok());
    let slower = judge(&Counts { replay: 206_000, ..stored.clone() }, &stored).unwrap_err();
    assert!(slower.contains("replay: 206000") && slower.contains("3.0 %") && slower.contains("200000"), "{slower}");
    let faster = judge(&Counts { step: 90_000, ..stored.clone() }, &stored).unwrap();
    assert!(faster.contains("step: 90000") && faster.contains("10.0 %") && faster.contains("ACCEPT=1"), "{faster}");
    let other = judge(&Counts { toolchain: "rustc 2".to_owned(), ..stored.clone() }, &stored).unwrap_err();
    assert!(other.contains("rustc 1") && other.contains("rustc 2"), "{other}");
}

/// The report; an error for a slow-down or another compiler.
fn judge(counted: &Counts, stored: &Counts) -> Result<String, String> {
    const STORE: &str = "store the new counts with `make guard ACCEPT=1`";
    if counted.toolchain != stored.toolchain {
        return Err(format!(
            "stored with {}, counted with {}: if this is intended, {STORE}",
            stored.toolchain, counted.toolchain
        ));
    }
    let (mut text, mut worse) = (Vec::new(), false);
    for (what, counted, stored) in [("step", counted.step, stored.step), ("replay", counted.replay, stored.replay)] {
        let change = counted as f64 / stored as f64 - 1.0;
        let than = if change < 0.0 { "fewer" } else { "more" };
        let percent = 100.0 * change.abs();
        text.push(format!("{what}: {counted} instructions per tick, {percent:.1} % {than} than the stored {stored}"));
        worse |= change > MARGIN;
        if change < -MARGIN {
            text.push(format!("{what} is faster: {STORE}"));
        }
    }
    if worse {
        text.push(format!("find the cause of the slow-down; if it is intended, {STORE}"));
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
        .expect("valgrind cannot be started; scripts/setup.sh installs it");
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

/// Instructions of a function and its callees: the sum over the calls of its callers.
///
/// `cfn=(ID) NAME` names the callee (the name only at its first occurrence); the line after `calls=` ends with the instructions of the calls.
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

/// Prints to standard error directly: the test harness captures the output of `eprintln` in a passing test.
fn print(text: &str) {
    std::io::stderr().write_all(format!("{text}\n").as_bytes()).unwrap();
}
