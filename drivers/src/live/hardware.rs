//! The robot as the executor uses it.

use super::clock::now_ns;
use super::socket::{LcmReceiver, LcmSender};
use crate::DriverError;
use controller::runtime::empty_state;
use lcmtypes::{Message, RobotState, channels};
use replay::udpm::Url;
use std::net::SocketAddrV4;

/// A robot, real or simulated. It is opened before the real-time thread starts. All methods are called from the real-time thread only: they must
/// not allocate or lock, and the only system calls are those of its own sockets.
pub trait Hardware: Send {
    /// Writes the newest measurement into `state`; false, and `state` unchanged, if none arrived since the last call.
    fn receive(&mut self, state: &mut RobotState) -> bool;

    /// Sends an encoded ROBOT_COMMAND.
    fn send(&mut self, command: &[u8]);

    /// Uses the measurements of this driver only, by its `sender_id`; of none for `None`.
    fn listen_to(&mut self, _driver: Option<i64>) {}

    /// Measurements that were not used: undecodable, of other senders, or of a driver whose robot is not known.
    fn refused(&self) -> u64 {
        0
    }

    /// Whether commands are sent over LCM; the publisher publishes them otherwise.
    fn is_on_bus(&self) -> bool {
        false
    }

    /// Commands that could not be sent.
    fn unsent(&self) -> u64 {
        0
    }
}

/// No robot: joints at rest in a posture, IMU upright. For tests of the executor and measurements of its jitter.
pub struct Dummy {
    state: RobotState,
}

impl Dummy {
    /// A robot with joint positions `q`, rad.
    pub fn new(q: Vec<f64>) -> Self {
        Dummy { state: RobotState { seq: -1, q: q.clone(), ..RobotState::zeros(q.len(), 1, 0) } }
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

/// Drivers whose measurements are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Driver {
    Any,
    None,
    Only(i64),
}

/// Any driver process that sends ROBOT_STATE and applies ROBOT_COMMAND, over LCM.
///
/// The real-time thread reads the socket itself: no other thread has to run between a measurement and the command.
pub struct LcmRobot {
    states: LcmReceiver,
    commands: LcmSender,
    /// Decoding buffer.
    received: RobotState,
    driver: Driver,
    /// Address of the driver, after its first measurement.
    address: Option<SocketAddrV4>,
    refused: u64,
    unsent: u64,
}

impl LcmRobot {
    /// Joins an LCM network. Until [`Hardware::listen_to`] is called, the measurements of any driver are used.
    ///
    /// # Errors
    /// If the network cannot be joined.
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        let (states, commands) = (LcmReceiver::open(url)?, LcmSender::open(url)?);
        let (driver, address) = (Driver::Any, None);
        Ok(LcmRobot { states, commands, received: empty_state(), driver, address, refused: 0, unsent: 0 })
    }
}

impl Hardware for LcmRobot {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        let LcmRobot { states, received, driver, address, refused, .. } = self;
        let mut is_new = false;
        states.receive(|from, channel, data| {
            if channel == channels::ROBOT_STATE {
                let is_decoded = received.decode_into(data).is_ok();
                let is_driver = match *driver {
                    Driver::Any => true,
                    Driver::None => false,
                    Driver::Only(id) => received.sender_id == id && address.is_none_or(|address| address == from),
                };
                if !is_decoded || !is_driver {
                    *refused += 1;
                    return;
                }
                *address = Some(from);
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

    fn listen_to(&mut self, driver: Option<i64>) {
        let driver = driver.map_or(Driver::None, Driver::Only);
        if driver != self.driver {
            (self.driver, self.address) = (driver, None);
        }
    }

    fn refused(&self) -> u64 {
        self.refused
    }

    fn is_on_bus(&self) -> bool {
        true
    }

    fn unsent(&self) -> u64 {
        self.unsent
    }
}
