//! The rounds: starts every process in turn, several times.

use crate::export;
use crate::inputs::Stack;
use crate::sample::Line;
use crate::table;
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// Arguments of `bench run`.
#[derive(clap::Args)]
pub struct Args {
    /// Number of rounds; each round starts every process once.
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Folder of the peers, written by scripts/bench_peers.sh. If it does not exist, only this project is timed.
    #[arg(long, default_value = "target/peers")]
    peers: PathBuf,
    /// Files for the peers.
    #[command(flatten)]
    export: export::Args,
    /// Log to replay [default: the log of the programs].
    #[arg(long)]
    replay: Option<PathBuf>,
    /// CPU to which single-threaded processes are bound.
    #[arg(long, default_value_t = 1)]
    cpu: usize,
    /// Run all processes at real-time priority (SCHED_FIFO), as a controller; needs the permission. Other processes do not run meanwhile.
    #[arg(long)]
    fifo: bool,
    /// Write every line of every round as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write the tables between the lines `<!-- bench -->` and `<!-- end of bench -->` of a file.
    #[arg(long)]
    into: Option<PathBuf>,
}

/// Number of passes over the items of a file in one round.
const PASSES: [(&str, &str); 3] = [("states", "20"), ("programs", "2"), ("ticks", "2")];
/// Largest relative difference of results: from a rigid-body peer, and from a solver.
const SAME: [f64; 2] = [1e-9, 1e-6];

/// A process that measures.
struct Contender {
    group: String,
    origin: Origin,
    program: PathBuf,
    arguments: Vec<String>,
    bound: bool,
}

/// Origin of the figures that a process prints.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    Ours,
    Pinocchio,
    /// A solver; its name is the name of the case.
    Solver,
}

/// Results by group (a robot, a set of programs, a stack, a replay), origin and case; one line per round.
pub type Measured = BTreeMap<(String, String, String), Vec<Line>>;

/// Runs all processes and prints the tables. Exit code 1 if the results of this project and of the peers differ.
pub fn run(args: &Args) -> Result<ExitCode> {
    export::export(&args.export)?;
    let contenders = contenders(args)?;
    let mut measured = Measured::new();
    for round in 0..args.rounds {
        for contender in &contenders {
            eprintln!("round {} of {}: {}", round + 1, args.rounds, contender.text());
            for line in contender.run(args)? {
                let origin = match contender.origin {
                    Origin::Ours => "ours".to_owned(),
                    Origin::Pinocchio => "Pinocchio".to_owned(),
                    Origin::Solver => line.case.clone(),
                };
                let case = if contender.origin == Origin::Solver { "solve".to_owned() } else { line.case.clone() };
                measured.entry((contender.group.clone(), origin, case)).or_default().push(line);
            }
        }
    }
    let text = table::markdown(&measured, &versions(args)?);
    println!("{text}");
    if let Some(path) = &args.json {
        let lines: Vec<_> = measured
            .iter()
            .map(|((group, origin, case), rounds)| {
                serde_json::json!({"group": group, "who": origin, "case": case, "rounds": rounds})
            })
            .collect();
        std::fs::write(path, serde_json::to_string_pretty(&lines)?).with_context(|| path.display().to_string())?;
    }
    if let Some(path) = &args.into {
        put_into(path, &text)?;
    }
    let differing = differing(&measured);
    for text in &differing {
        eprintln!("{text}");
    }
    Ok(ExitCode::from(u8::from(!differing.is_empty())))
}

/// The processes in the order in which they run; those to be compared are adjacent.
fn contenders(args: &Args) -> Result<Vec<Contender>> {
    let ours = std::env::current_exe()?;
    let there = args.peers.is_dir();
    if !there {
        eprintln!(
            "{} does not exist: only this project is timed; scripts/bench_peers.sh builds the peers",
            args.peers.display()
        );
    }
    let passes = |what: &str| PASSES.iter().find(|(name, _)| *name == what).map_or("1", |(_, n)| *n).to_owned();
    let text = |path: &Path| path.display().to_string();
    let mut all = Vec::new();
    let mut add = |group: &str, origin: Origin, program: &Path, arguments: Vec<String>, bound: bool| {
        let (group, program) = (group.to_owned(), program.to_owned());
        all.push(Contender { group, origin, program, arguments, bound });
    };
    let dir = &args.export.dir;
    for robot in export::ROBOTS {
        let states = text(&export::states_file(dir, robot));
        let urdf = text(&export::urdf(robot));
        let one = |kind: &str, rest: &[String]| [&["one".to_owned(), kind.to_owned()], rest].concat();
        if robot == "hyq" {
            for stack in [Stack::S1, Stack::S3] {
                let rest = [text(&args.export.log), stack.name().to_lowercase(), passes("ticks")];
                add(stack.name(), Origin::Ours, &ours, one("ticks", &rest), true);
            }
        }
        add(robot, Origin::Ours, &ours, one("rigid-body", &[states.clone(), urdf, passes("states")]), true);
        if there {
            let model = text(&args.peers.join(format!("{robot}.txt")));
            add(
                robot,
                Origin::Pinocchio,
                &args.peers.join("bin/pinocchio"),
                vec![model, states, passes("states")],
                true,
            );
        }
    }
    for (name, programs) in export::programs_files(dir) {
        let rest = vec![text(&programs), passes("programs")];
        let group = format!("programs of {name}");
        let of_ours = [vec!["one".to_owned(), "programs".to_owned()], rest.clone()].concat();
        add(&group, Origin::Solver, &ours, of_ours, true);
        for solver in ["daqp", "eiquadprog", "proxqp", "piqp"].into_iter().filter(|_| there) {
            add(&group, Origin::Solver, &args.peers.join("bin").join(solver), rest.clone(), true);
        }
    }
    let log = args.replay.as_ref().unwrap_or(&args.export.log);
    for jobs in ["1", "2"] {
        let arguments = vec!["one".to_owned(), "replay".to_owned(), text(log), jobs.to_owned()];
        add(&format!("replay, {jobs}"), Origin::Ours, &ours, arguments, jobs == "1");
    }
    Ok(all)
}

impl Contender {
    fn text(&self) -> String {
        let program = self.program.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        format!("{program} {}", self.arguments.join(" "))
    }

    fn run(&self, args: &Args) -> Result<Vec<Line>> {
        let mut words: Vec<String> = Vec::new();
        if self.bound {
            words.extend(["taskset".to_owned(), "--cpu-list".to_owned(), args.cpu.to_string()]);
        }
        if args.fifo {
            words.extend(["chrt", "--fifo", "10"].map(str::to_owned));
        }
        words.push(self.program.display().to_string());
        let mut command = Command::new(&words[0]);
        command.args(&words[1..]);
        let output = command.args(&self.arguments).stderr(Stdio::inherit()).output();
        let output = output.with_context(|| format!("{}: cannot start {}", self.text(), words[0]))?;
        if !output.status.success() {
            bail!("{} ended with {}", self.text(), output.status);
        }
        let lines = String::from_utf8(output.stdout)?;
        lines.lines().map(|line| serde_json::from_str(line).with_context(|| self.text())).collect()
    }
}

/// Results that differ by more than rounding. A solver alone may differ because it stops early; if all differ, the error is ours.
fn differing(measured: &Measured) -> Vec<String> {
    let mut differing = Vec::new();
    let mut nearest: BTreeMap<&str, f64> = BTreeMap::new();
    for ((group, origin, case), rounds) in measured {
        let Some(off) = rounds.iter().filter_map(|line| line.off).reduce(f64::max) else { continue };
        if origin == "Pinocchio" {
            if off > SAME[0] {
                differing.push(format!("{group}: {case} of Pinocchio differs from ours by {off:e}"));
            }
        } else if crate::programs::NAMES.iter().all(|name| name != origin) {
            let nearest = nearest.entry(group).or_insert(f64::INFINITY);
            *nearest = nearest.min(off);
        }
    }
    for (group, off) in nearest {
        if off > SAME[1] {
            differing.push(format!("{group}: every peer's solutions differ from ours, the nearest by {off:e}"));
        }
    }
    differing
}

/// CPU, compiler and versions of the peers, one text each.
fn versions(args: &Args) -> Result<Vec<String>> {
    let mut versions = Vec::new();
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let priority = if args.fifo { ", at real-time priority" } else { "" };
    versions.push(format!("{}, {cores} cores{priority}", model.trim_start_matches(['\t', ' ', ':'])));
    let rustc = Command::new("rustc").arg("--version").output().context("rustc --version")?;
    versions.push(String::from_utf8_lossy(&rustc.stdout).trim().to_owned());
    let path = args.peers.join("VERSIONS");
    if path.is_file() {
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        versions.extend(text.lines().map(str::to_owned));
    }
    Ok(versions)
}

/// Replaces the text between the two marks of a file.
fn put_into(path: &Path, tables: &str) -> Result<()> {
    const MARKS: [&str; 2] = ["<!-- bench -->\n", "<!-- end of bench -->"];
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let found = text.split_once(MARKS[0]).and_then(|(before, rest)| Some((before, rest.split_once(MARKS[1])?.1)));
    let Some((before, after)) = found else {
        bail!("{}: expected the lines {:?} and {:?}", path.display(), MARKS[0].trim(), MARKS[1]);
    };
    let text = format!("{before}{}{tables}{}{after}", MARKS[0], MARKS[1]);
    std::fs::write(path, text).with_context(|| path.display().to_string())
}
