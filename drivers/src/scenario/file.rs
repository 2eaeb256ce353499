//! The TOML file of a scenario: its tables, their checks, and the line of an error.

use super::object::{ObjectEntry, WeldEntry};
use super::{Push, Scenario};
use crate::DriverError;
use crate::checks::{BadKey, Window, check_range};
use crate::drives::DriveParams;
use crate::fault_injection::FaultEntry;
use crate::floor::FloorEntry;
use crate::operator_script::{OperatorKey, OperatorScript};
use crate::parameter_requests::ParameterEntry;
use crate::sensors::NoiseParams;
use crate::start::StartParams;
use crate::task_requests::TaskEntry;
use crate::terrain::TerrainParams;
use controller::params::exact::array;
use controller::quadruped::params::GaitParams;
use serde::Deserialize;

/// Reads and checks a text; see [`Scenario::parse`].
pub(super) fn parse(text: &str, source_name: &str, gaits: &GaitParams) -> Result<Scenario, DriverError> {
    let file: ScenarioFile = toml::from_str(text).map_err(|error| parse_error(text, source_name, &error))?;
    let at = |table: &'static str, number: usize| Place { text, file: source_name, table, number };

    let top = at("", 0);
    top.check(check_range("duration_s", &[file.duration_s], 0.001..=36_000.0))?;
    top.check(check_range("friction", &[file.friction], 0.01..=5.0))?;
    top.check(check_range("physics_steps", &[f64::from(file.physics_steps)], 1.0..=20.0))?;
    at("terrain", 0).check(file.terrain.check())?;
    at("noise", 0).check(file.noise.check())?;
    at("drives", 0).check(file.drives.check())?;
    at("start", 0).check(file.start.check())?;

    let mut last_t_s = 0.0;
    for (index, key) in file.operator.iter().enumerate() {
        let place = at("operator", index + 1);
        place.check(check_range("t_s", &[key.t_s], last_t_s..=36_000.0))?;
        place.check(key.check(gaits))?;
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
    let mut objects = Vec::with_capacity(file.object.len());
    for (index, object) in file.object.into_iter().enumerate() {
        let object = at("object", index + 1).check(object.resolve(file.friction, &objects))?;
        objects.push(object);
    }
    let mut welds = Vec::with_capacity(file.weld.len());
    for (index, weld) in file.weld.into_iter().enumerate() {
        welds.push(at("weld", index + 1).check(weld.resolve(&objects, index))?);
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
    let mut tasks = Vec::with_capacity(file.task.len());
    for (index, task) in file.task.into_iter().enumerate() {
        tasks.push(at("task", index + 1).check(task.resolve(index))?);
    }
    tasks.sort_by_key(|task| task.t_ns);
    Ok(Scenario {
        name: file.name,
        duration_s: file.duration_s,
        seed: file.seed,
        friction: file.friction,
        controller: file.controller,
        physics_steps: file.physics_steps,
        terrain: file.terrain,
        noise: file.noise,
        drives: file.drives,
        start: file.start,
        operator: OperatorScript::new(&file.operator, gaits),
        pushes,
        floors,
        objects,
        welds,
        faults,
        parameters,
        tasks,
    })
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
    #[serde(default = "default_controller")]
    controller: String,
    #[serde(default = "default_physics_steps")]
    physics_steps: u32,
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
    object: Vec<ObjectEntry>,
    #[serde(default)]
    weld: Vec<WeldEntry>,
    #[serde(default)]
    fault: Vec<FaultEntry>,
    #[serde(default)]
    parameter: Vec<ParameterEntry>,
    #[serde(default)]
    task: Vec<TaskEntry>,
}

fn default_controller() -> String {
    controller::quadruped::NAME.to_owned()
}

fn default_physics_steps() -> u32 {
    1
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
    #[serde(rename = "force_W", default, deserialize_with = "array")]
    f_W: [f64; 3],
    #[serde(rename = "torque_W", default, deserialize_with = "array")]
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

/// A table of a file, for error messages.
struct Place<'a> {
    text: &'a str,
    file: &'a str,
    table: &'static str,
    /// 0 for a plain table; counts from 1 in a list of tables.
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

    /// Line of the key in this table, from 1; the line of the table's header if it does not have the key.
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
