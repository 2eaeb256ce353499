//! Real-time settings of a thread: scheduler, core, memory, wake-up. Those that the system refuses are reported and omitted.

use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;
use serde::Deserialize;
use std::fs::File;
use std::io::Write;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Command that permits real-time priorities and locked memory.
pub const LIMITS_FIX: &str = "printf '%s - rtprio 95\\n%s - memlock unlimited\\n' $USER $USER | sudo tee /etc/security/limits.d/60-hoofprint.conf   (then log in again)";
/// Number of the capability to lock memory beyond the limit.
const CAP_IPC_LOCK: u32 = 14;

/// Real-time settings to request from the system.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RealtimeParams {
    /// Priority under SCHED_FIFO, 1 to 99; 0 = the system's default scheduler.
    pub priority: u8,
    /// Core to run on; none = any.
    pub core: Option<usize>,
    /// Lock all memory of the process in RAM.
    pub lock_memory: bool,
    /// Keep cores out of idle states with a long wake-up latency.
    pub stay_awake: bool,
}

impl Default for RealtimeParams {
    fn default() -> Self {
        RealtimeParams { priority: 80, core: None, lock_memory: true, stay_awake: true }
    }
}

/// Settings that the system granted; they are in force as long as this value exists.
#[derive(Debug, Default)]
pub struct Granted {
    /// Granted settings.
    pub held: Vec<String>,
    /// Refused settings with the reason.
    pub refused: Vec<String>,
    /// The kernel keeps the wake-up latency as long as this file is open.
    _awake: Option<File>,
}

impl Granted {
    /// The granted settings as one line.
    pub fn held_text(&self) -> String {
        if self.held.is_empty() { "no real-time setting".to_owned() } else { self.held.join(", ") }
    }

    /// All settings as one line, for RUN_INFO.
    pub fn text(&self) -> String {
        let nothing = self.held.is_empty().then(|| "no real-time setting".to_owned());
        nothing.iter().chain(&self.held).chain(&self.refused).cloned().collect::<Vec<_>>().join(", ")
    }
}

impl RealtimeParams {
    /// Default scheduler, any core, no locked memory.
    pub fn none() -> Self {
        RealtimeParams { priority: 0, core: None, lock_memory: false, stay_awake: false }
    }

    /// Requests the settings for the calling thread.
    pub fn apply(&self) -> Granted {
        let mut granted = Granted::default();
        let mut take = |what: String, result: Result<(), String>| match result {
            Ok(()) => granted.held.push(what),
            Err(why) => granted.refused.push(format!("{what} refused: {why}")),
        };
        if self.priority > 0 {
            take(format!("SCHED_FIFO {}", self.priority), fifo(self.priority));
        }
        if let Some(core) = self.core {
            take(format!("core {core}"), pin(core));
        }
        if self.lock_memory {
            take("locked memory".to_owned(), lock_memory());
        }
        // SCHED_FIFO has no timer slack; other schedulers may wake up to 50 us late to save power.
        take("no timer slack".to_owned(), nix::sys::prctl::set_timerslack(1).map_err(|error| error.desc().to_owned()));
        if self.stay_awake {
            let file = stay_awake();
            take(
                "cores awake".to_owned(),
                file.as_ref().map(drop).map_err(|error| format!("/dev/cpu_dma_latency: {error}")),
            );
            granted._awake = file.ok();
        }
        granted
    }
}

/// Locks present and future memory. Under a limit this is refused: the call itself may succeed, and a later allocation would then end the process.
fn lock_memory() -> Result<(), String> {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    if let Some(limit) = memory_limit(&read("/proc/self/limits"), &read("/proc/self/status")) {
        return Err(format!("the limit is {} kB, expected unlimited; {LIMITS_FIX}", limit / 1024));
    }
    mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE).map_err(|error| error.desc().to_owned())
}

/// The limit of locked memory, bytes; `None` if there is none or it does not apply.
///
/// - `limits`, `status`: texts of /proc/self/limits and /proc/self/status.
pub fn memory_limit(limits: &str, status: &str) -> Option<u64> {
    let capabilities = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let capabilities = capabilities.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0);
    if capabilities >> CAP_IPC_LOCK & 1 == 1 {
        return None;
    }
    limits.lines().find_map(|line| line.strip_prefix("Max locked memory"))?.split_whitespace().next()?.parse().ok()
}

fn fifo(priority: u8) -> Result<(), String> {
    let value = ThreadPriorityValue::try_from(priority)?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy).map_err(|error| {
        match error {
            thread_priority::Error::OS(1) => format!("not permitted; {LIMITS_FIX}"),
            thread_priority::Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
            error => error.to_string(),
        }
    })
}

fn pin(core: usize) -> Result<(), String> {
    let mut set = CpuSet::new();
    set.set(core).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set)).map_err(|error| {
        // The file exists on every Linux.
        let online = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap_or_default();
        format!("{}, available cores: {}", error.desc(), online.trim())
    })
}

fn stay_awake() -> std::io::Result<File> {
    let mut file = File::options().write(true).open("/dev/cpu_dma_latency")?;
    // Largest accepted wake-up latency, us, in native byte order.
    file.write_all(&0i32.to_ne_bytes())?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_locked_memory_is_found_unless_it_does_not_apply() {
        let limits =
            |limit| format!("Max processes  7  7  processes\nMax locked memory         {limit} {limit} bytes\n");
        let status = |bits| format!("Name:\thoof\nCapEff:\t{bits}\n");
        assert_eq!(memory_limit(&limits("8388608"), &status("0000000000000000")), Some(8_388_608));
        assert_eq!(memory_limit(&limits("8388608"), &status("000001ffffffffff")), None);
        assert_eq!(memory_limit(&limits("unlimited"), &status("0000000000000000")), None);
    }

    #[test]
    fn refused_settings_are_reported() {
        std::thread::spawn(|| {
            let settings = RealtimeParams { core: Some(1_000_000), ..RealtimeParams::none() };
            let granted = settings.apply();
            assert_eq!(granted.held, ["no timer slack"]);
            assert_eq!(granted.refused.len(), 1);
            let cores = std::fs::read_to_string("/sys/devices/system/cpu/online").unwrap();
            let refused = &granted.refused[0];
            assert!(refused.starts_with("core 1000000 ") && refused.ends_with(cores.trim()), "{refused}");
            assert_eq!(granted.text(), format!("no timer slack, {refused}"));
            assert!(!Granted::default().text().is_empty());
        })
        .join()
        .unwrap();
    }
}
