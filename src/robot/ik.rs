//! `hoof robot ik`: one-shot inverse kinematics.

use crate::{Outcome, say, say_json};
use controller::cartesian::one_shot::{Goal, Met, OneShot, one_shot};
use controller::params::Params;
use drivers::robot_files::RobotFiles;
use serde_json::json;

/// A goal is met within this distance, m, and this angle, rad.
const CLOSE: (f64, f64) = (1e-4, 1e-3);

#[derive(clap::Args)]
#[command(after_help = "Example: hoof robot ik centauro_upper --goal \"arm1_8 0.5 0.25 0.9\"\n         \
    hoof robot ik coman --hold l_sole --hold r_sole --goal \"RSoftHand 0.3 -0.2 0.6 0.9239 0 -0.3827 0\" --json\n\n\
    The base of a robot that can move starts with its lowest contact on the ground, and moves, too. Exit code 0: all goals are met within 0.1 mm\n\
    and 1 mrad; 1: one is not, and is named.")]
pub struct Args {
    /// Name of a robot in robots/, or its TOML file
    robot: String,
    /// "LINK X Y Z" or "LINK X Y Z QW QX QY QZ": pose in the world, m. Can be repeated
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    goal: Vec<String>,
    /// Link that keeps the pose that it has in the posture. Can be repeated
    #[arg(long, value_name = "LINK")]
    hold: Vec<String>,
    /// Posture to start at and to stay near to
    #[arg(long, value_name = "NAME", default_value = controller::model::NOMINAL)]
    posture: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    anyhow::ensure!(!args.goal.is_empty() || !args.hold.is_empty(), "expected --goal or --hold");
    let (files, params) = RobotFiles::find_with_params(&args.robot)?;
    let tree = files.tree()?;
    let robot = Params::from_toml(&params, &args.robot)?.robot.description(&tree)?;
    let mut goals = args.goal.iter().map(|text| goal(text)).collect::<anyhow::Result<Vec<_>>>()?;
    goals.extend(args.hold.iter().map(|link| Goal { link: link.clone(), position: None, q_wxyz: None }));
    let OneShot { state, goals, steps } = one_shot(&robot, &tree, &args.posture, &goals)?;
    let joints: Vec<(&str, f64)> = robot.joints.iter().map(|joint| &*joint.name).zip(state.q.iter().copied()).collect();
    let is_met = |met: &Met| met.position_error <= CLOSE.0 && met.orientation_error <= CLOSE.1;
    let all_met = goals.iter().all(is_met);
    if args.json {
        let joints: serde_json::Map<_, _> = joints.iter().map(|(name, q)| ((*name).to_owned(), json!(q))).collect();
        let goals: Vec<_> = goals
            .iter()
            .map(|met| {
                json!({ "link": met.link, "met": is_met(met), "position_error_m": met.position_error, "orientation_error_rad": met.orientation_error })
            })
            .collect();
        let base = json!({ "position_m": [state.p_WB.x, state.p_WB.y, state.p_WB.z], "quaternion_wxyz": state.q_WB });
        say_json(&json!({ "met": all_met, "steps": steps, "goals": goals, "base": base, "q": joints }))?;
        return Ok(Outcome::failed_if(!all_met));
    }
    for met in &goals {
        let verdict = if is_met(met) { "met" } else { "NOT met" };
        say(format!(
            "{}: {verdict}, {:.2e} m and {:.2e} rad from the goal",
            met.link, met.position_error, met.orientation_error
        ))?;
    }
    for (name, q) in joints {
        say(format!("{name} = {q:.6}"))?;
    }
    Ok(Outcome::failed_if(!all_met))
}

/// A goal from its text.
fn goal(text: &str) -> anyhow::Result<Goal> {
    let mut words = text.split_whitespace();
    let link = words.next().unwrap_or_default().to_owned();
    let number = |word: &str| word.parse().map_err(|_| anyhow::anyhow!("--goal {text:?}: {word:?} is not a number"));
    let numbers = words.map(number).collect::<anyhow::Result<Vec<f64>>>()?;
    let q_wxyz = match numbers.len() {
        3 => None,
        7 => Some([numbers[3], numbers[4], numbers[5], numbers[6]]),
        n => anyhow::bail!("--goal {text:?}: {n} numbers, expected LINK X Y Z or LINK X Y Z QW QX QY QZ"),
    };
    Ok(Goal { link, position: Some([numbers[0], numbers[1], numbers[2]]), q_wxyz })
}
