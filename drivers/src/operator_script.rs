//! Operator of a scenario: keyframes over time. Commands are sent on every change and 50 times a second, as a joystick does.

use crate::checks::{BadKey, check_range, to_ns};
use controller::quadruped::params::{Gait, GaitParams};
use lcmtypes::OperatorCommand;
use serde::Deserialize;

/// Period of the commands while nothing changes, ns.
pub const HEARTBEAT_NS: i64 = 20_000_000;

/// An `[[operator]]` entry of a scenario: the values that change at time `t_s`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OperatorKey {
    pub t_s: f64,
    mode: Option<Mode>,
    gait: Option<String>,
    v_x: Option<f64>,
    v_y: Option<f64>,
    yaw_rate: Option<f64>,
    roll: Option<f64>,
    pitch: Option<f64>,
    height_offset: Option<f64>,
    swing_frequency: Option<f64>,
    duty: Option<f64>,
    step_height: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Mode {
    Stand,
    Walk,
    Damping,
    Sit,
    Idle,
}

impl OperatorKey {
    /// Checks the values; `gaits` are those of the run.
    pub(crate) fn check(&self, gaits: &GaitParams) -> Result<(), BadKey> {
        if let Some(name) = self.gait.as_ref().filter(|name| gaits.named(name).is_none()) {
            let expected = gaits.names().collect::<Vec<_>>().join(", ");
            return Err(BadKey { key: "gait", found: format!("{name:?}"), expected });
        }
        let keys = [
            ("v_x", self.v_x, 5.0),
            ("v_y", self.v_y, 5.0),
            ("yaw_rate", self.yaw_rate, 5.0),
            ("roll", self.roll, 1.0),
            ("pitch", self.pitch, 1.0),
            ("height_offset", self.height_offset, 1.0),
            ("swing_frequency", self.swing_frequency, 100.0),
            ("duty", self.duty, 1.0),
            ("step_height", self.step_height, 1.0),
        ];
        keys.iter().try_for_each(|(key, value, limit)| check_range(key, value.as_slice(), -limit..=*limit))
    }
}

/// All commands of a run, each with all values.
#[derive(Clone, Debug, PartialEq)]
pub struct OperatorScript {
    commands: Vec<OperatorCommand>,
    /// Number of commands whose time has been reached.
    reached: usize,
    next_seq: i64,
    next_heartbeat_ns: i64,
    /// The commands are recorded messages; they are sent unchanged and without heartbeat.
    recorded: bool,
}

impl OperatorScript {
    /// The messages of an operator in another run, in the order of time.
    pub fn recorded(commands: Vec<OperatorCommand>) -> Self {
        OperatorScript { commands, reached: 0, next_seq: 0, next_heartbeat_ns: i64::MIN, recorded: true }
    }

    /// The commands of checked entries.
    pub(crate) fn new(keys: &[OperatorKey], gaits: &GaitParams) -> Self {
        let mut command = OperatorCommand {
            t_ns: 0,
            seq: 0,
            sender_id: 0,
            t_mode_ns: 0,
            mode: OperatorCommand::MODE_STAND,
            gait: OperatorCommand::GAIT_TROT,
            v_H: [0.0; 2],
            yaw_rate: 0.0,
            roll: 0.0,
            pitch: 0.0,
            height_offset: 0.0,
            swing_frequency: 0.0,
            duty: 0.0,
            step_height: 0.0,
        };
        let set = |slot: &mut f64, value: Option<f64>| *slot = value.unwrap_or(*slot);
        let mut commands = Vec::with_capacity(keys.len());
        for key in keys {
            command.t_ns = to_ns(key.t_s);
            if key.mode.is_some() || commands.is_empty() {
                command.t_mode_ns = command.t_ns;
            }
            command.mode = match key.mode {
                Some(Mode::Stand) => OperatorCommand::MODE_STAND,
                Some(Mode::Walk) => OperatorCommand::MODE_WALK,
                Some(Mode::Damping) => OperatorCommand::MODE_DAMPING,
                Some(Mode::Sit) => OperatorCommand::MODE_SIT,
                Some(Mode::Idle) => OperatorCommand::MODE_IDLE,
                None => command.mode,
            };
            let gait = key.gait.as_ref().and_then(|name| gaits.named(name));
            command.gait = gait.map_or(command.gait, Gait::number);
            set(&mut command.v_H[0], key.v_x);
            set(&mut command.v_H[1], key.v_y);
            set(&mut command.yaw_rate, key.yaw_rate);
            set(&mut command.roll, key.roll);
            set(&mut command.pitch, key.pitch);
            set(&mut command.height_offset, key.height_offset);
            set(&mut command.swing_frequency, key.swing_frequency);
            set(&mut command.duty, key.duty);
            set(&mut command.step_height, key.step_height);
            commands.push(command.clone());
        }
        OperatorScript { commands, reached: 0, next_seq: 0, next_heartbeat_ns: i64::MIN, recorded: false }
    }

    /// The message to send at `t_ns`, if any. Call it with increasing times.
    pub fn operator_at(&mut self, t_ns: i64) -> Option<OperatorCommand> {
        let reached = self.commands.iter().take_while(|command| command.t_ns <= t_ns).count();
        let changed = reached > self.reached;
        if self.recorded {
            self.reached = reached;
            return if changed { self.commands.get(reached - 1).cloned() } else { None };
        }
        if reached == 0 || !(changed || t_ns >= self.next_heartbeat_ns) {
            return None;
        }
        let message = OperatorCommand { t_ns, seq: self.next_seq, ..self.commands[reached - 1].clone() };
        self.reached = reached;
        self.next_seq += 1;
        self.next_heartbeat_ns = t_ns + HEARTBEAT_NS;
        Some(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Scenario;

    #[test]
    fn recorded_messages_are_sent_unchanged() {
        let text = "name = \"t\"\nduration_s = 1.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.01\nroll = 0.1\n[[operator]]\nt_s = 0.035\nv_x = 0.2\n";
        let send = |script: &mut OperatorScript| -> Vec<OperatorCommand> {
            (0..90).filter_map(|ms| script.operator_at(ms * 1_000_000)).collect()
        };
        let sent = send(&mut Scenario::parse(text, "t.toml", &GaitParams::default()).unwrap().operator);
        assert_eq!(sent.len(), 5);
        assert_eq!(send(&mut OperatorScript::recorded(sent.clone())), sent);
    }

    #[test]
    fn values_are_kept_until_changed_and_changes_are_sent_at_once() {
        let text = "name = \"t\"\nduration_s = 1.0\n[terrain]\nkind = \"flat\"\n\
            [[operator]]\nt_s = 0.01\nmode = \"stand\"\nroll = 0.1\n\
            [[operator]]\nt_s = 0.035\nmode = \"walk\"\ngait = \"crawl\"\nv_x = 0.2\n\
            [[operator]]\nt_s = 0.06\nv_y = -0.1\n";
        let mut script = Scenario::parse(text, "t.toml", &GaitParams::default()).unwrap().operator;
        let sent: Vec<OperatorCommand> = (0..90).filter_map(|ms| script.operator_at(ms * 1_000_000)).collect();

        let times: Vec<i64> = sent.iter().map(|command| command.t_ns / 1_000_000).collect();
        assert_eq!(times, [10, 30, 35, 55, 60, 80]);
        let numbers: Vec<i64> = sent.iter().map(|command| command.seq).collect();
        assert_eq!(numbers, [0, 1, 2, 3, 4, 5]);
        let last = OperatorCommand {
            t_ns: 80_000_000,
            seq: 5,
            sender_id: 0,
            t_mode_ns: 35_000_000,
            mode: OperatorCommand::MODE_WALK,
            gait: OperatorCommand::GAIT_CRAWL,
            v_H: [0.2, -0.1],
            yaw_rate: 0.0,
            roll: 0.1,
            pitch: 0.0,
            height_offset: 0.0,
            swing_frequency: 0.0,
            duty: 0.0,
            step_height: 0.0,
        };
        assert_eq!(sent[5], last);
        assert_eq!((sent[1].mode, sent[1].v_H), (OperatorCommand::MODE_STAND, [0.0, 0.0]));
    }
}
