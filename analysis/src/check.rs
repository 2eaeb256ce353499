//! Limits for the metrics of a run, from a TOML file.
//!
//! ```toml
//! [limits]
//! "tracking.pitch.std" = 0.01                             # at most
//! "locomotion.distance_m" = { min = 3.0 }
//! "tracking.feet.LF.x.rms" = { max = 0.02 }
//! "safety.fell" = { equals = false }
//! ```
//!
//! A key is the path of a value in `metrics.json`. An element of a list is identified by its index or by its `leg`, `stage`, `joint` or `fault`.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::Error;
use crate::metrics::Metrics;

/// Keys that identify an element of a list.
const NAMES: [&str; 4] = ["leg", "stage", "joint", "fault"];
/// Number of similar keys in an error message.
const OFFERED: usize = 3;

/// Limits, in the order of their keys.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    file: String,
    limits: Vec<(String, Limit)>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged, expecting = "a number (the maximum), or a table with `min`, `max` or `equals`")]
enum Limit {
    AtMost(f64),
    Bounds(Bounds),
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Bounds {
    min: Option<f64>,
    max: Option<f64>,
    equals: Option<toml::Value>,
}

/// Result of one limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Path of the value in `metrics.json`.
    pub key: String,
    /// Value of the log; `null` if it cannot be computed, which violates the limit.
    pub found: Value,
    /// The limit, as text.
    pub expected: String,
    /// True if the limit is met.
    pub pass: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    limits: toml::Table,
}

impl Limits {
    /// Reads a file of limits.
    ///
    /// # Errors
    /// [`Error::ReadFile`], or as [`Limits::parse`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = replay::read_text(path).map_err(|source| Error::ReadFile { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Parses the text of a file of limits; `name` is its name in error messages.
    ///
    /// # Errors
    /// [`Error::Choices`] with the key.
    pub fn parse(text: &str, name: &str) -> Result<Self, Error> {
        let failed = |problem: String| Error::Choices { file: name.to_owned(), problem };
        let file: File = toml::from_str(text).map_err(|e| failed(e.to_string().trim_end().to_owned()))?;
        let mut limits = Vec::new();
        for (key, value) in file.limits {
            let limit: Limit = value.clone().try_into().map_err(|_| {
                failed(format!(
                    "key `{key}`: found {value}, expected a number (the maximum), or a table with `min`, `max` or `equals`"
                ))
            })?;
            let empty = matches!(&limit, Limit::Bounds(Bounds { min: None, max: None, equals: None }));
            if empty || limit.numbers().any(f64::is_nan) {
                return Err(failed(format!("key `{key}`: found {value}, expected a number, `min`, `max` or `equals`")));
            }
            limits.push((key, limit));
        }
        Ok(Self { file: name.to_owned(), limits })
    }

    /// Compares metrics with the limits.
    ///
    /// # Errors
    /// [`Error::Choices`] if a key is not in `metrics.json`; the message lists similar keys.
    pub fn check(&self, metrics: &Metrics) -> Result<Vec<Verdict>, Error> {
        let tree: Value = serde_json::from_str(&metrics.to_json()).unwrap_or(Value::Null);
        let verdict = |(key, limit): &(String, Limit)| match find(&tree, key) {
            Some(found) => Ok(limit.judge(key, found)),
            None => Err(Error::Choices { file: self.file.clone(), problem: self.unknown(key, &tree) }),
        };
        self.limits.iter().map(verdict).collect()
    }

    fn unknown(&self, key: &str, tree: &Value) -> String {
        let mut known = Vec::new();
        keys(tree, String::new(), &mut known);
        known.sort_by_key(|name| distance(name, key));
        known.truncate(OFFERED);
        format!(
            "unknown key `{key}`; similar keys: {}",
            known.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ")
        )
    }
}

impl Limit {
    fn numbers(&self) -> impl Iterator<Item = f64> {
        let both = match self {
            Self::AtMost(max) => [None, Some(*max)],
            Self::Bounds(bounds) => [bounds.min, bounds.max],
        };
        both.into_iter().flatten()
    }

    fn judge(&self, key: &str, found: &Value) -> Verdict {
        let number = found.as_f64();
        let above = |min: f64| number.is_some_and(|v| v >= min);
        let below = |max: f64| number.is_some_and(|v| v <= max);
        let (pass, expected) = match self {
            Self::AtMost(max) => (below(*max), format!("at most {max}")),
            Self::Bounds(Bounds { min, max, equals }) => {
                let equal = |wanted: &toml::Value| match (wanted.as_float(), wanted.as_integer(), found) {
                    (Some(wanted), ..) => number == Some(wanted),
                    (_, Some(wanted), _) => number == Some(wanted as f64),
                    (.., Value::Bool(found)) => wanted.as_bool() == Some(*found),
                    (.., Value::String(found)) => wanted.as_str() == Some(found),
                    _ => false,
                };
                let conditions = [
                    min.map(|min| format!("at least {min}")),
                    max.map(|max| format!("at most {max}")),
                    equals.as_ref().map(|wanted| format!("equal to {wanted}")),
                ];
                let pass = min.is_none_or(above) && max.is_none_or(below) && equals.as_ref().is_none_or(equal);
                (pass, conditions.into_iter().flatten().collect::<Vec<_>>().join(", "))
            }
        };
        Verdict { key: key.to_owned(), found: found.clone(), expected, pass }
    }
}

/// The value at a key. A quantity that is `null` has all keys below it, with the value `null`.
fn find<'a>(tree: &'a Value, key: &str) -> Option<&'a Value> {
    key.split('.').try_fold(tree, |value, part| match value {
        Value::Object(map) => map.get(part),
        Value::Array(list) => {
            let named =
                |element: &&Value| NAMES.iter().any(|name| element.get(name).and_then(Value::as_str) == Some(part));
            list.iter().find(named).or_else(|| list.get(part.parse::<usize>().ok()?))
        }
        Value::Null => Some(value),
        _ => None,
    })
}

/// Keys of all values that can be compared.
fn keys(value: &Value, path: String, out: &mut Vec<String>) {
    let below = |part: &str| if path.is_empty() { part.to_owned() } else { format!("{path}.{part}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(name, value)| keys(value, below(name), out)),
        Value::Array(list) => {
            for (number, element) in list.iter().enumerate() {
                let name = NAMES.iter().find_map(|name| element.get(name).and_then(Value::as_str).map(str::to_owned));
                keys(element, below(&name.unwrap_or_else(|| number.to_string())), out);
            }
        }
        _ => out.push(path),
    }
}

/// Levenshtein distance: number of characters to replace, insert or delete.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let changed = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levenshtein_distances() {
        assert_eq!((distance("kitten", "sitting"), distance("", "abc"), distance("same", "same")), (3, 3, 0));
    }

    #[test]
    fn errors_name_the_key() {
        for (text, part) in [
            ("[limits]\n\"a.b\" = \"small\"", "key `a.b`: found \"small\""),
            ("[limits]\na = { most = 1 }", "key `a`"),
            ("[limits]\na = {}", "key `a`"),
            ("[limits]\na = nan", "key `a`"),
            ("[limit]\na = 1", "unknown field `limit`"),
        ] {
            let error = Limits::parse(text, "ci.toml").unwrap_err().to_string();
            assert!(error.starts_with("ci.toml: ") && error.contains(part), "{text}: {error}");
        }
    }
}
