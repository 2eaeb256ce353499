//! Joint signals of a run: what was measured and what was commanded, tick by tick.

use lcmtypes::{RobotCommand, RobotState};

use super::Tick;

/// Signals of each joint: position, velocity, torque.
const SIGNALS: usize = 3;

/// Joint signals of every tick, in the order of the URDF.
///
/// Kept as `f32`, 24 bits: more than an encoder gives, and ten minutes of twelve joints take 170 MB.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// Names: those of the URDF when it has as many movable joints as the messages, else `joint 0`, `joint 1`, …
    pub names: Vec<String>,
    pub(super) measured: Table,
    pub(super) commanded: Table,
}

/// One joint at one tick; rad, rad/s, N m (or m, m/s, N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    /// Position.
    pub q: f64,
    /// Velocity.
    pub qd: f64,
    /// Torque: measured, or the command's feed-forward.
    pub tau: f64,
}

/// Rows of `q…, qd…, tau…`.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// Joints of every row, once there is one.
    joints: Option<usize>,
    values: Vec<f32>,
}

impl Joints {
    /// Number of joints; 0 when the log holds none.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// What was measured of a joint at a tick.
    pub fn measured(&self, tick: &Tick, joint: usize) -> Option<JointSample> {
        self.measured.sample(tick.joint_rows[0]?, joint)
    }

    /// What was commanded of a joint at a tick.
    pub fn commanded(&self, tick: &Tick, joint: usize) -> Option<JointSample> {
        self.commanded.sample(tick.joint_rows[1]?, joint)
    }

    /// Joints that the messages have.
    pub(super) fn in_messages(&self) -> usize {
        self.measured.joints.or(self.commanded.joints).unwrap_or(0)
    }
}

impl Table {
    /// Number of the row of a state; the error says why there is none.
    pub fn push_state(&mut self, m: &RobotState) -> Result<u32, String> {
        self.push([&m.q, &m.qd, &m.tau])
    }

    /// Number of the row of a command; the error says why there is none.
    pub fn push_command(&mut self, m: &RobotCommand) -> Result<u32, String> {
        self.push([&m.q_des, &m.qd_des, &m.tau])
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
