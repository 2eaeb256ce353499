//! Measured and commanded joint signals of a run, by tick.

use lcmtypes::{RobotCommand, RobotState};

use super::Tick;

/// Number of signals of a joint: position, velocity, torque.
const SIGNALS: usize = 3;

/// Joint signals of all ticks, in the order of the URDF.
///
/// Values are `f32`, which has more bits than an encoder: ten minutes of twelve joints take 170 MB.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// Names from the URDF if it has as many movable joints as the messages, else `joint 0`, `joint 1`, …
    pub names: Vec<String>,
    pub(super) measured: Rows,
    pub(super) commanded: Rows,
}

/// Signals of one joint at one tick; rad, rad/s, N m (or m, m/s, N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    /// Position.
    pub q: f64,
    /// Velocity.
    pub qd: f64,
    /// Torque: measured, or the feed-forward torque of the command.
    pub tau: f64,
}

/// Rows of `q…, qd…, tau…`.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// Joints per row; `None` before the first row.
    joints: Option<usize>,
    values: Vec<f32>,
}

impl Joints {
    /// Number of joints; 0 if the log has no joint signals.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// Measured signals of a joint at a tick.
    pub fn measured(&self, tick: &Tick, joint: usize) -> Option<JointSample> {
        self.measured.sample(tick.joint_rows[0]?, joint)
    }

    /// Commanded signals of a joint at a tick.
    pub fn commanded(&self, tick: &Tick, joint: usize) -> Option<JointSample> {
        self.commanded.sample(tick.joint_rows[1]?, joint)
    }

    /// Number of joints in the inputs of the controller; 0 before the first.
    pub(super) fn in_inputs(&self) -> usize {
        self.measured.joints.unwrap_or(0)
    }

    /// Number of joints in the messages.
    pub(super) fn in_messages(&self) -> usize {
        self.measured.joints.or(self.commanded.joints).unwrap_or(0)
    }
}

impl Rows {
    /// Appends a state and returns its row; the error is the reason why it is rejected.
    pub fn push_state(&mut self, m: &RobotState) -> Result<u32, String> {
        self.push([&m.q, &m.qd, &m.tau])
    }

    /// Appends a command and returns its row; the error is the reason why it is rejected.
    pub fn push_command(&mut self, m: &RobotCommand) -> Result<u32, String> {
        self.push([&m.q_des, &m.qd_des, &m.tau])
    }

    /// Keeps these rows only, and writes their new numbers.
    pub fn keep<'r>(&mut self, rows: impl Iterator<Item = &'r mut u32>) {
        let width = SIGNALS * self.joints.unwrap_or(0);
        let mut kept = Vec::new();
        for row in rows {
            let begin = width * *row as usize;
            *row = u32::try_from(kept.len() / width.max(1)).expect("fewer rows than before");
            kept.extend_from_slice(self.values.get(begin..begin + width).unwrap_or_default());
        }
        self.values = kept;
    }

    fn push(&mut self, signals: [&[f64]; SIGNALS]) -> Result<u32, String> {
        let found = signals[0].len();
        let expected = *self.joints.get_or_insert(found);
        if signals.iter().any(|signal| signal.len() != expected) {
            return Err(format!("{found} joints, expected {expected} as in the first message"));
        }
        let row = self.values.len() / (SIGNALS * expected).max(1);
        self.values.extend(signals.iter().flat_map(|signal| signal.iter().map(|&v| v as f32)));
        u32::try_from(row).map_err(|_| "more than 2^32 messages".to_owned())
    }

    fn sample(&self, row: u32, joint: usize) -> Option<JointSample> {
        let n = self.joints?;
        let at = |signal: usize| {
            let index = SIGNALS * n * row as usize + n * signal + joint;
            self.values.get(index).copied().map(f64::from)
        };
        if joint < n { Some(JointSample { q: at(0)?, qd: at(1)?, tau: at(2)? }) } else { None }
    }
}
