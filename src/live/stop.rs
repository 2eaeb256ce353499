//! Request to end a process of a run: a signal, or the death of its parent.

use anyhow::Context;
use drivers::live::{EndCause, has_traffic};
use lcmtypes::channels;
use nix::unistd::{Pid, getppid};
use replay::udpm::Url;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Longest time for a controller to end after a request; it includes the time to sit down.
pub const END_TIMEOUT: Duration = Duration::from_secs(25);

/// Signals that end a run, with the cause that the EVENT reports.
const SIGNALS: [(i32, EndCause); 3] =
    [(SIGINT, EndCause::Interrupt), (SIGTERM, EndCause::Terminate), (SIGHUP, EndCause::HangUp)];

/// Request to end a process.
pub struct Stop {
    /// Position in [`SIGNALS`] + 1 of the last signal; 0 = none.
    signal: Arc<AtomicUsize>,
    parent: Option<Pid>,
}

impl Stop {
    /// Registers the signals.
    ///
    /// # Errors
    /// If a signal handler cannot be registered.
    pub fn new(parent: Option<i32>) -> anyhow::Result<Self> {
        let requested = Arc::new(AtomicUsize::new(0));
        for ((signal, _), number) in SIGNALS.into_iter().zip(1..) {
            signal_hook::flag::register_usize(signal, requested.clone(), number).context("signal handler")?;
        }
        Ok(Stop { signal: requested, parent: parent.map(Pid::from_raw) })
    }

    /// Why the process must end; `None` = it goes on.
    pub fn cause(&self) -> Option<EndCause> {
        let orphaned = self.is_orphaned().then_some(EndCause::ParentDied);
        orphaned.or_else(|| Some(SIGNALS.get(self.signal.load(Ordering::Relaxed).checked_sub(1)?)?.1))
    }

    /// Whether the process must end.
    pub fn is_due(&self) -> bool {
        self.cause().is_some()
    }

    /// Whether the parent has died.
    pub fn is_orphaned(&self) -> bool {
        self.parent.is_some_and(|parent| getppid() != parent)
    }

    /// Takes the number of the last signal, so that a second one can be detected.
    pub fn take_signal(&self) -> Option<i32> {
        Some(SIGNALS.get(self.signal.swap(0, Ordering::Relaxed).checked_sub(1)?)?.0)
    }
}

/// Waits until no ROBOT_COMMAND has arrived for a time `quiet`, at most [`END_TIMEOUT`]: after the death of `hoof run` the controller lets the
/// robot sit down, and driver and recorder must last until it has ended.
pub fn wait_for_controller(url: &Url, quiet: Duration) {
    let begin = Instant::now();
    while begin.elapsed() < END_TIMEOUT && has_traffic(url, channels::ROBOT_COMMAND, quiet).unwrap_or(false) {
        std::thread::sleep(quiet / 10);
    }
}
