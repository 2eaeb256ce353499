//! Bounded memory for logs of any length: of a long run every second tick is left out, then every second of the rest, and so on.

use super::Tick;
use super::read::{Gathered, first_from};
use lcmtypes::{ControllerTick, Message};

/// Ticks that a run holds at most. With ground truth and joint signals, 400,000 ticks need about 1 GB.
pub(super) const MAX_TICKS: usize = 400_000;
/// EVENTs that a run holds at most.
pub(super) const MAX_EVENTS: usize = 100_000;

/// Which ticks are used.
pub(super) struct Thinning {
    /// Ticks held at most.
    pub max_ticks: usize,
    /// Ticks whose numbers are multiples of this.
    pub stride: i64,
    /// Mode and fault of the last tick: a tick in which they change is used too.
    last: Option<(i8, i32)>,
    /// Ground truth is thinned at this number of messages.
    pub max_truth: usize,
    /// EVENTs that are left out.
    pub events_dropped: u64,
}

impl Default for Thinning {
    fn default() -> Self {
        Thinning::with(MAX_TICKS)
    }
}

impl Thinning {
    fn with(max_ticks: usize) -> Self {
        Thinning { max_ticks, stride: 1, last: None, max_truth: 2 * max_ticks, events_dropped: 0 }
    }

    /// Whether a message is used: it belongs to no tick, or to one that is used.
    pub fn takes(&mut self, channel: &str, data: &[u8]) -> bool {
        let of_tick = [
            "BASE_TRACKING",
            "LEG_STATE",
            "CONTACT_ESTIMATE",
            "WBC_SOLUTION",
            "CONTROLLER_TICK",
            "TIMING",
            "CONTROLLER_INPUT",
            "ROBOT_COMMAND",
        ];
        if self.stride == 1 || !of_tick.contains(&channel) {
            return true;
        }
        // Fingerprint and `t_ns` come before the number of the tick.
        let number = data.get(16..).and_then(|rest| rest.first_chunk()).map(|bytes| i64::from_be_bytes(*bytes));
        let is_due = number.is_none_or(|number| number % self.stride == 0);
        if channel != "CONTROLLER_TICK" {
            return is_due;
        }
        let now = ControllerTick::decode(data).ok().map(|tick| (tick.mode, tick.fault));
        let changes = now.is_some() && now != self.last;
        self.last = now.or(self.last);
        is_due || changes
    }
}

impl Gathered {
    /// Doubles the stride and leaves out the ticks between.
    pub fn thin(&mut self) {
        self.thinning.stride = self.thinning.stride.saturating_mul(2);
        let (stride, mut last) = (self.thinning.stride, None);
        let mut is_used = |tick: &Tick| {
            let now = tick.status.map(|status| (status.mode, status.fault));
            let changes = now.is_some() && now != last;
            last = now.or(last);
            changes || tick.number().is_none_or(|number| number % stride == 0)
        };
        self.ticks.retain(&mut is_used);
        self.stray.retain(|tick| tick.number().is_none_or(|number| number % stride == 0));
        self.thinning.last = last;
        // Ticks without number, or of a log in which mode or fault change all the time.
        if self.ticks.len() > self.thinning.max_ticks / 4 * 3 {
            keep_every_second(&mut self.ticks);
        }
        if self.stray.len() > self.thinning.max_ticks / 2 {
            keep_every_second(&mut self.stray);
        }
        for (side, rows) in [&mut self.joints.measured, &mut self.joints.commanded].into_iter().enumerate() {
            rows.keep(self.ticks.iter_mut().chain(&mut self.stray).filter_map(|tick| tick.joint_rows[side].as_mut()));
        }
        if self.truth.len() > self.thinning.max_ticks {
            self.thin_truth();
        }
    }

    /// Keeps the ground truth next to each tick, and that after the last tick.
    pub fn thin_truth(&mut self) {
        self.truth.sort_by_key(|m| m.t_ns);
        if let Some(end) = self.ticks.last().map(|tick| tick.t_ns) {
            let mut is_near = vec![false; self.truth.len()];
            for tick in self.ticks.iter().chain(&self.stray) {
                let after = first_from(&self.truth, |m| m.t_ns, tick.t_ns);
                for at in [after.checked_sub(1), Some(after)].into_iter().flatten() {
                    if let Some(near) = is_near.get_mut(at) {
                        *near = true;
                    }
                }
            }
            let mut near = is_near.into_iter();
            self.truth.retain(|m| near.next() == Some(true) || m.t_ns > end);
        }
        if self.truth.len() > 2 * self.thinning.max_ticks {
            keep_every_second(&mut self.truth);
        }
        self.thinning.max_truth = self.truth.len() + self.thinning.max_ticks / 2;
    }

    /// Leaves out every second joint state of a log without CONTROLLER_INPUT.
    pub fn thin_raw(&mut self) {
        keep_every_second(&mut self.raw.0);
        self.raw.1.keep(self.raw.0.iter_mut().map(|(_, row)| row));
    }
}

fn keep_every_second<T>(items: &mut Vec<T>) {
    let mut number = 0_usize;
    items.retain(|_| {
        number += 1;
        number % 2 == 1
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::{GroundTruth, RobotCommand, Timing};

    /// Ticks 0 to 999 with ground truth between them, at most 100 ticks.
    fn gathered() -> Gathered {
        let mut gathered = Gathered { thinning: Thinning::with(100), ..Gathered::default() };
        let mut bytes = Vec::new();
        let mut put = |channel: &str, message: &dyn Fn(&mut Vec<u8>)| {
            bytes.clear();
            message(&mut bytes);
            gathered.take(channel, &bytes).unwrap();
        };
        for tick in 0..1000 {
            let t_ns = 1000 * tick;
            let feet = || vec![[0.0; 3]; 4];
            let truth = GroundTruth {
                t_ns: t_ns - 300,
                n_contacts: 4,
                p_WF: feet(),
                v_WF: feet(),
                f_F_W: feet(),
                tau_F_W: feet(),
                contact: vec![1; 4],
                ..GroundTruth::default()
            };
            put("GROUND_TRUTH", &|out| truth.encode(out).unwrap());
            let command = RobotCommand { t_ns, tick, tau: vec![tick as f64], ..RobotCommand::zeros(1) };
            put("ROBOT_COMMAND", &|out| command.encode(out).unwrap());
            let mode = if tick == 333 { ControllerTick::MODE_DAMPING } else { ControllerTick::MODE_WALK };
            put("CONTROLLER_TICK", &|out| {
                ControllerTick { t_ns, tick, mode, ..Default::default() }.encode(out).unwrap()
            });
            put("TIMING", &|out| Timing { t_ns, tick, ..Default::default() }.encode(out).unwrap());
        }
        gathered
    }

    #[test]
    fn a_long_run_is_thinned_and_keeps_its_changes_of_mode() {
        let gathered = gathered();
        assert_eq!(gathered.thinning.stride, 16);
        assert!(gathered.truth.len() <= 300, "{} messages of ground truth", gathered.truth.len());
        let (ticks, joints, ..) = gathered.join(Some(0));
        let numbers: Vec<i64> = ticks.iter().filter_map(Tick::number).collect();
        assert_eq!(numbers.len(), ticks.len());
        assert!(numbers.is_sorted());
        let expected = (0..1000).filter(|tick| tick % 16 == 0 || [333, 334].contains(tick));
        assert!(expected.clone().all(|tick| numbers.contains(&tick)), "{numbers:?}");
        // A tick can be used in part when the stride changes.
        assert!(numbers.len() <= expected.count() + 4, "{numbers:?}");
        for tick in ticks.iter().filter(|tick| tick.number().is_some_and(|number| number % 16 == 0)) {
            let number = tick.number().unwrap();
            assert_eq!(joints.commanded(tick, 0).map(|joint| joint.tau), Some(number as f64), "tick {number}");
            assert_eq!(tick.truth.as_ref().map(|truth| truth.t_ns), Some(1000 * number - 300), "tick {number}");
            assert!(tick.timing.is_some());
        }
    }
}
