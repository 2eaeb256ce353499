//! `hoof set`: changes parameters of a live run.

use super::request::{self, ask};
use crate::robot::overrides;
use crate::{Outcome, say, say_json};
use drivers::live::clock::now_ns;
use drivers::parameter_requests::SOURCE;
use lcmtypes::bus::{Bus, Received};
use lcmtypes::{Event, Message, ParameterChange, ParameterRequest, channels};
use std::time::Duration;

/// How long until a wish is sent again. It has a number: who has granted it says so again.
const AGAIN: Duration = Duration::from_millis(400);

/// Change parameters of a live run
///
/// A controller with the new value takes over between two ticks, with the state of the one that runs. The answer says from which tick on, PARAMETER_CHANGE
/// has it in the log, and a replay does the same there. What is refused changes nothing; `[robot]` cannot be changed. Several are asked one after the
/// other, up to the first that is refused. Exit code 1 if one is refused, 2 if nobody answers.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof set trunk.kp='[800, 800, 800]'
         hoof set gait.trot.swing_frequency=3.5 swing.height=0.12

--json prints {\"refused\": BOOL, \"changes\": [{\"key\", \"value\", \"tick\"}], \"why\": TEXT or null}.")]
pub struct SetArgs {
    /// Parameter, as in a parameters file, and its new value in TOML
    #[arg(value_name = "KEY=VALUE", required = true)]
    set: Vec<String>,
    /// Network, else that of LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn set(args: &SetArgs) -> anyhow::Result<Outcome> {
    let wishes = overrides(&args.set)?;
    let (mut bus, url) = request::open(args.lcm_url.as_deref())?;
    [channels::PARAMETER_CHANGE, channels::EVENT].iter().try_for_each(|channel| bus.subscribe(channel))?;
    let (mut changes, mut why) = (Vec::new(), None);
    for (key, value) in &wishes {
        match wish(&mut bus, &url, key, value)? {
            Ok(change) => {
                if !args.json {
                    say(format!("{key} = {value} from tick {} on", change.tick))?;
                }
                changes.push(change);
            }
            Err(refusal) => {
                why = Some(refusal);
                break;
            }
        }
    }
    if args.json {
        let changes: Vec<_> = changes
            .iter()
            .map(|change| serde_json::json!({ "key": change.key, "value": change.value, "tick": change.tick }))
            .collect();
        say_json(&serde_json::json!({ "refused": why.is_some(), "changes": changes, "why": why }))?;
    } else if let Some(why) = &why {
        say(why)?;
    }
    Ok(Outcome::failed_if(why.is_some()))
}

/// Asks for one parameter: the change, or why it is refused.
fn wish(bus: &mut dyn Bus, url: &str, key: &str, value: &str) -> anyhow::Result<Result<ParameterChange, String>> {
    let seq = now_ns();
    let wish = ParameterRequest { t_ns: seq, seq, key: key.to_owned(), value: value.to_owned() };
    let refused = format!("{key} = {value} is refused");
    ask(bus, url, channels::PARAMETER_REQUEST, &wish, Some(AGAIN), |message: &Received| {
        if message.channel == channels::PARAMETER_CHANGE {
            return ParameterChange::decode(&message.data).ok().filter(|change| change.seq == seq).map(Ok);
        }
        let event = Event::decode(&message.data).ok()?;
        (event.source == SOURCE && event.text.starts_with(&refused)).then_some(Err(event.text))
    })
}
