//! Parameters set by key, as with `--set` on a command line.

use super::error::ParamsError;
use super::tables::Params;
use crate::quadruped::params::GaitTiming;
use std::collections::BTreeMap;

/// Sets parameters in a full or partial TOML text, and returns the full text.
///
/// - `overrides`: dotted keys and TOML values, for example `("gait.trot.swing_frequency", "3.5")`.
///
/// # Errors
/// The errors of [`Params::from_toml`], an unknown key, or a value whose type is not that of the present value.
pub fn apply_overrides(text: &str, overrides: &[(String, String)]) -> Result<String, ParamsError> {
    let full = Params::from_toml(text, "parameters")?.to_toml();
    let mut table: toml::Table = full.parse().expect("to_toml writes TOML");
    for (key, value) in overrides {
        set(&mut table, key, value)?;
        // An unknown word, such as a solver name. The error names the key; the parser would refer to a line of a text that the user has not seen.
        if let Err(error) = table.clone().try_into::<Params>() {
            let expected = error.message().rsplit_once("expected ").map_or(error.message(), |(_, expected)| expected);
            let (key, found) = (key.clone(), value.clone());
            return Err(ParamsError::BadValue { key, found, expected: expected.to_owned() });
        }
    }
    let text = toml::to_string(&table).expect("a table that was read can be written");
    Ok(Params::from_toml(&text, "parameters with overrides")?.to_toml())
}

/// Adds the gaits of a gait file, which contains `[gait.NAME]` tables and nothing else, and returns the full text.
///
/// - `text`: full or partial TOML text of the parameters.
/// - `source_name`: the gait file, for errors.
///
/// # Errors
/// The errors of [`Params::from_toml`] for either text, or a gait that the parameters have already.
pub fn add_gaits(text: &str, gaits: &str, source_name: &str) -> Result<String, ParamsError> {
    #[derive(serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        gait: BTreeMap<String, GaitTiming>,
    }
    let mut params = Params::from_toml(text, "parameters")?;
    let file: File = toml::from_str(gaits)
        .map_err(|e| ParamsError::Parse { source_name: source_name.to_owned(), error: e.to_string() })?;
    for (gait, timing) in file.gait {
        if params.gait.named(&gait).is_some() {
            let (key, found, expected) = ("name", format!("{gait:?}"), "a name that no other gait has".to_owned());
            return Err(ParamsError::Gait { gait, key, found, expected });
        }
        params.gait.further.insert(gait, timing);
    }
    params.gait.check()?;
    Ok(params.to_toml())
}

/// Dotted keys and values of a TOML table, as [`apply_overrides`] expects them. Nested tables and dotted keys are the same:
/// `{ wbc.friction = 0.6 }` equals `{ "wbc.friction" = 0.6 }`.
pub fn key_values(table: &toml::Table) -> Vec<(String, String)> {
    fn flatten(prefix: &str, table: &toml::Table, found: &mut Vec<(String, String)>) {
        for (name, value) in table {
            let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            match value {
                toml::Value::Table(inner) => flatten(&key, inner, found),
                value => found.push((key, value.to_string())),
            }
        }
    }
    let mut found = Vec::new();
    flatten("", table, &mut found);
    found
}

/// Sets parameters in a TOML text, as a `parameter_change_t` does, and returns the text with these changes and no others: keys that it omits stay
/// omitted, except those in the table of a changed key that the text omits. Changes may be applied one by one or together.
///
/// - `changes`: as the overrides of [`apply_overrides`].
///
/// # Errors
/// Those of [`apply_overrides`].
pub fn apply_changes(text: &str, changes: &[(String, String)]) -> Result<String, ParamsError> {
    let full: toml::Table = apply_overrides(text, changes)?.parse().expect("to_toml writes TOML");
    let mut table: toml::Table = text.parse().expect("apply_overrides has read it");
    for (key, _) in changes {
        copy(&full, &mut table, key);
    }
    Ok(toml::to_string(&table).expect("a table that was read can be written"))
}

/// Copies the value of a dotted key, which `from` contains.
fn copy(from: &toml::Table, to: &mut toml::Table, key: &str) {
    let (name, rest) = key.split_once('.').map_or((key, None), |(name, rest)| (name, Some(rest)));
    match (from.get(name), rest) {
        (Some(toml::Value::Table(from)), Some(rest)) if to.get(name).is_some_and(toml::Value::is_table) => {
            if let Some(toml::Value::Table(to)) = to.get_mut(name) {
                copy(from, to, rest);
            }
        }
        // A part of a table may lack required keys: a table that the text omits is copied whole.
        (Some(value), _) => drop(to.insert(name.to_owned(), value.clone())),
        (None, _) => {}
    }
}

/// Checks that a key names a parameter, for any robot: the joints of `robot.posture`, `robot.lying` and `robot.drives`, the keys of `[stack.tasks]` and the
/// names of further gaits depend on the robot's file and are not checked.
///
/// # Errors
/// [`ParamsError::UnknownKey`]
pub fn check_key(key: &str) -> Result<(), ParamsError> {
    const ANY_ROBOT: &str = "[robot]\nname = \"\"\nurdf = \"\"\nfeet = [\"a\", \"b\", \"c\", \"d\"]\nfoot_radius = 1.0\nimu_link = \"imu\"\nposture = { j = 0.0 }\n";
    if ["robot.posture.", "robot.lying.", "robot.drives.", "robot.postures.", "robot.joints.", "stack.tasks."]
        .iter()
        .any(|table| key.starts_with(table))
    {
        return Ok(());
    }
    let of_gait = match key.split('.').collect::<Vec<_>>()[..] {
        ["gait", name, parameter] if name != "trot" && name != "crawl" => format!("gait.trot.{parameter}"),
        _ => key.to_owned(),
    };
    let mut table: toml::Table =
        Params::from_toml(ANY_ROBOT, "defaults")?.to_toml().parse().expect("to_toml writes TOML");
    match set(&mut table, &of_gait, "0") {
        Err(ParamsError::UnknownKey { hint, .. }) => Err(ParamsError::UnknownKey { key: key.to_owned(), hint }),
        // The value does not matter here.
        _ => Ok(()),
    }
}

fn set(table: &mut toml::Table, key: &str, value: &str) -> Result<(), ParamsError> {
    let unknown = |hint: String| ParamsError::UnknownKey { key: key.to_owned(), hint };
    let mut path: Vec<&str> = key.split('.').collect();
    let last = path.pop().unwrap_or_default();
    let mut section = table;
    for (depth, name) in path.iter().enumerate() {
        let names = keys_of(section, &path[..depth]);
        section = match section.get_mut(*name) {
            Some(toml::Value::Table(inner)) => inner,
            _ => return Err(unknown(names)),
        };
    }
    let names = keys_of(section, &path);
    let slot = match section.get_mut(last) {
        Some(slot) if !slot.is_table() => slot,
        Some(toml::Value::Table(inner)) => return Err(unknown(keys_of(inner, &[path, vec![last]].concat()))),
        _ => return Err(unknown(names)),
    };
    let bad = || ParamsError::BadValue {
        key: key.to_owned(),
        found: value.to_owned(),
        expected: format!("a value like `{slot}` ({})", slot.type_str()),
    };
    let parsed: toml::Value = match format!("v = {value}").parse::<toml::Table>() {
        // Exactly one value.
        Ok(mut one) if one.len() == 1 => one.remove("v").ok_or_else(bad)?,
        Ok(_) => return Err(bad()),
        Err(_) if slot.is_str() => toml::Value::String(value.to_owned()),
        Err(_) => return Err(bad()),
    };
    let parsed = like(slot, parsed).ok_or_else(bad)?;
    *slot = parsed;
    Ok(())
}

/// Returns `new` if it has the type of `old`. Integers are converted where `old` is a float.
fn like(old: &toml::Value, new: toml::Value) -> Option<toml::Value> {
    use toml::Value::{Array, Float, Integer, String};
    match (old, new) {
        #[expect(clippy::cast_precision_loss, reason = "a person's parameter, far below 2^53")]
        (Float(_), Integer(i)) => Some(Float(i as f64)),
        (Array(old), Array(new)) if old.len() == new.len() => {
            old.iter().zip(new).map(|(o, n)| like(o, n)).collect::<Option<Vec<_>>>().map(Array)
        }
        // A list of names has any length; an array of numbers is a vector.
        (Array(old), Array(new)) if matches!(old[..], [String(_), ..]) && !new.is_empty() => {
            new.into_iter().map(|n| like(&old[0], n)).collect::<Option<Vec<_>>>().map(Array)
        }
        (Array(_), _) => None,
        (old, new) if old.same_type(&new) => Some(new),
        _ => None,
    }
}

fn keys_of(table: &toml::Table, path: &[&str]) -> String {
    let place = if path.is_empty() { "the top level".to_owned() } else { format!("[{}]", path.join(".")) };
    let names: Vec<&str> = table.keys().map(String::as_str).collect();
    match &names[..] {
        [] => format!(", {place} has no keys; add them in a parameters file"),
        names => format!(", keys of {place}: {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::{ParamsError, add_gaits, apply_changes, apply_overrides, check_key};

    #[test]
    fn a_gait_file_adds_gaits_and_nothing_else() {
        let text = include_str!("../../../robots/hyq/hyq.toml");
        let pace = "[gait.pace]\nduty = 0.55\nswing_frequency = 4\nlift_off_phase = [0.0, 0.5, 0.0, 0.5]\n";
        let with = add_gaits(text, pace, "pace.toml").unwrap();
        let changed = ("gait.pace.sway".to_owned(), "0.25".to_owned());
        let params = crate::params::Params::from_toml(&apply_overrides(&with, &[changed]).unwrap(), "test").unwrap();
        let pace_of = &params.gait.further["pace"];
        assert_eq!((pace_of.swing_frequency, pace_of.sway, pace_of.ramp), (4.0, 0.25, 0.5));
        // Every other line of the text is the same.
        let full = apply_overrides(text, &[]).unwrap();
        let added: Vec<&str> = with.lines().filter(|line| !full.lines().any(|other| other == *line)).collect();
        assert!(added.contains(&"[gait.pace]") && with.lines().count() == full.lines().count() + 9, "{added:?}");
        for name in ["trot", "crawl", "pace"] {
            let error = add_gaits(&with, &pace.replace("pace", name), "x.toml").unwrap_err();
            assert!(matches!(&error, ParamsError::Gait { gait, key: "name", .. } if gait == name), "{error}");
        }
        for bad in
            ["", "[gait]\nduty = 0.5\n", "[wbc]\nfriction = 0.5\n", "[gait.x]\nduty = 0.6\n", &format!("{pace}x = 1\n")]
        {
            let error = add_gaits(text, bad, "x.toml").unwrap_err();
            assert!(
                matches!(&error, ParamsError::Parse { source_name, .. } if source_name == "x.toml"),
                "{bad:?}: {error}"
            );
        }
    }

    #[test]
    fn keys_of_any_robot_are_known_without_its_file() {
        for key in [
            "safety.damping",
            "robot.foot_radius",
            "robot.sensors.gyro",
            "robot.posture.any",
            "robot.drives.any.power",
            "stack.tasks.base.weight",
            "gait.pace.duty",
        ] {
            assert!(check_key(key).is_ok(), "{key}");
        }
        for key in [
            "nope",
            "nope.x",
            "safety.nope",
            "robot.nope",
            "robot.sensors.nope",
            "robot.posture",
            "gait.pace",
            "gait.pace.x",
        ] {
            assert!(check_key(key).is_err(), "{key}");
        }
    }

    #[test]
    fn changes_one_by_one_or_together_add_only_their_keys() {
        let text = include_str!("../../../robots/hyq/hyq.toml");
        let change = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let [a, b] = [change("safety.max_state_age", "0.02"), change("safety.max_tilt", "0.5")];
        let one_by_one =
            apply_changes(&apply_changes(text, std::slice::from_ref(&a)).unwrap(), std::slice::from_ref(&b)).unwrap();
        let together = apply_changes(text, &[a.clone(), b.clone()]).unwrap();
        assert_eq!(one_by_one, together);
        let mut expected: toml::Table = text.parse().unwrap();
        for (key, value) in [("max_state_age", 0.02), ("max_tilt", 0.5)] {
            expected["safety"].as_table_mut().unwrap().insert(key.to_owned(), value.into());
        }
        assert_eq!(together.parse::<toml::Table>().unwrap(), expected);
        assert_eq!(apply_overrides(&together, &[]).unwrap(), apply_overrides(text, &[a, b]).unwrap());
        // In a table that the text omits.
        let [c, d] = [change("gait.crawl.swing_frequency", "2.5"), change("gait.crawl.duty", "0.6")];
        let one_by_one =
            apply_changes(&apply_changes(text, std::slice::from_ref(&c)).unwrap(), std::slice::from_ref(&d)).unwrap();
        assert_eq!(one_by_one, apply_changes(text, &[c, d]).unwrap());
    }
}
