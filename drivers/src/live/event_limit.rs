//! Limit on the number of EVENTs per source: a flood, of this process or of a foreign one, is counted instead of published or shown.

use std::collections::BTreeMap;

/// Length of a window, ns.
const WINDOW_NS: i64 = 1_000_000_000;
/// EVENTs of a source that pass in one window.
pub const PER_WINDOW: u32 = 20;
/// Sources that are counted separately; all others share one count.
const SOURCES: usize = 32;

/// Counts the EVENTs of each source.
#[derive(Debug, Default)]
pub struct EventLimit {
    windows: BTreeMap<String, Window>,
}

#[derive(Debug, Default)]
struct Window {
    begin_ns: i64,
    passed: u32,
    suppressed: u64,
}

/// EVENTs of a source that did not pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Suppressed {
    /// The source; empty for sources that share one count.
    pub source: String,
    /// Their number.
    pub count: u64,
}

impl Suppressed {
    /// Text for an EVENT or a screen.
    pub fn text(&self) -> String {
        format!("{} more EVENTs within 1 s suppressed, limit {PER_WINDOW}", self.count)
    }
}

impl EventLimit {
    /// Whether an EVENT of `source` at `now_ns` passes: at most `PER_WINDOW` per second.
    pub fn passes(&mut self, now_ns: i64, source: &str) -> bool {
        let is_own = self.windows.contains_key(source) || self.windows.len() < SOURCES;
        let window = self.windows.entry(if is_own { source.to_owned() } else { String::new() }).or_default();
        if window.passed == 0 {
            window.begin_ns = now_ns;
        }
        let passes = window.passed < PER_WINDOW;
        if passes {
            window.passed += 1;
        } else {
            window.suppressed += 1;
        }
        passes
    }

    /// Ends the windows that are over at `now_ns`; returns the sources of which EVENTs did not pass. Call it several times per second.
    pub fn take_suppressed(&mut self, now_ns: i64) -> Vec<Suppressed> {
        let is_over = |window: &Window| now_ns - window.begin_ns >= WINDOW_NS || now_ns < window.begin_ns;
        let mut found = Vec::new();
        self.windows.retain(|source, window| {
            if is_over(window) && window.suppressed > 0 {
                found.push(Suppressed { source: source.clone(), count: window.suppressed });
            }
            !is_over(window)
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_passes_in_part_and_is_counted() {
        let mut limit = EventLimit::default();
        let passed = (0..500).filter(|k| limit.passes(1000 + k, "foreign")).count();
        assert_eq!(passed, PER_WINDOW as usize);
        assert!(limit.passes(1500, "controller"), "sources are counted separately");
        assert_eq!(limit.take_suppressed(2000), []);
        let count = 500 - u64::from(PER_WINDOW);
        assert_eq!(limit.take_suppressed(1000 + WINDOW_NS), [Suppressed { source: "foreign".to_owned(), count }]);
        assert!(limit.passes(2000 + WINDOW_NS, "foreign"), "a new window");
    }

    #[test]
    fn many_sources_use_bounded_memory() {
        let mut limit = EventLimit::default();
        let passed = (0..10_000).filter(|k| limit.passes(0, &k.to_string())).count();
        assert_eq!((passed, limit.windows.len()), (SOURCES + PER_WINDOW as usize, SOURCES + 1));
    }
}
