//! `hoof task`: the tasks of a Cartesian server in a live run.

use crate::live::Client;
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use clap::{Subcommand, ValueEnum};
use drivers::live::clock::now_ns;
use lcmtypes::{
    Message, RequestReply, TaskAnswer, TaskReply, TaskRequest, TaskState, TaskStatus, TaskWaypoint, channels,
    enum_names,
};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Channels of a server in any component.
const REPLIES: &str = "(.*/)?TASK_REPLY";
const STATUSES: &str = "(.*/)?TASK_STATUS";
/// Time between two velocity requests.
const VELOCITY_PERIOD: Duration = Duration::from_millis(50);

/// Show and move the tasks of a Cartesian server (controller cartesian_ik) in a live run
///
/// Each operation is a request that the controller carries out in a tick, and answers; a refused one changes nothing. Positions are in m in the axes of the base
/// link of the task, orientations are quaternions w x y z. Exit code 1 if the request is refused, 2 if there is no answer.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof task list\n         \
    hoof task pose left_hand 0.4 0.2 0.9\n         \
    hoof task waypoints left_hand --relative --to \"1.5 0 0 0.1\" --to \"3 0.1 0 0\"\n         \
    hoof task mode left_hand velocity && hoof task velocity left_hand 0 0 0.05 --seconds 2\n         \
    hoof task base-link left_hand torso\n\n\
    --json prints {\"refused\": BOOL, \"code\": CODE, \"tick\": N, \"reason\": TEXT}. CODE is done, rejected, unknown_name, out_of_range or wrong_state.")]
pub struct Args {
    #[command(subcommand)]
    operation: Operation,
    /// LCM network [default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL", global = true)]
    lcm_url: Option<String>,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Operation {
    /// Print all tasks: type, links, level, mode, error, residual
    List,
    /// Print reference, pose and error of a task
    Info { task: String },
    /// Set the reference: X Y Z, or X Y Z and a quaternion QW QX QY QZ
    Pose {
        task: String,
        #[arg(num_args = 3..=7, required = true, allow_negative_numbers = true, value_name = "NUMBER")]
        pose: Vec<f64>,
        /// Relative to the present reference, in the axes of the base link
        #[arg(long)]
        relative: bool,
    },
    /// Move through poses, at rest in each of them
    Waypoints {
        task: String,
        /// A pose: "TIME X Y Z" or "TIME X Y Z QW QX QY QZ", TIME in s from now on. Can be repeated
        #[arg(long, required = true, allow_hyphen_values = true, value_name = "POSE")]
        to: Vec<String>,
        /// Relative to the present reference, in the axes of the base link
        #[arg(long)]
        relative: bool,
    },
    /// Move with a velocity: VX VY VZ in m/s, and WX WY WZ in rad/s; the task must be in velocity mode
    Velocity {
        task: String,
        #[arg(num_args = 3..=6, required = true, allow_negative_numbers = true, value_name = "NUMBER")]
        twist: Vec<f64>,
        /// Time for which it is repeated, s
        #[arg(long, default_value_t = 1.0, value_parser = crate::log::seconds)]
        seconds: f64,
    },
    /// Follow poses or velocities
    Mode { task: String, mode: Mode },
    /// Make the reference relative to another link, or to world; nothing moves
    BaseLink { task: String, link: String },
    /// Switch a task on or off; a task that is off is not in the problem
    Activate { task: String, state: Switch },
    /// Set the weight: one number, or one for each row
    Weight {
        task: String,
        #[arg(required = true, value_name = "NUMBER")]
        weights: Vec<f64>,
    },
    /// Set the gain, 1/s
    Gain { task: String, gain: f64 },
    /// Limit the reference: velocity (m/s), acceleration (m/s2), angular velocity (rad/s), angular acceleration (rad/s2), and optionally jerk (m/s3) and angular
    /// jerk (rad/s3); inf for none
    Limits {
        task: String,
        #[arg(num_args = 4..=6, required = true, value_name = "NUMBER")]
        limits: Vec<f64>,
    },
    /// Make the present pose the reference
    Reset { task: String },
    /// Give a posture task another named posture of the robot
    Posture { task: String, name: String },
}

#[derive(Clone, Copy, ValueEnum)]
enum Mode {
    Position,
    Velocity,
}

#[derive(Clone, Copy, ValueEnum)]
enum Switch {
    On,
    Off,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.operation {
        Operation::List => list(args),
        Operation::Info { task } => info(args, task),
        Operation::Velocity { seconds, .. } => {
            let mut client = client(args)?;
            let end = Instant::now() + Duration::from_secs_f64(*seconds);
            loop {
                let (tick, answer) = ask(&mut client, &args.operation)?;
                if answer.code != RequestReply::CODE_DONE || Instant::now() >= end {
                    return print(args, tick, &answer);
                }
                std::thread::sleep(VELOCITY_PERIOD);
            }
        }
        operation => {
            let (tick, answer) = ask(&mut client(args)?, operation)?;
            print(args, tick, &answer)
        }
    }
}

fn client(args: &Args) -> anyhow::Result<Client> {
    Client::listening(args.lcm_url.as_deref(), REPLIES)
}

/// Sends a request and waits for its answer, and the tick that carried it out.
fn ask(client: &mut Client, operation: &Operation) -> anyhow::Result<(i64, TaskAnswer)> {
    let request = request(operation)?;
    client.ask(
        channels::TASK_REQUEST,
        |sender_id, request_id| TaskRequest { t_ns: now_ns(), sender_id, request_id, ..request },
        |bytes, sender_id, request_id| {
            let reply = TaskReply::decode(bytes).ok()?;
            let of_request = |answer: &TaskAnswer| (answer.sender_id, answer.request_id) == (sender_id, request_id);
            Some((reply.tick, reply.answers.into_iter().find(of_request)?))
        },
    )
}

fn print(args: &Args, tick: i64, answer: &TaskAnswer) -> anyhow::Result<Outcome> {
    let is_done = answer.code == RequestReply::CODE_DONE;
    if args.json {
        let code = enum_names::reply_code(answer.code);
        say_json(&json!({ "refused": !is_done, "code": code, "tick": tick, "reason": answer.reason }))?;
    } else if is_done {
        say(format!("done in tick {tick}"))?;
    } else {
        say(format!("refused: {}", answer.reason))?;
    }
    Ok(Outcome::failed_if(!is_done))
}

/// The request of an operation.
fn request(operation: &Operation) -> anyhow::Result<TaskRequest> {
    let with_values = |task: &String, operation: i8, values: Vec<f64>| TaskRequest {
        operation,
        task: task.clone(),
        m: count(values.len()),
        values,
        ..TaskRequest::default()
    };
    let with_poses = |task: &String, operation: i8, relative: bool, poses: Vec<TaskWaypoint>| TaskRequest {
        operation,
        task: task.clone(),
        relative,
        n: count(poses.len()),
        poses,
        ..TaskRequest::default()
    };
    let with_name = |task: &String, operation: i8, name: &String| TaskRequest {
        name: name.clone(),
        ..with_values(task, operation, Vec::new())
    };
    Ok(match operation {
        Operation::List | Operation::Info { .. } => TaskRequest::default(),
        Operation::Pose { task, pose, relative } => {
            with_poses(task, TaskRequest::POSE, *relative, vec![waypoint(0.0, pose)?])
        }
        Operation::Waypoints { task, to, relative } => {
            let poses = to.iter().map(|to| timed(to)).collect::<anyhow::Result<_>>()?;
            with_poses(task, TaskRequest::WAYPOINTS, *relative, poses)
        }
        Operation::Velocity { task, twist, .. } => {
            anyhow::ensure!(matches!(twist.len(), 3 | 6), "velocity: {} numbers, expected 3 or 6", twist.len());
            let mut twist = twist.clone();
            twist.resize(6, 0.0);
            with_values(task, TaskRequest::VELOCITY, twist)
        }
        Operation::Mode { task, mode } => {
            let mode = match mode {
                Mode::Position => TaskRequest::MODE_POSITION,
                Mode::Velocity => TaskRequest::MODE_VELOCITY,
            };
            with_values(task, TaskRequest::MODE, vec![mode.into()])
        }
        Operation::BaseLink { task, link } => with_name(task, TaskRequest::BASE_LINK, link),
        Operation::Activate { task, state } => {
            with_values(task, TaskRequest::ACTIVATE, vec![f64::from(u8::from(matches!(state, Switch::On)))])
        }
        Operation::Weight { task, weights } => with_values(task, TaskRequest::WEIGHT, weights.clone()),
        Operation::Gain { task, gain } => with_values(task, TaskRequest::GAIN, vec![*gain]),
        Operation::Limits { task, limits } => {
            anyhow::ensure!(matches!(limits.len(), 4 | 6), "limits: {} numbers, expected 4 or 6", limits.len());
            with_values(task, TaskRequest::LIMITS, limits.clone())
        }
        Operation::Reset { task } => with_values(task, TaskRequest::RESET, Vec::new()),
        Operation::Posture { task, name } => with_name(task, TaskRequest::POSTURE, name),
    })
}

/// A way-point from its text.
fn timed(text: &str) -> anyhow::Result<TaskWaypoint> {
    let number = |word: &str| word.parse().map_err(|_| anyhow::anyhow!("--to {text:?}: {word:?} is not a number"));
    let numbers = text.split_whitespace().map(number).collect::<anyhow::Result<Vec<f64>>>()?;
    anyhow::ensure!(matches!(numbers.len(), 4 | 8), "--to {text:?}: {} numbers, expected 4 or 8", numbers.len());
    waypoint(numbers[0], &numbers[1..])
}

fn waypoint(time: f64, pose: &[f64]) -> anyhow::Result<TaskWaypoint> {
    anyhow::ensure!(
        matches!(pose.len(), 3 | 7),
        "a pose has {} numbers, expected X Y Z or X Y Z QW QX QY QZ",
        pose.len()
    );
    let q_wxyz = pose[3..].try_into().unwrap_or([1.0, 0.0, 0.0, 0.0]);
    Ok(TaskWaypoint { time, position: [pose[0], pose[1], pose[2]], q_wxyz })
}

fn count(n: usize) -> i32 {
    i32::try_from(n).unwrap_or(i32::MAX)
}

fn status(args: &Args) -> anyhow::Result<TaskStatus> {
    Client::listening(args.lcm_url.as_deref(), STATUSES)?.wait(|bytes| TaskStatus::decode(bytes).ok())
}

fn list(args: &Args) -> anyhow::Result<Outcome> {
    let status = status(args)?;
    if args.json {
        let levels: Vec<Value> = status
            .levels
            .iter()
            .map(|level| json!({ "status": level_status(level.status), "rows": level.rows, "rank": level.rank, "residual": level.residual, "active": level.active }))
            .collect();
        let tasks: Vec<Value> = status.tasks.iter().map(as_json).collect();
        say_json(&json!({ "tick": status.tick, "relaxed": status.relaxed, "tasks": tasks, "levels": levels }))?;
        return Ok(Outcome::Good);
    }
    let mut table = Table::new([
        Column::left("task"),
        Column::left("type"),
        Column::left("link"),
        Column::left("base link"),
        Column::left("level"),
        Column::left("mode"),
        Column::right("error"),
        Column::right("residual"),
    ]);
    for task in &status.tasks {
        table.row([
            task.name.clone(),
            task.r#type.clone(),
            task.link.clone(),
            task.base_link.clone(),
            if task.level < 0 { "constraint".to_owned() } else { (task.level + 1).to_string() },
            mode(task).to_owned(),
            format!("{:.2e}", norm(&task.error)),
            format!("{:.2e}", task.residual),
        ]);
    }
    say(table.to_string())?;
    for (k, level) in status.levels.iter().enumerate() {
        let at_limits =
            if level.active.is_empty() { String::new() } else { format!(", at limits: {}", level.active.join(" ")) };
        say(format!(
            "level {}: {}, {} rows, rank {}, residual {:.2e}{at_limits}",
            k + 1,
            level_status(level.status),
            level.rows,
            level.rank,
            level.residual
        ))?;
    }
    if status.relaxed {
        say("the constraints that are tasks contradict the limits of the joints")?;
    }
    Ok(Outcome::Good)
}

fn info(args: &Args, name: &str) -> anyhow::Result<Outcome> {
    let status = status(args)?;
    let known = || status.tasks.iter().map(|task| task.name.as_str()).collect::<Vec<_>>().join(", ");
    let task = status.tasks.iter().find(|task| task.name == name);
    let task = task.ok_or_else(|| anyhow::anyhow!("no task {name:?}; the tasks are {}", known()))?;
    if args.json {
        say_json(&as_json(task))?;
        return Ok(Outcome::Good);
    }
    let numbers = |x: &[f64]| x.iter().map(|x| format!("{x:+.4}")).collect::<Vec<_>>().join(" ");
    say(format!(
        "{name}: {}, {}, gain {} 1/s, weight {}\nreference {}\nactual    {}\nerror     {}\nresidual  {:.3e}",
        task.r#type,
        mode(task),
        task.gain,
        task.weight,
        numbers(&task.reference),
        numbers(&task.actual),
        numbers(&task.error),
        task.residual
    ))?;
    if task.waypoint >= 0 {
        say(format!("on the way to way-point {}: {:.0} %", task.waypoint + 1, 100.0 * task.progress))?;
    }
    Ok(Outcome::Good)
}

fn as_json(task: &TaskState) -> Value {
    json!({
        "name": task.name, "type": task.r#type, "link": task.link, "base_link": task.base_link, "level": task.level, "active": task.active,
        "mode": mode(task), "gain": task.gain, "weight": task.weight, "waypoint": task.waypoint, "progress": task.progress, "residual": task.residual,
        "reference": task.reference, "actual": task.actual, "error": task.error,
    })
}

fn mode(task: &TaskState) -> &'static str {
    match (task.active, task.mode) {
        (false, _) => "disabled",
        (true, TaskRequest::MODE_VELOCITY) => "velocity",
        (true, _) => "position",
    }
}

fn level_status(status: i8) -> &'static str {
    ["solved", "infeasible", "iteration_limit", "not_reached"]
        .get(usize::try_from(status).unwrap_or(3))
        .unwrap_or(&"unknown")
}

fn norm(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |sum, x| sum + x * x).sqrt()
}
