//! Limit on the number of EVENTs per source: a flood, of this process or of a foreign one, is counted instead of published or shown.

use lcmtypes::Event;
use std::collections::BTreeMap;

/// Length of a window, ns.
const WINDOW_NS: i64 = 1_000_000_000;
/// EVENTs of a source that pass in one window: as many errors, and as many others.
pub const PER_WINDOW: u32 = 20;
/// Sources that are counted separately; all others share one count.
const SOURCES: usize = 32;

/// Counts the EVENTs of each source, errors and others separately: a flood of warnings hides no error.
#[derive(Debug, Default)]
pub struct EventLimit {
    windows: BTreeMap<Key, Window>,
}

/// Source, and whether errors are counted.
type Key = (String, bool);

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
    /// Errors are counted, else EVENTs of other levels.
    pub is_error: bool,
    /// Their number.
    pub count: u64,
}

impl Suppressed {
    /// Text for an EVENT or a screen.
    pub fn text(&self) -> String {
        let what = if self.is_error { "errors" } else { "EVENTs" };
        format!("{} more {what} within 1 s suppressed, limit {PER_WINDOW}", self.count)
    }

    /// The EVENT that reports them, without sender and number.
    pub fn event(self, t_ns: i64) -> Event {
        let text = self.text();
        Event { t_ns, tick: -1, level: Event::LEVEL_WARNING, source: self.source, text, ..Event::default() }
    }
}

impl EventLimit {
    /// Whether an EVENT passes at `now_ns`: at most `PER_WINDOW` per second.
    pub fn passes(&mut self, now_ns: i64, event: &Event) -> bool {
        let mut key = (event.source.clone(), event.level == Event::LEVEL_ERROR);
        if !self.windows.contains_key(&key) && self.windows.len() >= SOURCES {
            key.0.clear();
        }
        let window = self.windows.entry(key).or_default();
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
        self.windows.retain(|(source, is_error), window| {
            if is_over(window) && window.suppressed > 0 {
                found.push(Suppressed { source: source.clone(), is_error: *is_error, count: window.suppressed });
            }
            !is_over(window)
        });
        found
    }

    /// Ends all windows, at the end of a run; returns the sources of which EVENTs did not pass.
    pub fn take_rest(&mut self) -> Vec<Suppressed> {
        let newest = self.windows.values().map(|window| window.begin_ns).max();
        newest.map_or_else(Vec::new, |begin_ns| self.take_suppressed(begin_ns.saturating_add(WINDOW_NS)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(source: &str, level: i8) -> Event {
        Event { source: source.to_owned(), level, ..Event::default() }
    }

    #[test]
    fn a_flood_passes_in_part_and_is_counted() {
        let mut limit = EventLimit::default();
        let flood = of("foreign", Event::LEVEL_WARNING);
        let passed = (0..500).filter(|k| limit.passes(1000 + k, &flood)).count();
        assert_eq!(passed, PER_WINDOW as usize);
        assert!(limit.passes(1500, &of("controller", Event::LEVEL_WARNING)), "sources are counted separately");
        assert!(limit.passes(1500, &of("foreign", Event::LEVEL_ERROR)), "errors are counted separately");
        assert_eq!(limit.take_suppressed(2000), []);
        let suppressed =
            Suppressed { source: "foreign".to_owned(), is_error: false, count: 500 - u64::from(PER_WINDOW) };
        assert_eq!(limit.take_suppressed(1000 + WINDOW_NS), [suppressed]);
        assert!(limit.passes(2000 + WINDOW_NS, &flood), "a new window");
    }

    #[test]
    fn at_the_end_the_open_windows_are_reported() {
        let mut limit = EventLimit::default();
        for (begin, source, count) in [(5, "a", 21), (WINDOW_NS / 2, "b", 23), (7, "c", 1)] {
            let flood = of(source, Event::LEVEL_WARNING);
            let passed = (0..count).filter(|_| limit.passes(begin, &flood)).count();
            assert_eq!(passed, 20.min(count));
        }
        assert_eq!(limit.take_suppressed(WINDOW_NS / 2), []);
        let rest: Vec<_> = limit.take_rest().into_iter().map(|rest| (rest.source, rest.count)).collect();
        assert_eq!(rest, [("a".to_owned(), 1), ("b".to_owned(), 3)]);
        assert_eq!(limit.take_rest(), []);
    }

    #[test]
    fn a_flood_of_errors_passes_in_part() {
        let mut limit = EventLimit::default();
        let error = of("driver", Event::LEVEL_ERROR);
        assert_eq!((0..500).filter(|_| limit.passes(0, &error)).count(), PER_WINDOW as usize);
        let report = limit.take_suppressed(WINDOW_NS).pop().unwrap().event(7);
        assert_eq!((report.level, &*report.source, report.t_ns), (Event::LEVEL_WARNING, "driver", 7));
        assert!(report.text.starts_with("480 more errors"), "{}", report.text);
    }

    #[test]
    fn many_sources_use_bounded_memory() {
        let mut limit = EventLimit::default();
        let passed = (0..10_000).filter(|k| limit.passes(0, &of(&k.to_string(), Event::LEVEL_WARNING))).count();
        assert_eq!((passed, limit.windows.len()), (SOURCES + PER_WINDOW as usize, SOURCES + 1));
    }
}
