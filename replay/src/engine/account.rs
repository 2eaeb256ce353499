//! Messages of a log that a replay cannot use: late, doubled, undecodable, of a tick without input, or of another sender.

use crate::printable;
use lcmtypes::channels::Channel;

/// Messages that are listed with channel and tick; all are counted.
const LISTED: usize = 100;

/// Why a message is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unused {
    /// It was recorded after the inputs of 256 later ticks, or is a repetition recorded after its tick was complete.
    Late,
    /// Its channel already has a message of this tick, with the same bytes.
    Doubled,
    /// Its channel already has a message of this tick, with other bytes.
    DoubledOtherBytes,
    /// It has the fingerprint of its type but does not decode.
    Undecodable,
    /// The log has no input of its tick.
    NoInput,
}

/// A message that is not used.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct UnusedMessage {
    /// Channel.
    pub channel: String,
    /// Tick in the message; `None` if it is too short to have one.
    pub tick: Option<i64>,
    /// Offset of its event in the file. For an output of a tick without input: offset of the first event of that tick.
    pub offset: u64,
    /// Why it is not used.
    pub why: Unused,
}

/// A PARAMETER_CHANGE whose parameter or value this build refuses. It is not applied.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct RejectedChange {
    /// First tick of the change.
    pub tick: i64,
    /// Offset of its event in the file.
    pub offset: u64,
    /// What is wrong with it.
    pub reason: String,
}

/// Messages on a channel of the run with another type than this build's. They are neither fed nor compared.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct OtherType {
    /// Channel.
    pub channel: String,
    /// Type of the channel in this build, or of the state inside a snapshot that has another type.
    pub type_name: String,
    /// Fingerprint of the first such message; hexadecimal in JSON.
    #[serde(serialize_with = "hexadecimal")]
    pub found: u64,
    /// Fingerprint of the type in this build; hexadecimal in JSON.
    #[serde(serialize_with = "hexadecimal")]
    pub expected: u64,
    /// Number of messages.
    pub count: u64,
    /// The channel has no message of this build's type: the type changed after the log was written. Otherwise another program sent them.
    pub is_every_message: bool,
}

fn hexadecimal<S: serde::Serializer>(fingerprint: &u64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&format_args!("{fingerprint:016x}"))
}

/// Account of the messages that a replay does not use.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Account {
    /// Late messages.
    pub late_messages: u64,
    /// Doubled messages.
    pub doubled_messages: u64,
    /// Undecodable messages.
    pub undecodable_messages: u64,
    /// Outputs of ticks without input after the last input, or with an impossible tick.
    pub outputs_without_input: u64,
    /// Parameter changes that are not valid, each counted once.
    pub rejected_changes: u64,
    /// The first of them.
    pub first_rejected_change: Option<RejectedChange>,
    /// Messages of other runs on the channels of this run.
    pub foreign_messages: u64,
    /// The first 100 of the messages that are lost to the replay.
    pub unused: Vec<UnusedMessage>,
    /// Messages of other types, by channel.
    pub other_types: Vec<OtherType>,
}

impl Account {
    /// No message of the run is lost to the replay. Messages of other senders do not matter.
    pub fn is_complete(&self) -> bool {
        self.late_messages == 0
            && self.doubled_messages == 0
            && self.undecodable_messages == 0
            && self.outputs_without_input == 0
            && self.rejected_changes == 0
    }

    /// One line for each kind of message that is lost to the replay, with the first of them.
    pub fn text(&self) -> Vec<String> {
        let line = |why: &[Unused], count: u64, what: &str| {
            let first = self.unused.iter().find(|message| why.contains(&message.why));
            let place = first.map_or(String::new(), |UnusedMessage { channel, tick, offset, .. }| {
                let tick = tick.map_or("without tick".to_owned(), |tick| format!("tick {tick}"));
                format!(", first {}, {tick}, byte {offset}", printable(channel))
            });
            (count > 0).then(|| format!("{count} messages {what}{place}"))
        };
        let lines = [
            line(&[Unused::Late], self.late_messages, "came too late or after their tick was complete"),
            line(&[Unused::Doubled, Unused::DoubledOtherBytes], self.doubled_messages, "are doubled"),
            line(&[Unused::Undecodable], self.undecodable_messages, "cannot be decoded"),
            line(&[Unused::NoInput], self.outputs_without_input, "belong to ticks without input"),
        ];
        let rejected = self.first_rejected_change.as_ref().map(|RejectedChange { tick, offset, reason }| {
            let count = self.rejected_changes;
            format!(
                "{count} PARAMETER_CHANGE are not valid, first of tick {tick}, byte {offset}: {}",
                printable(reason)
            )
        });
        lines.into_iter().flatten().chain(rejected).collect()
    }

    pub(super) fn unused(&mut self, channel: &str, tick: Option<i64>, offset: u64, why: Unused) {
        let count = match why {
            Unused::Late => &mut self.late_messages,
            Unused::Doubled | Unused::DoubledOtherBytes => &mut self.doubled_messages,
            Unused::Undecodable => &mut self.undecodable_messages,
            Unused::NoInput => &mut self.outputs_without_input,
        };
        *count += 1;
        if self.unused.len() < LISTED {
            self.unused.push(UnusedMessage { channel: channel.to_owned(), tick, offset, why });
        }
    }

    /// Counts a message of another type than `expected`.
    pub(super) fn other_type(&mut self, channel: &str, known: &Channel, found: Option<u64>, expected: u64) {
        if let Some(other) = self.other_types.iter_mut().find(|other| other.channel == channel) {
            other.count += 1;
            return;
        }
        // In a snapshot it may be a state inside that has another type.
        let ty = lcmtypes::types().by_fingerprint(expected);
        self.other_types.push(OtherType {
            channel: channel.to_owned(),
            type_name: ty.map_or(known.type_name, |ty| ty.name()).to_owned(),
            found: found.unwrap_or(0),
            expected,
            count: 1,
            is_every_message: true,
        });
    }
}
