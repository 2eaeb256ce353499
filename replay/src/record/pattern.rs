//! Selects channels by regular expression.

use crate::Error;
use regex_lite::Regex;

/// A regular expression that must match the whole name of a channel, as in LCM's subscriptions.
#[derive(Debug, Clone)]
pub struct Pattern(Regex);

impl Pattern {
    /// # Errors
    /// [`Error::Pattern`] if it is not a valid regular expression.
    pub fn new(pattern: &str) -> Result<Self, Error> {
        // Compile the pattern alone first: `)|(` is invalid, but would be valid inside the group.
        Regex::new(pattern)
            .and_then(|_| Regex::new(&format!("^(?:{pattern})$")))
            .map(Pattern)
            .map_err(|error| Error::Pattern { pattern: pattern.to_owned(), why: error.to_string() })
    }

    /// Whether the whole name matches.
    pub fn matches(&self, channel: &str) -> bool {
        self.0.is_match(channel)
    }
}

/// Selects channels.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Only channels that match this, if given.
    pub include: Option<Pattern>,
    /// Except channels that match this, if given.
    pub exclude: Option<Pattern>,
}

impl Filter {
    /// Whether a channel is selected.
    pub fn takes(&self, channel: &str) -> bool {
        self.include.as_ref().is_none_or(|include| include.matches(channel)) && !self.excludes(channel)
    }

    /// Whether a channel is explicitly not selected.
    pub fn excludes(&self, channel: &str) -> bool {
        self.exclude.as_ref().is_some_and(|exclude| exclude.matches(channel))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn patterns_match_whole_names() {
        let filter = Filter { include: Pattern::new("A|B.*").ok(), exclude: Pattern::new("B1").ok() };
        let taken: Vec<_> = ["A", "AA", "XA", "B", "B1", "B12", "C"].into_iter().filter(|c| filter.takes(c)).collect();
        assert_eq!(taken, ["A", "B", "B12"]);
        assert!(Filter::default().takes("anything"));
        assert!(matches!(Pattern::new("A)|(B").unwrap_err(), Error::Pattern { .. }));
    }
}
