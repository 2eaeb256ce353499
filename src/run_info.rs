//! RUN_INFO: what a log needs to explain itself and to rebuild its controller.

use lcmtypes::{RunInfo, TextFile};
use replay::engine::Build;

/// What differs from run to run.
pub struct Run<'a> {
    /// The controller, as [`controller::load`] finds it.
    pub controller: &'a str,
    /// Name of the robot.
    pub robot: &'a str,
    /// Text of its URDF.
    pub urdf: &'a str,
    /// Every parameter, as TOML.
    pub params: &'a str,
    /// Name and text of the scenario.
    pub scenario: (&'a str, &'a str),
    /// Seed of terrain and noise.
    pub seed: i64,
}

/// This build.
pub fn build() -> Build {
    Build {
        revision: env!("HOOF_REVISION").to_owned(),
        dirty: env!("HOOF_DIRTY") == "true",
        toolchain: env!("HOOF_TOOLCHAIN").to_owned(),
        flags: env!("HOOF_BUILD").to_owned(),
    }
}

/// The description of a run by this build on this machine; a live run puts its time and real-time settings in.
pub fn of(run: &Run) -> RunInfo {
    let lcm_types: Vec<TextFile> = lcmtypes::SOURCES
        .iter()
        .map(|(name, text)| TextFile { name: (*name).to_owned(), text: (*text).to_owned() })
        .collect();
    let Build { revision, dirty, toolchain, flags } = build();
    RunInfo {
        t_ns: 0,
        controller: run.controller.to_owned(),
        robot: run.robot.to_owned(),
        urdf: run.urdf.to_owned(),
        params: run.params.to_owned(),
        scenario_name: run.scenario.0.to_owned(),
        scenario: run.scenario.1.to_owned(),
        seed: run.seed,
        revision,
        dirty,
        toolchain,
        build: flags,
        host: host(),
        realtime: "lockstep".to_owned(),
        num_lcm_types: i32::try_from(lcm_types.len()).expect("there are a few dozen types"),
        lcm_types,
    }
}

/// Host name, kernel, CPU.
fn host() -> String {
    let file = |path: &str| std::fs::read_to_string(path).unwrap_or_default().trim().to_owned();
    let cpuinfo = file("/proc/cpuinfo");
    let cpu = cpuinfo.lines().find(|line| line.starts_with("model name")).and_then(|line| line.split(": ").nth(1));
    format!(
        "{}, Linux {}, {}",
        file("/proc/sys/kernel/hostname"),
        file("/proc/sys/kernel/osrelease"),
        cpu.unwrap_or("unknown CPU")
    )
}
