//! The robot as the executor sees it.

use super::clock::now_ns;
use super::socket::{Ear, Speaker};
use crate::DriverError;
use lcmtypes::{Message, RobotState, channels};
use replay::udpm::Url;

/// A robot, real or simulated. To make one is to open it, off the real-time thread; what follows is called from the real-time thread alone:
/// no allocation, no lock, and no system call but its own sockets.
pub trait Hardware: Send {
    /// Takes over the newest measurement, if one came since the last call.
    fn receive(&mut self, state: &mut RobotState) -> bool;

    /// Hands a command on: an encoded ROBOT_COMMAND.
    fn send(&mut self, command: &[u8]);

    /// Commands go over the bus already, so nobody else needs to publish them.
    fn is_on_bus(&self) -> bool {
        false
    }

    /// Commands that could not be sent.
    fn unsent(&self) -> u64 {
        0
    }
}

/// Joints for which there is memory from the beginning; a robot with more costs some allocations in its first ticks.
const JOINTS: usize = 64;

/// A state without joints, and with room for them.
pub fn empty_state() -> RobotState {
    let room = || Vec::with_capacity(JOINTS);
    RobotState { q: room(), qd: room(), tau: room(), ..RobotState::default() }
}

/// No robot: joints at rest in a posture, IMU upright. For trying an executor and measuring its jitter.
pub struct Dummy {
    state: RobotState,
}

impl Dummy {
    /// A robot whose joints stand at `q`, rad.
    pub fn new(q: Vec<f64>) -> Self {
        let nj = q.len();
        let mut state = RobotState { seq: -1, q, qd: vec![0.0; nj], tau: vec![0.0; nj], ..RobotState::default() };
        state.nj = i32::try_from(nj).expect("robots have fewer than 2^31 joints");
        (state.q_WI_wxyz, state.a_I) = ([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 9.81]);
        Dummy { state }
    }
}

impl Hardware for Dummy {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        (self.state.t_ns, self.state.seq) = (now_ns(), self.state.seq + 1);
        state.clone_from(&self.state);
        true
    }

    fn send(&mut self, _: &[u8]) {}
}

/// A measurement that is older by more than this than the one before it comes from a driver whose clock began anew, ns.
const CLOCK_BEGAN_ANEW_NS: i64 = 1_000_000_000;

/// Any driver process that sends ROBOT_STATE and obeys ROBOT_COMMAND, over LCM.
///
/// The real-time thread reads the network itself: no other thread has to be awake between a measurement and the command.
pub struct LcmRobot {
    states: Ear,
    commands: Speaker,
    heard: RobotState,
    unsent: u64,
}

impl LcmRobot {
    /// Joins a network.
    ///
    /// # Errors
    /// If it cannot be joined.
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        let (states, commands) = (Ear::open(url)?, Speaker::open(url)?);
        Ok(LcmRobot { states, commands, heard: empty_state(), unsent: 0 })
    }
}

impl Hardware for LcmRobot {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        let (mut taken, heard) = (false, &mut self.heard);
        self.states.hear(|channel, data| {
            if channel == channels::ROBOT_STATE && heard.decode_into(data).is_ok() {
                let younger_ns = heard.t_ns.saturating_sub(state.t_ns);
                if !(-CLOCK_BEGAN_ANEW_NS..=0).contains(&younger_ns) {
                    std::mem::swap(state, heard);
                    taken = true;
                }
            }
        });
        taken
    }

    fn send(&mut self, command: &[u8]) {
        // Nothing can be done about it in a tick; the driver's own watchdog acts when commands stay away.
        self.unsent += u64::from(!self.commands.say(channels::ROBOT_COMMAND, command));
    }

    fn is_on_bus(&self) -> bool {
        true
    }

    fn unsent(&self) -> u64 {
        self.unsent
    }
}
