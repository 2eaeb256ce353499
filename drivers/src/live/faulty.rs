//! A wrapper around any hardware that makes it fail, as the `[[fault]]` lines of a scenario say.
//!
//! What fails here is the way between controller and robot. A command that leaves is the controller's own, bit for bit, or a replay would find
//! another one in the log: drives that fail (`torque_loss`) and feet that are touched (`false_touch`) are the simulator's, and so is the operator of its
//! scenario (`drop_operator`).

use super::Hardware;
use super::clock::{now_ns, sleep_until};
use super::hardware::empty_state;
use crate::fault_injection::{FaultKind, FaultWindow};
use crate::{DriverError, FaultInjection};
use lcmtypes::RobotState;

/// Hardware that fails. The scenario's time begins with the first measurement.
pub struct Faulty {
    inner: Box<dyn Hardware>,
    faults: FaultInjection,
    began_ns: Option<i64>,
    /// As it came, and as it is handed on: a measurement that is lost must not spoil the last one.
    measured: RobotState,
    spoiled: RobotState,
}

impl Faulty {
    /// Whether a fault can happen here.
    pub fn can(kind: &FaultKind) -> bool {
        !matches!(kind, FaultKind::TorqueLoss { .. } | FaultKind::FalseTouch { .. } | FaultKind::DropOperator)
    }

    /// Wraps `inner`, a robot of these actuated joints. What [`Faulty::can`] not happen here has no effect.
    ///
    /// # Errors
    /// A fault that names a joint that the robot lacks.
    pub fn new(inner: Box<dyn Hardware>, faults: &[FaultWindow], joints: &[String]) -> Result<Self, DriverError> {
        Ok(Faulty {
            inner,
            faults: FaultInjection::new(faults, joints)?,
            began_ns: None,
            measured: empty_state(),
            spoiled: empty_state(),
        })
    }

    /// Time of the scenario, ns.
    fn t_ns(&self) -> i64 {
        self.began_ns.map_or(0, |began| now_ns() - began)
    }
}

impl Hardware for Faulty {
    fn receive(&mut self, state: &mut RobotState) -> bool {
        if let (Some(began), Some(end)) = (self.began_ns, self.faults.stands_still_until(self.t_ns())) {
            sleep_until(began + end);
        }
        if !self.inner.receive(&mut self.measured) {
            return false;
        }
        self.began_ns.get_or_insert_with(now_ns);
        self.spoiled.clone_from(&self.measured);
        if !self.faults.on_state(self.t_ns(), &mut self.spoiled) {
            return false;
        }
        std::mem::swap(state, &mut self.spoiled);
        true
    }

    fn send(&mut self, command: &[u8]) {
        if self.faults.command_arrives(self.t_ns()) {
            self.inner.send(command);
        }
    }

    fn is_on_bus(&self) -> bool {
        self.inner.is_on_bus()
    }

    fn unsent(&self) -> u64 {
        self.inner.unsent()
    }
}
