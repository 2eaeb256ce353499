//! A person's keys, pad or lines of text, made into operator commands.
//!
//! [`Desk`] is what the person's hands have set: pure, with the time given by the caller. [`Desk::command`] is what is to be sent now, and it
//! goes out 50 times a second whether anything has changed or not: silence means that the operator is gone.
//!
//! - A terminal tells when a key goes down and, while it is held, that it goes down again; it never tells when it is let go, least of all over ssh. So
//!   a velocity counts as long as velocity keys keep coming: [`HOLD_FIRST_NS`] from the first, since keyboards wait that long before
//!   they repeat, and [`HOLD_REPEAT_NS`] from each further one. All axes live together, since a keyboard repeats its last key only.
//! - A [`pad`] has sticks that spring back, and a bumper that has to be held: letting go of it stands the robot.
//! - A [`script`] says what it means, and it stays.
//! - Whoever begins takes over what the robot does: one that lies stays lying until it is told to stand up, and to one that is damped nothing is
//!   said, since an emergency stop would be this operator's, and the wish for anything else the end of somebody's ([`Desk::hear`]).
//! - Whoever leaves stands a robot that walks, and otherwise changes nothing ([`Desk::leave`]): a stop stays a stop.

pub mod pad;
pub mod script;

use controller::params::Params;
use controller::quadruped::params::{FootholdParams, TrunkParams};
use lcmtypes::{ControllerTick, OperatorCommand, channels};
use pad::PadState;

/// Where it speaks unless told otherwise. It is a source of its own beside OPERATOR_COMMAND ([`crate::operators`]), so that a person
/// can take over from whatever else commands.
pub const CHANNEL: &str = "OPERATOR_TELEOP";

/// Why no operator can speak on a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChannelError {
    /// Not a name that a run file may hold.
    #[error("a channel is 1 to 63 letters, digits, _ and -")]
    Name,
    /// Something else is said there.
    #[error("{type_name} is sent there, no operator's command")]
    Taken {
        /// What.
        type_name: &'static str,
    },
}

/// Whether an operator can speak on a channel.
///
/// # Errors
/// [`ChannelError`]
pub fn check_channel(name: &str) -> Result<(), ChannelError> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
    if !(1..=63).contains(&name.len()) || !name.chars().all(fits) {
        return Err(ChannelError::Name);
    }
    match channels::find(name) {
        Some(other) if name != channels::OPERATOR_COMMAND => Err(ChannelError::Taken { type_name: other.type_name }),
        _ => Ok(()),
    }
}

/// Time between two commands, changed or not, ns.
pub const HEARTBEAT_NS: i64 = 20_000_000;

/// How long a velocity lives from the first press of a key on, ns. Keyboards begin to repeat after 0.25 to 0.7 s.
pub const HOLD_FIRST_NS: i64 = 800_000_000;
/// How long it lives from each further one on, ns. Keyboards repeat 25 or 30 times a second, and a network may keep some back.
pub const HOLD_REPEAT_NS: i64 = 300_000_000;

/// Parts of the largest command that one press changes a pose by.
const POSE_STEP: f64 = 0.1;
/// The same of the pace.
const PACE_STEP: f64 = 0.1;

/// Largest commands, in each direction. The controller keeps to the same ones by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Speed in the plane, m/s.
    pub speed: f64,
    /// Turning, rad/s.
    pub yaw_rate: f64,
    /// Roll and pitch, rad.
    pub orientation: f64,
    /// Height above or below the nominal one, m.
    pub height: f64,
}

/// Those of a robot that says nothing of its own.
impl Default for Limits {
    fn default() -> Self {
        Limits::from_parts(&FootholdParams::default(), &TrunkParams::default())
    }
}

impl Limits {
    /// Those of a robot.
    pub fn of(params: &Params) -> Self {
        Limits::from_parts(&params.foothold, &params.trunk)
    }

    fn from_parts(foothold: &FootholdParams, trunk: &TrunkParams) -> Self {
        Limits {
            speed: foothold.max_speed,
            yaw_rate: foothold.max_yaw_rate,
            orientation: trunk.max_orientation,
            height: trunk.max_height_offset,
        }
    }
}

/// What a key or a button asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Press {
    /// A velocity: which, and in which direction.
    Move(Axis, Sign),
    /// A step of the pose.
    Pose(Pose, Sign),
    /// Larger or smaller velocities from now on.
    Pace(Sign),
    /// The other gait.
    Gait,
    /// Begins to walk, or stops walking.
    Walk,
    /// Stands up, or sits down.
    Posture,
    /// Level and at nominal height; of a robot that sits or was stopped, no torque: an emergency stop is taken back.
    Reset,
    /// Emergency stop.
    Stop,
}

/// A velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Forward.
    Forward = 0,
    /// To the left.
    Left = 1,
    /// Turning to the left.
    Turn = 2,
}

/// A part of the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pose {
    /// About x: left side up.
    Roll,
    /// About y: nose down.
    Pitch,
    /// Up.
    Height,
}

/// A direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// As the axis is named.
    Plus,
    /// The other way.
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

/// What the person has set.
#[derive(Clone, Debug)]
pub struct Desk {
    limits: Limits,
    /// `None` until the robot's mode is known and is not `DAMPING`, or the person says what it shall be.
    mode: Option<i8>,
    gait: i8,
    /// Forward and left, m/s, turn, rad/s, until `moves_until_ns`.
    moves: [f64; 3],
    moves_until_ns: i64,
    /// The velocity key that came last.
    last_move: Option<(Axis, Sign)>,
    /// Part of the largest velocity that a key stands for.
    pace: f64,
    roll: f64,
    pitch: f64,
    height: f64,
    swing_frequency: f64,
    duty: f64,
    step_height: f64,
    pad: PadState,
    /// The controller's mode, as last heard.
    robot: Option<i8>,
    seq: i64,
}

impl Desk {
    /// A desk that nobody has touched.
    pub fn new(limits: Limits) -> Self {
        Desk {
            limits,
            mode: None,
            gait: OperatorCommand::GAIT_TROT,
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
    pub fn limits(&self) -> Limits {
        self.limits
    }

    /// Takes the limits of a robot that has become known.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Part of the largest velocity that a key stands for.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// The mode that is asked for, `OperatorCommand::MODE_*`; `None` as long as nothing is sent.
    pub fn mode(&self) -> Option<i8> {
        self.mode
    }

    /// Takes the controller's mode, `ControllerTick::MODE_*`. The first one but `DAMPING` says what to begin with; when the robot saves itself
    /// later, it shall not walk on by itself afterwards.
    pub fn hear(&mut self, robot: i8) {
        let before = self.robot.replace(robot);
        let saved = robot == ControllerTick::MODE_DAMPING && before != Some(robot);
        if self.mode.is_none() {
            self.mode = match robot {
                ControllerTick::MODE_IDLE => Some(OperatorCommand::MODE_IDLE),
                ControllerTick::MODE_DAMPING => None,
                ControllerTick::MODE_SIT => Some(OperatorCommand::MODE_SIT),
                _ => Some(OperatorCommand::MODE_STAND),
            };
        } else if saved && self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
    }

    /// Takes a key press at `t_ns`.
    ///
    /// # Errors
    /// Says why nothing came of it.
    pub fn press(&mut self, press: Press, t_ns: i64) -> Result<(), &'static str> {
        use OperatorCommand as Op;
        match (press, self.mode) {
            (Press::Stop, _) => self.set_mode(Op::MODE_DAMPING),
            (Press::Reset, _) if self.is_stopped() => self.set_mode(Op::MODE_IDLE),
            (Press::Reset, Some(Op::MODE_SIT)) => self.set_mode(Op::MODE_IDLE),
            (Press::Reset, _) => (self.roll, self.pitch, self.height) = (0.0, 0.0, 0.0),
            (Press::Walk | Press::Posture | Press::Move(..), _) if self.is_stopped() => {
                return Err("emergency stop: r takes it back");
            }
            (Press::Walk, Some(Op::MODE_WALK)) => self.set_mode(Op::MODE_STAND),
            (Press::Walk, Some(Op::MODE_STAND)) => self.set_mode(Op::MODE_WALK),
            (Press::Move(axis, sign), Some(Op::MODE_WALK)) => self.steer(axis, sign, t_ns),
            (Press::Move(..), Some(Op::MODE_STAND)) => return Err("Space begins to walk"),
            (Press::Walk | Press::Move(..), _) => return Err("the robot has to stand first: Enter"),
            (Press::Posture, Some(Op::MODE_STAND)) => self.set_mode(Op::MODE_SIT),
            (Press::Posture, _) => self.set_mode(Op::MODE_STAND),
            (Press::Pose(pose, sign), _) => self.lean(pose, sign),
            (Press::Pace(sign), _) => self.pace = (self.pace + sign.factor() * PACE_STEP).clamp(PACE_STEP, 1.0),
            (Press::Gait, _) if self.gait == Op::GAIT_TROT => self.gait = Op::GAIT_CRAWL,
            (Press::Gait, _) => self.gait = Op::GAIT_TROT,
        }
        Ok(())
    }

    /// Takes the pad as it is now.
    ///
    /// # Errors
    /// Says why nothing came of a button.
    pub fn hold(&mut self, now: &PadState, t_ns: i64) -> Result<(), &'static str> {
        let before = std::mem::replace(&mut self.pad, now.clone());
        let mut outcome = Ok(());
        for button in now.pressed_since(&before) {
            outcome = outcome.and(self.press(button, t_ns));
        }
        if now.bumper && !before.bumper {
            if self.mode == Some(OperatorCommand::MODE_STAND) && !self.is_stopped() {
                self.set_mode(OperatorCommand::MODE_WALK);
            } else if self.mode != Some(OperatorCommand::MODE_WALK) {
                outcome = outcome.and(Err("the robot has to stand first: Start"));
            }
        }
        if before.bumper && !now.bumper && self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
        outcome
    }

    /// The operator goes: a robot that walks stands. What else it does, it goes on doing; above all an emergency stop is not taken back.
    pub fn leave(&mut self) {
        if self.mode == Some(OperatorCommand::MODE_WALK) {
            self.set_mode(OperatorCommand::MODE_STAND);
        }
        self.moves = [0.0; 3];
        self.pad = PadState::default();
    }

    /// What to send at `t_ns`; `None` while there is nothing to say. Counts the messages.
    pub fn command(&mut self, t_ns: i64) -> Option<OperatorCommand> {
        let mode = self.mode?;
        let [forward, left, turn] = self.velocities(t_ns);
        let Limits { orientation, .. } = self.limits;
        let lean = if self.pad.bumper { self.pad.pitch * orientation } else { 0.0 };
        let command = OperatorCommand {
            t_ns,
            seq: self.seq,
            mode,
            gait: self.gait,
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
        let Limits { speed, yaw_rate, .. } = self.limits;
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
        let limit = if axis == Axis::Turn { self.limits.yaw_rate } else { self.limits.speed };
        let moves = &mut self.moves[axis as usize];
        // Against the way it goes it stops first, and a further press turns it round.
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
        self.mode = Some(mode);
        self.moves = [0.0; 3];
        self.moves_until_ns = i64::MIN;
    }

    /// The joints are damped, whoever wanted it, and nobody has begun to take it back.
    fn is_stopped(&self) -> bool {
        let saved = self.robot == Some(ControllerTick::MODE_DAMPING);
        self.mode == Some(OperatorCommand::MODE_DAMPING) || saved && self.mode != Some(OperatorCommand::MODE_IDLE)
    }
}

#[cfg(test)]
mod tests;
