//! The run file (TOML): which robot, which network, who sends what. Files that it names are beside it; the log is below the working directory.

use crate::robot::read;
use anyhow::Context;
use drivers::live::RealtimeParams;
use drivers::live::clock::Beat;
use drivers::operators::{Arbiter, Source, default_sources};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// A live run, described.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// Name of a robot in robots/, or its TOML file.
    pub robot: String,
    /// Log that the recorder writes.
    pub log: PathBuf,
    /// The simulator, where there is no robot.
    pub simulation: Option<Simulation>,
    /// The network.
    #[serde(default)]
    pub lcm: Lcm,
    /// What the controller's side of the network is.
    #[serde(default)]
    pub hardware: Hardware,
    /// Scenario whose `[[fault]]` lines spoil what passes between controller and hardware.
    pub faults: Option<PathBuf>,
    /// Who may command.
    #[serde(default = "default_sources")]
    pub operator: Vec<Source>,
    /// The controllers, in the order in which they run: the last one that is started has the robot.
    #[serde(default = "quadruped_alone", rename = "controller")]
    pub controllers: Vec<Controller>,
    /// Parameters to change, as with `hoof sim --set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// When ticks are due.
    #[serde(default)]
    pub executor: Executor,
    /// What the control thread asks of the system.
    #[serde(default)]
    pub realtime: RealtimeParams,
}

/// The simulator in place of a robot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// Its scenario.
    pub scenario: PathBuf,
    /// Whether the scenario's operator commands and changes of parameters are sent.
    #[serde(default = "yes")]
    pub operator: bool,
}

/// The network.
#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Lcm {
    /// As liblcm takes it.
    pub url: String,
}

impl Default for Lcm {
    fn default() -> Self {
        Lcm { url: "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=2000000".to_owned() }
    }
}

/// What the controller works with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hardware {
    /// A driver process on the network.
    #[default]
    Lcm,
    /// Joints at rest in the robot's posture: nothing but the executor itself.
    Dummy,
}

/// One of the controllers.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Its name: `quadruped`, `hold`.
    pub name: String,
    /// Whether it starts at once; else `hoof ctl start NAME` does it.
    #[serde(default = "yes")]
    pub start: bool,
}

/// When ticks are due.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Executor {
    /// Time between ticks, µs.
    pub period_us: i64,
    /// When in the period, µs: a simulated driver measures at 0.
    pub phase_us: i64,
}

impl Executor {
    /// When ticks are due.
    pub fn beat(self) -> Beat {
        Beat { period_ns: self.period_us * 1000, phase_ns: self.phase_us * 1000 }
    }
}

impl Default for Executor {
    fn default() -> Self {
        Executor { period_us: 1000, phase_us: 300 }
    }
}

fn quadruped_alone() -> Vec<Controller> {
    vec![Controller { name: controller::quadruped::NAME.to_owned(), start: true }]
}

fn yes() -> bool {
    true
}

impl RunFile {
    /// The controllers as one, as RUN_INFO names it.
    pub fn controller(&self) -> String {
        let names: Vec<&str> = self.controllers.iter().map(|controller| &*controller.name).collect();
        format!("{}({})", controller::sequence::NAME, names.join(", "))
    }

    /// Reads and checks a file; every error names it.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let text = read(path)?;
        let mut file: RunFile = toml::from_str(&text)
            .map_err(|error| anyhow::anyhow!("{}", error.to_string().trim_end()))
            .with_context(|| path.display().to_string())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(simulation) = &mut file.simulation {
            simulation.scenario = folder.join(&simulation.scenario);
        }
        file.faults = file.faults.map(|faults| folder.join(faults));
        file.check().with_context(|| path.display().to_string())?;
        Ok(file)
    }

    fn check(&self) -> anyhow::Result<()> {
        let Executor { period_us, phase_us } = self.executor;
        let priority = self.realtime.priority;
        anyhow::ensure!(
            (100..=100_000).contains(&period_us),
            "executor.period_us is {period_us}, expected 100 to 100000"
        );
        anyhow::ensure!(
            (0..period_us).contains(&phase_us),
            "executor.phase_us is {phase_us}, expected 0 to less than executor.period_us ({period_us})"
        );
        Arbiter::new(self.operator.clone())?;
        anyhow::ensure!(priority <= 99, "realtime.priority is {priority}, expected 0 (no real-time scheduler) to 99");
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn load(text: &str) -> anyhow::Result<RunFile> {
        let path = std::env::temp_dir().join(format!("run-{}-{}.toml", std::process::id(), text.len()));
        std::fs::write(&path, text).unwrap();
        let file = RunFile::load(&path);
        std::fs::remove_file(&path).unwrap();
        file
    }

    #[test]
    fn the_shipped_run_files_are_read() {
        for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("runs")).unwrap() {
            let file = RunFile::load(&entry.unwrap().path()).unwrap();
            assert_eq!(file.executor.period_us, 1000);
            assert!(file.simulation.is_none_or(|simulation| simulation.scenario.is_file()));
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let minimal = "robot = \"hyq\"\nlog = \"a.mcap\"\n";
        assert!(load(minimal).is_ok());
        for (text, wanted) in [
            (format!("{minimal}robto = 1\n"), "unknown field `robto`"),
            (format!("{minimal}[executor]\nperiod_us = 5\n"), "executor.period_us is 5, expected 100 to 100000"),
            (format!("{minimal}[executor]\nphase_us = 1000\n"), "executor.phase_us is 1000, expected 0 to less than"),
            (format!("{minimal}[realtime]\npriority = 100\n"), "realtime.priority is 100"),
            (format!("{minimal}[[operator]]\nchannel = \"A B\"\npriority = 1\n"), "[[operator]] \"A B\": a channel is"),
            ("robot = \"hyq\"\n".to_owned(), "missing field `log`"),
        ] {
            let error = format!("{:#}", load(&text).unwrap_err());
            assert!(error.contains(wanted) && error.contains(".toml"), "{error}");
        }
    }
}
