//! Decides which ROBOT_COMMAND a driver executes: those of one run on this robot, from one sender, with values within the joints' ranges.

use super::joint_range::JointRange;
use crate::robot_info::difference;
use lcmtypes::{Message, RobotCommand, RobotInfo};
use std::collections::VecDeque;
use std::net::SocketAddrV4;

/// Time without a command after which another run may command the robot, ns.
const RELEASE_NS: i64 = 200_000_000;
/// Shortest time between two reports of refused messages, ns.
const REPORT_EVERY_NS: i64 = 1_000_000_000;
/// Runs that are remembered.
const RUNS: usize = 16;
/// Why a message is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// It cannot be decoded.
    NotDecoded,
    /// No EXPECTED_ROBOT of its run has been received.
    UnknownRun,
    /// Its run controls another robot.
    OtherRobot,
    /// Another run commands the robot.
    OtherRun,
    /// It has the identity of the run but comes from another address.
    OtherSender,
    /// Its tick is not later than the last one.
    OldTick,
    /// A value is out of range.
    OutOfRange,
}

impl Refused {
    const ALL: [Refused; 7] = [
        Refused::NotDecoded,
        Refused::UnknownRun,
        Refused::OtherRobot,
        Refused::OtherRun,
        Refused::OtherSender,
        Refused::OldTick,
        Refused::OutOfRange,
    ];

    fn text(self) -> &'static str {
        match self {
            Refused::NotDecoded => "cannot be decoded",
            Refused::UnknownRun => "of a run without EXPECTED_ROBOT",
            Refused::OtherRobot => "of a run with another robot",
            Refused::OtherRun => "of another run",
            Refused::OtherSender => "of another sender with the run's identity",
            Refused::OldTick => "with an old tick",
            Refused::OutOfRange => "out of range",
        }
    }
}

/// The run that commands the robot.
#[derive(Clone, Copy, Debug)]
struct Obeyed {
    run_id: i64,
    from: SocketAddrV4,
    tick: i64,
    arrival_ns: i64,
}

/// Accepts or refuses commands.
pub struct CommandGate {
    joints: Vec<JointRange>,
    robot: RobotInfo,
    /// Identity of each known run, and whether it controls this robot; oldest first.
    runs: VecDeque<(i64, bool)>,
    obeyed: Option<Obeyed>,
    /// Decoding buffer.
    received: RobotCommand,
    counts: [u64; Refused::ALL.len()],
    reported: [u64; Refused::ALL.len()],
    report_due_ns: i64,
    /// The last value out of range.
    range: String,
}

impl CommandGate {
    /// A gate for a robot with these actuated joints, in URDF order.
    pub fn new(joints: Vec<JointRange>, robot: RobotInfo) -> Self {
        let (counts, reported) = Default::default();
        CommandGate {
            joints,
            robot,
            runs: VecDeque::new(),
            obeyed: None,
            received: RobotCommand::default(),
            counts,
            reported,
            report_due_ns: i64::MIN,
            range: String::new(),
        }
    }

    /// Takes an EXPECTED_ROBOT. For a new run with another robot it returns the difference, as a sentence.
    pub fn expect(&mut self, expected: &RobotInfo) -> Option<String> {
        let different = difference(&self.robot, expected);
        if self.runs.iter().any(|run| *run == (expected.sender_id, different.is_none())) {
            return None;
        }
        self.runs.retain(|(run_id, _)| *run_id != expected.sender_id);
        if self.runs.len() == RUNS {
            self.runs.pop_front();
        }
        self.runs.push_back((expected.sender_id, different.is_none()));
        different
    }

    /// Takes a ROBOT_COMMAND that arrived at `now_ns`, and writes it into `command` if it is accepted.
    ///
    /// # Errors
    /// Why it is refused; it is counted.
    pub fn take(
        &mut self,
        from: SocketAddrV4,
        data: &[u8],
        now_ns: i64,
        command: &mut RobotCommand,
    ) -> Result<(), Refused> {
        let checked = self.check(from, data, now_ns);
        match checked {
            Ok(obeyed) => {
                self.obeyed = Some(obeyed);
                std::mem::swap(command, &mut self.received);
                Ok(())
            }
            Err(why) => {
                self.counts[why as usize] += 1;
                Err(why)
            }
        }
    }

    /// Commands refused so far.
    pub fn refused(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Sentence about the messages refused since the last report; at most one in a second.
    pub fn report(&mut self, now_ns: i64) -> Option<String> {
        if self.counts == self.reported || now_ns < self.report_due_ns {
            return None;
        }
        self.report_due_ns = now_ns.saturating_add(REPORT_EVERY_NS);
        let new = Refused::ALL.map(|why| (why, self.counts[why as usize] - self.reported[why as usize]));
        self.reported = self.counts;
        let parts: Vec<String> = new
            .iter()
            .filter(|(_, count)| *count > 0)
            .map(|(why, count)| match why {
                Refused::OutOfRange => format!("{count} out of range ({})", self.range),
                why => format!("{count} {}", why.text()),
            })
            .collect();
        Some(format!("ROBOT_COMMAND refused: {}", parts.join(", ")))
    }

    fn check(&mut self, from: SocketAddrV4, data: &[u8], now_ns: i64) -> Result<Obeyed, Refused> {
        self.received.decode_into(data).map_err(|_| Refused::NotDecoded)?;
        let RobotCommand { run_id, tick, .. } = self.received;
        let obeyed = self.obeyed.filter(|obeyed| now_ns.saturating_sub(obeyed.arrival_ns) <= RELEASE_NS);
        match obeyed {
            Some(obeyed) if obeyed.run_id != run_id => return Err(Refused::OtherRun),
            Some(obeyed) if obeyed.from != from => return Err(Refused::OtherSender),
            Some(obeyed) if tick <= obeyed.tick => return Err(Refused::OldTick),
            Some(_) => {}
            None => match self.runs.iter().find(|(known, _)| *known == run_id) {
                Some((_, true)) => {}
                Some((_, false)) => return Err(Refused::OtherRobot),
                None => return Err(Refused::UnknownRun),
            },
        }
        if let Some(range) = self.out_of_range() {
            self.range = range;
            return Err(Refused::OutOfRange);
        }
        Ok(Obeyed { run_id, from, tick, arrival_ns: now_ns })
    }

    /// The first value of the received command that is out of range, with its limits.
    fn out_of_range(&self) -> Option<String> {
        let RobotCommand { mode, tau, .. } = &self.received;
        if !(RobotCommand::MODE_IDLE..=RobotCommand::MODE_DAMPING).contains(mode) {
            return Some(format!("mode {mode}, expected 0 to 2"));
        }
        if tau.len() != self.joints.len() {
            return Some(format!("{} joints, expected {}", tau.len(), self.joints.len()));
        }
        self.joints.iter().enumerate().find_map(|(j, joint)| joint.check(j, &self.received))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use controller::params::Params;
    use robot_model::{JointInfo, JointKind};
    use std::net::Ipv4Addr;

    const MS: i64 = 1_000_000;

    fn address(port: u16) -> SocketAddrV4 {
        SocketAddrV4::new(Ipv4Addr::LOCALHOST, port)
    }

    fn robot(name: &str, sender_id: i64) -> RobotInfo {
        crate::robot_info::robot_info(name, "<robot/>", &["knee".to_owned()], sender_id)
    }

    fn gate() -> CommandGate {
        let knee = JointInfo {
            name: "knee".to_owned(),
            kind: JointKind::Revolute,
            lower: -2.0,
            upper: -0.5,
            effort: 10.0,
            velocity: 20.0,
            damping: 0.0,
            drive: robot_model::DriveLimits::default(),
        };
        let params = Params::from_toml(include_str!("../../../robots/hyq/hyq.toml"), "hyq.toml").unwrap();
        let mut gate = CommandGate::new(JointRange::of(&[knee], &[], &params), robot("a", 1));
        assert_eq!(gate.expect(&robot("a", 5)), None);
        assert_eq!(gate.expect(&robot("a", 6)), None);
        gate
    }

    fn command(run_id: i64, tick: i64) -> RobotCommand {
        RobotCommand { run_id, tick, mode: RobotCommand::MODE_TORQUE, ..RobotCommand::zeros(1) }
    }

    fn take(gate: &mut CommandGate, port: u16, ms: i64, command: &RobotCommand) -> Result<i64, Refused> {
        let (mut bytes, mut out) = (Vec::new(), RobotCommand::default());
        command.encode(&mut bytes).unwrap();
        gate.take(address(port), &bytes, ms * MS, &mut out).map(|()| out.tick)
    }

    #[test]
    fn one_run_from_one_sender_is_obeyed_until_it_has_timed_out() {
        let mut gate = gate();
        assert_eq!(take(&mut gate, 1, 0, &command(9, 0)), Err(Refused::UnknownRun));
        assert_eq!(take(&mut gate, 1, 0, &command(5, 0)), Ok(0));
        assert_eq!(take(&mut gate, 2, 1, &command(6, 8)), Err(Refused::OtherRun));
        assert_eq!(take(&mut gate, 2, 1, &command(5, 1)), Err(Refused::OtherSender));
        assert_eq!(take(&mut gate, 1, 1, &command(5, 0)), Err(Refused::OldTick));
        assert_eq!(take(&mut gate, 1, 2, &command(5, 1)), Ok(1));
        assert_eq!(take(&mut gate, 2, 202, &command(6, 8)), Err(Refused::OtherRun));
        assert_eq!(take(&mut gate, 2, 203, &command(6, 8)), Ok(8));
        assert_eq!(gate.refused(), 5);
    }

    #[test]
    fn a_run_with_another_robot_is_refused() {
        let mut gate = gate();
        assert!(gate.expect(&robot("b", 7)).is_some_and(|text| text.contains('a') && text.contains('b')));
        assert_eq!(gate.expect(&robot("b", 7)), None, "reported once");
        assert_eq!(take(&mut gate, 1, 0, &command(7, 0)), Err(Refused::OtherRobot));
    }

    #[test]
    fn values_out_of_range_are_refused_and_named() {
        let good = RobotCommand { tau: vec![60.0], kp: vec![10.0], kd: vec![5.0], q_des: vec![-1.0], ..command(5, 0) };
        let one = |value: f64| vec![value];
        for (bad, named) in [
            (RobotCommand { kd: one(-1e6), ..good.clone() }, "kd of knee"),
            (RobotCommand { kp: one(1e308), ..good.clone() }, "kp of knee"),
            (RobotCommand { kp: one(f64::NAN), ..good.clone() }, "kp of knee"),
            (RobotCommand { tau: one(2000.0), ..good.clone() }, "tau of knee"),
            (RobotCommand { q_des: one(1.0), ..good.clone() }, "q_des of knee"),
            (RobotCommand { qd_des: one(f64::INFINITY), ..good.clone() }, "qd_des of knee"),
            (RobotCommand { mode: 99, ..good.clone() }, "mode 99"),
            (RobotCommand { run_id: 5, ..RobotCommand::zeros(3) }, "3 joints"),
        ] {
            let mut gate = gate();
            assert_eq!(take(&mut gate, 1, 0, &bad), Err(Refused::OutOfRange), "{named}");
            let report = gate.report(0).unwrap();
            assert!(report.contains(named), "{report}");
        }
        assert_eq!(take(&mut gate(), 1, 0, &good), Ok(0));
    }

    #[test]
    fn refused_messages_are_counted_and_reported_once_a_second() {
        let (mut gate, mut out) = (gate(), RobotCommand::default());
        assert_eq!(gate.report(0), None);
        for _ in 0..3 {
            assert_eq!(gate.take(address(1), &[0; 50], 0, &mut out), Err(Refused::NotDecoded));
        }
        assert!(gate.report(0).is_some_and(|text| text.contains("3 cannot be decoded")));
        assert_eq!(gate.take(address(1), &[], MS, &mut out), Err(Refused::NotDecoded));
        assert_eq!(gate.report(MS), None);
        assert!(gate.report(1000 * MS).is_some_and(|text| text.contains("1 cannot be decoded")));
        assert_eq!(gate.report(3000 * MS), None);
    }
}
