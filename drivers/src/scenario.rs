//! What happens in a run, as TOML: terrain, operator, sensors, drives, pushes, floors that move, faults.
//!
//! ```toml
//! name = "push"
//! duration_s = 5.0
//! seed = 1
//! friction = 0.8
//!
//! [terrain]
//! kind = "flat"
//!
//! [start]               # how the robot is put down; may be left out
//! posture = "lying"     # or "standing"; also: roll, pitch (rad), joints = { lf_kfe_joint = -1.0 }
//!
//! [[operator]]          # a key holds until a later entry changes it
//! t_s = 0.0
//! mode = "stand"        # walk, sit, idle (no torque), damping (emergency stop)
//!
//! [[operator]]
//! t_s = 1.0
//! mode = "walk"
//! v_x = 0.2
//!
//! [[push]]
//! t_s = 2.5
//! duration_s = 0.2
//! force_W = [0.0, 150.0, 0.0]
//!
//! [noise]               # standard deviations; each key may be left out
//! position = 0.0005     # joints, rad
//! velocity = 0.02       # joints, rad/s
//! gyro = 0.005          # rad/s
//!
//! [drives]
//! lag_s = 0.005         # first-order lag of every torque
//! gain = { lf_kfe_joint = 0.8 }
//! gain_in_air = true    # only while the leg's foot touches nothing
//!
//! [[floor]]             # flat terrain only
//! t_s = 3.0             # from then on, when the foot is in the air
//! leg = "LF"
//! height_m = -0.05
//!
//! [[fault]]             # nan_sensor, stuck_encoder, torque_loss (joint), drop_state, drop_command, late_process, false_touch,
//! t_s = 4.0             # delay_state (delay_s), clock_jump (jump_s), imu_bias (gyro_rad_s, orientation_rad), drop_operator,
//! duration_s = 0.5      # false_reading (joint, quantity = "position" | "velocity" | "torque", offset)
//! kind = "torque_loss"
//! joint = "rh_kfe_joint"
//! factor = 0.2
//!
//! [[parameter]]         # asked of the controller while it runs; an EVENT says why where it is refused
//! t_s = 4.5
//! key = "trunk.kp"
//! value = [800.0, 800.0, 800.0]
//! ```
//!
//! A scenario is read whole and checked whole; after that nothing in it can fail but names of links and joints.

use crate::DriverError;
use crate::drives::DriveParams;
use crate::fault_injection::{FaultEntry, FaultWindow};
use crate::floor::{FloorEntry, FloorMove};
use crate::operator_script::{OperatorKey, OperatorScript};
use crate::parameter_requests::ParameterEntry;
use crate::sensors::NoiseParams;
use crate::start::StartParams;
use crate::terrain::{BadKey, TerrainParams, check_range};
use lcmtypes::ParameterRequest;
use serde::Deserialize;
use std::path::Path;

/// A run's description.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Short name.
    pub name: String,
    /// Length of the run, s.
    pub duration_s: f64,
    /// Seed of terrain and noise.
    pub seed: i64,
    /// Friction coefficient of feet and ground.
    pub friction: f64,
    /// The ground.
    pub terrain: TerrainParams,
    /// Noise of the sensors.
    pub noise: NoiseParams,
    /// Lag and gains of the drives.
    pub drives: DriveParams,
    /// How the robot is put down.
    pub start: StartParams,
    /// The operator's commands, complete and in order of time.
    pub operator: OperatorScript,
    /// Pushes, as in the file.
    pub pushes: Vec<Push>,
    /// Floors that move, as in the file.
    pub floors: Vec<FloorMove>,
    /// FaultInjection, as in the file.
    pub faults: Vec<FaultWindow>,
    /// Parameters that are to be otherwise, in the order of time.
    pub parameters: Vec<ParameterRequest>,
}

/// A force on a link for some time.
#[derive(Clone, Debug, PartialEq)]
pub struct Push {
    /// When it acts.
    pub window: Window,
    /// Link whose centre of mass it acts on; none = the base.
    pub link: Option<String>,
    /// Force in W, N.
    pub f_W: [f64; 3],
    /// Torque in W, N m.
    pub tau_W: [f64; 3],
}

/// A half-open span of time, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First instant inside.
    pub start_ns: i64,
    /// First instant after.
    pub end_ns: i64,
}

impl Window {
    /// Whether it holds at `t_ns`.
    pub fn contains(&self, t_ns: i64) -> bool {
        (self.start_ns..self.end_ns).contains(&t_ns)
    }

    pub(crate) fn new(t_s: f64, duration_s: f64) -> Self {
        Window { start_ns: to_ns(t_s), end_ns: to_ns(t_s + duration_s) }
    }
}

impl Scenario {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Unreadable, not TOML, an unknown key, a value of the wrong kind or out of range; the message names file, line and key.
    pub fn load(path: &Path) -> Result<Self, DriverError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| DriverError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Reads and checks a text; `source_name` stands in errors.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn parse(text: &str, source_name: &str) -> Result<Self, DriverError> {
        let file: ScenarioFile = toml::from_str(text).map_err(|error| parse_error(text, source_name, &error))?;
        let at = |table: &'static str, number: usize| Place { text, file: source_name, table, number };

        let top = at("", 0);
        top.check(check_range("duration_s", &[file.duration_s], 0.001..=36_000.0))?;
        top.check(check_range("friction", &[file.friction], 0.01..=5.0))?;
        at("terrain", 0).check(file.terrain.check())?;
        at("noise", 0).check(file.noise.check())?;
        at("drives", 0).check(file.drives.check())?;
        at("start", 0).check(file.start.check())?;

        let mut last_t_s = 0.0;
        for (index, key) in file.operator.iter().enumerate() {
            let place = at("operator", index + 1);
            place.check(check_range("t_s", &[key.t_s], last_t_s..=36_000.0))?;
            place.check(key.check())?;
            last_t_s = key.t_s;
        }
        let mut pushes = Vec::with_capacity(file.push.len());
        for (index, push) in file.push.into_iter().enumerate() {
            let place = at("push", index + 1);
            pushes.push(place.check(push.resolve())?);
        }
        let mut floors = Vec::with_capacity(file.floor.len());
        for (index, floor) in file.floor.iter().enumerate() {
            let place = at("floor", index + 1);
            floors.push(place.check(floor.resolve(file.terrain.kind))?);
        }
        let mut faults = Vec::with_capacity(file.fault.len());
        for (index, fault) in file.fault.into_iter().enumerate() {
            let place = at("fault", index + 1);
            faults.push(place.check(fault.resolve())?);
        }
        let mut parameters = Vec::with_capacity(file.parameter.len());
        for (index, parameter) in file.parameter.into_iter().enumerate() {
            let place = at("parameter", index + 1);
            parameters.push(place.check(parameter.resolve(index))?);
        }
        parameters.sort_by_key(|parameter| parameter.t_ns);
        Ok(Scenario {
            name: file.name,
            duration_s: file.duration_s,
            seed: file.seed,
            friction: file.friction,
            terrain: file.terrain,
            noise: file.noise,
            drives: file.drives,
            start: file.start,
            operator: OperatorScript::new(&file.operator),
            pushes,
            floors,
            faults,
            parameters,
        })
    }

    /// Length of the run, ns.
    pub fn duration_ns(&self) -> i64 {
        to_ns(self.duration_s)
    }

    /// The pushes that act at `t_ns`.
    pub fn pushes_at(&self, t_ns: i64) -> impl Iterator<Item = &Push> {
        self.pushes.iter().filter(move |push| push.window.contains(t_ns))
    }

    /// Starts and ends of pushes and faults, and floors that are to move, as sentences for the log, in order of time.
    pub fn timeline(&self) -> Vec<(i64, String)> {
        let mut events = Vec::new();
        let mut add = |window: Window, what: String| {
            events.push((window.start_ns, format!("{what} begins")));
            events.push((window.end_ns, format!("{what} ends")));
        };
        for Push { window, link, f_W, tau_W } in &self.pushes {
            let link = link.as_deref().unwrap_or("the base");
            add(*window, format!("push of {f_W:?} N and {tau_W:?} N m on {link}"));
        }
        for FaultWindow { window, kind } in &self.faults {
            add(*window, format!("fault {kind}"));
        }
        for FloorMove { t_ns, leg, height } in &self.floors {
            events.push((*t_ns, format!("floor under {} goes to {height} m when the foot is in the air", leg.name())));
        }
        events.sort_by_key(|event| event.0);
        events
    }
}

/// Seconds of a file as whole nanoseconds.
pub(crate) fn to_ns(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioFile {
    name: String,
    duration_s: f64,
    #[serde(default)]
    seed: i64,
    #[serde(default = "default_friction")]
    friction: f64,
    terrain: TerrainParams,
    #[serde(default)]
    noise: NoiseParams,
    #[serde(default)]
    drives: DriveParams,
    #[serde(default)]
    start: StartParams,
    operator: Vec<OperatorKey>,
    #[serde(default)]
    push: Vec<PushEntry>,
    #[serde(default)]
    floor: Vec<FloorEntry>,
    #[serde(default)]
    fault: Vec<FaultEntry>,
    #[serde(default)]
    parameter: Vec<ParameterEntry>,
}

fn default_friction() -> f64 {
    0.8
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PushEntry {
    t_s: f64,
    duration_s: f64,
    link: Option<String>,
    #[serde(rename = "force_W", default)]
    f_W: [f64; 3],
    #[serde(rename = "torque_W", default)]
    tau_W: [f64; 3],
}

impl PushEntry {
    fn resolve(self) -> Result<Push, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        check_range("duration_s", &[self.duration_s], 0.0..=36_000.0)?;
        check_range("force_W", &self.f_W, -1e5..=1e5)?;
        check_range("torque_W", &self.tau_W, -1e5..=1e5)?;
        Ok(Push { window: Window::new(self.t_s, self.duration_s), link: self.link, f_W: self.f_W, tau_W: self.tau_W })
    }
}

/// A table of a file, for messages.
struct Place<'a> {
    text: &'a str,
    file: &'a str,
    table: &'static str,
    /// 0 for a plain table, from 1 in a list of tables.
    number: usize,
}

impl Place<'_> {
    fn check<T>(&self, result: Result<T, BadKey>) -> Result<T, DriverError> {
        result.map_err(|BadKey { key, found, expected }| DriverError::Value {
            file: self.file.to_owned(),
            line: self.line(key),
            key: match (self.table, self.number) {
                ("", _) => key.to_owned(),
                (table, 0) => format!("{table}.{key}"),
                (table, number) => format!("{table}[{number}].{key}"),
            },
            found,
            expected,
        })
    }

    /// Line of the key in this table, or of the table where it does not have the key.
    fn line(&self, key: &str) -> usize {
        let header = if self.number == 0 { format!("[{}]", self.table) } else { format!("[[{}]]", self.table) };
        let lines = || self.text.lines().map(str::trim).enumerate();
        let start = if self.table.is_empty() {
            0
        } else {
            let mut headers = lines().filter(|(_, line)| line.starts_with(&header)).map(|(index, _)| index + 1);
            headers.nth(self.number.saturating_sub(1)).unwrap_or(0)
        };
        lines()
            .skip(start)
            .take_while(|(_, line)| !line.starts_with('['))
            .find(|(_, line)| line.split('=').next().is_some_and(|name| name.trim() == key))
            .map_or(start.max(1), |(index, _)| index + 1)
    }
}

fn parse_error(text: &str, file: &str, error: &toml::de::Error) -> DriverError {
    let offset = error.span().map_or(0, |span| span.start.min(text.len()));
    let line = text.bytes().take(offset).filter(|&byte| byte == b'\n').count() + 1;
    DriverError::Parse {
        file: file.to_owned(),
        line,
        error: error.message().replace('\n', ", "),
        text: text.lines().nth(line - 1).unwrap_or_default().trim().to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use controller::quadruped::leg::Leg;

    const SMALL: &str =
        "name = \"small\"\nduration_s = 2.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n";

    fn error(text: &str) -> String {
        Scenario::parse(text, "small.toml").unwrap_err().to_string()
    }

    #[test]
    fn defaults_are_those_of_the_documentation() {
        let scenario = Scenario::parse(SMALL, "small.toml").unwrap();
        assert_eq!((scenario.seed, scenario.friction, scenario.duration_ns()), (0, 0.8, 2_000_000_000));
        assert!(scenario.pushes.is_empty() && scenario.faults.is_empty());
    }

    #[test]
    fn an_unknown_key_is_named_with_file_and_line() {
        assert_eq!(
            error(&format!("{SMALL}v_z = 1.0\n")),
            "small.toml:8: unknown field `v_z`, expected one of `t_s`, `mode`, `gait`, `v_x`, `v_y`, `yaw_rate`, `roll`, `pitch`, \
             `height_offset`, `swing_frequency`, `duty`, `step_height`, in `v_z = 1.0`"
        );
        assert!(
            error(&SMALL.replace("\"flat\"", "\"moon\""))
                .starts_with("small.toml:4: unknown variant `moon`, expected one of `flat`")
        );
        assert!(error(&SMALL.replace("2.0", "\"2\"")).starts_with("small.toml:2: invalid type: string"));
    }

    #[test]
    fn a_value_out_of_range_is_named_with_file_line_and_key() {
        assert_eq!(
            error(&SMALL.replace("2.0", "-2.0")),
            "small.toml:2: duration_s is -2, expected at least 0.001 and at most 36000"
        );
        let late = format!("{SMALL}[[operator]]\nt_s = 1.5\n[[operator]]\n# earlier\nt_s = 1.0\n");
        assert_eq!(error(&late), "small.toml:12: operator[3].t_s is 1, expected at least 1.5 and at most 36000");
        let fast = format!("{SMALL}v_x = nan\n");
        assert_eq!(error(&fast), "small.toml:8: operator[1].v_x is NaN, expected at least -5 and at most 5");
        let fault =
            format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"torque_loss\"\njoint = \"knee\"\n");
        assert_eq!(
            error(&fault),
            "small.toml:8: fault[1].factor is missing, expected the part of the torque that remains"
        );
        let push = format!("{SMALL}[[push]]\nt_s = 1.0\nduration_s = -0.1\n");
        assert!(error(&push).starts_with("small.toml:10: push[1].duration_s is -0.1"));
    }

    #[test]
    fn drives_and_floors_are_checked_like_the_rest() {
        let lag = format!("{SMALL}[drives]\nlag_s = -0.005\n");
        assert_eq!(error(&lag), "small.toml:9: drives.lag_s is -0.005, expected at least 0 and at most 1");
        let gain = format!("{SMALL}[drives]\ngain = {{ knee = 20.0 }}\n");
        assert_eq!(error(&gain), "small.toml:9: drives.gain is 20, expected at least 0 and at most 2");
        let nobody = format!("{SMALL}[drives]\ngain_in_air = true\n");
        assert_eq!(
            error(&nobody),
            "small.toml:9: drives.gain_in_air is true, expected `gain` to name the joints it is meant for"
        );
        let floor = "[[floor]]\nt_s = 1.0\nleg = \"LF\"\nheight_m = -0.05\n";
        let scenario = Scenario::parse(&format!("{SMALL}{floor}"), "small.toml").unwrap();
        assert_eq!(scenario.floors, [FloorMove { t_ns: 1_000_000_000, leg: Leg::LF, height: -0.05 }]);
        assert!(scenario.timeline()[0].1.starts_with("floor under LF goes to -0.05 m"));
        let rough = format!("{}{floor}", SMALL.replace("flat", "rough"));
        assert_eq!(
            error(&rough),
            "small.toml:11: floor[1].height_m is given on terrain of kind rough, expected terrain of kind flat around it"
        );
        let leg = format!("{SMALL}{}", floor.replace("LF", "lf"));
        assert!(error(&leg).starts_with("small.toml:10: unknown variant `lf`, expected one of `LF`, `RF`, `LH`, `RH`"));
        let touch = format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"false_touch\"\n");
        assert_eq!(error(&touch), "small.toml:8: fault[1].force_N is missing, expected the force that is read, N");
        let needless = format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"drop_state\"\nleg = \"LF\"\n");
        assert_eq!(
            error(&needless),
            "small.toml:12: fault[1].leg is given, expected no such key with this kind of fault"
        );
    }

    #[test]
    fn windows_are_half_open_and_on_the_timeline() {
        let text = format!(
            "{SMALL}[[push]]\nt_s = 0.5\nduration_s = 0.1\nforce_W = [0.0, 60.0, 0.0]\n\
             [[fault]]\nt_s = 0.25\nduration_s = 1.0\nkind = \"drop_state\"\n"
        );
        let scenario = Scenario::parse(&text, "small.toml").unwrap();
        let pushes = |t_ns| scenario.pushes_at(t_ns).count();
        assert_eq!([499_999_999, 500_000_000, 599_999_999, 600_000_000].map(pushes), [0, 1, 1, 0]);
        let times: Vec<i64> = scenario.timeline().iter().map(|event| event.0 / 1_000_000).collect();
        assert_eq!(times, [250, 500, 600, 1250]);
        assert_eq!(scenario.timeline()[1].1, "push of [0.0, 60.0, 0.0] N and [0.0, 0.0, 0.0] N m on the base begins");
    }
}
