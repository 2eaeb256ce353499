//! Live runs: `hoof run`, and the processes that it starts.

mod component;
mod controller;
mod ctl;
mod driver;
mod process;
mod request;
pub use request::Client;
mod run;
mod run_file;
mod screen;
mod set;
mod stop;

use anyhow::Context;
use drivers::Scenario;
use drivers::live::has_traffic;
use replay::udpm::Url;
pub use run_file::RunFile;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

pub use component::{ComponentArgs, run as component};
pub use controller::{ControllerArgs, run as controller};
pub use ctl::{CtlArgs, ctl};
pub use driver::{DriverArgs, run as driver};
pub use run::{RunArgs, run};
pub use run_file::toml_error;
pub use set::{SetArgs, set};
pub use stop::{Stop, wait_for_controller};

/// Time for which a process waits for messages of another process with the same role: several periods.
const LISTEN: Duration = Duration::from_millis(30);

/// Arguments of all commands of a live run.
#[derive(clap::Args)]
pub struct Shared {
    /// Run file (TOML): robot, log, network, controller
    #[arg(value_parser = drivers::shipped::argument)]
    run_file: PathBuf,
    /// Scenario of the simulator [default: that of the run file]
    #[arg(long, value_name = "FILE", value_parser = drivers::shipped::argument)]
    scenario: Option<PathBuf>,
    /// LCM network [default: that of the run file]
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
    /// End when this process, the parent, has ended
    #[arg(long, hide = true)]
    parent: Option<i32>,
}

impl Shared {
    /// Run file and network, after the command-line arguments.
    fn load(&self) -> anyhow::Result<(RunFile, Url)> {
        let mut file = RunFile::load(&self.run_file)?;
        if let Some(scenario) = &self.scenario {
            let simulation = file.simulation.as_mut().with_context(|| {
                let (file, scenario) = (self.run_file.display(), scenario.display());
                format!("--scenario {scenario}: {file} has no [simulation]")
            })?;
            simulation.scenario.clone_from(scenario);
        }
        let url = self.lcm_url.as_ref().unwrap_or(&file.lcm.url);
        let url = url.parse().with_context(|| self.run_file.display().to_string())?;
        Ok((file, url))
    }
}

/// Fails if another process has the same role: two controllers must not command one robot, nor two drivers send its state.
fn refuse_a_second(role: &str, channel: &str, url: &Url) -> anyhow::Result<()> {
    anyhow::ensure!(
        !has_traffic(url, channel, LISTEN)?,
        "another {role} sends {channel} on {url}: end it, or use another port (--lcm-url)"
    );
    Ok(())
}

/// Length of a run.
#[derive(clap::Args, Default)]
pub struct Length {
    /// Damp the joints and end after N ticks of the controller
    #[arg(long, value_name = "N", conflicts_with = "seconds", value_parser = clap::value_parser!(i64).range(1..))]
    ticks: Option<i64>,
    /// After S seconds let a standing robot sit down, then end
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
}

fn seconds(text: &str) -> anyhow::Result<Duration> {
    let seconds = text.parse().ok().filter(|seconds| (0.001..=1e7).contains(seconds));
    seconds.map(Duration::from_secs_f64).context("expected 0.001 to 10000000")
}

impl Length {
    /// The same as command-line arguments; the length of `scenario` if none is given.
    fn arguments(&self, scenario: Option<&Scenario>) -> Vec<OsString> {
        let seconds = self.seconds.map(|seconds| seconds.as_secs_f64()).or_else(|| Some(scenario?.duration_s));
        match (self.ticks, seconds) {
            (Some(ticks), _) => vec!["--ticks".into(), ticks.to_string().into()],
            (None, Some(seconds)) => vec!["--seconds".into(), seconds.to_string().into()],
            (None, None) => Vec::new(),
        }
    }
}
