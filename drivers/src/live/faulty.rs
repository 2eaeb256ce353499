//! Hardware with injected faults: a wrapper that applies the `[[fault]]` entries of a scenario.
//!
//! The faults are those of the connection between controller and robot. The commands in the log stay those of the controller, bit for bit, as a
//! replay requires. Faults of the drives (`torque_loss`), of the feet (`false_touch`) and of the scenario's operator (`drop_operator`) are
//! injected in the simulator.

use super::Hardware;
use super::clock::{now_ns, sleep_until};
use crate::fault_injection::{FaultKind, FaultWindow};
use crate::{DriverError, FaultInjection};
use controller::runtime::empty_state;
use lcmtypes::RobotState;

/// Hardware with injected faults. The scenario's time starts with the first measurement.
pub struct Faulty {
    inner: Box<dyn Hardware>,
    faults: FaultInjection,
    start_ns: Option<i64>,
    /// Last measurement as received, and with faults. Two buffers, so that a dropped measurement does not change the one passed on before.
    measured: RobotState,
    faulty: RobotState,
}

impl Faulty {
    /// Whether a kind of fault can be injected here; the others are injected in the simulator.
    pub fn supports(kind: &FaultKind) -> bool {
        !matches!(kind, FaultKind::TorqueLoss { .. } | FaultKind::FalseTouch { .. } | FaultKind::DropOperator)
    }

    /// Wraps `inner`, a robot with these actuated joints. Faults that are not supported ([`Faulty::supports`]) have no effect.
    ///
    /// # Errors
    /// If a fault names a joint that the robot does not have.
    pub fn new(inner: Box<dyn Hardware>, faults: &[FaultWindow], joints: &[String]) -> Result<Self, DriverError> {
        Ok(Faulty {
            inner,
            faults: FaultInjection::new(faults, joints)?,
            start_ns: None,
            measured: empty_state(),
            faulty: empty_state(),
        })
    }

    /// Time of the scenario, ns.
    fn t_ns(&self) -> i64 {
        self.start_ns.map_or(0, |start| now_ns() - start)
    }
}

impl Hardware for Faulty {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        if let (Some(start), Some(end)) = (self.start_ns, self.faults.paused_until(self.t_ns())) {
            sleep_until(start + end);
        }
        if !self.inner.receive(&mut self.measured) {
            return false;
        }
        self.start_ns.get_or_insert_with(now_ns);
        self.faulty.clone_from(&self.measured);
        if !self.faults.on_state(self.t_ns(), &mut self.faulty) {
            return false;
        }
        std::mem::swap(state, &mut self.faulty);
        true
    }

    fn send(&mut self, command: &[u8]) {
        if self.faults.command_arrives(self.t_ns()) {
            self.inner.send(command);
        }
    }

    fn listen_to(&mut self, driver: Option<i64>) {
        self.inner.listen_to(driver);
    }

    fn refused(&self) -> u64 {
        self.inner.refused()
    }

    fn is_on_bus(&self) -> bool {
        self.inner.is_on_bus()
    }

    fn unsent(&self) -> u64 {
        self.inner.unsent()
    }
}
