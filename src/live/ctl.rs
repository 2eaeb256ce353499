//! `hoof ctl`: starts and stops controllers of a live run.

use super::request;
use crate::{Outcome, say, say_json};
use clap::ValueEnum;
use drivers::live::clock::now_ns;
use lcmtypes::bus::Bus;
use lcmtypes::{Event, ExecutorCommand, Message, channels};

/// Start or stop a controller of a live run
///
/// The run goes on meanwhile: a controller begins as on the first tick of a run, and the last of those that run has the robot. With none running the
/// joints are damped. The executor's answer is printed; exit code 1 if it refuses, 2 if nobody answers.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof ctl start hold\n         hoof ctl stop quadruped")]
pub struct CtlArgs {
    /// What to do
    #[arg(value_enum)]
    action: Action,
    /// Name of the controller
    controller: String,
    /// Network, else that of LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Go on with the opposite, so many times in all: to measure
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    repeat: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Action {
    Start,
    Stop,
}

impl Action {
    fn opposite(self) -> Self {
        match self {
            Action::Start => Action::Stop,
            Action::Stop => Action::Start,
        }
    }
}

pub fn ctl(args: &CtlArgs) -> anyhow::Result<Outcome> {
    let (mut bus, url) = request::open(args.lcm_url.as_deref())?;
    bus.subscribe(channels::EVENT)?;
    let mut action = args.action;
    let mut last = Event::default();
    for _ in 0..args.repeat {
        last = ask(&mut bus, &url, action, &args.controller)?;
        if last.level != Event::LEVEL_INFO {
            break;
        }
        action = action.opposite();
    }
    let refused = last.level != Event::LEVEL_INFO;
    if args.json {
        say_json(&serde_json::json!({ "refused": refused, "tick": last.tick, "answer": last.text }))?;
    } else {
        say(&last.text)?;
    }
    Ok(Outcome::failed_if(refused))
}

/// The executor's answer.
fn ask(bus: &mut dyn Bus, url: &str, action: Action, controller: &str) -> anyhow::Result<Event> {
    let (wire, done) = match action {
        Action::Start => (ExecutorCommand::ACTION_START, "starts"),
        Action::Stop => (ExecutorCommand::ACTION_STOP, "stops"),
    };
    let wish = ExecutorCommand { t_ns: now_ns(), action: wire, controller: controller.to_owned() };
    request::ask(bus, url, channels::EXECUTOR_COMMAND, &wish, None, |message| {
        let event = Event::decode(&message.data).ok()?;
        let is_done = event.text == format!("controller {controller} {done}");
        let is_refused = event.level == Event::LEVEL_WARNING && event.text.contains(controller);
        (event.source == "executor" && (is_done || is_refused)).then_some(event)
    })
}
