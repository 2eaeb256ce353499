//! A message as a tree with collapsible branches.

use lcm_idl::ast::ConstantValue;
use lcm_idl::{Leaf, Type, Value};
use replay::log::Types;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Arrays of structs up to this length are expanded by default.
const FEW: usize = 4;
/// Largest number of listed array elements, and of listed rows of 16 bytes of a message of unknown type.
const LISTED: usize = 1000;
/// Elements shown of a collapsed array.
const SHOWN: usize = 24;

/// A decoded message.
#[derive(Debug, Clone, PartialEq)]
pub enum Decoded {
    /// Its fields.
    Fields(Vec<Node>),
    /// Rows of bytes, and the reason why the message cannot be decoded.
    Bytes(String, Vec<String>),
}

/// A field or element of a message.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Field or index.
    name: String,
    content: Content,
}

#[derive(Debug, Clone, PartialEq)]
enum Content {
    Leaf { text: String, is_number: bool },
    Branch { parts: Vec<Node>, is_array: bool, left_out: usize },
}

/// One line of the tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// Path of the field, such as `state.q[3]`.
    pub path: String,
    /// Nesting depth.
    pub depth: usize,
    /// Field or index.
    pub name: String,
    /// Its value, or a preview of a collapsed branch.
    pub text: String,
    /// Of a branch: whether it is expanded.
    pub is_open: Option<bool>,
    /// It can be plotted.
    pub is_number: bool,
}

/// Decodes the last message of a channel. `length`: its size in bytes, larger than `bytes` if it was too long to be stored.
pub fn decode(types: &Types, channel: &str, bytes: &[u8], length: usize) -> Decoded {
    if bytes.len() < length {
        return Decoded::Bytes(format!("{length} bytes: too long to be shown"), Vec::new());
    }
    let Some(ty) = types.of_message(channel, bytes) else {
        return Decoded::Bytes(format!("{length} bytes of unknown type (--lcm-types DIR)"), hex(bytes));
    };
    match ty.decode_opened(bytes) {
        Ok((value, _)) => Decoded::Fields(fields(&value, Some(ty))),
        Err(error) => Decoded::Bytes(error.to_string(), hex(bytes)),
    }
}

/// The visible lines of a message. `toggled`: branches whose expansion differs from the default.
pub fn lines(fields: &[Node], toggled: &BTreeSet<String>) -> Vec<Line> {
    let mut lines = Vec::new();
    fields.iter().for_each(|node| node.lines("", 0, toggled, &mut lines));
    lines
}

/// Fields of a struct; empty for another value.
fn fields(value: &Value, ty: Option<Type>) -> Vec<Node> {
    let Value::Struct(fields) = value else { return Vec::new() };
    let node = |(place, (name, value)): (usize, &(Arc<str>, Value))| Node {
        name: name.to_string(),
        content: content(value, ty.and_then(|ty| ty.element(place)), &named(ty, name)),
    };
    fields.iter().enumerate().map(node).collect()
}

/// `element`: type of the structs in a field; `named`: finds the name of a constant.
fn content(value: &Value, element: Option<Type>, named: &dyn Fn(i64) -> Option<String>) -> Content {
    match value {
        Value::Struct(_) => Content::Branch { parts: fields(value, element), is_array: false, left_out: 0 },
        Value::Array(items) => {
            let node = |(place, item): (usize, &Value)| Node {
                name: format!("[{place}]"),
                content: content(item, element, named),
            };
            let left_out = items.len().saturating_sub(LISTED);
            Content::Branch {
                parts: items.iter().take(LISTED).enumerate().map(node).collect(),
                is_array: true,
                left_out,
            }
        }
        Value::String(text) if text.contains('\n') => text_content(text),
        leaf => {
            let leaf = leaf.as_leaf();
            let name = leaf.and_then(Leaf::as_i64).and_then(named).map_or(String::new(), |name| format!("  {name}"));
            let text = leaf.map_or(String::new(), |leaf| leaf.to_string()) + &name;
            Content::Leaf { text, is_number: leaf.and_then(Leaf::as_f64).is_some() }
        }
    }
}

/// The lines of a text.
fn text_content(text: &str) -> Content {
    let node = |(place, line): (usize, &str)| {
        let content =
            Content::Leaf { text: replay::printable(&line.replace('\t', " ")).into_owned(), is_number: false };
        Node { name: format!("[{place}]"), content }
    };
    let parts: Vec<Node> = text.lines().take(LISTED).enumerate().map(node).collect();
    Content::Branch { left_out: text.lines().count() - parts.len(), parts, is_array: true }
}

/// Names of the values of a field: those of `mode` are the constants `MODE_*` of its type.
fn named(ty: Option<Type<'_>>, field: &str) -> impl Fn(i64) -> Option<String> {
    let prefix = format!("{}_", field.to_uppercase());
    let constants = ty.map_or(&[][..], |ty| &ty.def().constants[..]);
    let named: Vec<(i64, String)> = constants
        .iter()
        .filter(|constant| constant.name.starts_with(&prefix))
        .filter_map(|constant| integer(constant.value).map(|value| (value, constant.name.clone())))
        .collect();
    move |number| named.iter().find(|(value, _)| *value == number).map(|(_, name)| name.clone())
}

fn integer(value: ConstantValue) -> Option<i64> {
    match value {
        ConstantValue::Int8(v) => Some(v.into()),
        ConstantValue::Int16(v) => Some(v.into()),
        ConstantValue::Int32(v) => Some(v.into()),
        ConstantValue::Int64(v) => Some(v),
        ConstantValue::Float(_) | ConstantValue::Double(_) => None,
    }
}

impl Node {
    fn lines(&self, parent: &str, depth: usize, toggled: &BTreeSet<String>, lines: &mut Vec<Line>) {
        let is_index = self.name.starts_with('[');
        let path = if parent.is_empty() || is_index {
            format!("{parent}{}", self.name)
        } else {
            format!("{parent}.{}", self.name)
        };
        let line = |text, is_open, is_number| Line {
            path: path.clone(),
            depth,
            name: self.name.clone(),
            text,
            is_open,
            is_number,
        };
        match &self.content {
            Content::Leaf { text, is_number } => lines.push(line(text.clone(), None, *is_number)),
            Content::Branch { parts, is_array, left_out } => {
                let is_open = self.is_open_by_default() != toggled.contains(&path);
                let text = if is_open && !is_array { String::new() } else { self.preview() };
                lines.push(line(text, Some(is_open), false));
                if is_open {
                    parts.iter().for_each(|part| part.lines(&path, depth + 1, toggled, lines));
                    if *left_out > 0 {
                        let text = format!("{left_out} more");
                        let (path, name) = (format!("{path}[…]"), "…".to_owned());
                        lines.push(Line { path, depth: depth + 1, name, text, is_open: None, is_number: false });
                    }
                }
            }
        }
    }

    /// Structs are expanded by default, arrays of numbers are not.
    fn is_open_by_default(&self) -> bool {
        let Content::Branch { parts, is_array, .. } = &self.content else { return false };
        let of_structs = parts.iter().any(|part| matches!(part.content, Content::Branch { is_array: false, .. }));
        !is_array || of_structs && parts.len() <= FEW
    }

    /// The contents of a branch in one line.
    fn preview(&self) -> String {
        let Content::Branch { parts, is_array, left_out } = &self.content else { return String::new() };
        if !is_array {
            return format!("{{{} fields}}", parts.len());
        }
        let shown = |node: &Node| match &node.content {
            Content::Leaf { text, .. } => rounded(text),
            Content::Branch { .. } => node.preview(),
        };
        let mut texts: Vec<String> = parts.iter().take(SHOWN).map(shown).collect();
        if parts.len() > SHOWN {
            texts.push("…".to_owned());
        }
        format!("[{}] {}", parts.len() + left_out, texts.join(" "))
    }
}

/// A float rounded to about four digits.
fn rounded(text: &str) -> String {
    match text.parse::<f64>() {
        Ok(x) if text.contains('.') && x.is_finite() => {
            if x != 0.0 && !(1e-3..1e5).contains(&x.abs()) {
                format!("{x:.2e}")
            } else {
                format!("{x:.3}")
            }
        }
        _ => text.to_owned(),
    }
}

/// Rows of 16 bytes in hexadecimal and ASCII.
fn hex(bytes: &[u8]) -> Vec<String> {
    let row = |(place, row): (usize, &[u8])| {
        let digits: Vec<String> = row.iter().map(|byte| format!("{byte:02x}")).collect();
        let text = row.iter().map(|byte| if (0x20..0x7f).contains(byte) { char::from(*byte) } else { '.' });
        format!("{:06x}  {:<47}  {}", place * 16, digits.join(" "), text.collect::<String>())
    };
    bytes.chunks(16).enumerate().take(LISTED).map(row).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use lcmtypes::{ControllerInput, ControllerTick, Message, RobotState, RunInfo, channels};

    fn decoded<M: Message>(channel: &str, message: &M) -> Decoded {
        let mut bytes = Vec::new();
        message.encode(&mut bytes).unwrap();
        decode(&Types::default(), channel, &bytes, bytes.len())
    }

    fn shown(decoded: &Decoded, toggled: &[&str]) -> Vec<String> {
        let Decoded::Fields(nodes) = decoded else { panic!("{decoded:?}") };
        let toggled = toggled.iter().map(|path| (*path).to_owned()).collect();
        lines(nodes, &toggled).iter().map(|line| format!("{} {}", line.path, line.text)).collect()
    }

    fn input() -> ControllerInput {
        let (q, qd, tau) = (vec![0.25, -1.0 / 3.0], vec![0.0; 2], vec![0.0; 2]);
        let state = RobotState { seq: 7, nj: 2, q, qd, tau, ..Default::default() };
        let mut input = ControllerInput { tick: 3, ..Default::default() };
        input.deliver(channels::ROBOT_STATE, 5, &state).unwrap();
        input
    }

    #[test]
    fn structs_are_expanded_and_number_arrays_collapsed() {
        let tree = decoded(channels::CONTROLLER_INPUT, &input());
        let lines = shown(&tree, &[]);
        for line in [
            "tick 3",
            "messages[0].channel \"ROBOT_STATE\"",
            "messages[0].data.seq 7",
            "messages[0].data.q [2] 0.250 -0.333",
        ] {
            assert!(lines.iter().any(|found| found == line), "{line:?} in {lines:#?}");
        }
        let lines = shown(&tree, &["messages[0].data.q"]);
        for line in ["messages[0].data.q[1] -0.3333333333333333", "messages[0].data.q [2] 0.250 -0.333"] {
            assert!(lines.iter().any(|found| found == line), "{line:?} in {lines:#?}");
        }
        assert!(!shown(&tree, &["messages"]).iter().any(|found| found.starts_with("messages[0]")));
    }

    #[test]
    fn a_text_expands_into_its_lines() {
        let scenario = "[noise]\ngyro = 0.1\n".to_owned();
        let info = RunInfo { scenario, robot: "hyq".to_owned(), ..Default::default() };
        let lines = shown(&decoded(channels::RUN_INFO, &info), &["scenario"]);
        let at = lines.iter().position(|line| line == "scenario [2] [noise] gyro = 0.1").unwrap();
        assert_eq!(lines[at + 1..at + 3], ["scenario[0] [noise]", "scenario[1] gyro = 0.1"]);
        assert!(lines.iter().any(|line| line == "robot \"hyq\""));
    }

    #[test]
    fn values_are_shown_with_the_names_of_constants() {
        let tick = ControllerTick { mode: ControllerTick::MODE_WALK, fault: 6, fault_index: 2, ..Default::default() };
        let lines = shown(&decoded(channels::CONTROLLER_TICK, &tick), &[]);
        for line in ["mode 2  MODE_WALK", "fault 6  FAULT_TILT", "fault_index 2"] {
            assert!(lines.iter().any(|found| found == line), "{line:?} in {lines:#?}");
        }
    }

    #[test]
    fn undecodable_messages_are_shown_as_bytes() {
        let Decoded::Bytes(why, rows) = decode(&Types::default(), "X", b"\0\x01no known type of message", 26) else {
            panic!()
        };
        assert!(why.starts_with("26 bytes"), "{why}");
        assert_eq!(rows[0], "000000  00 01 6e 6f 20 6b 6e 6f 77 6e 20 74 79 70 65 20  ..no known type ");
        assert_eq!(rows.len(), 2);
        let mut bytes = Vec::new();
        input().encode(&mut bytes).unwrap();
        bytes.truncate(60);
        assert!(
            matches!(decode(&Types::default(), "X", &bytes, 60), Decoded::Bytes(why, _) if why.contains("controller_input_t"))
        );
        assert!(
            matches!(decode(&Types::default(), "X", &[], 5_000_000), Decoded::Bytes(why, rows) if why.starts_with("5000000 bytes") && rows.is_empty())
        );
    }
}
