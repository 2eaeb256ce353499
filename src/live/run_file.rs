//! The run file (TOML): robot, network, operators, controllers. Paths of input files are relative to the run file; that of the log is relative to
//! the working directory.

use crate::robot::{RobotFiles, read};
use anyhow::Context;
use controller::params::Params;
use drivers::DriverError;
use drivers::command_mux::{CommandMux, Source, default_sources};
use drivers::components::{CommonParams, ComponentEntry, Runs, resolve};
use drivers::live::RealtimeParams;
use drivers::live::clock::TickSchedule;
use drivers::teleop::check_channel;
use lcmtypes::ComponentInfo;
use replay::udpm::Url;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Description of a live run.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// Name of a robot in robots/, or its TOML file.
    pub robot: String,
    /// Log file.
    pub log: PathBuf,
    /// The simulator, if there is no robot.
    pub simulation: Option<Simulation>,
    /// The LCM network.
    #[serde(default)]
    pub lcm: Lcm,
    /// Hardware of the controller.
    #[serde(default)]
    pub hardware: Hardware,
    /// Scenario whose `[[fault]]` entries are injected between controller and hardware.
    pub faults: Option<PathBuf>,
    /// The operators.
    #[serde(default = "default_sources")]
    pub operator: Vec<Source>,
    /// The controllers of the first component, in the order of execution. The last running one commands the robot.
    #[serde(default, rename = "controller")]
    pub controllers: Vec<Controller>,
    /// The components: without `[[controller]]` entries the first one commands the robot.
    #[serde(default, rename = "component")]
    components: Vec<ComponentEntry>,
    /// The first of them, if it commands the robot.
    #[serde(skip)]
    first: Option<ComponentEntry>,
    /// Preset of the robot's parameters, as with `hoof sim --preset`.
    pub preset: Option<String>,
    /// Gait files, as with `hoof sim --gait`.
    #[serde(default)]
    pub gait: Vec<PathBuf>,
    /// Parameters to change, as with `hoof sim --set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// Schedule of the ticks.
    #[serde(default)]
    pub executor: Executor,
    /// Real-time settings of the control thread.
    #[serde(default)]
    pub realtime: RealtimeParams,
}

/// The simulator in place of a robot.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// Scenario file.
    pub scenario: PathBuf,
    /// Whether to send the scenario's operator commands and parameter requests.
    #[serde(default = "yes")]
    pub operator: bool,
}

/// The LCM network.
#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Lcm {
    /// URL, as for liblcm.
    pub url: String,
}

impl Default for Lcm {
    fn default() -> Self {
        Lcm { url: "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=2000000".to_owned() }
    }
}

/// Hardware of the controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Hardware {
    /// A driver process on the network.
    #[default]
    Lcm,
    /// No robot: joints at rest in the robot's posture.
    Dummy,
}

/// A `[[controller]]` entry.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Name: `quadruped`, `hold`.
    pub name: String,
    /// Whether it runs from the first tick on; otherwise `hoof ctl start NAME` starts it.
    #[serde(default = "yes")]
    pub start: bool,
}

/// Schedule of the ticks.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Executor {
    /// Period, µs.
    pub period_us: i64,
    /// Time of the tick within the period, µs; a simulated driver measures at 0. `None`: [`PHASE`] of the period.
    pub phase_us: Option<i64>,
}

/// Default phase, as a fraction of the period: after the driver's measurement, and early enough for its next step.
const PHASE: (i64, i64) = (3, 10);

impl Executor {
    /// The schedule of the ticks.
    pub fn schedule(self) -> TickSchedule {
        let period_ns = self.period_us * 1000;
        let phase_ns = self.phase_us.map_or(period_ns * PHASE.0 / PHASE.1, |phase_us| phase_us * 1000);
        TickSchedule { period_ns, phase_ns }
    }
}

impl Default for Executor {
    fn default() -> Self {
        Executor { period_us: 1000, phase_us: None }
    }
}

fn yes() -> bool {
    true
}

impl RunFile {
    /// Name and kind of the first component for RUN_INFO: a sequence of the controllers.
    pub fn first(&self) -> (String, String) {
        let names: Vec<&str> = self.controllers.iter().map(|controller| &*controller.name).collect();
        let name = self.first.as_ref().map_or(controller::sequence::NAME, |first| &first.name);
        (name.to_owned(), format!("{}({})", controller::sequence::NAME, names.join(", ")))
    }

    /// Parameters to change in the first component.
    pub fn set_of_first(&self) -> Vec<String> {
        let of_first = self.first.iter().flat_map(|first| &first.set);
        self.set.iter().chain(of_first).cloned().collect()
    }

    /// Preset of the parameters of the first component.
    pub fn preset_of_first(&self) -> Option<&str> {
        self.first.as_ref().and_then(|first| first.preset.as_deref()).or(self.preset.as_deref())
    }

    /// Channels that the first component listens to.
    pub fn receives(&self) -> &[String] {
        self.first.as_ref().map_or(&[], |first| &first.receives)
    }

    /// The components beside the first one.
    pub fn others(&self) -> &[ComponentEntry] {
        &self.components
    }

    /// Checks them, and reads their parameters.
    ///
    /// # Errors
    /// See [`resolve`].
    pub fn resolve_others(&self) -> Result<Vec<ComponentInfo>, DriverError> {
        let RunFile { robot, preset, gait, set, .. } = self;
        let common = CommonParams { robot, preset: preset.as_deref(), gaits: gait, set };
        resolve(self.others(), (&self.first().0, self.receives()), common)
    }

    /// Which controllers run from the first tick on, one bit each.
    pub fn running(&self) -> i64 {
        self.controllers.iter().enumerate().fold(0, |bits, (k, one)| bits | i64::from(one.start) << k)
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// Every error names the file.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let text = read(path)?;
        let mut file: RunFile = toml::from_str(&text).map_err(|error| toml_error(path, &text, &error))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(simulation) = &mut file.simulation {
            simulation.scenario = folder.join(&simulation.scenario);
        }
        file.faults = file.faults.map(|faults| folder.join(faults));
        file.gait = file.gait.iter().map(|gait| folder.join(gait)).collect();
        file.split_first().and_then(|()| file.check()).with_context(|| path.display().to_string())?;
        Ok(file)
    }

    /// The robot's files, and its parameters with all changes of this file.
    ///
    /// # Errors
    /// See [`RobotFiles::find_changed`].
    pub fn robot_files(&self) -> Result<(RobotFiles, String), DriverError> {
        RobotFiles::find_changed(&self.robot, self.preset_of_first(), &self.gait, &self.set_of_first())
    }

    /// Makes the first `[[component]]` the controller if there is no `[[controller]]`; the quadruped if there is neither.
    fn split_first(&mut self) -> anyhow::Result<()> {
        if !self.controllers.is_empty() {
            return Ok(());
        }
        if self.components.is_empty() {
            self.controllers = vec![Controller { name: controller::quadruped::NAME.to_owned(), start: true }];
            return Ok(());
        }
        let first = self.components.remove(0);
        first.check()?;
        let ComponentEntry { name, kind, period_ticks, phase_ticks, latency_ticks, runs, .. } = &first;
        anyhow::ensure!(
            (*period_ticks, *phase_ticks, *latency_ticks, *runs) == (1, 0, 0, Runs::Rt),
            "[[component]] {name:?}: the first component commands the robot: expected period_ticks = 1, phase_ticks = 0, latency_ticks = 0, \
             runs = \"rt\""
        );
        anyhow::ensure!(
            first.joints.is_empty(),
            "[[component]] {name:?}: joints: the first component commands all joints that no other one commands"
        );
        self.controllers = vec![Controller { name: kind.clone(), start: true }];
        self.first = Some(first);
        Ok(())
    }

    fn check(&self) -> anyhow::Result<()> {
        let Executor { period_us, phase_us } = self.executor;
        let priority = self.realtime.priority;
        anyhow::ensure!(
            (100..=100_000).contains(&period_us),
            "executor.period_us is {period_us}, expected 100 to 100000"
        );
        if let Some(phase_us) = phase_us {
            anyhow::ensure!(
                (0..period_us).contains(&phase_us),
                "executor.phase_us is {phase_us}, expected 0 to less than executor.period_us ({period_us})"
            );
        }
        CommandMux::new(self.operator.clone())?;
        for Source { channel, .. } in &self.operator {
            check_channel(channel).with_context(|| format!("[[operator]] {channel}"))?;
        }
        let is_name = |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if let Some(Controller { name, .. }) = self.controllers.iter().find(|controller| !is_name(&controller.name)) {
            anyhow::bail!("[[controller]] name = {name:?}: expected letters, digits and _");
        }
        let scenario = self.simulation.as_ref().map(|simulation| ("simulation.scenario", &simulation.scenario));
        for (key, file) in scenario.into_iter().chain(self.faults.as_ref().map(|faults| ("faults", faults))) {
            anyhow::ensure!(file.is_file(), "{key}: file {} not found", file.display());
        }
        self.lcm.url.parse::<Url>().with_context(|| format!("lcm.url = {:?}", self.lcm.url))?;
        RobotFiles::find_with_params(&self.robot).with_context(|| format!("robot = {:?}", self.robot))?;
        let preset = self.preset_of_first();
        RobotFiles::find_changed(&self.robot, preset, &[], &[])
            .with_context(|| format!("preset = {:?}", preset.unwrap_or_default()))?;
        RobotFiles::find_changed(&self.robot, preset, &self.gait, &[]).context("gait")?;
        let set = || format!("set = {:?}", self.set_of_first());
        let (_, params) = self.robot_files().with_context(set)?;
        Params::from_toml(&params, &self.robot).with_context(set)?;
        // The outputs of a controller that another one replaces have its name in front, as those of a component.
        let clash =
            self.components.iter().find(|one| self.controllers.iter().any(|controller| controller.name == one.name));
        if let Some(ComponentEntry { name, .. }) = clash {
            anyhow::bail!("[[component]] name = {name:?}: a controller of the first component has this name");
        }
        self.resolve_others()?;
        anyhow::ensure!(priority <= 99, "realtime.priority is {priority}, expected 0 (no real-time scheduler) to 99");
        Ok(())
    }
}

/// A TOML error on one line: file, line, key or value, what was expected.
pub fn toml_error(path: &Path, text: &str, error: &toml::de::Error) -> anyhow::Error {
    let offset = error.span().map_or(0, |span| span.start.min(text.len()));
    let number = text.bytes().take(offset).filter(|&byte| byte == b'\n').count();
    let line = text.lines().nth(number).unwrap_or_default().trim();
    let at = if line.is_empty() { String::new() } else { format!(", in `{line}`") };
    anyhow::anyhow!("{}:{}: {}{at}", path.display(), number + 1, error.message().replace('\n', ", "))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn load(text: &str) -> anyhow::Result<RunFile> {
        let (process, thread) = (std::process::id(), std::thread::current().id());
        let path = std::env::temp_dir().join(format!("run-{process}-{thread:?}.toml"));
        std::fs::write(&path, text).unwrap();
        let file = RunFile::load(&path);
        std::fs::remove_file(&path).unwrap();
        file
    }

    #[test]
    fn the_shipped_run_files_are_valid() {
        for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("runs")).unwrap() {
            let file = RunFile::load(&entry.unwrap().path()).unwrap();
            assert_eq!(file.executor.period_us, 1000);
            assert!(file.simulation.is_none_or(|simulation| simulation.scenario.is_file()));
        }
    }

    #[test]
    fn errors_name_file_key_and_value() {
        let minimal = "robot = \"hyq\"\nlog = \"a.mcap\"\n";
        assert!(load(minimal).is_ok());
        let operator = |channel| format!("{minimal}[[operator]]\nchannel = \"{channel}\"\npriority = 1\n");
        assert!(load(&operator("OPERATOR_COMMAND")).is_ok());
        let controller = |name| format!("{minimal}[[controller]]\nname = \"{name}\"\n");
        for (text, named) in [
            (format!("{minimal}robto = 1\n"), "unknown field `robto`"),
            (format!("{minimal}[executor]\nperiod_us = 5\n"), "executor.period_us is 5"),
            (format!("{minimal}[executor]\nphase_us = 1000\n"), "executor.phase_us is 1000"),
            (format!("{minimal}[realtime]\npriority = 100\n"), "realtime.priority is 100"),
            (format!("{minimal}[[operator]]\nchannel = \"A B\"\npriority = 1\n"), "[[operator]] \"A B\""),
            ("robot = \"hyq\"\n".to_owned(), "missing field `log`"),
            (operator("PARAMETER_REQUEST"), "hoofprint.parameter_request_t"),
            (operator("ROBOT_STATE"), "hoofprint.robot_state_t"),
            (controller("hold, quadruped"), "[[controller]] name = \"hold, quadruped\""),
            (controller(""), "[[controller]] name = \"\""),
            (format!("{minimal}faults = \"nope.toml\"\n"), "nope.toml"),
            (format!("{minimal}gait = [\"nope.toml\"]\n"), "nope.toml"),
            (format!("{minimal}preset = \"unknown\"\n"), "preset = \"unknown\""),
            (format!("{minimal}set = [\"trunk.kpp=3\"]\n"), "\"trunk.kpp\""),
            (format!("{minimal}set = [\"wbc.friction=-1\"]\n"), "wbc.friction is -1"),
            (format!("{minimal}set = [\"trunk.kp\"]\n"), "\"trunk.kp\": "),
            (format!("{minimal}set = [\"trunk.kp=\"]\n"), "\"trunk.kp=\": "),
            (format!("{minimal}[executor]\nperiod_us = \"x\"\n"), "period_us"),
            (format!("{minimal}[lcm]\nurl = \"udpm://1.2.3.4\"\n"), "lcm.url"),
            (format!("{minimal}[simulation]\nscenario = \"nope.toml\"\n"), "simulation.scenario"),
            ("robot = \"nope\"\nlog = \"a.mcap\"\n".to_owned(), "robot = \"nope\""),
        ] {
            let error = format!("{:#}", load(&text).unwrap_err());
            assert!(error.contains(named) && error.contains(".toml"), "{error}");
            assert!(error.matches("nope.toml").count() < 2, "{error}");
        }
    }

    /// Each pair: `[[component]]` entries, and what the error names. Every error names the file and the component.
    #[test]
    fn errors_of_components_name_component_key_and_value() {
        let first = "robot = \"hyq\"\nlog = \"a.mcap\"\n[[component]]\nname = \"legs\"\nkind = \"hold\"\n";
        let knee = "[[component]]\nname = \"knee\"\nkind = \"posture\"\njoints = [\"lf_kfe_joint\"]\n";
        let external = "[[component]]\nname = \"script\"\nkind = \"external\"\n";
        let list = |n: usize| (0..n).map(|k| format!("\"script/C{k}\"")).collect::<Vec<_>>().join(", ");
        let unused = "[[component]]\nname = \"foot\"\nkind = \"posture\"\n";
        for valid in ["", knee, &format!("receives = [{}]\n{knee}receives = [\"knee/X\"]\n{external}", list(24))] {
            load(&format!("{first}{valid}")).unwrap();
        }
        for (more, component, named) in [
            // Of the first one.
            ("period_ticks = 2\n".to_owned(), "legs", "period_ticks"),
            ("period_ticks = 0\n".to_owned(), "legs", "period_ticks is 0"),
            ("pause_ms = 10\n".to_owned(), "legs", "pause_ms is 10"),
            ("runs = \"worker\"\nlatency_ticks = 1\n".to_owned(), "legs", "runs = \"rt\""),
            ("receives = [\"arms/JOINT_REFERENCE\"]\n".to_owned(), "legs", "\"arms/JOINT_REFERENCE\""),
            ("receives = [\"ROBOT_STATE\"]\n".to_owned(), "legs", "\"ROBOT_STATE\""),
            (format!("receives = [{}]\n{external}", list(25)), "legs", "25 channels"),
            // Of another one.
            (format!("{knee}period_ticks = 0\n"), "knee", "period_ticks is 0"),
            (format!("{knee}phase_ticks = -1\n"), "knee", "phase_ticks is -1"),
            (format!("{knee}runs = \"worker\"\n"), "knee", "latency_ticks is 0"),
            (format!("{knee}runs = \"process\"\n"), "knee", "latency_ticks is 0"),
            (format!("{knee}pause_ms = 10\n"), "knee", "pause_ms is 10"),
            (format!("{external}pause_ms = 10\n"), "script", "pause_ms is 10"),
            (format!("{knee}receives = [{}]\n{external}", list(25)), "knee", "25 channels"),
            (format!("{knee}receives = [\"script/X\", \"script/X\"]\n{external}"), "knee", "\"script/X\""),
            (format!("{knee}receives = [\"legs/JOINT_REFERENCE\"]\n"), "knee", "first component"),
            (format!("{knee}receives = [\"wings/X\"]\n"), "knee", "\"wings/X\""),
            (format!("{knee}{}", knee.replace("lf_", "rf_")), "knee", "name"),
            (format!("{knee}{}", knee.replace("knee", "foot")), "foot", "lf_kfe_joint"),
            (knee.replace("knee", "legs"), "legs", "name"),
            (unused.replace("foot", "recorder"), "recorder", "name"),
            (unused.replace("foot", "a b"), "a b", "name"),
            (unused.replace("\"posture\"", "\"sequence(hold)\""), "foot", "kind"),
            (knee.replace("lf_kfe_joint", "lf_kfe"), "knee", "\"lf_kfe\""),
            (format!("{knee}preset = \"nope\"\n"), "knee", "nope"),
            (format!("{knee}set = [\"motion.postrue=1\"]\n"), "knee", "\"motion.postrue\""),
        ] {
            let error = format!("{:#}", load(&format!("{first}{more}")).unwrap_err());
            assert!(error.contains(named) && error.contains(&format!("{component:?}")), "{named}: {error}");
            assert_eq!(error.matches("/run-").count(), 1, "{error}");
        }
    }

    /// The preset of the run file is that of every component without one of its own.
    #[test]
    fn a_preset_of_the_run_is_a_preset_of_its_components() {
        let of = |run: &str, first: &str, other: &str| {
            let legs = format!("[[component]]\nname = \"legs\"\nkind = \"hold\"\n{first}");
            let knee = format!("[[component]]\nname = \"knee\"\nkind = \"posture\"\n{other}");
            let file = load(&format!("robot = \"hyq\"\nlog = \"a.mcap\"\n{run}{legs}{knee}")).unwrap();
            let others = file.resolve_others().unwrap();
            [file.robot_files().unwrap().1, others[0].params.clone()]
        };
        let printed = "preset = \"printed\"\n";
        let [plain, of_printed] = [of("", "", "")[0].clone(), of("", printed, "")[0].clone()];
        assert_ne!(plain, of_printed);
        for (run, first, other, is_printed) in [
            ("", "", "", [false, false]),
            (printed, "", "", [true, true]),
            ("", printed, "", [true, false]),
            ("", "", printed, [false, true]),
        ] {
            let expected = is_printed.map(|printed| if printed { &of_printed } else { &plain }.clone());
            assert!(of(run, first, other) == expected, "{run:?} {first:?} {other:?}");
        }
    }

    #[test]
    fn the_default_phase_is_a_fraction_of_the_period() {
        for (text, phase_ns) in [
            ("", 300_000),
            ("[executor]\nperiod_us = 250\n", 75_000),
            ("[executor]\nperiod_us = 4000\n", 1_200_000),
            ("[executor]\nperiod_us = 250\nphase_us = 0\n", 0),
        ] {
            let file = load(&format!("robot = \"hyq\"\nlog = \"a.mcap\"\n{text}")).unwrap();
            assert_eq!(file.executor.schedule().phase_ns, phase_ns, "{text}");
        }
    }
}
