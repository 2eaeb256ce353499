//! A scenario with some of its keys changed: the same file format, so that the result can be run again by hand.

use anyhow::Context;
use toml::{Table, Value};

/// A key, `terrain.step_height_m` or `push[0].force_W[1]`, and its value as TOML.
pub type Change = (String, String);

/// The text of a scenario under another name and with changes. A key that is not there is added; the scenario's own check comes later.
///
/// # Errors
/// A text that is no TOML; a key that names an entry of a list that is not there; a value that is no TOML.
pub fn edited(text: &str, name: &str, changes: &[Change]) -> anyhow::Result<String> {
    let mut root: Table = text.parse()?;
    root.insert("name".to_owned(), Value::String(name.to_owned()));
    for (key, value) in changes {
        let value = read_value(value).with_context(|| format!("{key}={value}"))?;
        *place(&mut root, key)? = value;
    }
    Ok(toml::to_string(&root)?)
}

fn read_value(text: &str) -> anyhow::Result<Value> {
    let mut table: Table = format!("value = {text}").parse()?;
    table.remove("value").context("there is no value")
}

/// Where a key stands; made if the last step is missing in its table.
fn place<'t>(root: &'t mut Table, key: &str) -> anyhow::Result<&'t mut Value> {
    let mut steps = steps(key)?.into_iter().peekable();
    let Some(Step::Key(first)) = steps.next() else { anyhow::bail!("{key}: expected a key, such as terrain.kind") };
    let is_last = steps.peek().is_none();
    anyhow::ensure!(is_last || root.contains_key(first), "{key}: the scenario has no {first}");
    let mut at = root.entry(first).or_insert(Value::Boolean(false));
    while let Some(step) = steps.next() {
        let is_last = steps.peek().is_none();
        at = match (step, at) {
            (Step::Key(name), Value::Table(table)) => {
                anyhow::ensure!(is_last || table.contains_key(name), "{key}: the scenario has no {name} there");
                table.entry(name).or_insert(Value::Boolean(false))
            }
            (Step::Index(i), Value::Array(list)) => {
                let n = list.len();
                list.get_mut(i).with_context(|| format!("{key}: there are {n} entries, counted from 0"))?
            }
            (Step::Key(name), _) => anyhow::bail!("{key}: what stands before {name} is no table"),
            (Step::Index(i), _) => anyhow::bail!("{key}: what stands before [{i}] is no list"),
        };
    }
    Ok(at)
}

enum Step<'k> {
    Key(&'k str),
    Index(usize),
}

fn steps(key: &str) -> anyhow::Result<Vec<Step<'_>>> {
    let mut steps = Vec::new();
    for part in key.split('.') {
        let (name, mut rest) = part.split_at(part.find('[').unwrap_or(part.len()));
        anyhow::ensure!(!name.is_empty(), "{key}: a name is missing");
        steps.push(Step::Key(name));
        while let Some((index, behind)) = rest.strip_prefix('[').and_then(|text| text.split_once(']')) {
            steps.push(Step::Index(index.parse().with_context(|| format!("{key}: [{index}] is no number"))?));
            rest = behind;
        }
        anyhow::ensure!(rest.is_empty(), "{key}: {rest} makes no sense");
    }
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "name = \"a\"\nduration_s = 2.0\n[terrain]\nkind = \"flat\"\n[[push]]\nforce_W = [0.0, 60.0, 0.0]\n";

    fn change(key: &str, value: &str) -> anyhow::Result<Table> {
        Ok(edited(TEXT, "b", &[(key.to_owned(), value.to_owned())])?.parse()?)
    }

    #[test]
    fn keys_are_changed_added_and_reached_in_lists() {
        let expected = |text: &str| text.parse::<Table>().unwrap();
        let with = |from: &str, to: &str| expected(&TEXT.replace("\"a\"", "\"b\"").replace(from, to));
        assert_eq!(change("duration_s", "5.0").unwrap(), with("2.0", "5.0"));
        assert_eq!(change("terrain.kind", "\"steps\"").unwrap(), with("flat", "steps"));
        assert_eq!(change("push[0].force_W[1]", "-90.0").unwrap(), with("60.0", "-90.0"));
        assert_eq!(change("noise", "{ gyro = 0.1 }").unwrap(), with("[terrain]", "noise = { gyro = 0.1 }\n[terrain]"));
        assert_eq!(change("terrain.cell_m", "0.05").unwrap(), with("\"flat\"", "\"flat\"\ncell_m = 0.05"));
    }

    #[test]
    fn a_key_that_leads_nowhere_is_named() {
        let text = |key, value| format!("{:#}", change(key, value).unwrap_err());
        assert_eq!(text("push[1].t_s", "1.0"), "push[1].t_s: there are 1 entries, counted from 0");
        assert_eq!(text("noise.gyro", "0.1"), "noise.gyro: the scenario has no noise");
        assert_eq!(text("duration_s.x", "1"), "duration_s.x: what stands before x is no table");
        assert_eq!(text("terrain[0]", "1"), "terrain[0]: what stands before [0] is no list");
        assert_eq!(text("push[x]", "1"), "push[x]: [x] is no number: invalid digit found in string");
        assert!(text("duration_s", "five").starts_with("duration_s=five: "));
    }
}
