//! Teleoperation: key presses, gamepad state or lines of text, converted to operator commands.
//!
//! [`OperatorInput`] holds what the person has set. It is pure: the caller gives the time. [`OperatorInput::command`] returns the command to send,
//! 50 times a second whether it has changed or not: if the commands stop, the operator times out.
//!
//! - A terminal reports when a key is pressed and, while it is held, repeats of it; it does not report the release, in particular over ssh. So a
//!   velocity is kept for [`HOLD_FIRST_NS`] after the first press, since keyboards wait that long before they repeat, and for [`HOLD_REPEAT_NS`]
//!   after each repeat. All axes share one time-out, since a keyboard repeats its last key only.
//! - A [`pad`] has sticks that return to the centre, and a bumper that has to be held to walk: when it is released, the robot stands.
//! - Values set by a [`script`] are kept until they are set again.
//! - A new operator starts from the robot's state: a lying robot keeps lying until STAND is requested. While the robot is damped, nothing is sent:
//!   an emergency stop would become this operator's, and any other mode could clear another operator's ([`OperatorInput::set_robot_mode`]).
//! - When an operator leaves, a walking robot stands; any other mode is kept, so an emergency stop stays in force ([`OperatorInput::leave`]).

pub mod pad;
pub mod script;

use controller::params::Params;
use controller::quadruped::envelope;
use controller::quadruped::params::{FootholdParams, GaitParams, TrunkParams};
use controller::quadruped::robot::Robot;
use lcmtypes::{ControllerTick, OperatorCommand, channels};
use pad::PadState;

/// Default channel of teleoperation: a source of its own beside OPERATOR_COMMAND ([`crate::command_mux`]), so that a person can take over from
/// other operators.
pub const CHANNEL: &str = "OPERATOR_TELEOP";

/// Invalid channel for operator commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// Not a valid name for a run file.
    #[error("invalid channel name, expected 1 to 63 letters, digits, _ and -")]
    Name,
    /// The channel carries another type.
    #[error("channel of {type_name}, expected one for operator commands")]
    Taken {
        /// The type.
        type_name: &'static str,
    },
}

/// Whether a text is a valid channel name of an operator: 1 to 63 letters, digits, `_` and `-`.
pub fn is_channel_name(name: &str) -> bool {
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
    (1..=63).contains(&name.len()) && name.chars().all(is_allowed)
}

/// Checks that operator commands can be sent on a channel.
///
/// # Errors
/// [`ChannelError`]
pub fn check_channel(name: &str) -> Result<(), ChannelError> {
    if !is_channel_name(name) {
        return Err(ChannelError::Name);
    }
    match channels::find(name) {
        Some(other) if name != channels::OPERATOR_COMMAND => Err(ChannelError::Taken { type_name: other.type_name }),
        _ => Ok(()),
    }
}

/// Period of the commands, changed or not, ns.
pub const HEARTBEAT_NS: i64 = 20_000_000;

/// Time for which a velocity is kept after the first press of a key, ns. Keyboards start to repeat after 0.25 to 0.7 s.
pub const HOLD_FIRST_NS: i64 = 800_000_000;
/// Time for which a velocity is kept after each repeat, ns. Keyboards repeat 25 to 30 times a second; a network may delay some repeats.
pub const HOLD_REPEAT_NS: i64 = 300_000_000;

/// Step of a pose per key press, as a fraction of the largest command.
const POSE_STEP: f64 = 0.1;
/// Step of the pace per key press.
const PACE_STEP: f64 = 0.1;

/// Largest commands, in each direction. The controller applies the same limits, and further ones to combinations of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// The gaits, by their number; at least one.
    pub gaits: Vec<GaitLimits>,
    /// Roll and pitch, rad.
    pub orientation: f64,
    /// Height above or below the nominal one, m.
    pub height: f64,
}

/// Name and limits of a gait.
#[derive(Clone, Debug, PartialEq)]
pub struct GaitLimits {
    /// Its name.
    pub name: String,
    /// Speed in the plane, m/s.
    pub speed: f64,
    /// Turning, rad/s.
    pub yaw_rate: f64,
}

/// Default limits, for an unknown robot.
impl Default for Limits {
    fn default() -> Self {
        let FootholdParams { max_speed: speed, max_yaw_rate: yaw_rate, .. } = FootholdParams::default();
        let TrunkParams { max_orientation: orientation, max_height_offset: height, .. } = TrunkParams::default();
        let of_gait = |name: &str| GaitLimits { name: name.to_owned(), speed, yaw_rate };
        Limits { gaits: GaitParams::default().names().map(of_gait).collect(), orientation, height }
    }
}

impl Limits {
    /// Limits of a robot: its parameters, and the length of its steps in each gait. An invalid URDF leaves those of the parameters.
    pub fn of(params: &Params, urdf: &str) -> Self {
        let of_parameters = (params.foothold.max_speed, params.foothold.max_yaw_rate);
        let robot = Robot::new(urdf, &params.robot).ok();
        let of_gait = |name: &str| {
            let found = robot.as_ref().zip(params.gait.named(name));
            let (speed, yaw_rate) = found.map_or(of_parameters, |(robot, gait)| envelope::pace(robot, params, gait));
            GaitLimits { name: name.to_owned(), speed, yaw_rate }
        };
        let (orientation, height) = (params.trunk.max_orientation, params.trunk.max_height_offset);
        Limits { gaits: params.gait.names().map(of_gait).collect(), orientation, height }
    }

    /// The largest of a number of all gaits.
    fn largest(&self, of: fn(&GaitLimits) -> f64) -> f64 {
        self.gaits.iter().map(of).fold(0.0, f64::max)
    }
}

/// Action of a key or button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// Set a velocity.
    Move(Axis, Sign),
    /// Change the pose by one step.
    Pose(Pose, Sign),
    /// Increase or decrease the velocity of later presses.
    Pace(Sign),
    /// Switch to the next gait.
    Gait,
    /// Start or stop walking.
    Walk,
    /// Stand up, or sit down.
    Posture,
    /// Level the base at nominal height. If the robot sits or is stopped: request IDLE (no torque), which clears an emergency stop.
    Reset,
    /// Trigger the emergency stop.
    Stop,
}

/// Axis of a velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Forward.
    Forward = 0,
    /// Left.
    Left = 1,
    /// Turn to the left.
    Turn = 2,
}

/// Coordinate of the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pose {
    /// Rotation about x, positive: left side up.
    Roll,
    /// Rotation about y, positive: nose down.
    Pitch,
    /// Height, positive up.
    Height,
}

/// Direction along an axis or coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Positive.
    Plus,
    /// Negative.
    Minus,
}

impl Sign {
    fn factor(self) -> f64 {
        match self {
            Sign::Plus => 1.0,
            Sign::Minus => -1.0,
        }
    }
}

/// Values set by an operator, and the operator command made from them.
#[derive(Clone, Debug)]
pub struct OperatorInput {
    limits: Limits,
    /// Requested `operator_command_t` MODE_*; `None` until the robot's mode is known and not `DAMPING`, or the operator sets one.
    mode: Option<i8>,
    /// Time of the first command after the mode was requested; `None` before that command.
    t_mode_ns: Option<i64>,
    /// Number of the gait, below that of `limits.gaits`.
    gait: usize,
    /// Forward and left, m/s, and turn, rad/s; zero after `moves_until_ns`.
    moves: [f64; 3],
    moves_until_ns: i64,
    /// The last velocity key.
    last_move: Option<(Axis, Sign)>,
    /// Velocity of a key press as a fraction of the limit.
    pace: f64,
    roll: f64,
    pitch: f64,
    height: f64,
    swing_frequency: f64,
    duty: f64,
    step_height: f64,
    pad: PadState,
    /// Last known mode of the controller.
    robot: Option<i8>,
    seq: i64,
}

impl OperatorInput {
    /// No input yet.
    pub fn new(limits: Limits) -> Self {
        OperatorInput {
            limits,
            mode: None,
            t_mode_ns: None,
            gait: 0,
            moves: [0.0; 3],
            moves_until_ns: i64::MIN,
            last_move: None,
            pace: 0.5,
            roll: 0.0,
            pitch: 0.0,
            height: 0.0,
            swing_frequency: 0.0,
            duty: 0.0,
            step_height: 0.0,
            pad: PadState::default(),
            robot: None,
            seq: 0,
        }
    }

    /// Largest commands.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The present gait and its limits.
    pub fn gait(&self) -> &GaitLimits {
        &self.limits.gaits[self.gait]
    }

    /// Sets the limits, once the robot is known. The gait stays the one of the same name; without one, it is the first.
    pub fn set_limits(&mut self, limits: &Limits) {
        if self.limits != *limits {
            self.gait = limits.gaits.iter().position(|gait| gait.name == self.gait().name).unwrap_or(0);
            self.limits.clone_from(limits);
        }
    }

    /// Velocity of a key press as a fraction of the limit.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// Requested mode, `OperatorCommand::MODE_*`; `None` as long as nothing is sent.
    pub fn mode(&self) -> Option<i8> {
        self.mode
    }

    /// Sets the controller's mode, `ControllerTick::MODE_*`. The first one other than `DAMPING` determines the first request. If the controller
    /// later enters its safe state, a request to walk becomes a request to stand, so that the robot does not walk on by itself afterwards.
    pub fn set_robot_mode(&mut self, robot: i8) {
        let before = self.robot.replace(robot);
        let is_newly_damped = robot == ControllerTick::MODE_DAMPING && before != Some(robot);
        if self.mode.is_none() {
            self.mode = match robot {
                ControllerTick::MODE_IDLE => Some(OperatorCommand::MODE_IDLE),
                ControllerTick::MODE_DAMPING => None,
                ControllerTick::MODE_SIT => Some(OperatorCommand::MODE_SIT),
                _ => Some(OperatorCommand::MODE_STAND),
            };
        } else if is_newly_damped && self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
    }

    /// Applies a key press at `t_ns`.
    ///
    /// # Errors
    /// The reason if the press had no effect.
    pub fn press(&mut self, press: Press, t_ns: i64) -> Result<(), &'static str> {
        use OperatorCommand as Op;
        match (press, self.mode) {
            (Press::Stop, _) => self.set_mode(Op::MODE_DAMPING),
            (Press::Reset, _) if self.is_stopped() => self.set_mode(Op::MODE_IDLE),
            (Press::Reset, Some(Op::MODE_SIT)) => self.set_mode(Op::MODE_IDLE),
            (Press::Reset, _) => (self.roll, self.pitch, self.height) = (0.0, 0.0, 0.0),
            (Press::Walk | Press::Posture | Press::Move(..), _) if self.is_stopped() => {
                return Err("emergency stop in force: r clears it");
            }
            (Press::Walk, Some(Op::MODE_WALK)) => self.set_mode(Op::MODE_STAND),
            (Press::Walk, Some(Op::MODE_STAND)) => self.set_mode(Op::MODE_WALK),
            (Press::Move(axis, sign), Some(Op::MODE_WALK)) => self.steer(axis, sign, t_ns),
            (Press::Move(..), Some(Op::MODE_STAND)) => return Err("not walking: press Space first"),
            (Press::Walk | Press::Move(..), _) => return Err("not standing: press Enter first"),
            (Press::Posture, Some(Op::MODE_STAND)) => self.set_mode(Op::MODE_SIT),
            (Press::Posture, _) => self.set_mode(Op::MODE_STAND),
            (Press::Pose(pose, sign), _) => self.lean(pose, sign),
            (Press::Pace(sign), _) => self.pace = (self.pace + sign.factor() * PACE_STEP).clamp(PACE_STEP, 1.0),
            (Press::Gait, _) => self.gait = (self.gait + 1) % self.limits.gaits.len(),
        }
        Ok(())
    }

    /// Applies the present state of a gamepad.
    ///
    /// # Errors
    /// The reason if a button had no effect.
    pub fn apply_pad(&mut self, now: &PadState, t_ns: i64) -> Result<(), &'static str> {
        let before = std::mem::replace(&mut self.pad, now.clone());
        let mut outcome = Ok(());
        for button in now.pressed_since(&before) {
            outcome = outcome.and(self.press(button, t_ns));
        }
        if now.bumper && !before.bumper {
            if self.mode == Some(OperatorCommand::MODE_STAND) && !self.is_stopped() {
                self.set_mode(OperatorCommand::MODE_WALK);
            } else if self.mode != Some(OperatorCommand::MODE_WALK) {
                outcome = outcome.and(Err("not standing: press Start first"));
            }
        }
        if before.bumper && !now.bumper && self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
        outcome
    }

    /// Ends the input: a walking robot is requested to stand. Any other mode is kept, so an emergency stop is not cleared.
    pub fn leave(&mut self) {
        if self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
        self.moves = [0.0; 3];
        self.pad = PadState::default();
    }

    /// The command to send at `t_ns`, with the next seq; the link sets the sender. `None` while no mode is requested.
    pub fn command(&mut self, t_ns: i64) -> Option<OperatorCommand> {
        let mode = self.mode?;
        let [forward, left, turn] = self.velocities(t_ns);
        let Limits { orientation, .. } = self.limits;
        let lean = if self.pad.bumper { self.pad.pitch * orientation } else { 0.0 };
        let command = OperatorCommand {
            t_ns,
            seq: self.seq,
            sender_id: 0,
            t_mode_ns: *self.t_mode_ns.get_or_insert(t_ns),
            mode,
            gait: i8::try_from(self.gait).unwrap_or(OperatorCommand::GAIT_TROT),
            v_H: [forward, left],
            yaw_rate: turn,
            roll: self.roll,
            pitch: (self.pitch + lean).clamp(-orientation, orientation),
            height_offset: self.height,
            swing_frequency: self.swing_frequency,
            duty: self.duty,
            step_height: self.step_height,
        };
        self.seq += 1;
        Some(command)
    }

    /// Forward and left, m/s, turn, rad/s.
    fn velocities(&self, t_ns: i64) -> [f64; 3] {
        let GaitLimits { speed, yaw_rate, .. } = *self.gait();
        if self.mode != Some(OperatorCommand::MODE_WALK) {
            return [0.0; 3];
        }
        let [mut forward, mut left, turn] = match &self.pad {
            pad if pad.bumper => [pad.forward * speed, pad.left * speed, pad.turn * yaw_rate],
            _ if t_ns > self.moves_until_ns => [0.0; 3],
            _ => self.moves,
        };
        let length = libm::hypot(forward, left);
        if length > speed {
            (forward, left) = (forward / length * speed, left / length * speed);
        }
        [forward, left, turn.clamp(-yaw_rate, yaw_rate)]
    }

    fn steer(&mut self, axis: Axis, sign: Sign, t_ns: i64) {
        let held = t_ns <= self.moves_until_ns;
        if !held {
            self.moves = [0.0; 3];
        }
        let limit = if axis == Axis::Turn { self.gait().yaw_rate } else { self.gait().speed };
        let moves = &mut self.moves[axis as usize];
        // The first press against the present direction stops the axis; the next one reverses it.
        *moves = if *moves * sign.factor() < 0.0 { 0.0 } else { sign.factor() * self.pace * limit };
        let repeats = self.last_move.replace((axis, sign)) == Some((axis, sign)) && held;
        let hold_ns = if repeats { HOLD_REPEAT_NS } else { HOLD_FIRST_NS };
        self.moves_until_ns = self.moves_until_ns.max(t_ns + hold_ns);
    }

    fn lean(&mut self, pose: Pose, sign: Sign) {
        let Limits { orientation, height, .. } = self.limits;
        let (value, limit) = match pose {
            Pose::Roll => (&mut self.roll, orientation),
            Pose::Pitch => (&mut self.pitch, orientation),
            Pose::Height => (&mut self.height, height),
        };
        *value = (*value + sign.factor() * POSE_STEP * limit).clamp(-limit, limit);
    }

    fn set_mode(&mut self, mode: i8) {
        (self.mode, self.t_mode_ns) = (Some(mode), None);
        self.moves = [0.0; 3];
        self.moves_until_ns = i64::MIN;
    }

    /// The joints are damped for any reason, and this operator has not requested to clear it.
    fn is_stopped(&self) -> bool {
        let is_damped = self.robot == Some(ControllerTick::MODE_DAMPING);
        self.mode == Some(OperatorCommand::MODE_DAMPING) || is_damped && self.mode != Some(OperatorCommand::MODE_IDLE)
    }
}

#[cfg(test)]
mod tests;
