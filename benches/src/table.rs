//! The result as Markdown tables.

use crate::programs;
use crate::run::Measured;
use crate::sample::Line;
use controller::Stage;
use std::fmt::Write;

/// Quantities in the order of the table: case and description.
const QUANTITIES: [(&str, &str); 8] = [
    ("pass", "forward kinematics up to accelerations; in this project the pass that all rows below use"),
    ("foot_jacobians", "Jacobians of four feet"),
    ("mass_matrix", "mass matrix"),
    ("bias_force", "bias force"),
    ("foot_accelerations", "bias accelerations of four feet"),
    ("com", "centre of mass and its velocity"),
    ("centroidal", "centroidal momentum and its matrix"),
    ("set", "**all that a tick needs**"),
];
/// Pinocchio's two ways to compute the set; the faster one is the reference.
const SETS: [&str; 2] = ["set", "set, crba in the world frame"];
/// Limit on the time of a tick in units of Pinocchio's set on the same robot: half of TSID's tick for S1, TSID's tick for S3.
const TICK_LIMIT: [(&str, f64); 2] = [("S1", 3.6), ("S3", 7.2)];
/// Required speed of a replay on two cores, as a multiple of real time.
const REPLAY_SPEED: f64 = 40.0;

/// All tables.
pub fn markdown(measured: &Measured, versions: &[String]) -> String {
    let all = Lines(measured);
    let mut out = String::new();
    all.write(&mut out, versions).expect("writing to a String does not fail");
    out
}

/// One case in all rounds.
#[derive(Clone, Copy)]
struct Case<'a>(&'a [Line]);

impl Case<'_> {
    fn median(self, of: impl Fn(&Line) -> f64) -> f64 {
        median(self.0.iter().map(of).collect())
    }

    /// `median (p99)` in µs.
    fn text(self) -> String {
        format!("{} ({})", us(self.median(|line| line.median_ns)), us(self.median(|line| line.p99_ns)))
    }

    fn allocations(self) -> String {
        self.0.iter().filter_map(|line| line.allocations).max().map_or("-".to_owned(), |n| n.to_string())
    }

    /// Median of the rounds' ratios of the medians.
    fn ratio(self, to: Case) -> f64 {
        median(self.0.iter().zip(to.0).map(|(ours, theirs)| ours.median_ns / theirs.median_ns).collect())
    }
}

struct Lines<'a>(&'a Measured);

impl<'a> Lines<'a> {
    fn case(&self, group: &str, origin: &str, case: &str) -> Option<Case<'a>> {
        self.0.get(&(group.to_owned(), origin.to_owned(), case.to_owned())).map(|lines| Case(lines))
    }

    /// The faster one of Pinocchio's ways to compute the set.
    fn set(&self, robot: &str) -> Option<Case<'a>> {
        let sets = SETS.iter().filter_map(|set| self.case(robot, "Pinocchio", set));
        sets.min_by(|a, b| a.median(|line| line.median_ns).total_cmp(&b.median(|line| line.median_ns)))
    }

    fn write(&self, out: &mut String, versions: &[String]) -> std::fmt::Result {
        writeln!(
            out,
            "Median (p99) of single calls in µs: medians over rounds in which the processes ran in turn. {}.\n",
            versions.join("; ")
        )?;
        self.rigid_body(out)?;
        self.programs(out)?;
        self.ticks(out)?;
        self.replay(out)
    }

    fn rigid_body(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "| rigid body | HyQ | Pinocchio | ratio | ANYmal B | Pinocchio | ratio | allocations |")?;
        writeln!(out, "|---|---|---|---|---|---|---|---|")?;
        for (case, description) in QUANTITIES {
            write!(out, "| {description} |")?;
            let mut allocations = String::new();
            for robot in ["hyq", "anymal_b"] {
                let ours = self.case(robot, "ours", case);
                let peer = if case == "set" { self.set(robot) } else { self.case(robot, "Pinocchio", case) };
                let ratio = ours.zip(peer).map_or("-".to_owned(), |(ours, peer)| format!("{:.2}", ours.ratio(peer)));
                write!(out, " {} | {} | {ratio} |", text(ours), text(peer))?;
                allocations = ours.map(Case::allocations).unwrap_or_default();
            }
            writeln!(out, " {allocations} |")?;
        }
        writeln!(out)
    }

    fn programs(&self, out: &mut String) -> std::fmt::Result {
        let groups: Vec<&str> = ["S1", "S3 level 1", "S3 level 2", "S3 level 3"]
            .into_iter()
            .filter(|name| self.has_programs(name))
            .collect();
        let ours = programs::NAMES[0];
        writeln!(
            out,
            "| quadratic programs | {} | time of ours / its time, S1 | largest error | unsolved | allocations |",
            groups.join(" | ")
        )?;
        writeln!(out, "|---|{}---|---|---|---|", "---|".repeat(groups.len()))?;
        for origin in self.solvers() {
            write!(out, "| {origin} |")?;
            let cases: Vec<_> = groups.iter().map(|name| self.program(name, origin)).collect();
            for case in &cases {
                write!(out, " {} |", text(*case))?;
            }
            let ratio = cases[0].and_then(|it| Some(self.program(groups[0], ours)?.ratio(it)));
            let ratio = ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"));
            let lines = || cases.iter().flatten().flat_map(|case| case.0);
            let off = lines().filter_map(|line| line.off).fold(0.0, f64::max);
            let unsolved =
                cases.iter().flatten().filter_map(|case| case.0.iter().map(|line| line.unsolved).max()).sum::<u64>();
            let allocations = cases.iter().flatten().map(|case| case.allocations()).max().unwrap_or_default();
            writeln!(out, " {ratio} | {off:.0e} | {unsolved} | {allocations} |")?;
        }
        writeln!(out)
    }

    /// Solvers of this project first, then the others by their time on the programs of S1.
    fn solvers(&self) -> Vec<&'a str> {
        let mut names: Vec<&str> = self
            .0
            .keys()
            .filter(|(group, ..)| group == "programs of S1")
            .map(|(_, origin, _)| origin.as_str())
            .collect();
        let time = |origin: &str| self.program("S1", origin).map_or(0.0, |case| case.median(|line| line.median_ns));
        let ours = |origin: &str| programs::NAMES.contains(&origin);
        names.sort_by(|a, b| ours(b).cmp(&ours(a)).then(time(a).total_cmp(&time(b))));
        names
    }

    fn has_programs(&self, name: &str) -> bool {
        self.0.keys().any(|(group, ..)| *group == format!("programs of {name}"))
    }

    fn program(&self, name: &str, origin: &str) -> Option<Case<'a>> {
        self.case(&format!("programs of {name}"), origin, "solve")
    }

    fn ticks(&self, out: &mut String) -> std::fmt::Result {
        let [s1, s3] = ["S1", "S3"].map(|stack| self.case(stack, "ours", "tick"));
        writeln!(out, "| tick of HyQ | S1 | S3 |")?;
        writeln!(out, "|---|---|---|")?;
        writeln!(out, "| **input to torques** | {} | {} |", text(s1), text(s3))?;
        let ratio = |stack: &str, tick: Option<Case>| {
            let limit = TICK_LIMIT.iter().find(|(name, _)| *name == stack).map_or(f64::NAN, |(_, limit)| *limit);
            tick.zip(self.set("hyq"))
                .map_or("-".to_owned(), |(tick, set)| format!("{:.1} (limit: {limit})", tick.ratio(set)))
        };
        writeln!(out, "| in Pinocchio's sets of HyQ | {} | {} |", ratio("S1", s1), ratio("S3", s3))?;
        let tail = |tick: Option<Case>| {
            tick.map_or("-".to_owned(), |tick| format!("{:.2}", tick.median(|line| line.p99_ns / line.median_ns)))
        };
        writeln!(out, "| p99 / median (limit: 1.5) | {} | {} |", tail(s1), tail(s3))?;
        let allocations = |tick: Option<Case>| tick.map(Case::allocations).unwrap_or_default();
        writeln!(out, "| allocations | {} | {} |", allocations(s1), allocations(s3))?;
        for stage in Stage::ALL {
            let case = format!("stage {}", stage.name());
            let [s1, s3] = ["S1", "S3"].map(|stack| text(self.case(stack, "ours", &case)));
            writeln!(out, "| {case} | {s1} | {s3} |")?;
        }
        writeln!(out)
    }

    fn replay(&self, out: &mut String) -> std::fmt::Result {
        writeln!(out, "| replay of HyQ, S1, every message compared | times real time (required: {REPLAY_SPEED}) |")?;
        writeln!(out, "|---|---|")?;
        for (jobs, text) in [("1", "one thread"), ("2", "two threads")] {
            let factor = self
                .case(&format!("replay, {jobs}"), "ours", "replay")
                .map_or(f64::NAN, |case| case.median(|line| line.real_time_factor.unwrap_or(f64::NAN)));
            writeln!(out, "| {text} | {factor:.1} |")?;
        }
        Ok(())
    }
}

fn text(case: Option<Case>) -> String {
    case.map_or("-".to_owned(), Case::text)
}

/// Nanoseconds as µs with three digits.
fn us(ns: f64) -> String {
    let us = ns / 1e3;
    let digits = if us < 10.0 { 2 } else { usize::from(us < 100.0) };
    format!("{us:.digits$}")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
