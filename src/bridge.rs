//! `hoof bridge`: connects a live run to other middleware.

use crate::live::Stop;
use crate::{Outcome, say, say_json};
use anyhow::Context;
use bridge::session::{Options, Session, Summary};
use bridge::twist::CHANNEL;
use clap::Subcommand;
use drivers::teleop::check_channel;
use lcmtypes::bus::LcmBus;
use std::time::{Duration, Instant};

#[derive(Subcommand)]
pub enum Command {
    Ros2(Ros2Args),
}

/// Publish a live run as ROS 2 topics over DDS, without a ROS installation
///
/// Topics: /joint_states, /imu, /tf, /contact/FOOT (estimated forces, in the frames of the feet), /robot_description. Times are those of the wall clock. The
/// pose of the base in /tf has the estimated orientation and height; the horizontal position is zero.
///
/// With --allow-commands a geometry_msgs/Twist on /cmd_vel is followed: a velocity makes a standing robot walk, and zero or 0.5 s without a Twist makes it
/// stand. A lying robot and an emergency stop stay as they are. Every program in the DDS domain can send a Twist. The run file of the robot must list
/// the channel of the commands among its operators, with its priority.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof bridge ros2\n         hoof bridge ros2 --allow-commands --domain 7\n\n\
    --json prints {\"domain\": N, \"robot\": NAME, \"topics\": [TOPIC], \"published\": N, \"dropped\": N, \"twists\": N, \"malformed\": N, \"commands\": N} \
    at the end.")]
pub struct Ros2Args {
    /// Follow velocity commands on /cmd_vel
    #[arg(long)]
    allow_commands: bool,
    /// Channel of the commands to the run
    #[arg(long, value_name = "NAME", default_value = CHANNEL, requires = "allow_commands")]
    channel: String,
    /// DDS domain, the ROS_DOMAIN_ID of the ROS 2 programs, 0 to 232
    #[arg(long, value_name = "N", default_value_t = 0)]
    domain: u16,
    /// Messages per second and topic, 1 to 1000; /tf has at most 100
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate_hz: f64,
    /// End after this time [default: Ctrl-C]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// LCM network [default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL", default_value = "", hide_default_value = true)]
    lcm_url: String,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    let Command::Ros2(args) = command;
    anyhow::ensure!((1.0..=1000.0).contains(&args.rate_hz), "--rate-hz {}: expected 1 to 1000", args.rate_hz);
    if let Some(seconds) = args.seconds {
        anyhow::ensure!((0.0..=1e9).contains(&seconds), "--seconds {seconds}: expected 0 to 1e9");
    }
    let seconds = args.seconds.map(Duration::from_secs_f64);
    if args.allow_commands {
        check_channel(&args.channel).with_context(|| format!("--channel {:?}", args.channel))?;
    }
    let stop = Stop::new(None)?;
    let bus = LcmBus::open(&args.lcm_url).context("run `hoof doctor` to find the cause")?;
    let commands = args.allow_commands.then(|| args.channel.clone());
    let options = Options { domain: args.domain, rate_hz: args.rate_hz, commands };
    let mut session = Session::open(Box::new(bus), options)?;
    let start = Instant::now();
    while !stop.is_due() && seconds.is_none_or(|seconds| start.elapsed() < seconds) {
        session.step()?;
    }
    let summary = session.end()?;
    if args.json {
        say_json(&summary)?;
    } else {
        say(text(&summary))?;
    }
    Ok(Outcome::Good)
}

fn text(summary: &Summary) -> String {
    let Summary { domain, robot, topics, counts, commands } = summary;
    let robot = robot.as_deref().unwrap_or("no run");
    let (published, dropped, twists, malformed) = (counts.published, counts.dropped, counts.twists, counts.malformed);
    format!(
        "domain {domain}, {robot}: {published} messages on {} topics, {dropped} dropped\n\
         {twists} velocity commands received, {malformed} malformed; {commands} operator commands sent",
        topics.len()
    )
}
