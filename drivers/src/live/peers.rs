//! Drivers and other runs on the network of a run: which driver's measurements to use, and whether a second driver or run has appeared.

use crate::robot_info::difference;
use lcmtypes::RobotInfo;
use std::collections::VecDeque;

/// Largest age of a ROBOT_INFO or EXPECTED_ROBOT, ns: an older one is a replayed recording.
const FRESH_NS: i64 = 5_000_000_000;
/// Time for which a driver does not answer EXPECTED_ROBOT beside another one before it counts as ended, ns.
const SILENT_NS: i64 = 300_000_000;
/// Period of EXPECTED_ROBOT, ns: in general, and while it is open whether a driver has ended.
const PERIODS_NS: [i64; 2] = [1_000_000_000, 50_000_000];
/// Peers that are remembered so that each is reported once.
const REPORTED: usize = 64;

/// What a message of a peer shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Finding {
    /// Use the measurements of this driver, its `sender_id`, and of no other.
    Driver(i64),
    /// A driver has another robot; the difference.
    OtherRobot(String),
    /// Two drivers of this robot are running.
    SecondDriver,
    /// Another run is active; whether it started before this one.
    SecondRun {
        /// It started before this one.
        is_earlier: bool,
    },
}

/// The peers of a run.
#[derive(Debug)]
pub struct Peers {
    expected: RobotInfo,
    /// `sender_id` of the driver in use.
    driver: Option<i64>,
    /// Another driver of the robot, and the time of its first message since the last one of `driver`, ns.
    second: Option<(i64, i64)>,
    reported: VecDeque<i64>,
}

impl Peers {
    /// The peers of the run that sends `expected` as its EXPECTED_ROBOT.
    pub fn new(expected: RobotInfo) -> Self {
        Peers { expected, driver: None, second: None, reported: VecDeque::new() }
    }

    /// The run's EXPECTED_ROBOT, sent at `t_ns`.
    pub fn expected(&mut self, t_ns: i64) -> &RobotInfo {
        self.expected.t_ns = t_ns;
        &self.expected
    }

    /// Time between two EXPECTED_ROBOT, ns.
    pub fn period_ns(&self) -> i64 {
        PERIODS_NS[usize::from(self.second.is_some())]
    }

    /// Takes a ROBOT_INFO that arrived at `now_ns`.
    pub fn robot_info(&mut self, info: &RobotInfo, now_ns: i64) -> Option<Finding> {
        if !is_fresh(info, now_ns) {
            return None;
        }
        let id = info.sender_id;
        if let Some(different) = difference(info, &self.expected) {
            return self.is_new(id).then_some(Finding::OtherRobot(different));
        }
        match &self.driver {
            Some(driver) if *driver == id => {
                // It answers after the other one: both are running.
                let (second, _) = self.second.take()?;
                self.is_new(second).then_some(Finding::SecondDriver)
            }
            Some(_) if now_ns.saturating_sub(self.second.get_or_insert((id, now_ns)).1) < SILENT_NS => None,
            _ => {
                (self.driver, self.second) = (Some(id), None);
                Some(Finding::Driver(id))
            }
        }
    }

    /// Takes an EXPECTED_ROBOT that arrived at `now_ns`.
    pub fn expected_robot(&mut self, info: &RobotInfo, now_ns: i64) -> Option<Finding> {
        let mine = (self.expected.t_start_ns, self.expected.sender_id);
        let other = (info.t_start_ns, info.sender_id);
        if mine.1 == other.1 || !is_fresh(info, now_ns) || !self.is_new(info.sender_id) {
            return None;
        }
        Some(Finding::SecondRun { is_earlier: other < mine })
    }

    /// Whether a peer has not been reported.
    fn is_new(&mut self, id: i64) -> bool {
        if self.reported.contains(&id) {
            return false;
        }
        if self.reported.len() == REPORTED {
            self.reported.pop_front();
        }
        self.reported.push_back(id);
        true
    }
}

/// Whether a message was sent recently.
pub fn is_fresh(info: &RobotInfo, now_ns: i64) -> bool {
    now_ns.saturating_sub(info.t_ns).saturating_abs() <= FRESH_NS
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn info(robot: &str, sender_id: i64, t_start_ns: i64, t_ns: i64) -> RobotInfo {
        RobotInfo { t_ns, sender_id, t_start_ns, ..crate::robot_info::robot_info(robot, "", &[], 0) }
    }

    fn peers() -> Peers {
        Peers::new(info("a", 10, 7 * S, 0))
    }

    #[test]
    fn the_driver_of_the_same_robot_is_used_and_another_robot_is_reported_once() {
        let mut peers = peers();
        assert!(matches!(peers.robot_info(&info("b", 1, 0, S), S), Some(Finding::OtherRobot(_))));
        assert_eq!(peers.robot_info(&info("b", 1, 0, S), S), None);
        assert_eq!(peers.robot_info(&info("a", 2, 0, S), 7 * S), None, "a recording");
        assert_eq!(peers.robot_info(&info("a", 2, 0, S), S), Some(Finding::Driver(2)));
        assert_eq!(peers.robot_info(&info("a", 2, 0, 2 * S), 2 * S), None);
    }

    #[test]
    fn a_second_driver_is_found_and_a_restarted_one_is_used() {
        let mut peers = peers();
        peers.robot_info(&info("a", 2, 0, 0), 0);
        assert_eq!(peers.period_ns(), S);
        assert_eq!(peers.robot_info(&info("a", 3, 0, S), S), None, "the first one may have ended");
        assert!(peers.period_ns() < SILENT_NS);
        assert_eq!(peers.robot_info(&info("a", 2, 0, S), S), Some(Finding::SecondDriver));
        assert_eq!(peers.robot_info(&info("a", 3, 0, 2 * S), 2 * S), None);
        let later = 2 * S + SILENT_NS;
        assert_eq!(peers.robot_info(&info("a", 3, 0, later), later), Some(Finding::Driver(3)));
    }

    #[test]
    fn of_two_runs_both_find_the_same_one_to_be_earlier() {
        let (mut one, mut two) = (peers(), Peers::new(info("a", 11, 8 * S, 0)));
        let (of_one, of_two) = (one.expected(9 * S).clone(), two.expected(9 * S).clone());
        assert_eq!(one.expected_robot(&of_two, 9 * S), Some(Finding::SecondRun { is_earlier: false }));
        assert_eq!(two.expected_robot(&of_one, 9 * S), Some(Finding::SecondRun { is_earlier: true }));
        assert_eq!(one.expected_robot(&of_two, 9 * S), None, "once");
        assert_eq!(one.expected_robot(&of_one, 9 * S), None, "its own message");
    }
}
