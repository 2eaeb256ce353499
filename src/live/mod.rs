//! Live runs: `hoof run`, and the processes that it starts.

mod controller;
mod ctl;
mod driver;
mod process;
mod request;
mod run;
mod run_file;
mod screen;
mod set;

use anyhow::Context;
use drivers::Scenario;
use drivers::live::somebody_speaks;
use nix::unistd::{Pid, getppid};
use replay::udpm::Url;
use run_file::RunFile;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub use controller::{ControllerArgs, run as controller};
pub use ctl::{CtlArgs, ctl};
pub use driver::{DriverArgs, run as driver};
pub use run::{RunArgs, run};
pub use set::{SetArgs, set};

/// How long a process listens for another one of its kind: some periods.
const HEARING: Duration = Duration::from_millis(30);

/// What all commands of a live run take.
#[derive(clap::Args)]
pub struct Shared {
    /// Run file (TOML): robot, log, network, controller
    #[arg(value_parser = drivers::shipped::argument)]
    run_file: PathBuf,
    /// Scenario of the simulator, instead of the run file's
    #[arg(long, value_name = "FILE", value_parser = drivers::shipped::argument)]
    scenario: Option<PathBuf>,
    /// Network, instead of the run file's
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Print JSON at the end
    #[arg(long)]
    json: bool,
    /// Ends with this process, which has started it
    #[arg(long, hide = true)]
    parent: Option<i32>,
}

impl Shared {
    /// The run file, with what is asked for in its place.
    fn load(&self) -> anyhow::Result<(RunFile, Url)> {
        let mut file = RunFile::load(&self.run_file)?;
        if let Some(scenario) = &self.scenario {
            let simulation = file.simulation.as_mut().with_context(|| {
                let (file, scenario) = (self.run_file.display(), scenario.display());
                format!("--scenario {scenario}: there is no [simulation] in {file}, so there is nothing to happen")
            })?;
            simulation.scenario.clone_from(scenario);
        }
        let url = self.lcm_url.as_ref().unwrap_or(&file.lcm.url);
        let url = url.parse().with_context(|| self.run_file.display().to_string())?;
        Ok((file, url))
    }
}

/// Refuses where another process does the same job: two who command one robot, or two robots in one place, are a danger.
fn refuse_a_second(job: &str, channel: &str, url: &Url) -> anyhow::Result<()> {
    anyhow::ensure!(
        !somebody_speaks(url, channel, HEARING)?,
        "another {job} sends {channel} on {url}: end it first, or give this run a port of its own (--lcm-url)"
    );
    Ok(())
}

/// How long a run is, if it ends by itself.
#[derive(clap::Args, Default)]
pub struct Length {
    /// End with this tick of the controller, the joints damped
    #[arg(long, value_name = "N", conflicts_with = "seconds", value_parser = clap::value_parser!(i64).range(1..))]
    ticks: Option<i64>,
    /// Let a robot that stands sit down after so many seconds, and end
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
}

fn seconds(text: &str) -> anyhow::Result<Duration> {
    let seconds = text.parse().ok().filter(|seconds| (0.001..=1e7).contains(seconds));
    seconds.map(Duration::from_secs_f64).context("expected 0.001 to 10000000")
}

impl Length {
    /// The same on a command line; without one, the length of `scenario`.
    fn arguments(&self, scenario: Option<&Scenario>) -> Vec<OsString> {
        let seconds = self.seconds.map(|seconds| seconds.as_secs_f64()).or_else(|| Some(scenario?.duration_s));
        match (self.ticks, seconds) {
            (Some(ticks), _) => vec!["--ticks".into(), ticks.to_string().into()],
            (None, Some(seconds)) => vec!["--seconds".into(), seconds.to_string().into()],
            (None, None) => Vec::new(),
        }
    }
}

/// Whether a process is to end: Ctrl-C, SIGTERM, or whoever started it is gone.
struct Stop {
    asked: Arc<AtomicBool>,
    parent: Option<Pid>,
}

impl Stop {
    fn new(shared: &Shared) -> anyhow::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::flag::register(signal, asked.clone()).context("signal handler")?;
        }
        Ok(Stop { asked, parent: shared.parent.map(Pid::from_raw) })
    }

    fn is_due(&self) -> bool {
        self.is_asked() || self.parent.is_some_and(|parent| getppid() != parent)
    }

    /// By a signal.
    fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// Forgets that somebody asked, so that asking again can be told from it.
    fn forget(&self) {
        self.asked.store(false, Ordering::Relaxed);
    }
}
