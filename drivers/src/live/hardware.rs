//! The robot as the executor uses it.

use super::clock::now_ns;
use super::socket::{LcmReceiver, LcmSender};
use crate::DriverError;
use lcmtypes::{Message, RobotState, channels};
use replay::udpm::Url;

/// A robot, real or simulated. It is opened before the real-time thread starts. All methods are called from the real-time thread only: they must
/// not allocate or lock, and the only system calls are those of its own sockets.
pub trait Hardware: Send {
    /// Writes the newest measurement into `state`; false, and `state` unchanged, if none arrived since the last call.
    fn receive(&mut self, state: &mut RobotState) -> bool;

    /// Sends an encoded ROBOT_COMMAND.
    fn send(&mut self, command: &[u8]);

    /// Whether commands are sent over LCM; the publisher publishes them otherwise.
    fn is_on_bus(&self) -> bool {
        false
    }

    /// Commands that could not be sent.
    fn unsent(&self) -> u64 {
        0
    }
}

/// Joints for which memory is allocated in advance. A robot with more joints causes allocations in its first ticks.
const JOINTS: usize = 64;

/// A state without joints, with memory allocated for them.
pub fn empty_state() -> RobotState {
    let room = || Vec::with_capacity(JOINTS);
    RobotState { q: room(), qd: room(), tau: room(), ..RobotState::default() }
}

/// No robot: joints at rest in a posture, IMU upright. For tests of the executor and measurements of its jitter.
pub struct Dummy {
    state: RobotState,
}

impl Dummy {
    /// A robot with joint positions `q`, rad.
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

/// If a measurement is older than the one before it by more than this, the driver's clock was reset, ns.
const CLOCK_RESET_NS: i64 = 1_000_000_000;

/// Any driver process that sends ROBOT_STATE and applies ROBOT_COMMAND, over LCM.
///
/// The real-time thread reads the socket itself: no other thread has to run between a measurement and the command.
pub struct LcmRobot {
    states: LcmReceiver,
    commands: LcmSender,
    /// Decoding buffer.
    received: RobotState,
    unsent: u64,
}

impl LcmRobot {
    /// Joins an LCM network.
    ///
    /// # Errors
    /// If the network cannot be joined.
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        let (states, commands) = (LcmReceiver::open(url)?, LcmSender::open(url)?);
        Ok(LcmRobot { states, commands, received: empty_state(), unsent: 0 })
    }
}

impl Hardware for LcmRobot {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        let (mut is_new, received) = (false, &mut self.received);
        self.states.receive(|channel, data| {
            if channel == channels::ROBOT_STATE && received.decode_into(data).is_ok() {
                let newer_ns = received.t_ns.saturating_sub(state.t_ns);
                if !(-CLOCK_RESET_NS..=0).contains(&newer_ns) {
                    std::mem::swap(state, received);
                    is_new = true;
                }
            }
        });
        is_new
    }

    fn send(&mut self, command: &[u8]) {
        // A failure is only counted: the driver's watchdog damps when commands time out.
        self.unsent += u64::from(!self.commands.send(channels::ROBOT_COMMAND, command));
    }

    fn is_on_bus(&self) -> bool {
        true
    }

    fn unsent(&self) -> u64 {
        self.unsent
    }
}
