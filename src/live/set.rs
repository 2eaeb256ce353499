//! `hoof set`: changes parameters of a live run.

use super::request::Client;
use crate::robot::overrides;
use crate::{Outcome, say, say_json};
use drivers::live::clock::now_ns;
use lcmtypes::{ParameterRequest, RequestReply, channels, enum_names};

/// Change parameters of a live run
///
/// A controller with the new value takes over between two ticks, with the state of the running controller. Prints the first tick with the new value. The
/// log holds the change as PARAMETER_CHANGE, and a replay repeats it at that tick. A rejected request changes nothing; parameters of `[robot]` cannot be
/// changed. Several parameters are changed one after the other, up to the first rejected one. Exit code 1 if a request is rejected, 2 if there is no reply.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof set trunk.kp='[800, 800, 800]'
         hoof set gait.trot.swing_frequency=3.5 swing.height=0.12

--json prints {\"refused\": BOOL, \"code\": CODE, \"changes\": [{\"key\", \"value\", \"tick\"}], \"why\": TEXT or null}. CODE is that of the last request:
done, rejected, unknown_name, out_of_range or wrong_state.")]
pub struct SetArgs {
    /// Parameter, as in a parameters file, and its new value in TOML
    #[arg(value_name = "KEY=VALUE", required = true)]
    set: Vec<String>,
    /// LCM network [default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn set(args: &SetArgs) -> anyhow::Result<Outcome> {
    let requests = overrides(&args.set)?;
    let mut client = Client::open(args.lcm_url.as_deref())?;
    let (mut changes, mut refusal) = (Vec::new(), None);
    for (key, value) in &requests {
        let reply = client.request(channels::PARAMETER_REQUEST, RequestReply::KIND_PARAMETER, |sender_id, seq| {
            ParameterRequest { t_ns: now_ns(), sender_id, seq, key: key.clone(), value: value.clone() }
        })?;
        if reply.code != RequestReply::CODE_DONE {
            refusal = Some(reply);
            break;
        }
        if !args.json {
            say(format!("{key} = {value} from tick {} on", reply.tick))?;
        }
        changes.push(serde_json::json!({ "key": key, "value": value, "tick": reply.tick }));
    }
    let code = refusal.as_ref().map_or(RequestReply::CODE_DONE, |reply| reply.code);
    let why = refusal.map(|reply| reply.reason);
    if args.json {
        let code = enum_names::reply_code(code);
        say_json(&serde_json::json!({ "refused": why.is_some(), "code": code, "changes": changes, "why": why }))?;
    } else if let Some(why) = &why {
        say(why)?;
    }
    Ok(Outcome::failed_if(why.is_some()))
}
