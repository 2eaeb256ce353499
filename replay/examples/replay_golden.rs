//! Replays a corpus of golden logs with this build, without simulator and analysis, to check that other optimization levels and instruction
//! sets give the same bits.
//!
//!     cargo run -p replay --example replay_golden -- logs/golden [--json]
//!
//! `scripts/replay_across_builds.sh` runs it in several builds. Exit codes as for `hoof corpus check`: 0 all outputs are identical, 1 an
//! output differs, 2 there is no corpus.

use replay::corpus;
use std::process::ExitCode;

fn main() -> ExitCode {
    let (options, folders): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|arg| arg == "--json");
    let dir = folders.first().map_or("logs/golden", String::as_str);
    let jobs = std::thread::available_parallelism().map_or(1, usize::from);
    let logs = match corpus::check(dir, jobs) {
        Ok(logs) if !logs.is_empty() => logs,
        Ok(_) => {
            eprintln!("error: {dir}: no golden log");
            return ExitCode::from(2);
        }
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::from(2);
        }
    };
    if !options.is_empty() {
        match serde_json::to_string_pretty(&logs) {
            Ok(text) => println!("{text}"),
            Err(error) => {
                eprintln!("error: {dir}: {error}");
                return ExitCode::from(2);
            }
        }
        return ExitCode::from(u8::from(logs.iter().any(|log| !log.identical)));
    }
    for log in &logs {
        let found = match (&log.first_divergence, &log.error) {
            (None, None) if log.identical => format!("identical: {} ticks", log.ticks),
            (None, error) => error.clone().unwrap_or_else(|| "nothing to compare".to_owned()),
            (Some(d), _) => {
                let also: Vec<String> = d.also.iter().map(|f| format!("{} {}", f.channel, f.field)).collect();
                let also = if also.is_empty() { String::new() } else { format!("; also {}", also.join(", ")) };
                format!(
                    "differs from tick {} on, first in stage {}: {} {}: recorded {}, replayed {}{also}",
                    d.tick, d.stage, d.channel, d.field, d.recorded, d.replayed
                )
            }
        };
        println!("{}: {found}", log.name);
    }
    ExitCode::from(u8::from(logs.iter().any(|log| !log.identical)))
}
