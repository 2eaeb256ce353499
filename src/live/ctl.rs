//! `hoof ctl`: starts and stops controllers of a live run.

use super::request::Client;
use crate::{Outcome, say, say_json};
use clap::ValueEnum;
use drivers::live::clock::now_ns;
use lcmtypes::{ExecutorCommand, RequestReply, channels, enum_names};

/// Start or stop a controller of a live run
///
/// The run continues. A started controller begins as on the first tick of a run; the last running controller of the run file commands the robot. If no
/// controller is running, the joints are damped. Exit code 1 if the request is rejected, 2 if there is no reply.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof ctl start hold\n         hoof ctl stop quadruped\n\n\
    --json prints {\"refused\": BOOL, \"code\": CODE, \"tick\": N, \"answer\": TEXT}. CODE is done, rejected, unknown_name, out_of_range or wrong_state.")]
pub struct CtlArgs {
    /// Action
    #[arg(value_enum)]
    action: Action,
    /// Name of the controller
    controller: String,
    /// LCM network [default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Number of actions, alternating between ACTION and its opposite; for measurements
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

    /// `executor_command_t` ACTION_*.
    fn code(self) -> i8 {
        match self {
            Action::Start => ExecutorCommand::ACTION_START,
            Action::Stop => ExecutorCommand::ACTION_STOP,
        }
    }

    fn past(self) -> &'static str {
        match self {
            Action::Start => "started",
            Action::Stop => "stopped",
        }
    }
}

pub fn ctl(args: &CtlArgs) -> anyhow::Result<Outcome> {
    let mut client = Client::open(args.lcm_url.as_deref())?;
    let (mut action, mut left) = (args.action, args.repeat);
    let (action, reply) = loop {
        let reply =
            client.request(channels::EXECUTOR_COMMAND, RequestReply::KIND_EXECUTOR, |sender_id, request_id| {
                ExecutorCommand {
                    t_ns: now_ns(),
                    sender_id,
                    request_id,
                    action: action.code(),
                    controller: args.controller.clone(),
                }
            })?;
        left -= 1;
        if left == 0 || reply.code != RequestReply::CODE_DONE {
            break (action, reply);
        }
        action = action.opposite();
    };
    let is_done = reply.code == RequestReply::CODE_DONE;
    let text = if is_done { format!("controller {} {}", args.controller, action.past()) } else { reply.reason };
    if args.json {
        let code = enum_names::reply_code(reply.code);
        say_json(&serde_json::json!({ "refused": !is_done, "code": code, "tick": reply.tick, "answer": text }))?;
    } else {
        say(&text)?;
    }
    Ok(Outcome::failed_if(!is_done))
}
