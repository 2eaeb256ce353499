//! `hoof replay LOG --break TICK`: prints every quantity of a tick.

use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use controller::dump::{Group, Value};
use replay::engine::{Cursor, Moment, Options, Replay, lines, of_bytes};

pub fn run(replay: &Replay, options: &Options, tick: i64, json: bool) -> anyhow::Result<Outcome> {
    let bar = Progress::new("to the tick");
    let moment = Cursor::open(replay, options, &mut |part| bar.set(part))?.go_to(tick)?;
    drop(bar);
    let tree = tree(&moment);
    if json {
        say_json(&tree)?
    } else {
        say(lines(&tree).join("\n"))?
    }
    Ok(Outcome::failed_if(moment.divergence.is_some()))
}

/// A tick as a tree of quantities: time, difference, input, stages, recorded and replayed messages.
pub fn tree(moment: &Moment) -> Group {
    let mut tree = Group::new()
        .with("tick", moment.tick)
        .with("t_ns", moment.t_ns)
        .with("since_s", moment.since_s)
        .with("agrees", moment.divergence.is_none());
    if let Some(d) = &moment.divergence {
        let mut difference = Group::new()
            .with("stage", d.stage.clone())
            .with("channel", d.channel.as_str())
            .with("field", d.field.as_str())
            .with("recorded", d.recorded.as_str())
            .with("replayed", d.replayed.as_str());
        if let Some(index) = &d.index {
            difference = difference.with("index", serde_json::to_string(index).unwrap_or_default());
        }
        tree = tree.with("difference", difference);
    }
    if let Some(input) = moment.input_quantities() {
        tree = tree.with("input", input);
    }
    for (stage, quantities) in &moment.dump.stages {
        tree = tree.with(stage.name(), quantities.clone());
    }
    let messages = |messages: &mut dyn Iterator<Item = (&str, &[u8])>| {
        messages.fold(Group::new(), |group, (channel, bytes)| {
            let unknown = || Value::Text(format!("{} bytes of an unknown type", bytes.len()));
            group.with(channel, of_bytes(bytes).unwrap_or_else(unknown))
        })
    };
    tree.with("recorded", messages(&mut moment.recorded.iter().map(|(c, bytes)| (&**c, &bytes[..]))))
        .with("replayed", messages(&mut moment.replayed.iter().map(|(c, bytes)| (*c, &bytes[..]))))
        .with("beside", messages(&mut moment.beside.iter().map(|event| (&*event.channel, &event.data[..]))))
}
