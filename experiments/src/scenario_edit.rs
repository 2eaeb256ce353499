//! Changes keys of a scenario file. The result is a scenario file too, so that a user can run it again.

use anyhow::Context;
use toml::{Table, Value};

/// A key, `terrain.step_height_m` or `push[0].force_W[1]`, and its value as TOML.
pub type Change = (String, String);

/// Renames a scenario and changes keys. A missing key is added; whether it is valid is checked when the scenario is parsed.
///
/// # Errors
/// Text or value that is not TOML; a key below a table or list entry that does not exist.
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
    table.remove("value").context("expected a TOML value")
}

/// The value of a key; inserted if only the last step is missing.
fn place<'t>(root: &'t mut Table, key: &str) -> anyhow::Result<&'t mut Value> {
    let mut steps = steps(key)?.into_iter().peekable();
    let Some(Step::Key(first)) = steps.next() else { anyhow::bail!("{key}: expected a key such as terrain.kind") };
    let is_last = steps.peek().is_none();
    anyhow::ensure!(is_last || root.contains_key(first), "{key}: the scenario has no {first}");
    let mut at = root.entry(first).or_insert(Value::Boolean(false));
    while let Some(step) = steps.next() {
        let is_last = steps.peek().is_none();
        at = match (step, at) {
            (Step::Key(name), Value::Table(table)) => {
                anyhow::ensure!(is_last || table.contains_key(name), "{key}: the scenario has no {name}");
                table.entry(name).or_insert(Value::Boolean(false))
            }
            (Step::Index(i), Value::Array(list)) => {
                let n = list.len();
                list.get_mut(i).with_context(|| {
                    format!("{key}: index {i} is out of range, the list has {n} entries, counted from 0")
                })?
            }
            (Step::Key(name), _) => anyhow::bail!("{key}: the value before {name} is not a table"),
            (Step::Index(i), _) => anyhow::bail!("{key}: the value before [{i}] is not a list"),
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
        anyhow::ensure!(!name.is_empty(), "{key}: a name is empty");
        steps.push(Step::Key(name));
        while let Some((index, behind)) = rest.strip_prefix('[').and_then(|text| text.split_once(']')) {
            steps.push(Step::Index(index.parse().with_context(|| format!("{key}: [{index}] is not an index"))?));
            rest = behind;
        }
        anyhow::ensure!(rest.is_empty(), "{key}: unexpected {rest}");
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
    fn keys_are_changed_and_added_also_in_lists() {
        let expected = |text: &str| text.parse::<Table>().unwrap();
        let with = |from: &str, to: &str| expected(&TEXT.replace("\"a\"", "\"b\"").replace(from, to));
        assert_eq!(change("duration_s", "5.0").unwrap(), with("2.0", "5.0"));
        assert_eq!(change("terrain.kind", "\"steps\"").unwrap(), with("flat", "steps"));
        assert_eq!(change("push[0].force_W[1]", "-90.0").unwrap(), with("60.0", "-90.0"));
        assert_eq!(change("noise", "{ gyro = 0.1 }").unwrap(), with("[terrain]", "noise = { gyro = 0.1 }\n[terrain]"));
        assert_eq!(change("terrain.cell_m", "0.05").unwrap(), with("\"flat\"", "\"flat\"\ncell_m = 0.05"));
    }

    #[test]
    fn errors_name_the_key() {
        let keys = ["push[1].t_s", "noise.gyro", "duration_s.x", "terrain[0]", "push[x]", "push[0", ".x", ""];
        for (key, value) in keys.map(|key| (key, "1")).into_iter().chain([("duration_s", "five")]) {
            let error = format!("{:#}", change(key, value).unwrap_err());
            assert!(error.starts_with(key), "{error}");
        }
    }
}
