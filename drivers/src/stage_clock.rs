//! Times of a tick and its stages, for TIMING.

use crate::live::clock::{now_ns, wall_ns};
use controller::{Probe, Stage};
use lcmtypes::Timing;

/// Reads the monotonic clock at the start of a tick and at the end of each stage. Allocates nothing.
#[derive(Debug, Default)]
pub struct StageClock {
    wall_ns: i64,
    start_ns: i64,
    last_ns: i64,
    stage_ns: [i64; Stage::ALL.len()],
}

impl StageClock {
    /// Starts a tick.
    pub fn start(&mut self) {
        self.wall_ns = wall_ns();
        self.start_ns = now_ns();
        self.last_ns = self.start_ns;
        self.stage_ns = [0; Stage::ALL.len()];
    }

    /// Time since the start of the tick, ns.
    pub fn elapsed_ns(&self, now_ns: i64) -> i64 {
        now_ns - self.start_ns
    }

    /// The tick's TIMING without wake-up and deadline; it ends with its last stage.
    pub fn timing(&self, t_ns: i64, tick: i64) -> Timing {
        let Self { wall_ns, start_ns, last_ns, stage_ns } = *self;
        Timing { t_ns, tick, wall_ns, wake_ns: start_ns, start_ns, end_ns: last_ns, deadline_ns: 0, stage_ns }
    }
}

impl Probe for StageClock {
    /// Adds to the stage's duration: a sequence of controllers runs a stage once per controller.
    fn stage_done(&mut self, stage: Stage) {
        let now = now_ns();
        self.stage_ns[stage as usize] += now - self.last_ns;
        self.last_ns = now;
    }
}
