//! The list of all tables of the parameters file.

use super::error::ParamsError;
use super::key::toml_key;
use super::range::Bound;
use super::robot::RobotConfig;
use crate::cartesian::params::CartesianParams;
use crate::hold::params::HoldParams;
use crate::posture::params::MotionParams;
use crate::qp::QpParams;
use crate::quadruped::params::{
    ContactParams, FootholdParams, GaitParams, PostureParams, RecoveryParams, RelativeFeetParams, StandParams,
    SwingParams, TerrainParams, TrunkParams, WbcParams,
};
use crate::safety::SafetyParams;
use crate::stack::{Formula, StackParams};
use crate::tour::params::TourParams;
use serde::{Deserialize, Serialize};

/// Tables of the controllers that work with any robot.
pub const FOR_ANY_ROBOT: [&str; 6] = ["robot", "safety", "hold", "motion", "tour", "cartesian_ik"];

/// Every parameter of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Feet, posture and sensors of the robot.
    pub robot: RobotConfig,
    /// Gait timing and force ramps.
    #[serde(default)]
    pub gait: GaitParams,
    /// Foothold planner, filter and limits of the velocity command.
    #[serde(default)]
    pub foothold: FootholdParams,
    /// Swing trajectory and closed-loop inverse kinematics.
    #[serde(default)]
    pub swing: SwingParams,
    /// Contact estimation.
    #[serde(default)]
    pub contact: ContactParams,
    /// Terrain estimation.
    #[serde(default)]
    pub terrain: TerrainParams,
    /// Reactions to disturbances.
    #[serde(default)]
    pub recovery: RecoveryParams,
    /// Trunk orientation task and height of the base.
    #[serde(default)]
    pub trunk: TrunkParams,
    /// Stance task with feedback between the feet.
    #[serde(default)]
    pub relative_feet: RelativeFeetParams,
    /// Posture task.
    #[serde(default)]
    pub posture: PostureParams,
    /// Tasks, their weights and priorities.
    #[serde(default)]
    pub stack: StackParams,
    /// Choice of the QP solver.
    #[serde(default)]
    pub qp: QpParams,
    /// Constraints and solver settings of the quadratic programs.
    #[serde(default)]
    pub wbc: WbcParams,
    /// Standing up and sitting down.
    #[serde(default)]
    pub stand: StandParams,
    /// Limits that lead to the safe state, and the damping in it.
    #[serde(default)]
    pub safety: SafetyParams,
    /// The hold controller.
    #[serde(default)]
    pub hold: HoldParams,
    /// The posture controller.
    #[serde(default)]
    pub motion: MotionParams,
    /// The tour controller.
    #[serde(default)]
    pub tour: TourParams,
    /// The Cartesian server.
    #[serde(default)]
    pub cartesian_ik: CartesianParams,
}

impl Params {
    /// Reads and checks a TOML text.
    ///
    /// - `source_name`: file name or description of the text, for errors.
    ///
    /// # Errors
    /// The text is not TOML, has unknown or missing keys, or values of the wrong type or out of range.
    pub fn from_toml(text: &str, source_name: &str) -> Result<Self, ParamsError> {
        let parse_error = |error: String| ParamsError::Parse { source_name: source_name.to_owned(), error };
        let params: Params = toml::from_str(text).map_err(|error| parse_error(error.to_string()))?;
        params.check_robot(text).map_err(parse_error)?;
        params.check()?;
        Ok(params)
    }

    /// Writes every parameter as TOML, defaults included. [`Params::from_toml`] reads the same bits back. For a robot with the keys for any robot
    /// these are the tables `FOR_ANY_ROBOT`.
    pub fn to_toml(&self) -> String {
        if self.robot.is_quadruped() {
            return toml::to_string(self).expect("plain structs of numbers, strings and tables always serialize");
        }
        let mut table =
            toml::Table::try_from(self).expect("plain structs of numbers, strings and tables always serialize");
        table.retain(|name, _| FOR_ANY_ROBOT.contains(&name));
        toml::to_string(&table).expect("a table of plain values can be written")
    }

    /// Checks that the keys of the robot are complete, and that a robot with the keys for any robot has only the tables of controllers for any robot.
    fn check_robot(&self, text: &str) -> Result<(), String> {
        if let Some(key) = self.robot.missing() {
            return Err(format!("missing field `{key}` in table [robot]"));
        }
        if self.robot.is_quadruped() {
            return Ok(());
        }
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
        match table.keys().find(|name| !FOR_ANY_ROBOT.contains(&name.as_str())) {
            Some(name) => Err(format!(
                "table [{name}] is for robots with robot.feet; expected one of {}",
                FOR_ANY_ROBOT.join(", ")
            )),
            None => Ok(()),
        }
    }

    /// Checks the range of each number, relations between them, and that the formula of the stack can be parsed.
    fn check(&self) -> Result<(), ParamsError> {
        Formula::parse(&self.stack.formula)?;
        let table = toml::Table::try_from(self).expect("plain structs of numbers, strings and tables always serialize");
        for bound in bounds() {
            let mut found = Vec::new();
            if let Some(value) = lookup(&table, bound.key) {
                numbers(bound.key, value, &mut found);
            }
            if let Some((key, found)) = found.into_iter().find(|(_, x)| !(bound.range.contains)(*x)) {
                return Err(ParamsError::OutOfRange { key: key.into(), found, expected: bound.text() });
            }
        }
        let Params { robot, gait, wbc, contact, .. } = self;
        gait.check()?;
        for (joint, drive) in &robot.drives {
            let (rated, no_load) = (drive.rated_velocity, drive.no_load_velocity);
            let key = format!("robot.drives.{}.rated_velocity", toml_key(joint));
            less(&key, rated < no_load || rated == f64::INFINITY, rated, "less than no_load_velocity", no_load)?;
        }
        less("wbc.f_z_min", wbc.f_z_min < wbc.f_z_max, wbc.f_z_min, "less than wbc.f_z_max", wbc.f_z_max)?;
        let (release, touch) = (contact.release_load, contact.touch_load);
        less("contact.release_load", release <= touch, release, "at most contact.touch_load", touch)
    }
}

/// Each number among the parameters, with its allowed range.
pub fn bounds() -> impl Iterator<Item = &'static Bound> {
    let tables: [&[Bound]; 12] = [
        RobotConfig::BOUNDS,
        GaitParams::BOUNDS,
        FootholdParams::BOUNDS,
        ContactParams::BOUNDS,
        RecoveryParams::BOUNDS,
        TrunkParams::BOUNDS,
        WbcParams::BOUNDS,
        StandParams::BOUNDS,
        SafetyParams::BOUNDS,
        HoldParams::BOUNDS,
        MotionParams::BOUNDS,
        TourParams::BOUNDS,
    ];
    tables.into_iter().flatten()
}

fn lookup<'a>(table: &'a toml::Table, key: &str) -> Option<&'a toml::Value> {
    let (table, key) = match key.split_once('.') {
        Some((first, rest)) => (table.get(first)?.as_table()?, rest),
        None => return table.get(key),
    };
    lookup(table, key)
}

/// All numbers of a value, of its elements and of its table, each with its key; an element of an array has the key of the array.
fn numbers(key: &str, value: &toml::Value, found: &mut Vec<(String, f64)>) {
    match value {
        toml::Value::Float(x) => found.push((key.to_owned(), *x)),
        #[expect(clippy::cast_precision_loss, reason = "the integers among the parameters have 32 bits")]
        toml::Value::Integer(x) => found.push((key.to_owned(), *x as f64)),
        toml::Value::Array(values) => values.iter().for_each(|value| numbers(key, value, found)),
        toml::Value::Table(values) => {
            values.iter().for_each(|(name, value)| numbers(&format!("{key}.{}", toml_key(name)), value, found));
        }
        _ => {}
    }
}

fn less(key: &str, holds: bool, found: f64, relation: &str, limit: f64) -> Result<(), ParamsError> {
    let expected = || format!("{relation} ({limit})");
    if holds { Ok(()) } else { Err(ParamsError::OutOfRange { key: key.into(), found, expected: expected() }) }
}

#[cfg(test)]
mod tests {
    use super::super::apply_overrides;
    use super::*;

    const ROBOT: &str = r#"
        [robot]
        name = "box"
        urdf = "box.urdf"
        feet = ["a", "b", "c", "d"]
        foot_radius = 0.02
        imu_link = "imu"
        posture = { j1 = 0.1 }
    "#;

    fn overridden(key: &str, value: &str) -> Result<Params, ParamsError> {
        let text = apply_overrides(ROBOT, &[(key.to_owned(), value.to_owned())])?;
        Params::from_toml(&text, "test")
    }

    #[test]
    fn full_text_reads_back_to_the_same_parameters() {
        let params = Params::from_toml(ROBOT, "test").unwrap();
        assert_eq!(Params::from_toml(&params.to_toml(), "test").unwrap(), params);
    }

    /// Every array of the parameters, with one element more and one less.
    #[test]
    fn an_array_of_another_length_is_an_error() {
        fn arrays(table: &toml::Table, path: &[String], found: &mut Vec<Vec<String>>) {
            for (key, value) in table {
                let path = [path, std::slice::from_ref(key)].concat();
                match value {
                    toml::Value::Table(inner) => arrays(inner, &path, found),
                    toml::Value::Array(_) => found.push(path),
                    _ => {}
                }
            }
        }
        let task = "[stack]\nformula = \"contact + trunk + hand << base_dynamics << friction << force_bounds\"\n[stack.tasks.hand]\ntype = \"cartesian\"\nlink = \"a\"\nkp = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n\
                    kd = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]\n";
        let full: toml::Table =
            Params::from_toml(&format!("{ROBOT}\n{task}"), "test").unwrap().to_toml().parse().unwrap();
        let mut found = Vec::new();
        arrays(&full, &[], &mut found);
        assert!(found.len() >= 11, "{found:?}");
        for path in found {
            for longer in [true, false] {
                let mut table = full.clone();
                let inside =
                    path[..path.len() - 1].iter().fold(&mut table, |table, key| table[key].as_table_mut().unwrap());
                let array = inside[&path[path.len() - 1]].as_array_mut().unwrap();
                let last = array.pop().unwrap();
                // A list of names has any length.
                if last.is_str() {
                    continue;
                }
                array.extend(vec![last; if longer { 2 } else { 0 }]);
                let error = Params::from_toml(&table.to_string(), "test").unwrap_err();
                assert!(matches!(error, ParamsError::Parse { .. }), "{path:?}: {error}");
            }
        }
    }

    #[test]
    fn every_number_has_a_bound_and_every_bound_a_number() {
        let mut text = ROBOT.to_owned();
        text += "lying = { j1 = 0.1 }\n";
        text += "drives = { j1 = { power = 100.0, rated_velocity = 1.0, no_load_velocity = 2.0 } }";
        let params = Params::from_toml(&text, "test").unwrap();
        let table = toml::Table::try_from(&params).unwrap();
        let count = |value: &toml::Value| {
            let mut found = Vec::new();
            numbers("", value, &mut found);
            found.len()
        };
        let bounded: usize = bounds().map(|bound| count(lookup(&table, bound.key).expect(bound.key))).sum();
        assert_eq!(bounded, count(&toml::Value::Table(table)));
    }

    /// `UPDATE_GOLDEN=1` writes the page.
    #[test]
    #[expect(clippy::disallowed_methods, reason = "a test that rewrites the page on request")]
    fn the_page_of_parameters_lists_every_bound() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/parameters.md");
        let rows = bounds().map(|bound| format!("| `{}` | {} | {} |\n", bound.key, bound.range.expected, bound.unit));
        let table = format!("| parameter | allowed | unit |\n|---|---|---|\n{}", rows.collect::<String>());
        let page = std::fs::read_to_string(&path).unwrap();
        let (head, listed) = page.split_at(page.find("| parameter").unwrap());
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&path, format!("{head}{table}")).unwrap();
        } else {
            assert_eq!(listed, table);
        }
    }

    #[test]
    fn safety_cannot_be_switched_off() {
        for bound in SafetyParams::BOUNDS {
            for value in ["1e9", "-1", "nan", "inf"] {
                let value = if bound.key == "safety.max_qp_failures" { "1000000" } else { value };
                let error = overridden(bound.key, value).unwrap_err();
                assert!(matches!(&error, ParamsError::OutOfRange { key, .. } if **key == *bound.key), "{error}");
            }
        }
    }

    #[test]
    fn overrides_reach_numbers_arrays_and_switches() {
        assert_eq!(overridden("gait.trot.swing_frequency", "4").unwrap().gait.trot.swing_frequency, 4.0);
        assert_eq!(overridden("trunk.kp", "[1, 2.5, 3]").unwrap().trunk.kp, [1.0, 2.5, 3.0]);
        assert!(!overridden("posture.swing_inertia", "false").unwrap().posture.swing_inertia);
        assert_eq!(overridden("robot.posture.j1", "-0.5").unwrap().robot.posture["j1"], -0.5);
    }

    #[test]
    fn a_drive_has_positive_limits_and_its_speeds_in_order() {
        let with = |drive: &str| Params::from_toml(&format!("{ROBOT}\ndrives = {{ j1 = {{ {drive} }} }}"), "test");
        for good in ["", "power = 100.0", "rated_velocity = 2.0", "no_load_velocity = 2.0", "power = inf"] {
            with(good).unwrap();
        }
        for (bad, found) in [
            ("power = 0.0", "power"),
            ("power = -1.0", "power"),
            ("power = nan", "power"),
            ("no_load_velocity = 0.0", "no_load_velocity"),
            ("rated_velocity = 3.0, no_load_velocity = 2.0", "rated_velocity"),
            ("rated_velocity = 2.0, no_load_velocity = 2.0", "rated_velocity"),
        ] {
            let error = with(bad).unwrap_err();
            let expected = format!("robot.drives.j1.{found}");
            assert!(matches!(&error, ParamsError::OutOfRange { key, .. } if **key == *expected), "{error}");
        }
    }

    #[test]
    fn errors_contain_the_key_the_value_and_what_was_expected() {
        let unknown = |key, value| match overridden(key, value).unwrap_err() {
            ParamsError::UnknownKey { key: found, hint } => {
                assert_eq!(found, key);
                hint
            }
            other => panic!("{key}: {other}"),
        };
        assert!(unknown("gait.trott.duty", "0.6").ends_with("[gait]: crawl, trot"));
        assert!(unknown("wbc.mu", "0.6").contains("friction"));
        assert!(unknown("gait.trot", "1").contains("[gait.trot]: duty"));
        assert!(unknown("stack.tasks", "{}").contains("[stack.tasks]"));
        for (key, value, expected) in [
            ("wbc.friction", "high", "`0.6` (float)"),
            ("qp.solver", "clarabell", "`active_set` or `clarabel`"),
            ("trunk.kp", "[1.0, 2.0]", "`[1000.0, 1000.0, 1000.0]`"),
        ] {
            let error = overridden(key, value).unwrap_err();
            let ParamsError::BadValue { key: k, found, expected: e } = &error else { panic!("{error}") };
            assert!(k == key && found == value && e.contains(expected), "{error}");
        }
        // Each of these is invalid for a `clamp`, as a count, or in a QP.
        for (key, value) in [
            ("gait.trot.duty", "1.5"),
            ("foothold.max_yaw_rate", "-1"),
            ("trunk.max_orientation", "nan"),
            ("trunk.kp", "[1, inf, 1]"),
            ("posture.stance_kd", "[1, 1, -1]"),
            ("gait.crawl.lift_off_phase", "[0, 0.5, 1, 0.25]"),
            ("swing.reach_time", "0.6"),
            ("contact.debounce", "0"),
            ("contact.release_load", "0.06"),
            ("wbc.f_z_min", "1000"),
            ("wbc.max_iterations", "0"),
            ("wbc.friction", "2e9"),
            ("safety.max_qp_failures", "-1"),
            ("robot.posture.j1", "nan"),
        ] {
            let error = overridden(key, value).unwrap_err();
            assert!(matches!(&error, ParamsError::OutOfRange { key: found, .. } if **found == *key), "{error}");
        }
        let error = Params::from_toml(&format!("{ROBOT}\n[wbc]\nmu = 0.5"), "box.toml").unwrap_err();
        let ParamsError::Parse { source_name, error } = error else { panic!("{error}") };
        assert!(source_name == "box.toml" && error.contains("`mu`"), "{error}");
    }
}
