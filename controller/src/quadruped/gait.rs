//! Gait clock and leg state machines.
//!
//! The clock determines lift-offs only; contact estimation determines touchdowns. A gait is a row of a table: duty factor, swing frequency, and
//! the phase at which each leg lifts off. Source: Raiola et al. 2020, section 4.3 and Fig. 4.
//!
//! | phase | condition | next phase |
//! |---|---|---|
//! | stance | the clock passes the leg's lift-off phase | swing up |
//! | | the foot has lost its load ([`super::recovery`]) | reach |
//! | swing up | t ≥ T_sw/2; contact is ignored | swing down |
//! | | the foot hits an obstacle ([`super::recovery`]) | swing up, restarted |
//! | swing down | contact | stance |
//! | | t ≥ T_sw | reach |
//! | reach | contact | stance |
//! | | t ≥ (1 + 2 `reach_time`) T_sw: the foot moves down for `reach_time` T_sw and waits for `reach_time` T_sw | fault hold |
//! | fault hold | contact | stance |
//!
//! A leg lifts off only from stance. No leg lifts off while another is late (reach, fault hold): the clock waits for it. So the order of the legs
//! is always the same, and a late foot is never in the air together with the feet of the next step.

use super::leg::{Leg, LegPhase, PerLeg};
use super::params::Gait;
use super::recovery::ContactEvents;
use super::state::{Cadence, Mode, State};
use super::timing::{Timing, cyclic, gait_params};
use crate::params::Params;

/// Changes of the legs and of the gait in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transitions {
    /// Legs that have just lifted off.
    pub lift_off: PerLeg<bool>,
    /// Legs that restart a swing, or start to search for the ground, at their present position.
    pub restart: PerLeg<bool>,
    /// Legs that have just landed.
    pub touchdown: PerLeg<bool>,
    /// Height of the swings that start, m; 0 = as high as the leg's last swing.
    pub step_height: f64,
    /// The robot has just started to walk, or changed to another gait.
    pub gait_starts: bool,
    /// The robot has just stopped walking.
    pub gait_ends: bool,
}

/// What the operator requests of the gait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaitRequest {
    /// true: walk; false: stand.
    pub walk: bool,
    /// The gait, applied when all feet are in stance.
    pub gait: Gait,
    /// The timing, applied at the same time.
    pub cadence: Cadence,
    /// Height of the swings that start now, m; 0 = as high as the leg's last swing.
    pub step_height: f64,
}

/// Advances the clock and the legs by one tick.
///
/// When all feet are in stance, a request to walk starts the clock, and a request to stand stops it and ends the walk.
///
/// - `events`: contact events of this tick.
/// - `dt`: time since the last tick, s.
pub fn update(
    state: &mut State,
    params: &Params,
    request: GaitRequest,
    events: &ContactEvents,
    dt: f64,
) -> Transitions {
    let mut transitions = Transitions { step_height: request.step_height, ..Transitions::default() };
    let timing = Timing::of(state, params);
    for leg in Leg::ALL {
        state.t_leg[leg] += dt;
        let (next, landed) = leg_transition(state, params, &timing, leg);
        if landed {
            state.t_leg[leg] = 0.0;
        }
        transitions.touchdown[leg] = landed;
        state.leg_state[leg] = next;
        if events.collision[leg] && next == LegPhase::SwingUp {
            (state.t_leg[leg], state.reflexes[leg]) = (0.0, state.reflexes[leg].saturating_add(1));
            transitions.restart[leg] = true;
        } else if events.lost[leg] && next.is_stance() {
            (state.leg_state[leg], state.t_leg[leg], state.t_unloaded[leg]) = (LegPhase::Reach, timing.T_sw, 0.0);
            state.step_length[leg] = 0.0;
            transitions.restart[leg] = true;
        }
    }

    let all_stand = state.leg_state.0.iter().all(|phase| phase.is_stance());
    if all_stand && !request.walk && state.mode == Mode::Walk {
        state.gait_running = false;
        state.mode = Mode::Stance;
        transitions.gait_ends = true;
    }
    // A gait with sway restarts when its cadence changes, because the sway depends on the cadence.
    let sways = gait_params(state.gait, params).sway > 0.0;
    let other_gait = request.gait != state.gait || (sways && request.cadence != state.cadence());
    // A gait that has just started makes a step before the next one begins.
    let has_stepped = state.gait_clock > 0.0;
    if all_stand && request.walk && (!state.gait_running || (other_gait && has_stepped)) {
        // After another gait the first lift-off waits until the sway of both gaits is at rest.
        transitions.gait_starts = true;
        let after = if state.gait_running { Timing::of(state, params).lead_in } else { 0.0 };
        state.mode = Mode::Walk;
        state.gait = request.gait;
        state.set_cadence(request.cadence);
        state.gait_running = true;
        state.first_phase = phase_of_longest_stance(state, params);
        // The first lift-off is at time 0.
        state.gait_clock = -Timing::of(state, params).lead_in.max(after);
    } else if all_stand && request.walk && request.cadence != state.cadence() {
        // A trot continues at the same phase of the stride, between the same two lift-offs.
        let before = Timing::of(state, params).T;
        state.set_cadence(request.cadence);
        state.gait_clock *= Timing::of(state, params).T / before;
    }

    if state.gait_running {
        let as_requested = request.gait == state.gait && request.cadence == state.cadence();
        advance(state, params, request.walk && (as_requested || state.gait_clock <= 0.0), dt, &mut transitions);
    }
    transitions
}

/// Lift-off phase of the leg that has stood longest; of several, the one whose phase is first. A gait begins with it, so that every leg steps even if the
/// gait changes often.
fn phase_of_longest_stance(state: &State, params: &Params) -> f64 {
    let row = gait_params(state.gait, params);
    let (mut longest, mut first) = (0.0, 1.0);
    for leg in Leg::ALL.into_iter().filter(|leg| row.steps(*leg)) {
        let (t, phase) = (state.t_leg[leg], row.lift_off_phase[leg as usize]);
        if t > longest || (t == longest && phase < first) {
            (longest, first) = (t, phase);
        }
    }
    first
}

/// Advances the clock by `dt` and lifts the legs whose phase it passes. The clock stops while a leg that should lift off or have landed is not
/// ready, and, if `may_lift` is false, before each lift-off.
fn advance(state: &mut State, params: &Params, may_lift: bool, dt: f64, transitions: &mut Transitions) {
    let timing = Timing::of(state, params);
    let (before, after) = (state.gait_clock, state.gait_clock + dt);
    // `before` is excluded and `after` included, so each phase is passed exactly once.
    let passes = |at: f64| before < at && at <= after;
    let due = timing.lift_off.0.map(|at| passes(at) || passes(at + timing.T));
    let waits = |leg: Leg| match state.leg_state[leg] {
        LegPhase::Stance => false,
        // A restarted swing may still be in the air when other legs are due.
        LegPhase::SwingUp | LegPhase::SwingDown => {
            due[leg as usize]
                || (due.contains(&true) && cyclic(after - timing.lift_off[leg], timing.T) > timing.T_sw + 1e-9)
        }
        LegPhase::Reach | LegPhase::FaultHold => due.contains(&true),
    };
    if Leg::ALL.into_iter().any(waits) || (!may_lift && due.contains(&true)) {
        return;
    }
    for leg in Leg::ALL {
        if due[leg as usize] {
            state.leg_state[leg] = LegPhase::SwingUp;
            state.t_leg[leg] = 0.0;
            state.reflexes[leg] = 0;
            transitions.lift_off[leg] = true;
        }
    }
    state.gait_clock = if after >= timing.T { after - timing.T } else { after };
}

/// The next phase of a leg, and whether it has just landed.
fn leg_transition(state: &State, params: &Params, timing: &Timing, leg: Leg) -> (LegPhase, bool) {
    let (t, contact) = (state.t_leg[leg], state.contact[leg]);
    let end_of_search = timing.T_sw * (1.0 + 2.0 * params.swing.reach_time);
    match state.leg_state[leg] {
        LegPhase::Stance => (LegPhase::Stance, false),
        LegPhase::SwingUp if t >= 0.5 * timing.T_sw => (LegPhase::SwingDown, false),
        LegPhase::SwingUp => (LegPhase::SwingUp, false),
        _ if contact => (LegPhase::Stance, true),
        LegPhase::SwingDown if t >= timing.T_sw => (LegPhase::Reach, false),
        LegPhase::Reach if t >= end_of_search => (LegPhase::FaultHold, false),
        phase => (phase, false),
    }
}

#[cfg(test)]
mod tests {
    use super::super::foot_load::force_bounds;
    use super::*;

    fn params() -> Params {
        Params::from_toml(
            "[robot]\nname=\"r\"\nurdf=\"r\"\nfeet=[\"a\",\"b\",\"c\",\"d\"]\nfoot_radius=0.02\nimu_link=\"i\"\nposture={}",
            "test",
        )
        .unwrap()
    }

    /// Walks for `ticks`. Each foot has contact from `late` (s) after its planned touchdown on. Returns the lift-offs (tick, leg).
    fn walk(params: &Params, gait: Gait, late: f64, ticks: i64) -> (State, Vec<(i64, Leg)>) {
        let mut state = State::new(12);
        state.mode = Mode::Stance;
        let timing = Timing::at(gait, Cadence::default(), params);
        let mut lifts = Vec::new();
        for tick in 0..ticks {
            for leg in Leg::ALL {
                state.contact[leg] = state.leg_state[leg].is_stance() || state.t_leg[leg] >= timing.T_sw + late;
            }
            let transitions = update(
                &mut state,
                params,
                GaitRequest { walk: true, gait, cadence: Cadence::default(), step_height: 0.1 },
                &ContactEvents::default(),
                1e-3,
            );
            lifts.extend(Leg::ALL.into_iter().filter(|&leg| transitions.lift_off[leg]).map(|leg| (tick, leg)));
        }
        (state, lifts)
    }

    #[test]
    fn trot_lifts_diagonals_in_turn_and_crawl_one_leg_at_a_time() {
        let (_, lifts) = walk(&params(), Gait::TROT, -0.01, 1600);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs, [Leg::LF, Leg::RH, Leg::RF, Leg::LH, Leg::LF, Leg::RH]);
        assert_eq!(lifts[0].0, lifts[1].0);
        let half = lifts[2].0 - lifts[0].0;
        assert!((half - 556).abs() <= 1, "half a stride is {half} ticks");

        let (_, lifts) = walk(&params(), Gait::CRAWL, -0.01, 3700);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs, [Leg::LF, Leg::RH, Leg::RF, Leg::LH, Leg::LF]);
    }

    #[test]
    fn the_clock_waits_for_a_late_foot_and_keeps_the_order() {
        // 0.1 s late is more than the 0.056 s in which all feet stand: the other pair is due and must wait.
        let (_, lifts) = walk(&params(), Gait::TROT, 0.1, 1700);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs[..4], [Leg::LF, Leg::RH, Leg::RF, Leg::LH]);
        let half = lifts[2].0 - lifts[0].0;
        assert!((half - 600).abs() <= 2, "half a stride is {half} ticks");
    }

    #[test]
    fn gaits_that_alternate_each_second_let_every_leg_step() {
        let params = params();
        let mut state = State::new(12);
        state.mode = Mode::Stance;
        let mut lifts = [0; 4];
        for tick in 0..20_000 {
            let gait = if tick / 1000 % 2 == 0 { Gait::TROT } else { Gait::CRAWL };
            for leg in Leg::ALL {
                state.contact[leg] = state.leg_state[leg].is_stance() || state.t_leg[leg] >= 0.49;
            }
            let request = GaitRequest { walk: true, gait, cadence: Cadence::default(), step_height: 0.1 };
            let transitions = update(&mut state, &params, request, &ContactEvents::default(), 1e-3);
            for leg in Leg::ALL {
                lifts[leg as usize] += i32::from(transitions.lift_off[leg]);
            }
        }
        let (least, most) = (lifts.iter().min().unwrap(), lifts.iter().max().unwrap());
        assert!(*least >= 4 && 2 * least >= *most, "{lifts:?}");
    }

    #[test]
    fn contact_is_ignored_in_the_first_half_of_swing() {
        let params = params();
        let mut state = State::new(12);
        state.mode = Mode::Walk;
        (state.gait_running, state.gait_clock) = (true, 0.01);
        state.leg_state[Leg::LF] = LegPhase::SwingUp;
        state.t_leg = PerLeg::default();
        state.contact = PerLeg([true; 4]);
        let request = GaitRequest { walk: true, gait: Gait::TROT, cadence: Cadence::default(), step_height: 0.1 };
        let mut landed_at = None;
        for tick in 0..400 {
            if update(&mut state, &params, request, &ContactEvents::default(), 1e-3).touchdown[Leg::LF] {
                landed_at = Some(tick);
                break;
            }
        }
        // 250 ticks of swing-up, and one more in which the contact counts.
        assert!(matches!(landed_at, Some(249..=251)), "{landed_at:?}");
    }

    #[test]
    fn a_foot_without_ground_contact_is_held_and_the_gait_stops() {
        let (state, lifts) = walk(&params(), Gait::TROT, 10.0, 3000);
        assert_eq!(state.leg_state[Leg::LF], LegPhase::FaultHold);
        assert_eq!(lifts.len(), 2);
        // Held from 1.0 s after the lift-off on, on the ground after 1.4 s: the other pair steps then.
        let (_, lifts) = walk(&params(), Gait::TROT, 0.9, 2000);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs, [Leg::LF, Leg::RH, Leg::RF, Leg::LH]);
        let waited = lifts[2].0 - lifts[0].0;
        assert!((waited - 1400).abs() <= 2, "{waited} ticks");
    }

    #[test]
    fn after_a_request_to_stand_the_steps_are_completed() {
        let params = params();
        let (mut state, _) = walk(&params, Gait::TROT, -0.01, 200);
        assert!(!state.leg_state[Leg::LF].is_stance());
        for _ in 0..600 {
            for leg in Leg::ALL {
                state.contact[leg] = state.t_leg[leg] >= 0.49;
            }
            let transitions = update(
                &mut state,
                &params,
                GaitRequest { walk: false, gait: Gait::TROT, cadence: Cadence::default(), step_height: 0.1 },
                &ContactEvents::default(),
                1e-3,
            );
            assert_eq!(transitions.lift_off, PerLeg::default());
        }
        assert_eq!((state.mode, state.gait_running), (Mode::Stance, false));
    }

    #[test]
    fn force_bounds_ramp_to_zero_before_lift_off_and_back() {
        let params = params();
        let mut state = State::new(12);
        state.mode = Mode::Stance;
        let request = GaitRequest { walk: true, gait: Gait::TROT, cadence: Cadence::default(), step_height: 0.1 };
        let mut last = 1000.0;
        let step = 1000.0 / 27.0;
        for _ in 0..1000 {
            for leg in Leg::ALL {
                state.contact[leg] = state.t_leg[leg] >= 0.49;
            }
            update(&mut state, &params, request, &ContactEvents::default(), 1e-3);
            let (lower, upper) = force_bounds(&state, &params, &Timing::of(&state, &params), 80.0, Leg::LF);
            assert!(lower <= upper && (upper - last).abs() < step, "{last} to {upper}");
            last = upper;
        }
    }
}
