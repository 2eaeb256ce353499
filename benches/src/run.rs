//! The rounds: every process in turn, and again.

use crate::export;
use crate::inputs::Stack;
use crate::sample::Line;
use crate::table;
use anyhow::{Context, Result, bail, ensure};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// How to run, and where to leave the result.
#[derive(clap::Args)]
pub struct Args {
    /// Rounds; each takes everything once.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Folder of the peers, as scripts/bench_peers.sh leaves it; without it ours are timed alone.
    #[arg(long, default_value = "target/peers")]
    peers: PathBuf,
    /// Files for the peers.
    #[command(flatten)]
    export: export::Args,
    /// A longer log to replay; else the one whose programs are taken.
    #[arg(long)]
    replay: Option<PathBuf>,
    /// Processor that single-threaded processes are bound to.
    #[arg(long, default_value_t = 1)]
    cpu: usize,
    /// Write every line of every round as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Put the tables between the lines `<!-- bench -->` and `<!-- end of bench -->` of a file.
    #[arg(long)]
    into: Option<PathBuf>,
}

/// How often the items of a file are used in one round.
const PASSES: [(&str, &str); 3] = [("states", "20"), ("programs", "2"), ("ticks", "2")];
/// Largest difference between ours and a rigid-body peer, and between ours and a solver, relative.
const SAME: [f64; 2] = [1e-9, 1e-6];

/// A process that times something.
struct Contender {
    group: String,
    who: Who,
    program: PathBuf,
    arguments: Vec<String>,
    bound: bool,
}

/// Whose figures a process prints.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Who {
    Ours,
    Pinocchio,
    /// Whose name is in the case.
    Solver,
}

/// What was measured, by group (a robot, a set of programs, a stack, a replay), whose it is, and case; a line a round.
pub type Measured = BTreeMap<(String, String, String), Vec<Line>>;

/// Runs everything and prints the tables. Exit code 1 if ours and the peers' results differ.
pub fn run(args: &Args) -> Result<ExitCode> {
    export::export(&args.export)?;
    let contenders = contenders(args)?;
    let mut measured = Measured::new();
    for round in 0..args.rounds {
        for contender in &contenders {
            eprintln!("round {} of {}: {}", round + 1, args.rounds, contender.text());
            for line in contender.run(args.cpu)? {
                let who = match contender.who {
                    Who::Ours => "ours".to_owned(),
                    Who::Pinocchio => "Pinocchio".to_owned(),
                    Who::Solver => line.case.clone(),
                };
                let case = if contender.who == Who::Solver { "solve".to_owned() } else { line.case.clone() };
                measured.entry((contender.group.clone(), who, case)).or_default().push(line);
            }
        }
    }
    ensure!(!measured.is_empty(), "--rounds is 0: nothing was measured");
    let text = table::markdown(&measured, &versions(&args.peers)?);
    println!("{text}");
    if let Some(path) = &args.json {
        let lines: Vec<_> = measured
            .iter()
            .map(|((group, who, case), rounds)| {
                serde_json::json!({"group": group, "who": who, "case": case, "rounds": rounds})
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

/// In the order in which they run: what is set against each other stands next to each other.
fn contenders(args: &Args) -> Result<Vec<Contender>> {
    let ours = std::env::current_exe()?;
    let there = args.peers.is_dir();
    if !there {
        eprintln!("{}: not there, so ours are timed alone; scripts/bench_peers.sh builds it", args.peers.display());
    }
    let passes = |what: &str| PASSES.iter().find(|(name, _)| *name == what).map_or("1", |(_, n)| *n).to_owned();
    let text = |path: &Path| path.display().to_string();
    let mut all = Vec::new();
    let mut add = |group: &str, who: Who, program: &Path, arguments: Vec<String>, bound: bool| {
        let (group, program) = (group.to_owned(), program.to_owned());
        all.push(Contender { group, who, program, arguments, bound });
    };
    let dir = &args.export.dir;
    for robot in export::ROBOTS {
        let states = text(&export::states_file(dir, robot));
        let urdf = text(&export::urdf(robot));
        let one = |kind: &str, rest: &[String]| [&["one".to_owned(), kind.to_owned()], rest].concat();
        if robot == "hyq" {
            for stack in [Stack::S1, Stack::S3] {
                let rest = [text(&args.export.log), stack.name().to_lowercase(), passes("ticks")];
                add(stack.name(), Who::Ours, &ours, one("ticks", &rest), true);
            }
        }
        add(robot, Who::Ours, &ours, one("rigid-body", &[states.clone(), urdf, passes("states")]), true);
        if there {
            let model = text(&args.peers.join(format!("{robot}.txt")));
            add(robot, Who::Pinocchio, &args.peers.join("bin/pinocchio"), vec![model, states, passes("states")], true);
        }
    }
    for (name, programs) in export::programs_files(dir) {
        let rest = vec![text(&programs), passes("programs")];
        let group = format!("programs of {name}");
        let of_ours = [vec!["one".to_owned(), "programs".to_owned()], rest.clone()].concat();
        add(&group, Who::Solver, &ours, of_ours, true);
        for solver in ["daqp", "eiquadprog", "proxqp", "piqp"].into_iter().filter(|_| there) {
            add(&group, Who::Solver, &args.peers.join("bin").join(solver), rest.clone(), true);
        }
    }
    let log = args.replay.as_ref().unwrap_or(&args.export.log);
    for jobs in ["1", "2"] {
        let arguments = vec!["one".to_owned(), "replay".to_owned(), text(log), jobs.to_owned()];
        add(&format!("replay, {jobs}"), Who::Ours, &ours, arguments, jobs == "1");
    }
    Ok(all)
}

impl Contender {
    fn text(&self) -> String {
        let program = self.program.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        format!("{program} {}", self.arguments.join(" "))
    }

    fn run(&self, cpu: usize) -> Result<Vec<Line>> {
        let mut command = if self.bound {
            let mut command = Command::new("taskset");
            command.args(["--cpu-list", &cpu.to_string()]).arg(&self.program);
            command
        } else {
            Command::new(&self.program)
        };
        let output = command.args(&self.arguments).stderr(Stdio::inherit()).output();
        let output = output.with_context(|| format!("cannot start {}", self.text()))?;
        if !output.status.success() {
            bail!("{} ended with {}", self.text(), output.status);
        }
        let lines = String::from_utf8(output.stdout)?;
        lines.lines().map(|line| serde_json::from_str(line).with_context(|| self.text())).collect()
    }
}

/// Where results differ by more than rounding. A solver that stops early is off by itself; if all are, we are.
fn differing(measured: &Measured) -> Vec<String> {
    let mut differing = Vec::new();
    let mut nearest: BTreeMap<&str, f64> = BTreeMap::new();
    for ((group, who, case), rounds) in measured {
        let Some(off) = rounds.iter().filter_map(|line| line.off).reduce(f64::max) else { continue };
        if who == "Pinocchio" {
            if off > SAME[0] {
                differing.push(format!("{group}: {case} of Pinocchio differs from ours by {off:e}"));
            }
        } else if crate::programs::NAMES.iter().all(|name| name != who) {
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

/// Versions of everything, as one line of text each.
fn versions(peers: &Path) -> Result<Vec<String>> {
    let mut versions = Vec::new();
    let cpu = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    versions.push(format!("{}, {cores} cores", model.trim_start_matches(['\t', ' ', ':'])));
    let rustc = Command::new("rustc").arg("--version").output().context("rustc --version")?;
    versions.push(String::from_utf8_lossy(&rustc.stdout).trim().to_owned());
    let path = peers.join("VERSIONS");
    if path.is_file() {
        let text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        versions.extend(text.lines().map(str::to_owned));
    }
    Ok(versions)
}

/// Replaces what stands between the two marks of a file.
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
