//! Checks of the machine for a real-time control loop.

use super::Check;
use super::files::{CAP_SYS_NICE, System};
use drivers::live::{LIMITS_FIX, RealtimeParams, memory_limit};
use nix::sys::statvfs::statvfs;
use std::path::Path;

/// Log data rate of a live quadruped run with margin, bytes/s: 20 s of HyQ give 38 MB.
const LOG_BYTES_PER_S: u64 = 2_500_000;

/// All checks of the machine.
pub fn checks(system: &System, logs: &Path) -> Vec<Check> {
    vec![
        scheduler(system, try_scheduler()),
        memory(system),
        kernel(system),
        governor(system),
        wake_up(system),
        timer_slack(system),
        clock_source(system),
        cores(std::thread::available_parallelism().map_or(1, usize::from)),
        mujoco(&system.text("/proc/self/maps").unwrap_or_default()),
        disk(logs, free_bytes(logs)),
    ]
}

/// Requests the real-time scheduler on a temporary thread. Returns the error, if any.
fn try_scheduler() -> Option<String> {
    let asked = RealtimeParams { priority: 1, core: None, lock_memory: false, stay_awake: false };
    let refused = std::thread::spawn(move || asked.apply().refused).join().unwrap_or_default();
    refused.into_iter().find(|refused| refused.starts_with("SCHED_FIFO"))
}

fn scheduler(system: &System, refused: Option<String>) -> Check {
    const NAME: &str = "real-time scheduler";
    let Some(refused) = refused else { return Check::ok(NAME, "SCHED_FIFO is permitted") };
    let limit = system.limit("Max realtime priority").unwrap_or(0);
    let capable = system.is_capable(CAP_SYS_NICE);
    let (found, fix) = match (capable, limit) {
        (false, 0) => (format!("{refused}: the real-time priority limit is 0"), LIMITS_FIX.to_owned()),
        _ => (
            format!("{refused} although permitted: the control group has no real-time budget"),
            "sudo sysctl -w kernel.sched_rt_runtime_us=-1".to_owned(),
        ),
    };
    Check::warn(NAME, format!("{found}; other programs can delay the control loop"), fix)
}

fn memory(system: &System) -> Check {
    const NAME: &str = "locked memory";
    let text = |file| system.text(file).unwrap_or_default();
    match memory_limit(&text("/proc/self/limits"), &text("/proc/self/status")) {
        None => Check::ok(NAME, "permitted without limit"),
        Some(limit) => {
            let found = format!("limit {} kB; a page fault in the control loop can cost a tick", limit / 1024);
            Check::warn(NAME, found, LIMITS_FIX.to_owned())
        }
    }
}

fn kernel(system: &System) -> Check {
    const NAME: &str = "kernel";
    let release = system.text("/proc/sys/kernel/osrelease").unwrap_or_default();
    let version = system.text("/proc/sys/kernel/version").unwrap_or_default();
    if system.number("/sys/kernel/realtime") == Some(1) || version.contains("PREEMPT_RT") {
        return Check::ok(NAME, format!("{release}, PREEMPT_RT"));
    }
    let delay = "ticks are occasionally late by some ms";
    let rt = "apt-get install linux-image-rt-amd64   (Debian; then start again with it)";
    let (found, fix) = match preemption(system, &release, &version) {
        Some(kind @ ("none" | "voluntary")) => (
            format!("{release}, preemption {kind}: a long kernel operation blocks the thread on its core for some ms"),
            format!("preempt=full on the kernel command line; better: {rt}"),
        ),
        Some(kind) => (format!("{release}, preemption {kind}, no PREEMPT_RT: {delay}"), rt.to_owned()),
        None => (format!("{release}, no PREEMPT_RT: {delay}"), rt.to_owned()),
    };
    Check::warn(NAME, found, fix)
}

/// Preemption model of a kernel without PREEMPT_RT: from its status, its command line, or its build configuration, in this order.
fn preemption(system: &System, release: &str, version: &str) -> Option<&'static str> {
    const KINDS: [&str; 4] = ["none", "voluntary", "lazy", "full"];
    let known = |found: &str| KINDS.into_iter().find(|kind| *kind == found);
    let now = system.text("/sys/kernel/debug/sched/preempt").unwrap_or_default();
    let requested = system.text("/proc/cmdline").unwrap_or_default();
    let built = system.text(&format!("/boot/config-{release}")).or_else(|| system.unpacked("/proc/config.gz"));
    let built = built.unwrap_or_default();
    now.split_whitespace()
        .find_map(|word| known(word.strip_prefix('(')?.strip_suffix(')')?))
        .or_else(|| requested.split_whitespace().rev().find_map(|word| known(word.strip_prefix("preempt=")?)))
        .or_else(|| {
            let has = |name: &str| built.lines().any(|line| line == format!("CONFIG_PREEMPT{name}=y"));
            [("_NONE", "none"), ("_VOLUNTARY", "voluntary"), ("_LAZY", "lazy"), ("", "full")]
                .into_iter()
                .find_map(|(name, kind)| has(name).then_some(kind))
        })
        .or((!version.contains("PREEMPT")).then_some("none"))
}

fn governor(system: &System) -> Check {
    const NAME: &str = "processor clock";
    let folder = "/sys/devices/system/cpu";
    let names = system.names(folder);
    let governors: Vec<String> =
        names.iter().filter_map(|cpu| system.text(&format!("{folder}/{cpu}/cpufreq/scaling_governor"))).collect();
    match governors.iter().find(|governor| *governor != "performance") {
        _ if governors.is_empty() => Check::ok(NAME, "no frequency scaling by the kernel"),
        None => Check::ok(NAME, "governor performance"),
        Some(slow) => Check::warn(
            NAME,
            format!("governor {slow}: a tick takes longer after an idle time"),
            "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
        ),
    }
}

fn wake_up(system: &System) -> Check {
    const NAME: &str = "wake-up latency";
    let file = "/dev/cpu_dma_latency";
    if system.is_writable(file) {
        return Check::ok(
            NAME,
            format!("{file} is writable: deep sleep states are disabled while the controller runs"),
        );
    }
    if !system.has(file) {
        return Check::ok(NAME, format!("no {file}: the kernel uses no deep sleep states"));
    }
    let found = format!("{file} is not writable: waking from a deep sleep state takes up to 0.2 ms");
    Check::warn(NAME, found, format!("sudo chgrp $(id -gn) {file} && sudo chmod g+w {file}"))
}

fn timer_slack(system: &System) -> Check {
    const NAME: &str = "timer slack";
    let slack = system.number("/proc/self/timerslack_ns").unwrap_or(0);
    Check::ok(NAME, format!("{} us for a new process; the control thread sets its own to the minimum", slack / 1000))
}

fn clock_source(system: &System) -> Check {
    const NAME: &str = "clock source";
    let folder = "/sys/devices/system/clocksource/clocksource0";
    let current = system.text(&format!("{folder}/current_clocksource")).unwrap_or_else(|| "unknown".to_owned());
    let available = system.text(&format!("{folder}/available_clocksource")).unwrap_or_default();
    let fast = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];
    if fast.contains(&&*current) || current == "unknown" {
        return Check::ok(NAME, current);
    }
    let better = available.split_whitespace().find(|name| fast.contains(name));
    let found = format!("{current}: reading the clock takes microseconds");
    match better {
        Some(better) => Check::warn(NAME, found, format!("echo {better} | sudo tee {folder}/current_clocksource")),
        None => Check::warn(NAME, found, "boot with tsc=reliable if the TSC of this processor is reliable"),
    }
}

fn cores(count: usize) -> Check {
    const NAME: &str = "cores";
    match count {
        1 => Check::warn(
            NAME,
            "1: controller, driver and recorder share it",
            "use a machine with two cores, or run the recorder on another machine",
        ),
        _ => Check::ok(NAME, count.to_string()),
    }
}

fn mujoco(maps: &str) -> Check {
    const NAME: &str = "MuJoCo";
    match maps.split_whitespace().find(|word| word.contains("libmujoco")) {
        Some(path) => Check::ok(NAME, path),
        None => Check::fail(NAME, "the library is not loaded", "make setup && make build"),
    }
}

fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = statvfs(folder).ok()?;
    Some(disk.blocks_available() * disk.fragment_size())
}

fn disk(folder: &Path, free: Option<u64>) -> Check {
    const NAME: &str = "disk for logs";
    let Some(free) = free else {
        let folder = folder.display();
        return Check::fail(NAME, format!("{folder} does not exist"), format!("mkdir -p {folder}"));
    };
    let minutes = free / LOG_BYTES_PER_S / 60;
    let found = format!("{} GB free: {minutes} min of recording", free / 1_000_000_000);
    let fix = "remove old logs (hoof log info logs/runs/*.mcap), or use another disk with --logs";
    match minutes {
        0..=1 => Check::fail(NAME, found, fix),
        2..=29 => Check::warn(NAME, found, fix),
        _ => Check::ok(NAME, found),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::super::files::tests::machine;
    use super::*;

    fn level_and_fix(check: &Check) -> (Level, &str) {
        (check.level, check.fix.as_deref().unwrap_or(""))
    }

    #[test]
    fn a_missing_real_time_limit_is_a_warning_with_the_limits_file() {
        let unprivileged = [
            ("/proc/self/status", "CapEff:\t0000000000000000\n"),
            ("/proc/self/limits", "Max realtime priority     0  0\nMax locked memory    8388608  8388608 bytes\n"),
        ];
        let system = machine("unprivileged", &unprivileged);
        let check = scheduler(&system, Some("SCHED_FIFO 1 refused: EPERM".to_owned()));
        assert_eq!(level_and_fix(&check), (Level::Warn, LIMITS_FIX));
        assert!(memory(&system).found.contains("8192 kB"));
        assert_eq!(scheduler(&system, None).level, Level::Ok);

        let root = machine("root", &[("/proc/self/status", "CapEff:\t000001ffffffffff\n")]);
        assert_eq!(memory(&root).level, Level::Ok);
        let in_group = scheduler(&root, Some("SCHED_FIFO 1 refused: EPERM".to_owned()));
        assert_eq!(level_and_fix(&in_group), (Level::Warn, "sudo sysctl -w kernel.sched_rt_runtime_us=-1"));
    }

    #[test]
    fn kernel_preemption_is_detected() {
        let of = |version: &str, realtime: &str| {
            kernel(&machine("kernel", &[("/proc/sys/kernel/version", version), ("/sys/kernel/realtime", realtime)]))
        };
        assert_eq!(of("#1 SMP PREEMPT_RT Debian", "").level, Level::Ok);
        assert_eq!(of("#1 SMP", "1").level, Level::Ok);
        assert!(of("#1 SMP PREEMPT_DYNAMIC", "").found.contains("no PREEMPT_RT"));
        assert!(of("#1 SMP", "").found.contains(", preemption none: "));
    }

    /// Priority: status, then command line, then build configuration.
    #[test]
    fn preemption_is_read_from_status_command_line_and_configuration() {
        let [now, requested, built] = ["/sys/kernel/debug/sched/preempt", "/proc/cmdline", "/boot/config-6.1"];
        let of = |files: &[(&str, &str)]| preemption(&machine("preemption", files), "6.1", "#1 SMP PREEMPT_DYNAMIC");
        assert_eq!(of(&[]), None);
        assert_eq!(
            of(&[(built, "CONFIG_PREEMPT_BUILD=y\nCONFIG_PREEMPT_NONE=y\n# CONFIG_PREEMPT is not set\n")]),
            Some("none")
        );
        assert_eq!(of(&[(built, "CONFIG_PREEMPT=y\n")]), Some("full"));
        assert_eq!(of(&[(built, "CONFIG_PREEMPT=y\n"), (requested, "quiet preempt=voluntary\n")]), Some("voluntary"));
        assert_eq!(of(&[(now, "none voluntary (full)\n"), (requested, "preempt=none\n")]), Some("full"));
        let check = kernel(&machine(
            "none",
            &[("/proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC"), (requested, "preempt=none")],
        ));
        assert!(check.fix.unwrap().contains("preempt=full"));
    }

    #[test]
    fn one_slow_governor_is_a_warning() {
        let file = |n| format!("/sys/devices/system/cpu/cpu{n}/cpufreq/scaling_governor");
        let of = |a: &str, b: &str| governor(&machine("governor", &[(&file(0), a), (&file(1), b)]));
        assert_eq!(of("performance", "performance").level, Level::Ok);
        assert!(of("performance", "schedutil").found.starts_with("governor schedutil"));
        assert_eq!(governor(&machine("fixed", &[])).level, Level::Ok);
    }

    #[test]
    fn a_slow_clock_source_is_a_warning_with_a_faster_one() {
        let folder = "/sys/devices/system/clocksource/clocksource0";
        let of = |current: &str, available: &str| {
            let (a, b) = (format!("{folder}/current_clocksource"), format!("{folder}/available_clocksource"));
            clock_source(&machine("clock", &[(&a, current), (&b, available)]))
        };
        assert_eq!(of("tsc\n", "tsc hpet").level, Level::Ok);
        let fix = format!("echo tsc | sudo tee {folder}/current_clocksource");
        assert_eq!(level_and_fix(&of("hpet", "tsc hpet")), (Level::Warn, &*fix));
        assert!(of("hpet", "hpet acpi_pm").fix.unwrap().contains("tsc=reliable"));
    }

    #[test]
    fn disk_space_library_and_cores_are_checked() {
        let here = Path::new(".");
        let level = |free| disk(here, free).level;
        assert_eq!(
            [Some(0), Some(1_000_000_000), Some(100_000_000_000), None].map(level),
            [Level::Fail, Level::Warn, Level::Ok, Level::Fail]
        );
        assert!(disk(here, Some(100_000_000_000)).found.contains("666 min"));
        assert_eq!(mujoco("7f r-xp 0 08:01 12 /a/libmujoco.so.3.17.0\n").found, "/a/libmujoco.so.3.17.0");
        assert_eq!(mujoco("7f r-xp 0 08:01 12 /a/libc.so\n").level, Level::Fail);
        assert_eq!((cores(1).level, cores(2).level), (Level::Warn, Level::Ok));
    }

    #[test]
    fn wake_up_latency_and_timer_slack_are_checked() {
        let file = "/dev/cpu_dma_latency";
        assert_eq!(wake_up(&machine("awake", &[(file, "")])).level, Level::Ok);
        assert!(wake_up(&machine("none", &[])).found.starts_with("no /dev/cpu_dma_latency"));
        assert!(timer_slack(&machine("slack", &[("/proc/self/timerslack_ns", "50000\n")])).found.starts_with("50 us"));
    }
}
