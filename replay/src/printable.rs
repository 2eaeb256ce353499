//! Makes text from logs, networks and file names safe to print.

use crate::names::byte_of;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// The text with every control character escaped as in a Rust string (`\n`, `\u{1b}`), so that text from a log or network can neither
/// control a terminal nor forge a line of output. Bidirectional overrides, which reorder the text around them, are escaped too, and the
/// characters that stand for bytes which are not UTF-8 in the name of a channel (`\xe9`). Printable text is returned as it is.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if let Some(byte) = byte_of(c) {
            let _ = write!(out, "\\x{byte:02x}");
        } else if is_unsafe(c) {
            let _ = write!(out, "{}", c.escape_default());
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

/// [`printable`] for each line of a text that may have several: line breaks stay.
pub fn printable_lines(text: &str) -> String {
    text.lines().map(printable).collect::<Vec<_>>().join("\n")
}

/// [`printable`] for JSON: each unsafe character inside a string becomes `\uXXXX`, so that the text still parses to the same value.
pub fn printable_json(json: &str) -> Cow<'_, str> {
    let is_unsafe = |c: char| c != '\n' && is_unsafe(c);
    if !json.contains(is_unsafe) {
        return Cow::Borrowed(json);
    }
    // All unsafe characters are below U+10000.
    json.chars()
        .fold(String::new(), |mut out, c| {
            let _ = if is_unsafe(c) { write!(out, "\\u{:04x}", u32::from(c)) } else { write!(out, "{c}") };
            out
        })
        .into()
}

/// [`printable`] for a path.
pub fn printable_path(path: &Path) -> String {
    printable(&path.to_string_lossy()).into_owned()
}

fn is_unsafe(c: char) -> bool {
    c.is_control()
        || byte_of(c).is_some()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_and_bidirectional_overrides_are_escaped() {
        let cases = [
            ("ROBOT_STATE", "ROBOT_STATE"),
            ("Größe 7", "Größe 7"),
            ("A\u{1b}[31m\nB\t", "A\\u{1b}[31m\\nB\\t"),
            ("\u{9b}2J\u{7f}", "\\u{9b}2J\\u{7f}"),
            ("a\u{202e}b", "a\\u{202e}b"),
            ("caf\u{efe9}", "caf\\xe9"),
        ];
        for (text, expected) in cases {
            assert_eq!(printable(text), expected);
        }
        let hostile = serde_json::json!({ "a\u{9b}": "b\u{202e}\u{1b}\n\u{7f}" });
        let json = serde_json::to_string_pretty(&hostile).unwrap();
        assert!(!printable_json(&json).contains(|c| c != '\n' && is_unsafe(c)));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&printable_json(&json)).unwrap(), hostile);
        assert_eq!(printable_lines("a\u{7}\nb\r\n"), "a\\u{7}\nb");
    }
}
