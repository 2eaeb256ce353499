//! Converts the log of a simulated run for `scripts/render_walk.py`: the robot on its ground as MJCF, and its poses over time as CSV.
//!
//! ```text
//! cargo run --release -p drivers --example poses -- run.mcap out/walk      # writes out/walk/model.xml and out/walk/poses.csv
//! python3 scripts/render_walk.py out/walk/model.xml out/walk/poses.csv --out out/walk
//! ```
//!
//! All inputs come from the log: RUN_INFO contains URDF, parameters, scenario and seed.

use controller::params::Params;
use drivers::{MujocoSim, Scenario, SimParams, Simulator, Terrain};
use lcmtypes::{GroundTruth, Message, RobotState, RunInfo, channels};
use replay::log::LogReader;
use robot_model::UrdfTree;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Time between two poses, ns: 50 per second.
const EVERY: i64 = 20_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [log, out] = args.as_slice() else { return Err("expected two arguments: LOG and the output folder".into()) };
    std::fs::create_dir_all(out)?;

    let (mut csv, mut joints, mut state) = (String::new(), None, RobotState::default());
    for event in LogReader::open(log)?.events() {
        let event = event?;
        match &*event.channel {
            channels::RUN_INFO => joints = Some(write_model(&RunInfo::decode(&event.data)?, Path::new(out))?),
            channels::ROBOT_STATE => state = RobotState::decode(&event.data)?,
            channels::GROUND_TRUTH if event.t_ns % EVERY == 0 => {
                row(&mut csv, &GroundTruth::decode(&event.data)?, &state)?
            }
            _ => {}
        }
    }
    let joints = joints.ok_or("the log has no RUN_INFO")?;
    let header = format!("t_s,x,y,z,qw,qx,qy,qz,{}\n", joints.join(","));
    std::fs::write(Path::new(out).join("poses.csv"), header + &csv)?;
    Ok(())
}

/// Writes the MJCF file and returns the joint names.
fn write_model(info: &RunInfo, out: &Path) -> Result<Vec<String>, Box<dyn Error>> {
    let params = Params::from_toml(info.params(), "RUN_INFO")?;
    let scenario = Scenario::parse(&info.scenario, &info.scenario_name, &params.gait)?;
    let terrain = Terrain::new(&scenario.terrain, info.seed);
    let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
    let sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(&scenario))?;
    std::fs::write(out.join("model.xml"), sim.mjcf())?;
    Ok(sim.joints().to_vec())
}

fn row(csv: &mut String, truth: &GroundTruth, state: &RobotState) -> std::fmt::Result {
    #[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
    let t_s = truth.t_ns as f64 * 1e-9;
    write!(csv, "{t_s}")?;
    for x in truth.p_WB.iter().chain(&truth.q_WB_wxyz).chain(&state.q) {
        write!(csv, ",{x}")?;
    }
    writeln!(csv)
}
