//! Channels by regular expression.

use crate::Error;
use regex_lite::Regex;

/// A regular expression that has to match a channel's whole name, as LCM's subscriptions do.
#[derive(Debug, Clone)]
pub struct Pattern(Regex);

impl Pattern {
    /// # Errors
    /// [`Error::Pattern`] if it is no regular expression.
    pub fn new(pattern: &str) -> Result<Self, Error> {
        // The pattern by itself first: `)|(` is none, though it becomes one in brackets.
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

/// Which channels are wanted.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Only these, if given.
    pub include: Option<Pattern>,
    /// And none of these.
    pub exclude: Option<Pattern>,
}

impl Filter {
    /// Whether a channel is wanted.
    pub fn takes(&self, channel: &str) -> bool {
        self.include.as_ref().is_none_or(|include| include.matches(channel))
            && !self.exclude.as_ref().is_some_and(|exclude| exclude.matches(channel))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn whole_names_count() {
        let filter = Filter { include: Pattern::new("A|B.*").ok(), exclude: Pattern::new("B1").ok() };
        let taken: Vec<_> = ["A", "AA", "XA", "B", "B1", "B12", "C"].into_iter().filter(|c| filter.takes(c)).collect();
        assert_eq!(taken, ["A", "B", "B12"]);
        assert!(Filter::default().takes("anything"));
        assert!(matches!(Pattern::new("A)|(B").unwrap_err(), Error::Pattern { .. }));
    }
}
