//! Times of a tick and its stages, for TIMING.

use crate::live::clock::{now_ns, wall_ns};
use controller::Probe;
use lcmtypes::Timing;

/// Reads the monotonic clock at the start of a tick and at the end of each stage. Allocates nothing in a tick.
#[derive(Debug)]
pub struct StageClock {
    last_ns: i64,
    timing: Timing,
}

impl StageClock {
    /// A clock for a component with `n_stages` stages.
    pub fn new(n_stages: usize) -> Self {
        let stage_ns = vec![0; n_stages];
        let n_stages = i32::try_from(n_stages).expect("components have fewer than 2^31 stages");
        StageClock { last_ns: 0, timing: Timing { n_stages, stage_ns, ..Timing::default() } }
    }

    /// Starts a tick.
    pub fn start(&mut self) {
        self.timing.wall_ns = wall_ns();
        self.last_ns = now_ns();
        self.timing.start_ns = self.last_ns;
        self.timing.stage_ns.fill(0);
    }

    /// The tick's TIMING without deadline; it wakes when it starts and ends with its last stage.
    pub fn timing(&mut self, t_ns: i64, tick: i64) -> &mut Timing {
        let m = &mut self.timing;
        (m.t_ns, m.tick) = (t_ns, tick);
        (m.wake_ns, m.end_ns, m.deadline_ns) = (m.start_ns, self.last_ns, 0);
        m
    }
}

impl Probe for StageClock {
    /// Adds to the stage's duration: a sequence of controllers runs a stage once per controller.
    fn stage_done(&mut self, stage: usize) {
        let now = now_ns();
        if let Some(stage_ns) = self.timing.stage_ns.get_mut(stage) {
            *stage_ns += now - self.last_ns;
        }
        self.last_ns = now;
    }
}
