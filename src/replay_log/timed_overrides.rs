//! Parameter changes during a replay, read from a TOML file.

use crate::live::toml_error;
use crate::robot::read;
use anyhow::{Context, ensure};
use controller::params::key_values;
use replay::engine::{TimedOverride, When};
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    change: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    tick: Option<i64>,
    t_s: Option<f64>,
    set: toml::Table,
}

/// Reads the changes. They must be in the order of time.
pub fn read_file(path: &Path) -> anyhow::Result<Vec<TimedOverride>> {
    let text = read(path)?;
    let file = toml::from_str(&text).map_err(|error| toml_error(path, &text, &error))?;
    changes(&file).with_context(|| path.display().to_string())
}

fn changes(file: &File) -> anyhow::Result<Vec<TimedOverride>> {
    let by_tick = file.change.first().is_some_and(|entry| entry.tick.is_some());
    let mut changes = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for (number, entry) in (1..).zip(&file.change) {
        let when = match (entry.tick, entry.t_s) {
            (Some(tick), None) if by_tick => When::Tick(tick),
            (None, Some(t_s)) if !by_tick => When::Seconds(t_s),
            _ => anyhow::bail!("change {number}: expected either `tick` or `t_s`, the same key in every change"),
        };
        #[expect(clippy::cast_precision_loss, reason = "ticks of a log are far below 2^53")]
        let at = match when {
            When::Tick(tick) => tick as f64,
            When::Seconds(t_s) => t_s,
        };
        ensure!(
            at.is_finite() && at >= last,
            "change {number}: time {at}, expected a finite time not before the previous change ({last})"
        );
        last = at;
        changes.extend(key_values(&entry.set).into_iter().map(|(key, value)| TimedOverride { when, key, value }));
    }
    Ok(changes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_read_in_order() {
        let text = "[[change]]\nt_s = 1.5\nset = { wbc.friction = 0.6, \"trunk.kp\" = [1.0, 2.0, 3.0] }\n[[change]]\nt_s = 2\nset.wbc.friction = 0.7";
        let changes = changes(&toml::from_str(text).unwrap()).unwrap();
        let found: Vec<(When, &str, &str)> = changes.iter().map(|c| (c.when, &*c.key, &*c.value)).collect();
        let (first, second) = (When::Seconds(1.5), When::Seconds(2.0));
        let mut expected = vec![
            (first, "trunk.kp", "[1.0, 2.0, 3.0]"),
            (first, "wbc.friction", "0.6"),
            (second, "wbc.friction", "0.7"),
        ];
        expected.sort_by(|a, b| a.1.cmp(b.1));
        let mut found = found;
        found.sort_by(|a, b| a.1.cmp(b.1));
        assert_eq!(found, expected);
    }

    #[test]
    fn changes_out_of_order_are_rejected() {
        let parse = |text: &str| anyhow::Ok(changes(&toml::from_str(text)?)?);
        let error = |text: &str| format!("{:#}", parse(text).unwrap_err());
        let late = "[[change]]\ntick = 5\nset = {}\n[[change]]\ntick = 4\nset = {}";
        assert!(error(late).starts_with("change 2:"), "{}", error(late));
        let mixed = "[[change]]\ntick = 5\nset = {}\n[[change]]\nt_s = 6.0\nset = {}";
        assert!(error(mixed).starts_with("change 2:"), "{}", error(mixed));
        assert!(error("[[change]]\ntick = 5\nat = 3\nset = {}").contains("unknown field `at`"));
    }
}
