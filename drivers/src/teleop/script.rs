//! Lines of text as an operator: `walk vx=0.2`, `gait=crawl`, `wait 2.5`, `estop`.
//!
//! A line is a mode, or numbers, or both, or a time to wait. What is set stays until it is set again; a new mode begins with
//! velocities of zero.

use super::{Axis, Desk, Limits};
use controller::params::range::Range;
use controller::quadruped::params::{DUTY, STEP_HEIGHT, SWING_FREQUENCY};
use lcmtypes::OperatorCommand;
use std::time::Duration;

/// Longest wait that a line may ask for, s.
const LONGEST_WAIT_S: f64 = 86_400.0;

/// Why a line is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum ScriptError {
    #[error("\"{found}\" is neither stand, walk, sit, idle, estop nor KEY=VALUE, nor wait SECONDS")]
    Word { found: String },
    #[error("unknown key \"{key}\", known: vx, vy, yaw, roll, pitch, height, gait, swing_frequency, duty, step_height")]
    Key { key: String },
    #[error("{key}={found}: expected {expected}")]
    Value { key: String, found: String, expected: String },
}

impl Desk {
    /// Takes a line; how long to wait before the next one. A line that is wrong in any part changes nothing.
    ///
    /// # Errors
    /// [`ScriptError`], which names the word.
    pub fn line(&mut self, line: &str) -> Result<Duration, ScriptError> {
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
        // Modes first: one sets the velocities to zero, wherever it stands in the line.
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
        let Limits { speed, yaw_rate, orientation, height } = self.limits;
        let within = |limit: f64| number(key, value, |x| x.abs() <= limit, || format!("-{limit} to {limit}"));
        // 0 leaves it to the parameters, as in the message.
        let fits = |Range { contains, expected }: Range| {
            number(key, value, |x| x == 0.0 || contains(x), || format!("{expected}, or 0 for the parameters' own"))
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
                self.gait = match value {
                    "trot" => OperatorCommand::GAIT_TROT,
                    "crawl" => OperatorCommand::GAIT_CRAWL,
                    _ => {
                        let (key, found, expected) = (key.to_owned(), value.to_owned(), "trot or crawl".to_owned());
                        return Err(ScriptError::Value { key, found, expected });
                    }
                }
            }
            _ => return Err(ScriptError::Key { key: key.to_owned() }),
        }
        Ok(())
    }

    /// Moves at a velocity until told otherwise.
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
