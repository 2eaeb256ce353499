//! Velocity commands of ROS 2, and the operator commands made from them.
//!
//! A Twist has no mode, and stops mean something else than for a person: programs publish zero when they have arrived, or nothing at all. So
//!
//! - a velocity makes a standing robot walk, and zero makes a walking robot stand;
//! - a Twist counts for [`HOLD_NS`]; then the robot is requested to stand for [`FAREWELL_NS`], and after that nothing is sent: the operator times out, and
//!   others may command;
//! - nothing is sent unless the robot stands or walks: a Twist never makes a lying robot stand up, and never clears an emergency stop.

use lcmtypes::{ControllerTick, OperatorCommand};

/// Default channel of the commands: a source of its own, which a run file lists with its priority.
pub const CHANNEL: &str = "OPERATOR_ROS2";
/// Time for which a Twist counts, ns.
pub const HOLD_NS: i64 = 500_000_000;
/// Time for which a robot is requested to stand after the last Twist, ns: ten commands, of which some may be lost.
pub const FAREWELL_NS: i64 = 200_000_000;
/// Largest velocity that is taken, m/s and rad/s: far beyond what any robot follows.
const LARGEST: f64 = 100.0;
/// Length of an encoded Twist: six numbers.
const LENGTH: usize = 48;

/// The part of a `geometry_msgs/Twist` that a robot on the ground follows, in H.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Forward and leftward velocity, m/s.
    pub v_H: [f64; 2],
    /// Heading rate, positive to the left, rad/s.
    pub yaw_rate: f64,
}

impl Twist {
    /// Reads the CDR of a `geometry_msgs/Twist` without its encapsulation header. `None` unless it has six finite numbers, each below 100.
    pub fn from_cdr(bytes: &[u8], little_endian: bool) -> Option<Self> {
        // Encoders may add up to 3 bytes of padding.
        if !(LENGTH..LENGTH + 4).contains(&bytes.len()) {
            return None;
        }
        let mut numbers = [0.0; 6];
        for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
            let bytes: [u8; 8] = bytes.try_into().ok()?;
            *number = if little_endian { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) };
        }
        let [x, y, .., turn] = numbers;
        numbers.iter().all(|n| n.abs() <= LARGEST).then_some(Twist { v_H: [x, y], yaw_rate: turn })
    }

    fn is_zero(&self) -> bool {
        *self == Twist::default()
    }
}

/// The operator that follows velocity commands. It is pure: the caller gives the time.
#[derive(Clone, Debug, Default)]
pub struct TwistOperator {
    /// Last Twist and its time of arrival, ns.
    last: Option<(Twist, i64)>,
    /// Mode of the last command and the time at which it was requested, ns.
    requested: Option<(i8, i64)>,
    seq: i64,
}

impl TwistOperator {
    /// Takes a Twist that arrived at `t_ns`.
    pub fn receive(&mut self, twist: Twist, t_ns: i64) {
        self.last = Some((twist, t_ns));
    }

    /// The command to send at `t_ns`; the caller sets its sender. `None` if no command is due.
    ///
    /// - `robot`: `controller_tick_t` MODE_* of the controller; `None` if it is not known.
    pub fn command(&mut self, t_ns: i64, robot: Option<i8>) -> Option<OperatorCommand> {
        let command = self.wanted(t_ns, robot);
        let Some((mode, twist)) = command else {
            self.requested = None;
            return None;
        };
        let t_mode_ns = self.requested.filter(|(before, _)| *before == mode).map_or(t_ns, |(_, since)| since);
        self.requested = Some((mode, t_mode_ns));
        let seq = self.seq;
        self.seq += 1;
        let Twist { v_H, yaw_rate } = twist;
        Some(OperatorCommand { t_ns, seq, t_mode_ns, mode, v_H, yaw_rate, ..OperatorCommand::default() })
    }

    /// Mode and velocity.
    fn wanted(&mut self, t_ns: i64, robot: Option<i8>) -> Option<(i8, Twist)> {
        let is_on_its_feet = matches!(robot, Some(ControllerTick::MODE_STANCE | ControllerTick::MODE_WALK));
        let (twist, arrived) = self.last.filter(|_| is_on_its_feet)?;
        let age = t_ns.saturating_sub(arrived);
        if age <= HOLD_NS && !twist.is_zero() {
            return Some((OperatorCommand::MODE_WALK, twist));
        }
        if age <= HOLD_NS + FAREWELL_NS {
            return Some((OperatorCommand::MODE_STAND, Twist::default()));
        }
        self.last = None;
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn encoded(numbers: [f64; 6]) -> Vec<u8> {
        numbers.into_iter().flat_map(f64::to_le_bytes).collect()
    }

    #[test]
    fn a_twist_has_six_finite_numbers() {
        let bytes = encoded([0.2, -0.1, 9.0, 8.0, 7.0, 0.3]);
        let expected = Twist { v_H: [0.2, -0.1], yaw_rate: 0.3 };
        assert_eq!(Twist::from_cdr(&bytes, true), Some(expected));
        let swapped: Vec<u8> = bytes.chunks(8).flat_map(|n| n.iter().rev().copied()).collect();
        assert_eq!(Twist::from_cdr(&swapped, false), Some(expected));
        for length in 0..48 {
            assert_eq!(Twist::from_cdr(&bytes[..length], true), None, "{length}");
        }
        assert_eq!(Twist::from_cdr(&[&bytes[..], &[0; 4]].concat(), true), None);
        for k in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 101.0] {
                let mut numbers = [0.1; 6];
                numbers[k] = bad;
                assert_eq!(Twist::from_cdr(&encoded(numbers), true), None, "{k}: {bad}");
            }
        }
    }

    #[test]
    fn a_velocity_makes_the_robot_walk_and_its_end_makes_it_stand() {
        let forward = Twist { v_H: [0.2, 0.0], yaw_rate: 0.1 };
        let mut operator = TwistOperator::default();
        let (stance, walk) = (Some(ControllerTick::MODE_STANCE), Some(ControllerTick::MODE_WALK));
        assert_eq!(operator.command(0, stance), None, "no Twist yet");
        operator.receive(forward, 10 * MS);
        let first = operator.command(20 * MS, stance).unwrap();
        assert_eq!((first.mode, first.seq, first.t_mode_ns), (OperatorCommand::MODE_WALK, 0, 20 * MS));
        assert_eq!((first.v_H, first.yaw_rate), ([0.2, 0.0], 0.1));
        let held = operator.command(510 * MS, walk).unwrap();
        assert_eq!((held.mode, held.seq, held.t_mode_ns), (OperatorCommand::MODE_WALK, 1, 20 * MS));
        let stand = operator.command(510 * MS + 1, walk).unwrap();
        assert_eq!((stand.mode, stand.v_H, stand.yaw_rate), (OperatorCommand::MODE_STAND, [0.0; 2], 0.0));
        assert_eq!(operator.command(710 * MS, walk).unwrap().mode, OperatorCommand::MODE_STAND);
        assert_eq!(operator.command(710 * MS + 1, walk), None);
        operator.receive(Twist::default(), 800 * MS);
        assert_eq!(operator.command(800 * MS, walk).unwrap().mode, OperatorCommand::MODE_STAND, "zero");
    }

    #[test]
    fn a_robot_that_neither_stands_nor_walks_gets_no_command() {
        for mode in [
            ControllerTick::MODE_IDLE,
            ControllerTick::MODE_DAMPING,
            ControllerTick::MODE_STAND_UP,
            ControllerTick::MODE_SIT,
            77,
        ] {
            let mut operator = TwistOperator::default();
            operator.receive(Twist { v_H: [0.2, 0.0], yaw_rate: 0.0 }, 0);
            assert_eq!((operator.command(0, Some(mode)), operator.command(0, None)), (None, None), "{mode}");
        }
    }
}
