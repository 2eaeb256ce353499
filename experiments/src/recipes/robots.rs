//! Robots without hand-tuned parameters: public URDFs, each with the parameter file that `hoof robot init` writes for it.

use crate::bench::{Bench, RunSpec, Sample, count};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;
use anyhow::Context;
use controller::model::GRAVITY;
use controller::params::Params;
use controller::quadruped::robot::Robot;
use controller::robot_init::{Options, propose};
use drivers::mesh;
use drivers::robot_files::{find_shipped, read};
use lcmtypes::ControllerTick;
use std::path::{Path, PathBuf};
use std::process::Command;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "robots",
    title: "public quadrupeds with the files of `hoof robot init`: trot, crawl, lie, stand up, sit, pushes, rough ground",
    published: "no number",
    robot: "hyq",
    seeds: 10,
    minutes: 40.0,
    run: robots,
};

/// Folder of the first package.
macro_rules! example {
    ($file:literal) => {
        concat!("example-robot-data/robots/", $file)
    };
}

/// Name, and URDF below the folder of `scripts/fetch_robots.sh`.
const ROBOTS: [(&str, &str); 12] = [
    ("solo12", example!("solo_description/robots/solo12.urdf")),
    ("a1", example!("a1_description/urdf/a1.urdf")),
    ("go1", example!("go1_description/urdf/go1.urdf")),
    ("go2", example!("go2_description/urdf/go2.urdf")),
    ("b1", example!("b1_description/urdf/b1.urdf")),
    ("b1_z1", example!("b1_description/urdf/b1-z1.urdf")),
    ("laikago", example!("laikago_description/urdf/laikago.urdf")),
    ("anymal_b", example!("anymal_b_simple_description/robots/anymal.urdf")),
    ("anymal_c", example!("anymal_c_simple_description/urdf/anymal.urdf")),
    ("hyq", example!("hyq_description/robots/hyq_no_sensors.urdf")),
    ("mini_cheetah", "pybullet_data/mini_cheetah/mini_cheetah.urdf"),
    ("aliengo", "pybullet_data/aliengo/aliengo.urdf"),
];

/// Force of a push as a fraction of the weight, and its duration, s.
const PUSH: (f64, f64) = (0.25, 0.2);
/// Phases of a stride at which pushes begin.
const PHASES: u32 = 12;
/// Time between two pushes, s.
const BETWEEN_PUSHES: f64 = 2.0;
/// Largest height of a stone, as a fraction of the robot's nominal height.
const STONE: f64 = 0.07;

/// Part of the commanded distance that a walk on flat ground must cover.
const FOLLOWED: f64 = 0.8;
/// Modes of a run that lies, stands up, walks and sits down.
const GETS_UP: [i8; 7] = [
    ControllerTick::MODE_IDLE,
    ControllerTick::MODE_STAND_UP,
    ControllerTick::MODE_STANCE,
    ControllerTick::MODE_WALK,
    ControllerTick::MODE_STANCE,
    ControllerTick::MODE_SIT,
    ControllerTick::MODE_IDLE,
];

/// A robot with the files written for it.
struct Candidate {
    name: &'static str,
    toml: PathBuf,
    /// Weight, N.
    weight: f64,
    /// Height of the hips above the ground, m.
    height: f64,
    /// Time of a stride of its trot, s.
    stride: f64,
    /// Highest trot speed that is commanded, m/s, and the same for the crawl.
    speeds: [f64; 2],
}

fn robots(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let Some(folder) = fetched(bench)? else { return Ok(vec![Row::info("robots fetched", 0.0, "")]) };
    let mut rows = Vec::new();
    for (name, urdf) in ROBOTS {
        match candidate(bench, name, &folder.join(urdf)) {
            Ok(candidate) => rows.extend(judged(bench, &candidate)?),
            Err(error) => {
                bench.note(format!("{name}: {error:#}"));
                rows.push(Row::info(format!("{name}: files written"), 0.0, "").exactly(1.0));
            }
        }
    }
    Ok(rows)
}

/// The folder with the URDFs; `None`, with a note, if they cannot be fetched.
fn fetched(bench: &Bench) -> anyhow::Result<Option<PathBuf>> {
    let script = find_shipped("scripts/fetch_robots.sh")?;
    let folder = bench.dir().join("fetched");
    let done = Command::new(&script)
        .arg(std::path::absolute(&folder)?)
        .output()
        .with_context(|| script.display().to_string())?;
    match done.status.code() {
        Some(0) => Ok(Some(folder)),
        Some(3) => {
            bench.note(format!("skipped: {}", String::from_utf8_lossy(&done.stderr).trim()));
            Ok(None)
        }
        _ => anyhow::bail!("{}: {}", script.display(), String::from_utf8_lossy(&done.stderr).trim()),
    }
}

/// Writes the files of a robot.
fn candidate(bench: &Bench, name: &'static str, urdf: &Path) -> anyhow::Result<Candidate> {
    let text = read(urdf)?;
    let folder = bench.dir().join(name);
    let options = Options {
        urdf_file: "source.urdf",
        beside: false,
        srdf: None,
        name: Some(name),
        fixed: &[],
        bounds: &|mesh| mesh::bounds(mesh, urdf),
    };
    let proposal = propose(&text, &urdf.display().to_string(), &options)?;
    std::fs::create_dir_all(&folder)?;
    let toml = folder.join(format!("{name}.toml"));
    std::fs::write(&toml, &proposal.toml)?;
    let urdf = proposal.urdf.unwrap_or(text);
    std::fs::write(folder.join(&proposal.urdf_file), &urdf)?;
    let params = Params::from_toml(&proposal.toml, name)?;
    let robot = Robot::new(&urdf, &params.robot)?;
    let stride = |gait: &controller::quadruped::params::GaitTiming| 1.0 / (gait.swing_frequency * (1.0 - gait.duty));
    let step = params.foothold.max_step_length;
    let speed = |gait, most: f64| (0.5 * step / stride(gait)).min(most);
    Ok(Candidate {
        name,
        toml,
        weight: robot.mass() * GRAVITY,
        height: proposal.hip_height,
        stride: stride(&params.gait.trot),
        speeds: [speed(&params.gait.trot, 0.4), speed(&params.gait.crawl, 0.1)],
    })
}

fn judged(bench: &Bench, robot: &Candidate) -> anyhow::Result<Vec<Row>> {
    let Candidate { name, height, speeds: [trot, crawl], .. } = robot;
    let spec = |scenario: &str, run: &str| RunSpec::of(scenario).named(format!("{name}_{run}")).robot(&robot.toml);
    let walk = |gait: &str, speed: f64| {
        let operator = format!(
            "[{{ t_s = 0.0, mode = \"stand\", gait = \"{gait}\" }}, {{ t_s = 1.0, mode = \"walk\" }}, {{ t_s = 2.0, v_x = {speed:.4} }}]"
        );
        spec("flat_trot", gait).with("operator", operator).with("duration_s", "12.0")
    };
    let far = |run: &Sample, way: Option<f64>, least: f64| !run.failed() && way.is_some_and(|way| way >= least);
    let row = |what: &str, passed: usize, runs: usize| {
        Row::info(format!("{name}: {what}: passed of {runs}"), count(passed), "").exactly(count(runs))
    };
    let mut rows = Vec::new();
    for (gait, speed) in [("trot", trot), ("crawl", crawl)] {
        let run = bench.one(walk(gait, *speed))?;
        let passed = far(&run, run.metrics.locomotion.displacement_m, FOLLOWED * speed * 10.0);
        rows.push(row(&format!("{gait} at {speed:.2} m/s"), usize::from(passed), 1));
    }
    let lies = bench.one_with(spec("lie_stand_walk_sit", "lie"), modes)?;
    let passed = !lies.failed() && lies.measured == GETS_UP;
    rows.push(row("lie, stand up, walk, sit", usize::from(passed), 1));
    let pushed = bench.all(&format!("{name} pushes"), Direction::ALL.map(|to| pushes(robot, to)).to_vec())?;
    let passed = pushed.iter().filter(|run| !run.failed()).count();
    rows.push(row(&format!("pushes at {PHASES} phases, directions"), passed, pushed.len()));
    let most = STONE * height;
    let rough = bench.seeds().map(|seed| {
        spec("rough_trot", "rough").with("terrain.height_m", format!("[{:.4}, {most:.4}]", most / 2.0)).seed(seed)
    });
    let rough = bench.all(&format!("{name} rough"), rough.collect())?;
    let walked = |run: &&Sample| far(run, run.metrics.locomotion.distance_m, 0.5 * trot * 16.0);
    let passed = rough.iter().filter(walked).count();
    rows.push(row("rough ground, seeds", passed, rough.len()));
    Ok(rows)
}

/// The modes of a run, without repetitions.
fn modes(run: &Run) -> Vec<i8> {
    let mut modes: Vec<i8> =
        run.ticks.iter().filter_map(|tick| tick.status.as_ref()).map(|status| status.mode).collect();
    modes.dedup();
    modes
}

/// Direction of a push in W.
#[derive(Clone, Copy)]
enum Direction {
    Forward,
    Backward,
    Left,
    Right,
}

impl Direction {
    const ALL: [Direction; 4] = [Direction::Forward, Direction::Backward, Direction::Left, Direction::Right];

    fn of(self) -> (&'static str, [f64; 2]) {
        match self {
            Direction::Forward => ("forward", [1.0, 0.0]),
            Direction::Backward => ("backward", [-1.0, 0.0]),
            Direction::Left => ("left", [0.0, 1.0]),
            Direction::Right => ("right", [0.0, -1.0]),
        }
    }
}

/// Time at which a push begins, s: the robot trots from 1 s on, and each push is at a phase of the stride that is a twelfth later than that of the push before.
fn push_time(robot: &Candidate, number: u32) -> f64 {
    let strides = (BETWEEN_PUSHES / robot.stride).ceil();
    2.0 + f64::from(number) * robot.stride * (strides + 1.0 / f64::from(PHASES))
}

/// A trot in place with a push at each phase.
fn pushes(robot: &Candidate, direction: Direction) -> RunSpec {
    let (name, [x, y]) = direction.of();
    let force = PUSH.0 * robot.weight;
    let push = |number| {
        let at = push_time(robot, number);
        format!("{{ t_s = {at:.4}, duration_s = {}, force_W = [{:.3}, {:.3}, 0.0] }}", PUSH.1, x * force, y * force)
    };
    let all = (0..PHASES).map(push).collect::<Vec<_>>().join(", ");
    let operator = "[{ t_s = 0.0, mode = \"stand\", gait = \"trot\" }, { t_s = 1.0, mode = \"walk\" }]";
    RunSpec::of("flat_trot")
        .named(format!("{}_push_{name}", robot.name))
        .robot(&robot.toml)
        .with("operator", operator)
        .with("push", format!("[{all}]"))
        .with("duration_s", format!("{:.2}", push_time(robot, PHASES)))
}
