//! Finds the first difference of a tick: the earliest stage, then the first field.

use controller::dump::Group;
use lcm_idl::{Leaf, Value};
use lcmtypes::channels::{self, Stage};
use lcmtypes::{ControllerTick, Message};
use std::fmt::Write as _;

/// The first difference between a record and its replay.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Divergence {
    /// Tick.
    pub tick: i64,
    /// Time of the tick, ns.
    pub t_ns: i64,
    /// The same, s since the run's first tick.
    pub t_s: f64,
    /// The earliest stage of the tick that differs, by the names in RUN_INFO; those of the quadruped: input, estimation, gait, tasks, qp, output.
    pub stage: String,
    /// Channel with the difference.
    pub channel: String,
    /// Field, such as `state.q`; empty if the message is on one side only.
    pub field: String,
    /// Index in the field, if it is an array.
    pub index: Option<Index>,
    /// Recorded value; floats as hexadecimal float and decimal.
    pub recorded: String,
    /// Replayed value.
    pub replayed: String,
    /// Distance of the two floats in ulp; `None` for other types and NaN.
    pub ulp: Option<u64>,
    /// First different field of every other message of the tick, in the order of the controller's outputs.
    pub also: Vec<FieldDifference>,
    /// The last identical tick, or the tick of the snapshot that the replay started from; `None` if there is none.
    pub last_agreed_tick: Option<i64>,
    /// What the stage was computed from in the replay, besides the state before the tick; large arrays by their digest.
    pub inputs: Group,
}

/// The first field in which a message differs.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct FieldDifference {
    /// Channel.
    pub channel: String,
    /// Field; empty if the message is on one side only.
    pub field: String,
    /// Index in the field, if it is an array.
    pub index: Option<Index>,
    /// Recorded value; floats as hexadecimal float and decimal.
    pub recorded: String,
    /// Replayed value.
    pub replayed: String,
    /// Distance of the two floats in ulp; `None` for other types and NaN.
    pub ulp: Option<u64>,
}

/// Index in an array: one number, or one per dimension.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
#[serde(untagged)]
pub enum Index {
    /// Index in a one-dimensional array.
    One(usize),
    /// Index in a multi-dimensional array.
    Many(Vec<usize>),
}

/// A recorded and a replayed message; `None` if absent.
pub(super) struct Pair<'a> {
    pub channel: &'a str,
    pub recorded: Option<&'a [u8]>,
    pub replayed: Option<&'a [u8]>,
}

/// Whether two messages are CONTROLLER_TICKs that are equal except for the digest of the parameters, which a what-if replay changes.
pub(super) fn is_same_tick(channel: &str, recorded: &[u8], replayed: &[u8]) -> bool {
    let without = |bytes: &[u8]| {
        let tick = ControllerTick::decode(bytes).ok()?;
        let mut rest = Vec::new();
        ControllerTick { digest_parameters: 0, ..tick }.encode(&mut rest).ok()?;
        Some(rest)
    };
    channel.ends_with(channels::CONTROLLER_TICK)
        && without(recorded).is_some_and(|tick| Some(tick) == without(replayed))
}

/// Finds the first difference of a tick.
///
/// - `different`: all different pairs in the order of the controller's outputs.
/// - `stages`: names of the stages of a tick.
/// - `is_what_if`: the parameters may differ.
pub(super) fn attribute(
    tick: i64,
    t_ns: i64,
    t_s: f64,
    different: &[Pair],
    stages: &[String],
    is_what_if: bool,
) -> Option<Divergence> {
    let digests = different.iter().find(|pair| pair.channel == channels::CONTROLLER_TICK);
    let name_of = |stage: usize| stages.get(stage).map_or_else(|| stage.to_string(), Clone::clone);
    // Channels outside the table are computed last.
    let stage_of = |channel: &str| {
        let known = channels::find(channel).and_then(|known| known.stage).unwrap_or(Stage::Output);
        stages.iter().position(|name| name == known.name()).unwrap_or(stages.len().saturating_sub(1))
    };
    let (stage, shown) = match digests.and_then(|pair| first_digest(pair, is_what_if)) {
        Some((stage, digest, recorded, replayed)) => {
            let shown = different.iter().find(|pair| stage_of(pair.channel) == stage && !is_tick(pair));
            let digest = FieldDifference {
                channel: channels::CONTROLLER_TICK.to_owned(),
                field: match digest {
                    Digests::Parameters => "digest_parameters".to_owned(),
                    Digests::Stage => format!("digest_{}", name_of(stage)),
                },
                index: None,
                recorded: format!("{recorded:#018x}"),
                replayed: format!("{replayed:#018x}"),
                ulp: None,
            };
            (stage, shown.map_or(digest, difference))
        }
        None => {
            let pair = different.iter().min_by_key(|pair| stage_of(pair.channel))?;
            (stage_of(pair.channel), difference(pair))
        }
    };
    let others = different.iter().filter(|pair| pair.channel != shown.channel && !is_tick(pair));
    let also = others.map(difference).collect();
    let FieldDifference { channel, field, index, recorded, replayed, ulp } = shown;
    let (stage, last_agreed_tick, inputs) = (name_of(stage), None, Group::new());
    Some(Divergence {
        tick,
        t_ns,
        t_s,
        stage,
        channel,
        field,
        index,
        recorded,
        replayed,
        ulp,
        also,
        last_agreed_tick,
        inputs,
    })
}

/// Digests name the stage only, not the field.
fn is_tick(pair: &Pair) -> bool {
    pair.channel == channels::CONTROLLER_TICK
}

/// What a digest covers.
#[derive(Clone, Copy)]
enum Digests {
    Stage,
    Parameters,
}

/// The earliest stage with different digests, what they cover, and both digests. The parameters count as an input, except in a what-if replay.
fn first_digest(pair: &Pair, is_what_if: bool) -> Option<(usize, Digests, i64, i64)> {
    let recorded = ControllerTick::decode(pair.recorded?).ok()?;
    let replayed = ControllerTick::decode(pair.replayed?).ok()?;
    let parameters = |tick: &ControllerTick| if is_what_if { 0 } else { tick.digest_parameters };
    let mut found = None;
    let stages = recorded.digest.iter().zip(&replayed.digest).enumerate();
    if let Some((stage, (a, b))) = { stages }.find(|(_, (a, b))| a != b) {
        found = Some((stage, Digests::Stage, *a, *b));
    }
    // The input comes before the parameters, and these before every other stage.
    let [a, b] = [&recorded, &replayed].map(parameters);
    if a != b && found.is_none_or(|(stage, ..)| stage > 0) {
        found = Some((0, Digests::Parameters, a, b));
    }
    found
}

/// The first different field of a pair, by reflection.
fn difference(pair: &Pair) -> FieldDifference {
    let side = |bytes: Option<&[u8]>| bytes.map_or("absent".to_owned(), |bytes| format!("{} bytes", bytes.len()));
    let channel = pair.channel.to_owned();
    let whole = || FieldDifference {
        channel: channel.clone(),
        field: String::new(),
        index: None,
        recorded: side(pair.recorded),
        replayed: side(pair.replayed),
        ulp: None,
    };
    let (Some(recorded), Some(replayed)) = (pair.recorded, pair.replayed) else { return whole() };
    let fingerprints = [recorded, replayed].map(crate::log::fingerprint);
    if fingerprints[0] != fingerprints[1] {
        let [recorded, replayed] = fingerprints.map(|f| f.map_or("none".to_owned(), |f| format!("{f:016x}")));
        return FieldDifference { field: "fingerprint".into(), recorded, replayed, ..whole() };
    }
    let ty = lcmtypes::types().of_message(recorded);
    let Some(Ok(Some(found))) = ty.map(|ty| ty.first_difference(recorded, replayed)) else { return whole() };
    let (field, index) = split_path(&found.path);
    let ulp = found.ulps();
    FieldDifference { channel, field, index, recorded: show(&found.left), replayed: show(&found.right), ulp }
}

/// The largest difference of two floats of a pair, ulp; `None` if no floats differ.
pub(super) fn largest_ulp(pair: &Pair) -> Option<u64> {
    let (recorded, replayed) = (pair.recorded?, pair.replayed?);
    let ty = lcmtypes::types().of_message(recorded)?;
    let floats = |bytes| {
        let mut floats = Vec::new();
        let keep = |leaf: Leaf| {
            if let Leaf::Double(v) = leaf {
                floats.push(v)
            }
        };
        let mut keep = keep;
        ty.walk(bytes, |_, leaf| keep(leaf)).ok().map(|()| floats)
    };
    let (recorded, replayed) = (floats(recorded)?, floats(replayed)?);
    let distance = |(a, b): (f64, f64)| {
        let of = lcm_idl::Difference { path: String::new(), left: Value::Double(a), right: Value::Double(b) };
        (a.to_bits() != b.to_bits()).then(|| of.ulps()).flatten()
    };
    recorded.into_iter().zip(replayed).filter_map(distance).max()
}

/// `f_F_W[2][1]` is the field `f_F_W` at the index 2, 1. Indices inside the path, as in `legs[2].q`, stay in the field.
fn split_path(path: &str) -> (String, Option<Index>) {
    let (mut field, mut indices) = (path, Vec::new());
    while let Some((before, number)) = field.strip_suffix(']').and_then(|open| open.rsplit_once('[')) {
        let Ok(number) = number.parse() else { break };
        indices.insert(0, number);
        field = before;
    }
    let index = match indices[..] {
        [] => None,
        [one] => Some(Index::One(one)),
        _ => Some(Index::Many(indices)),
    };
    (field.to_owned(), index)
}

/// A value as text; a float as hexadecimal float and decimal.
pub(crate) fn show(value: &Value) -> String {
    match value {
        Value::Double(v) => format!("{} ({v:?})", hex_float(*v)),
        Value::Float(v) => format!("{} ({v:?})", hex_float(f64::from(*v))),
        other => other.to_string(),
    }
}

/// A float as exact hexadecimal text, as C's `%a` prints it: `0x1.8p+1` is 3. A NaN is shown with its bits.
fn hex_float(v: f64) -> String {
    let bits = v.to_bits();
    let mut text = String::from(if v.is_sign_negative() { "-" } else { "" });
    let (exponent, mantissa) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    let (lead, power) = match exponent {
        0x7ff if mantissa != 0 => return format!("nan:{bits:#018x}"),
        0x7ff => return text + "inf",
        0 if mantissa == 0 => return text + "0x0p+0",
        0 => ('0', -1022),
        _ => ('1', exponent as i64 - 1023),
    };
    let digits = format!("{mantissa:013x}");
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    write!(text, "0x{lead}{point}{digits}p{power:+}").expect("writing to a string does not fail");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values: `float.hex` of Python 3.11, without its trailing zeros.
    #[test]
    fn hexadecimal_floats_are_exact() {
        let cases = [
            (3.0, "0x1.8p+1"),
            (-0.1, "-0x1.999999999999ap-4"),
            (1.0, "0x1p+0"),
            (0.0, "0x0p+0"),
            (-0.0, "-0x0p+0"),
            (f64::MIN_POSITIVE / 2.0, "0x0.8p-1022"),
            (f64::MAX, "0x1.fffffffffffffp+1023"),
            (f64::NEG_INFINITY, "-inf"),
        ];
        for (value, text) in cases {
            assert_eq!(hex_float(value), text);
        }
        assert_eq!(hex_float(f64::from_bits(0x7ff8_0000_0000_0001)), "nan:0x7ff8000000000001");
    }

    #[test]
    fn trailing_indices_are_split_from_the_path() {
        assert_eq!(split_path("tau[7]"), ("tau".into(), Some(Index::One(7))));
        assert_eq!(split_path("f_F_W[2][1]"), ("f_F_W".into(), Some(Index::Many(vec![2, 1]))));
        assert_eq!(split_path("legs[2].q"), ("legs[2].q".into(), None));
    }
}
