//! All that survives a tick, and its snapshot.

use super::leg::{Leg, LegPhase, PerLeg};
use crate::RestoreError;
use lcmtypes::{ControllerTick, QuadrupedState, RobotState, enum_names};
use nalgebra::Vector3;

/// What the controller as a whole does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// No torque: no input has been seen yet, or the operator wants none.
    #[default]
    Idle,
    /// Stands on all feet.
    Stance,
    /// Walks, or finishes its last steps.
    Walk,
    /// Safe state: the joints are damped, nothing else is asked of them.
    Damping,
    /// Gets up from the ground.
    StandUp,
    /// Sits down, and lies when it has.
    Sit,
}

impl Mode {
    const ALL: [Mode; 6] = [Mode::Idle, Mode::Stance, Mode::Walk, Mode::Damping, Mode::StandUp, Mode::Sit];

    /// Name as in events: `IDLE`, `STANCE`, `WALK`, `DAMPING`, `STAND_UP`, `SIT`.
    pub fn name(self) -> &'static str {
        enum_names::mode(self as i8)
    }
}

/// Sequence of the legs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gait {
    /// Diagonal pairs.
    #[default]
    Trot,
    /// One leg at a time.
    Crawl,
}

impl Gait {
    /// All gaits, by their number in `operator_command_t`.
    pub const ALL: [Gait; 2] = [Gait::Trot, Gait::Crawl];
}

/// Timing of the gait as the operator has set it. 0 = as in the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cadence {
    /// Swing frequency, Hz.
    pub swing_frequency: f64,
    /// Duty factor.
    pub duty: f64,
}

/// Where getting up or sitting down is. The table stands in [`super::stand_sit`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MovePhase {
    /// Neither is going on.
    #[default]
    None,
    /// The legs fold under the trunk, from wherever they are.
    Gather,
    /// The feet push the trunk up.
    Rise,
    /// The feet let the trunk down.
    Lower,
    /// The legs go from folded to where they lie.
    Spread,
    /// The joints grow soft.
    Release,
    /// It lies; the joints are damped.
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
}

/// Getting up or sitting down between two ticks. Meanings and units stand at `quadruped_state_t`, `move_*`, `support`, `t_held`.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "every field is documented at quadruped_state_t")]
pub struct Motion {
    pub phase: MovePhase,
    pub progress: f64,
    pub start: f64,
    pub q: Vec<f64>,
    pub support: f64,
    pub t_held: f64,
}

/// Why the controller is in the safe state: a code of `controller_tick_t`, what it names and what was found there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// FAULT_* of `controller_tick_t`.
    pub code: i32,
    /// Joint (URDF order), leg or row; -1 = none.
    pub index: i32,
    /// The value found, in its own unit.
    pub value: f64,
}

impl Default for Fault {
    fn default() -> Self {
        Fault { code: ControllerTick::FAULT_NONE, index: -1, value: 0.0 }
    }
}

/// State of the quadruped controller between two ticks. Meanings, frames and units stand at `quadruped_state_t`.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "every field is documented at quadruped_state_t")]
pub struct State {
    pub t_ns: i64,
    pub tick: i64,
    pub mode: Mode,
    pub fault: Fault,
    pub started: bool,
    pub qp_failures: i32,
    pub gait: Gait,
    pub gait_clock: f64,
    pub gait_running: bool,
    pub leg_phase: PerLeg<LegPhase>,
    pub t_leg: PerLeg<f64>,
    pub contact: PerLeg<bool>,
    pub contact_count: PerLeg<i32>,
    pub f_F_W: PerLeg<Vector3<f64>>,
    pub p_lift_H: PerLeg<Vector3<f64>>,
    pub p_stance_H: PerLeg<[f64; 2]>,
    pub step_length: PerLeg<f64>,
    pub step_heading: PerLeg<f64>,
    pub sway_H: [f64; 2],
    pub sway_rate_H: [f64; 2],
    pub sway_rest_H: [f64; 2],
    pub sway_rest_rate_H: [f64; 2],
    pub q_des: Vec<f64>,
    pub tau_last: Vec<f64>,
    pub qd_des: Vec<f64>,
    pub qdd_des: Vec<f64>,
    pub yaw_des: f64,
    pub rp_des: [f64; 2],
    pub height: f64,
    pub height_offset: f64,
    pub zeta: f64,
    pub v_H_des: [f64; 2],
    pub yaw_rate_des: f64,
    pub cadence: Cadence,
    pub step_height: PerLeg<f64>,
    pub reflexes: PerLeg<i32>,
    pub t_unloaded: PerLeg<f64>,
    pub v_H_est: [f64; 2],
    pub v_trim_H: [f64; 2],
    pub p_ground_W: PerLeg<Vector3<f64>>,
    pub gradient_W: [f64; 2],
    pub t_still: f64,
    pub t_no_contact: f64,
    pub motion: Motion,
}

impl State {
    /// The state before the first tick.
    pub fn new(nj: usize) -> Self {
        State {
            t_ns: 0,
            tick: -1,
            mode: Mode::default(),
            fault: Fault::default(),
            started: false,
            qp_failures: 0,
            gait: Gait::default(),
            gait_clock: 0.0,
            gait_running: false,
            leg_phase: PerLeg::default(),
            // It has stood since ever: no ramp after a touchdown.
            t_leg: PerLeg([f64::INFINITY; 4]),
            contact: PerLeg::default(),
            contact_count: PerLeg::default(),
            f_F_W: PerLeg::default(),
            p_lift_H: PerLeg::default(),
            p_stance_H: PerLeg::default(),
            step_length: PerLeg::default(),
            step_heading: PerLeg::default(),
            sway_H: [0.0; 2],
            sway_rate_H: [0.0; 2],
            sway_rest_H: [0.0; 2],
            sway_rest_rate_H: [0.0; 2],
            q_des: vec![0.0; nj],
            tau_last: vec![0.0; nj],
            qd_des: vec![0.0; nj],
            qdd_des: vec![0.0; nj],
            yaw_des: 0.0,
            rp_des: [0.0; 2],
            height: 0.0,
            height_offset: 0.0,
            zeta: 0.0,
            v_H_des: [0.0; 2],
            yaw_rate_des: 0.0,
            cadence: Cadence::default(),
            step_height: PerLeg::default(),
            reflexes: PerLeg::default(),
            t_unloaded: PerLeg::default(),
            v_H_est: [0.0; 2],
            v_trim_H: [0.0; 2],
            p_ground_W: PerLeg::default(),
            gradient_W: [0.0; 2],
            t_still: 0.0,
            t_no_contact: 0.0,
            motion: Motion { q: vec![0.0; nj], ..Motion::default() },
        }
    }

    /// Begins `mode` with a past of nothing but time, contacts, height and torques, legs standing. Allocates nothing.
    pub fn begin(&mut self, mode: Mode) {
        let take = std::mem::take;
        let motion = Motion { q: take(&mut self.motion.q), ..Motion::default() };
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
            height: self.height,
            t_still: self.t_still,
            motion,
            ..State::new(0)
        };
        next.qd_des.fill(0.0);
        next.qdd_des.fill(0.0);
        *self = next;
    }

    /// Keeps mode, fault and time, and of all else nothing that was computed: numbers that are none may be anywhere. Allocates nothing.
    ///
    /// - `height`: of the base over its feet, m.
    pub fn forget(&mut self, measured: &RobotState, height: f64) {
        let fault = self.fault;
        self.begin(self.mode);
        (self.fault, self.f_F_W, self.height) = (fault, PerLeg::default(), height);
        self.q_des.copy_from_slice(&measured.q);
        self.motion.q.copy_from_slice(&measured.q);
        self.tau_last.fill(0.0);
    }

    /// Takes the state apart into its message. No `..`: a new field stops compiling here until it is in the snapshot.
    pub fn write(&self, m: &mut QuadrupedState) {
        let State {
            t_ns,
            tick,
            mode,
            fault: Fault { code, index, value },
            started,
            qp_failures,
            gait,
            gait_clock,
            gait_running,
            leg_phase,
            t_leg,
            contact,
            contact_count,
            f_F_W,
            p_lift_H,
            p_stance_H,
            step_length,
            step_heading,
            sway_H,
            sway_rate_H,
            sway_rest_H,
            sway_rest_rate_H,
            q_des,
            tau_last,
            qd_des,
            qdd_des,
            yaw_des,
            rp_des,
            height,
            height_offset,
            zeta,
            v_H_des,
            yaw_rate_des,
            cadence: Cadence { swing_frequency, duty },
            step_height,
            reflexes,
            t_unloaded,
            v_H_est,
            v_trim_H,
            p_ground_W,
            gradient_W,
            t_still,
            t_no_contact,
            motion: Motion { phase: move_phase, progress: move_progress, start: move_start, q: move_q, support, t_held },
        } = self;
        m.t_ns = *t_ns;
        m.tick = *tick;
        m.mode = *mode as i8;
        m.fault = *code;
        m.fault_index = *index;
        m.fault_value = *value;
        m.started = *started;
        m.qp_failures = *qp_failures;
        m.gait = *gait as i8;
        m.gait_clock = *gait_clock;
        m.gait_running = *gait_running;
        m.leg_state = leg_phase.0.map(|phase| phase as i8);
        m.t_leg = t_leg.0;
        m.contact = contact.0;
        m.contact_count = contact_count.0;
        m.f_F_W = f_F_W.0.map(Into::into);
        m.p_lift_H = p_lift_H.0.map(Into::into);
        m.p_stance_H = p_stance_H.0;
        m.step_length = step_length.0;
        m.step_heading = step_heading.0;
        m.sway_H = *sway_H;
        m.sway_rate_H = *sway_rate_H;
        m.sway_rest_H = *sway_rest_H;
        m.sway_rest_rate_H = *sway_rest_rate_H;
        m.nj = i32::try_from(q_des.len()).expect("robots have fewer than 2^31 joints");
        m.q_des.clone_from(q_des);
        m.tau_last.clone_from(tau_last);
        m.qd_des.clone_from(qd_des);
        m.qdd_des.clone_from(qdd_des);
        m.yaw_des = *yaw_des;
        m.rp_des = *rp_des;
        m.height = *height;
        m.height_offset = *height_offset;
        m.zeta = *zeta;
        m.v_H_des = *v_H_des;
        m.yaw_rate_des = *yaw_rate_des;
        m.swing_frequency = *swing_frequency;
        m.duty = *duty;
        m.step_height = step_height.0;
        m.reflexes = reflexes.0;
        m.t_unloaded = t_unloaded.0;
        m.v_H_est = *v_H_est;
        m.v_trim_H = *v_trim_H;
        m.p_ground_W = p_ground_W.0.map(Into::into);
        m.gradient_W = *gradient_W;
        m.t_still = *t_still;
        m.t_no_contact = *t_no_contact;
        m.move_phase = *move_phase as i8;
        m.move_progress = *move_progress;
        m.move_start = *move_start;
        m.move_q.clone_from(move_q);
        m.support = *support;
        m.t_held = *t_held;
    }

    /// Takes over the state that [`State::write`] took apart. The arrays change places with those of the message, so this allocates nothing.
    ///
    /// # Errors
    /// A state of a robot with another number of joints; numbers that are not finite; numbers that name no mode, gait, leg phase or move. The
    /// state is then as it was.
    pub fn read(&mut self, m: &mut QuadrupedState) -> Result<(), RestoreError> {
        let nj = self.q_des.len();
        if m.q_des.len() != nj {
            return Err(RestoreError::Joints { found: m.q_des.len(), expected: nj });
        }
        let numbers: [(_, &[f64]); 36] = [
            ("gait_clock", &[m.gait_clock]),
            ("f_F_W", m.f_F_W.as_flattened()),
            ("p_lift_H", m.p_lift_H.as_flattened()),
            ("p_stance_H", m.p_stance_H.as_flattened()),
            ("step_length", &m.step_length),
            ("step_heading", &m.step_heading),
            ("sway_H", &m.sway_H),
            ("sway_rate_H", &m.sway_rate_H),
            ("sway_rest_H", &m.sway_rest_H),
            ("sway_rest_rate_H", &m.sway_rest_rate_H),
            ("q_des", &m.q_des),
            ("tau_last", &m.tau_last),
            ("qd_des", &m.qd_des),
            ("qdd_des", &m.qdd_des),
            ("yaw_des", &[m.yaw_des]),
            ("rp_des", &m.rp_des),
            ("height", &[m.height]),
            ("height_offset", &[m.height_offset]),
            ("zeta", &[m.zeta]),
            ("v_H_des", &m.v_H_des),
            ("yaw_rate_des", &[m.yaw_rate_des]),
            ("swing_frequency", &[m.swing_frequency]),
            ("duty", &[m.duty]),
            ("step_height", &m.step_height),
            ("t_unloaded", &m.t_unloaded),
            ("v_H_est", &m.v_H_est),
            ("v_trim_H", &m.v_trim_H),
            ("p_ground_W", m.p_ground_W.as_flattened()),
            ("gradient_W", &m.gradient_W),
            ("t_still", &[m.t_still]),
            ("t_no_contact", &[m.t_no_contact]),
            ("move_progress", &[m.move_progress]),
            ("move_start", &[m.move_start]),
            ("move_q", &m.move_q),
            ("support", &[m.support]),
            ("t_held", &[m.t_held]),
        ];
        for (field, values) in numbers {
            if values.iter().any(|x| !x.is_finite()) {
                return Err(RestoreError::NotFinite { field });
            }
        }
        // A leg that has stood since ever has an infinite time; the value of a fault is what was found.
        if m.t_leg.iter().any(|t| !t.is_finite() && *t != f64::INFINITY) {
            return Err(RestoreError::NotFinite { field: "t_leg" });
        }
        let mut leg_phase = PerLeg::default();
        for leg in Leg::ALL {
            leg_phase[leg] = of_number("leg_state", &LegPhase::ALL, m.leg_state[leg as usize])?;
        }
        let (mode, gait) = (of_number("mode", &Mode::ALL, m.mode)?, of_number("gait", &Gait::ALL, m.gait)?);
        let phase = of_number("move_phase", &MovePhase::ALL, m.move_phase)?;
        let take = std::mem::take;
        let next = State {
            t_ns: m.t_ns,
            tick: m.tick,
            mode,
            fault: Fault { code: m.fault, index: m.fault_index, value: m.fault_value },
            started: m.started,
            qp_failures: m.qp_failures,
            gait,
            gait_clock: m.gait_clock,
            gait_running: m.gait_running,
            leg_phase,
            t_leg: PerLeg(m.t_leg),
            contact: PerLeg(m.contact),
            contact_count: PerLeg(m.contact_count),
            f_F_W: PerLeg(m.f_F_W.map(Into::into)),
            p_lift_H: PerLeg(m.p_lift_H.map(Into::into)),
            p_stance_H: PerLeg(m.p_stance_H),
            step_length: PerLeg(m.step_length),
            step_heading: PerLeg(m.step_heading),
            sway_H: m.sway_H,
            sway_rate_H: m.sway_rate_H,
            sway_rest_H: m.sway_rest_H,
            sway_rest_rate_H: m.sway_rest_rate_H,
            q_des: take(&mut m.q_des),
            tau_last: take(&mut m.tau_last),
            qd_des: take(&mut m.qd_des),
            qdd_des: take(&mut m.qdd_des),
            yaw_des: m.yaw_des,
            rp_des: m.rp_des,
            height: m.height,
            height_offset: m.height_offset,
            zeta: m.zeta,
            v_H_des: m.v_H_des,
            yaw_rate_des: m.yaw_rate_des,
            cadence: Cadence { swing_frequency: m.swing_frequency, duty: m.duty },
            step_height: PerLeg(m.step_height),
            reflexes: PerLeg(m.reflexes),
            t_unloaded: PerLeg(m.t_unloaded),
            v_H_est: m.v_H_est,
            v_trim_H: m.v_trim_H,
            p_ground_W: PerLeg(m.p_ground_W.map(Into::into)),
            gradient_W: m.gradient_W,
            t_still: m.t_still,
            t_no_contact: m.t_no_contact,
            motion: Motion {
                phase,
                progress: m.move_progress,
                start: m.move_start,
                q: take(&mut m.move_q),
                support: m.support,
                t_held: m.t_held,
            },
        };
        let before = std::mem::replace(self, next);
        (m.q_des, m.tau_last, m.qd_des, m.qdd_des) = (before.q_des, before.tau_last, before.qd_des, before.qdd_des);
        m.move_q = before.motion.q;
        Ok(())
    }
}

fn of_number<T: Copy>(field: &'static str, all: &[T], number: i8) -> Result<T, RestoreError> {
    usize::try_from(number)
        .ok()
        .and_then(|i| all.get(i).copied())
        .ok_or(RestoreError::Value { field, found: number.into() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::OperatorCommand;

    #[test]
    fn numbers_are_those_of_the_messages() {
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
        assert_eq!(Gait::ALL.map(|gait| gait as i8), gaits);
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
    fn a_number_without_meaning_is_refused_by_name() {
        let mut m = QuadrupedState::default();
        State::new(0).write(&mut m);
        m.leg_state[2] = 9;
        let mut refused = |nj| State::new(nj).read(&mut m).unwrap_err().to_string();
        assert_eq!(refused(0), "snapshot field leg_state is 9, which means nothing");
        assert_eq!(refused(12), "snapshot has 0 joints, the robot has 12");
    }
}
