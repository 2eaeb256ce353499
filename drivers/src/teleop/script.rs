//! Operator input as lines of text: `walk vx=0.2`, `gait=crawl`, `wait 2.5`, `estop`.
//!
//! A line holds a mode, `KEY=VALUE` pairs, or both; or a time to wait. Values are kept until they are set again. A new mode resets the velocities
//! to zero.

use super::{Axis, Limits, OperatorInput};
use controller::params::range::Range;
use controller::quadruped::params::{DUTY, STEP_HEIGHT, SWING_FREQUENCY};
use lcmtypes::OperatorCommand;
use std::time::Duration;

/// Longest wait of a line, s.
const LONGEST_WAIT_S: f64 = 86_400.0;

/// Invalid line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum ScriptError {
    #[error("unknown word \"{found}\", expected stand, walk, sit, idle, estop, KEY=VALUE or wait SECONDS")]
    Word { found: String },
    #[error(
        "unknown key \"{key}\", expected vx, vy, yaw, roll, pitch, height, gait, swing_frequency, duty, step_height"
    )]
    Key { key: String },
    #[error("{key}={found}: expected {expected}")]
    Value { key: String, found: String, expected: String },
}

impl OperatorInput {
    /// Applies a line; returns the time to wait before the next one. An invalid line changes nothing.
    ///
    /// # Errors
    /// [`ScriptError`], which names the word.
    pub fn apply_line(&mut self, line: &str) -> Result<Duration, ScriptError> {
        let text = line.split('#').next().unwrap_or("");
        let words: Vec<&str> = text.split_whitespace().collect();
        if let ["wait", seconds] = words[..] {
            let expected = || format!("0 to {LONGEST_WAIT_S} s");
            return Ok(Duration::from_secs_f64(number(
                "wait",
                seconds,
                |s| (0.0..=LONGEST_WAIT_S).contains(&s),
                expected,
            )?));
        }
        let mut next = self.clone();
        // Modes first, wherever they are in the line: a new mode resets the velocities.
        let (pairs, modes): (Vec<&str>, Vec<&str>) = words.into_iter().partition(|word| word.contains('='));
        for word in modes {
            next.switch_to(word)?;
        }
        for (key, value) in pairs.iter().filter_map(|pair| pair.split_once('=')) {
            next.set(key, value)?;
        }
        *self = next;
        Ok(Duration::ZERO)
    }

    fn switch_to(&mut self, word: &str) -> Result<(), ScriptError> {
        let mode = match word {
            "stand" => OperatorCommand::MODE_STAND,
            "walk" => OperatorCommand::MODE_WALK,
            "sit" => OperatorCommand::MODE_SIT,
            "idle" => OperatorCommand::MODE_IDLE,
            "estop" => OperatorCommand::MODE_DAMPING,
            _ => return Err(ScriptError::Word { found: word.to_owned() }),
        };
        if self.mode != Some(mode) {
            self.set_mode(mode);
        }
        Ok(())
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), ScriptError> {
        let Limits { orientation, height, .. } = self.limits;
        // A line may set the velocity before the gait.
        let [speed, yaw_rate] = [self.limits.largest(|gait| gait.speed), self.limits.largest(|gait| gait.yaw_rate)];
        let within = |limit: f64| number(key, value, |x| x.abs() <= limit, || format!("-{limit} to {limit}"));
        // 0 selects the value of the parameters, as in the message.
        let fits = |Range { contains, expected }: Range| {
            number(
                key,
                value,
                |x| x == 0.0 || contains(x),
                || format!("{expected}, or 0 for the value of the parameters"),
            )
        };
        match key {
            "vx" => self.move_at(Axis::Forward, within(speed)?),
            "vy" => self.move_at(Axis::Left, within(speed)?),
            "yaw" => self.move_at(Axis::Turn, within(yaw_rate)?),
            "roll" => self.roll = within(orientation)?,
            "pitch" => self.pitch = within(orientation)?,
            "height" => self.height = within(height)?,
            "swing_frequency" => self.swing_frequency = fits(SWING_FREQUENCY)?,
            "duty" => self.duty = fits(DUTY)?,
            "step_height" => self.step_height = fits(STEP_HEIGHT)?,
            "gait" => {
                let names: Vec<&str> = self.limits.gaits.iter().map(|gait| &*gait.name).collect();
                let Some(gait) = names.iter().position(|name| *name == value) else {
                    let (key, found, expected) = (key.to_owned(), value.to_owned(), names.join(", "));
                    return Err(ScriptError::Value { key, found, expected });
                };
                self.gait = gait;
            }
            _ => return Err(ScriptError::Key { key: key.to_owned() }),
        }
        Ok(())
    }

    /// Sets a velocity until it is set again.
    fn move_at(&mut self, axis: Axis, velocity: f64) {
        self.moves[axis as usize] = velocity;
        self.moves_until_ns = i64::MAX;
    }
}

fn number(
    key: &str,
    text: &str,
    fits: impl Fn(f64) -> bool,
    expected: impl Fn() -> String,
) -> Result<f64, ScriptError> {
    let error = || ScriptError::Value { key: key.to_owned(), found: text.to_owned(), expected: expected() };
    text.parse().ok().filter(|x| fits(*x)).ok_or_else(error)
}
