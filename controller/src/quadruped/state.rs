//! The state that the controller keeps between two ticks.

use super::fields::{self, Field, Part, enum_field, state_fields};
use super::leg::{Leg, LegPhase, PerLeg};
use super::params::Gait;
use crate::digest::Digest;
use crate::dump::{Group, Value};
use crate::error::RestoreError;
use crate::safety::Fault;
use lcmtypes::{QuadrupedState, RobotState, enum_names};
use nalgebra::Vector3;

/// Mode of the controller. The transitions are in [`super::modes`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// No torque: before the first valid input, or on request of the operator.
    #[default]
    Idle,
    /// Stands on all feet.
    Stance,
    /// Walks, or finishes the last steps of a walk.
    Walk,
    /// Safe state: the joints are damped, and no other torque acts.
    Damping,
    /// Stands up from the ground.
    StandUp,
    /// Sits down, and then lies.
    Sit,
}

impl Mode {
    /// All modes, by their number in `controller_tick_t`.
    pub const ALL: [Mode; 6] = [Mode::Idle, Mode::Stance, Mode::Walk, Mode::Damping, Mode::StandUp, Mode::Sit];

    /// Name as in events: `IDLE`, `STANCE`, `WALK`, `DAMPING`, `STAND_UP`, `SIT`.
    pub fn name(self) -> &'static str {
        enum_names::mode(self as i8)
    }
}

/// A snapshot may contain any number: [`super::params::GaitParams::gait`] checks it against the parameters.
impl Field for Gait {
    type Message = i8;

    #[inline(always)]
    fn to_message(self) -> i8 {
        self.number()
    }

    fn from_message(field: &'static str, message: i8) -> Result<Self, RestoreError> {
        let number = u8::try_from(message).map_err(|_| RestoreError::Value {
            field,
            found: message.into(),
            last: i8::MAX.into(),
        })?;
        Ok(Gait::numbered(number))
    }

    fn all(self, _: fn(f64) -> bool) -> bool {
        true
    }

    #[inline(always)]
    fn digest(self, digest: &mut Digest) {
        digest.word(u64::from(self.number().cast_unsigned()));
    }

    fn value(self) -> Value {
        i32::from(self.number()).into()
    }

    #[cfg(test)]
    fn example(n: u8) -> Self {
        Gait::numbered(1 + n % 100)
    }
}

/// Gait timing commanded by the operator. 0 = the value of the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cadence {
    /// Swing frequency, Hz.
    pub swing_frequency: f64,
    /// Duty factor.
    pub duty: f64,
}

/// Phase of standing up or sitting down. The transitions are in [`super::stand_sit`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MovePhase {
    /// The robot neither stands up nor sits down.
    #[default]
    None,
    /// The legs fold under the trunk, from their present posture.
    Gather,
    /// The feet push the trunk up.
    Rise,
    /// The feet lower the trunk.
    Lower,
    /// The legs move from the folded to the lying posture.
    Spread,
    /// The joint stiffness decreases to zero.
    Release,
    /// The robot lies; the joints are damped.
    Lie,
}

impl MovePhase {
    /// All phases, by their number in `quadruped_state_t`.
    pub const ALL: [MovePhase; 7] = [
        MovePhase::None,
        MovePhase::Gather,
        MovePhase::Rise,
        MovePhase::Lower,
        MovePhase::Spread,
        MovePhase::Release,
        MovePhase::Lie,
    ];

    /// Name, as in dumps.
    pub fn name(self) -> &'static str {
        ["None", "Gather", "Rise", "Lower", "Spread", "Release", "Lie"][self as usize]
    }
}

enum_field! {
    Mode, mode => mode.name();
    LegPhase, phase => phase.name();
    MovePhase, phase => phase.name();
}

// To add a field, add a line here and a field with the same name in quadruped_state_t.lcm. The order of the lines is the order in which digests
// and dumps contain the fields. `unit` is the unit in dumps. `accepts` names the check of a snapshot's numbers if it is not `finite`.
state_fields! {
    /// State of the quadruped controller between two ticks. `quadruped_state_t` documents meaning, frame and unit of each field.
    #[derive(Clone, Debug, PartialEq)]
    #[expect(missing_docs, reason = "every field is documented at quadruped_state_t")]
    pub struct State, message QuadrupedState;
    robot {
        t_ns: i64, unit "ns", digest [], dump [];
        tick: i64, digest [], dump [];
        gait_clock: f64, unit "s", digest [Gait], dump [Gait];
        first_phase: f64, digest [Gait], dump [Gait];
        yaw_des: f64, unit "rad", digest [Gait], dump [Gait];
        height_offset: f64, unit "m", digest [Gait], dump [Gait];
        zeta: f64, digest [Gait], dump [Gait];
        yaw_rate_des: f64, unit "rad/s", digest [Gait], dump [Gait];
        swing_frequency: f64, unit "Hz", digest [Gait], dump [Gait];
        duty: f64, digest [Gait], dump [Gait];
        rp_des: [f64; 2], unit "rad", digest [Gait], dump [Gait];
        v_H_des: [f64; 2], unit "m/s", digest [Gait], dump [Gait];
        v_trim_H: [f64; 2], unit "m/s", digest [Gait], dump [Gait];
        sway_H: [f64; 2], unit "m", digest [Gait], dump [Gait];
        sway_rate_H: [f64; 2], unit "m/s", digest [], dump [];
        sway_rest_H: [f64; 2], unit "m", digest [], dump [];
        sway_rest_rate_H: [f64; 2], unit "m/s", digest [], dump [];
        gait: Gait, digest [Gait], dump [];
        gait_running: bool, digest [], dump [Gait];
        mode: Mode, digest [Gait, StandSit], dump [Output];
        fault: i32, digest [], dump [Output as "fault_code"];
        fault_index: i32, digest [], dump [Output];
        fault_value: f64, accepts any, digest [], dump [Output];
        started: bool, digest [], dump [];
        qp_failures: i32, digest [], dump [];
        move_phase: MovePhase, digest [StandSit], dump [StandSit];
        move_progress: f64, digest [StandSit], dump [StandSit];
        move_start: f64, digest [StandSit], dump [StandSit];
        support: f64, digest [StandSit], dump [StandSit];
        t_held: f64, unit "s", digest [StandSit], dump [StandSit];
        height: f64, unit "m", digest [Estimation], dump [Estimation];
        v_H_est: [f64; 2], unit "m/s", digest [Estimation], dump [Estimation];
        gradient_W: [f64; 2], digest [Estimation], dump [Estimation];
        t_still: f64, unit "s", digest [], dump [];
        t_no_contact: f64, unit "s", digest [], dump [];
    }
    legs {
        leg_state: LegPhase, digest [Gait], dump [Gait as "phase"];
        reflexes: i32, digest [Gait], dump [Gait];
        t_leg: f64, unit "s", accepts finite_or_infinity, digest [Gait], dump [Gait];
        t_unloaded: f64, unit "s", digest [Gait], dump [Gait];
        step_length: f64, unit "m", digest [Gait], dump [Gait];
        step_heading: f64, unit "rad", digest [Gait], dump [Gait];
        step_height: f64, unit "m", digest [Gait], dump [Gait];
        f_F_W: Vector3<f64>, unit "N", digest [Estimation], dump [Estimation];
        p_ground_W: Vector3<f64>, unit "m", digest [Estimation], dump [Estimation];
        contact: bool, digest [Estimation], dump [Estimation];
        contact_count: i32, digest [], dump [];
        p_lift_H: Vector3<f64>, unit "m", digest [], dump [];
        p_stance_H: [f64; 2], unit "m", digest [], dump [];
    }
    joints {
        move_q, unit "rad", digest [StandSit], dump [StandSit];
        q_des, unit "rad", digest [Gait, StandSit], dump [Gait, StandSit, Output];
        qd_des, unit "rad/s", digest [Gait, StandSit], dump [Gait, StandSit, Output];
        qdd_des, unit "rad/s²", digest [Gait], dump [Gait];
        tau_last, unit "N m", digest [StandSit], dump [Output as "tau"];
    }
}

impl State {
    /// The state before the first tick.
    pub fn new(nj: usize) -> Self {
        let none = Fault::default();
        State {
            tick: -1,
            fault: none.code,
            fault_index: none.index,
            fault_value: none.value,
            // Infinite stance time: no load ramp.
            t_leg: PerLeg([f64::INFINITY; 4]),
            ..State::zeros(nj)
        }
    }

    /// The reason for the safe state.
    pub fn fault(&self) -> Fault {
        Fault { code: self.fault, index: self.fault_index, value: self.fault_value }
    }

    /// Sets the reason for the safe state.
    pub fn set_fault(&mut self, fault: Fault) {
        Fault { code: self.fault, index: self.fault_index, value: self.fault_value } = fault;
    }

    /// Gait timing in use.
    pub fn cadence(&self) -> Cadence {
        Cadence { swing_frequency: self.swing_frequency, duty: self.duty }
    }

    /// Sets the gait timing.
    pub fn set_cadence(&mut self, cadence: Cadence) {
        Cadence { swing_frequency: self.swing_frequency, duty: self.duty } = cadence;
    }

    /// Enters `mode`: keeps time, contacts, height and torques, and resets everything else, with all legs in stance. Allocates nothing. A test lists
    /// the fields that are kept.
    pub fn enter(&mut self, mode: Mode) {
        let take = std::mem::take;
        let mut next = State {
            t_ns: self.t_ns,
            tick: self.tick,
            mode,
            started: self.started,
            contact: self.contact,
            contact_count: self.contact_count,
            f_F_W: self.f_F_W,
            q_des: take(&mut self.q_des),
            tau_last: take(&mut self.tau_last),
            qd_des: take(&mut self.qd_des),
            qdd_des: take(&mut self.qdd_des),
            move_q: take(&mut self.move_q),
            height: self.height,
            t_still: self.t_still,
            ..State::new(0)
        };
        next.qd_des.fill(0.0);
        next.qdd_des.fill(0.0);
        *self = next;
    }

    /// Keeps mode, fault and time, and resets everything else: after a non-finite command any computed value may be NaN. Allocates nothing.
    ///
    /// - `height`: height of the base above the feet, m.
    pub fn reset(&mut self, measured: &RobotState, height: f64) {
        let fault = self.fault();
        self.enter(self.mode);
        self.set_fault(fault);
        (self.f_F_W, self.height) = (PerLeg::default(), height);
        self.q_des.copy_from_slice(&measured.q);
        self.move_q.copy_from_slice(&measured.q);
        self.tau_last.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::{ControllerTick, Message, OperatorCommand};

    #[test]
    fn numbers_of_enumerations_are_those_of_the_messages() {
        let modes = [
            ControllerTick::MODE_IDLE,
            ControllerTick::MODE_STANCE,
            ControllerTick::MODE_WALK,
            ControllerTick::MODE_DAMPING,
            ControllerTick::MODE_STAND_UP,
            ControllerTick::MODE_SIT,
        ];
        assert_eq!(Mode::ALL.map(|mode| mode as i8), modes);
        let gaits = [OperatorCommand::GAIT_TROT, OperatorCommand::GAIT_CRAWL];
        assert_eq!([Gait::TROT, Gait::CRAWL].map(Gait::number), gaits);
        let moves = [
            QuadrupedState::MOVE_NONE,
            QuadrupedState::MOVE_GATHER,
            QuadrupedState::MOVE_RISE,
            QuadrupedState::MOVE_LOWER,
            QuadrupedState::MOVE_SPREAD,
            QuadrupedState::MOVE_RELEASE,
            QuadrupedState::MOVE_LIE,
        ];
        assert_eq!(MovePhase::ALL.map(|phase| phase as i8), moves);
    }

    #[test]
    fn every_field_survives_a_snapshot() {
        let nj = 12;
        let (written, initial) = (State::example(nj), State::new(nj.into()));
        assert_eq!(written.equal_fields(&initial), [""; 0], "the example must differ from the initial state");
        let mut message = QuadrupedState::default();
        written.write(&mut message);
        let mut bytes = Vec::new();
        message.encode(&mut bytes).unwrap();
        let mut restored = initial;
        restored.read(&mut QuadrupedState::decode(&bytes).unwrap()).unwrap();
        assert_eq!(restored.equal_fields(&written), State::NAMES);
        assert_eq!(restored, written);
    }

    #[test]
    fn entering_a_mode_keeps_these_fields_and_resets_all_others() {
        let (mut entered, before, initial) = (State::example(12), State::example(12), State::new(12));
        entered.enter(Mode::Stance);
        let kept = [
            "t_ns",
            "tick",
            "started",
            "height",
            "t_still",
            "f_F_W",
            "contact",
            "contact_count",
            "move_q",
            "q_des",
            "tau_last",
        ];
        let of_before: Vec<_> = entered.equal_fields(&before).into_iter().filter(|name| *name != "mode").collect();
        assert_eq!(of_before, kept);
        let reset: Vec<_> =
            State::NAMES.iter().filter(|name| !kept.contains(*name) && **name != "mode").copied().collect();
        let equal: Vec<_> = entered.equal_fields(&initial).into_iter().filter(|name| *name != "mode").collect();
        assert_eq!(equal, reset);
    }

    #[test]
    fn a_snapshot_with_an_invalid_value_is_rejected_by_field_and_changes_nothing() {
        let mut good = QuadrupedState::default();
        State::new(12).write(&mut good);
        let read = |change: fn(&mut QuadrupedState)| {
            let (mut message, mut state) = (good.clone(), State::example(12));
            change(&mut message);
            let result = state.read(&mut message);
            assert!(result.is_ok() || state == State::example(12), "the state has changed");
            result
        };
        let value = |change| match read(change).unwrap_err() {
            RestoreError::Value { field, found, last } => (field, found, last),
            other => panic!("{other}"),
        };
        assert_eq!(value(|m| m.leg_state[2] = 9), ("leg_state", 9, 4));
        assert_eq!(value(|m| m.mode = -1), ("mode", -1, 5));
        assert_eq!(value(|m| m.gait = -1), ("gait", -1, 127));
        assert_eq!(value(|m| m.move_phase = 7), ("move_phase", 7, 6));
        let not_finite = |change| match read(change).unwrap_err() {
            RestoreError::NotFinite { field } => field,
            other => panic!("{other}"),
        };
        assert_eq!(not_finite(|m| m.sway_H[1] = f64::NAN), "sway_H");
        assert_eq!(not_finite(|m| m.p_lift_H[3][2] = f64::INFINITY), "p_lift_H");
        assert_eq!(not_finite(|m| m.t_leg[0] = f64::NEG_INFINITY), "t_leg");
        assert_eq!(not_finite(|m| m.move_q[11] = f64::NAN), "move_q");
        assert!(read(|m| (m.t_leg[0], m.fault_value) = (f64::INFINITY, f64::NAN)).is_ok());
        let joints = read(|m| m.q_des.truncate(6)).unwrap_err();
        assert!(matches!(joints, RestoreError::Joints { found: 6, expected: 12 }), "{joints}");
    }
}
