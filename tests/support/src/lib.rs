//! Helpers for the tests of all crates.

/// A copy of `text` with `from` replaced by `to`: an edit of a TOML or URDF text that is certain to have an effect.
///
/// # Panics
/// If `from` does not occur in `text` exactly once.
#[track_caller]
pub fn replace_once(text: &str, from: &str, to: &str) -> String {
    let n = text.matches(from).count();
    assert_eq!(n, 1, "{from:?} occurs {n} times, expected once, in:\n{text}");
    text.replacen(from, to, 1)
}

#[cfg(test)]
mod tests {
    use super::replace_once;

    #[test]
    fn replaces_the_only_occurrence() {
        assert_eq!(replace_once("a = 1\nb = 2\n", "1", "3"), "a = 3\nb = 2\n");
    }

    #[test]
    #[should_panic(expected = "occurs 0 times")]
    fn panics_without_an_occurrence() {
        replace_once("a = 1\n", "2", "3");
    }

    #[test]
    #[should_panic(expected = "occurs 2 times")]
    fn panics_with_two_occurrences() {
        replace_once("a = 1\nb = 1\n", "1", "3");
    }
}
