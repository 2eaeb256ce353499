//! Makes text from logs, networks and file names safe to print.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// The text with every control character escaped as in a Rust string (`\n`, `\u{1b}`), so that text from a log or network can neither
/// control a terminal nor forge a line of output. Bidirectional overrides, which reorder the text around them, are escaped too.
/// Printable text is returned as it is.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unsafe(c) {
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

/// [`printable`] for a path.
pub fn printable_path(path: &Path) -> String {
    printable(&path.to_string_lossy()).into_owned()
}

fn is_unsafe(c: char) -> bool {
    c.is_control() || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
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
        ];
        for (text, expected) in cases {
            assert_eq!(printable(text), expected);
        }
        assert_eq!(printable_lines("a\u{7}\nb\r\n"), "a\\u{7}\nb");
    }
}
