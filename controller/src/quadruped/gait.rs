//! Gait clock and leg state machines.
//!
//! The clock gives lift-offs only; touchdown comes from contact estimation (haptic). A gait is a row of a table: duty factor, swing
//! frequency, and the phase at which each leg lifts off. Source: Raiola et al. 2020, section 4.3 and Fig. 4.
//!
//! | phase | leaves when | to |
//! |---|---|---|
//! | stance | the clock passes the leg's phase | swing up |
//! | | it has carried nothing for a while, and was to | reach |
//! | swing up | t ≥ T_sw/2; contact is ignored | swing down |
//! | | it runs into something | swing up, anew |
//! | swing down | contact | stance |
//! | | t ≥ T_sw | reach |
//! | reach | contact | stance |
//! | | t ≥ (1 + `reach_time`) T_sw, then held `reach_time` T_sw more | fault hold |
//! | fault hold | contact | stance |
//!
//! A leg lifts only from stance, and none lifts while another is late (reach, fault hold): the clock waits for them, so the order of legs
//! is never broken and a late foot is not left alone in the air.

use super::leg::{Leg, LegPhase, PerLeg};
use super::recovery::Surprises;
use super::state::{Cadence, Gait, Mode, State};
use crate::model::GRAVITY;
use crate::params::{GaitTiming, Params};

/// Part of the load below which a foot touches no more, over which no foot is asked to press.
const LEAST_PART: f64 = 0.8;
/// Time in which the base goes from rest into a gait's sway, s.
const SWAY_LEAD_IN: f64 = 0.8;

/// Timing of a gait, derived from its parameters. Seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Swing time.
    pub T_sw: f64,
    /// Stance time.
    pub T_st: f64,
    /// Stride.
    pub T: f64,
    /// Length of the ramps of the force bounds: a part of the time in which all four legs stand (at least two ticks).
    pub T_ramp: f64,
    /// Time in the stride at which each leg lifts off.
    pub lift_off: PerLeg<f64>,
    /// Time between the start of the clock and the first lift-off: legs unload in it, and the base begins to sway.
    pub lead_in: f64,
}

impl Timing {
    /// Timing in use.
    pub fn of(state: &State, params: &Params) -> Self {
        Self::at(state.gait, state.cadence, params)
    }

    /// Timing of `gait` at a cadence.
    pub fn at(gait: Gait, cadence: Cadence, params: &Params) -> Self {
        let row = row_of(gait, params);
        let chosen = |commanded: f64, of_row: f64| if commanded > 0.0 { commanded } else { of_row };
        let T_sw = 1.0 / chosen(cadence.swing_frequency, row.swing_frequency);
        let T = T_sw / (1.0 - chosen(cadence.duty, row.duty));
        let lift_off = PerLeg(row.lift_off_phase.map(|phase| phase * T));
        let T_ramp = (row.ramp * all_stance_time(&lift_off, T, T_sw)).max(0.002);
        let lead_in = if row.sway > 0.0 { SWAY_LEAD_IN } else { T_ramp };
        Timing { T_sw, T_st: T - T_sw, T, T_ramp, lift_off, lead_in }
    }
}

/// Row of the gait table.
pub fn row_of(gait: Gait, params: &Params) -> &GaitTiming {
    match gait {
        Gait::Trot => &params.gait.trot,
        Gait::Crawl => &params.gait.crawl,
    }
}

/// Shortest time between a planned touchdown and the next lift-off of another leg, s.
fn all_stance_time(lift_off: &PerLeg<f64>, T: f64, T_sw: f64) -> f64 {
    let mut shortest = T;
    for a in lift_off.0 {
        for b in lift_off.0 {
            let gap = cyclic(b - a, T);
            if gap > 1e-9 {
                shortest = shortest.min(gap - T_sw);
            }
        }
    }
    shortest
}

/// `x` in `[0, T)`.
pub fn cyclic(x: f64, T: f64) -> f64 {
    let r = libm::fmod(x, T);
    if r < 0.0 { r + T } else { r }
}

/// Time until the clock reaches a leg's lift-off, s, in `(0, T]` from the first lift-off on; just after a lift-off it is a whole stride.
pub fn time_to_lift_off(state: &State, timing: &Timing, leg: Leg) -> f64 {
    if state.gait_clock < 0.0 {
        return timing.lift_off[leg] - state.gait_clock;
    }
    timing.T - cyclic(state.gait_clock - timing.lift_off[leg], timing.T)
}

/// What changed in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transitions {
    /// Legs that have just left the ground by command.
    pub lift_off: PerLeg<bool>,
    /// Legs that begin a swing, or a search for the ground, from where they are.
    pub anew: PerLeg<bool>,
    /// Legs that have just landed.
    pub touchdown: PerLeg<bool>,
    /// Height of the swings that begin, m; 0 = each as high as the leg's last.
    pub step_height: f64,
    /// The robot has just begun to walk, or to walk in another gait.
    pub gait_begins: bool,
    /// It has just come to stand.
    pub gait_ends: bool,
}

/// What the operator wants of the gait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// To walk; otherwise to stand.
    pub walk: bool,
    /// Which gait, from the next instant on in which all feet stand.
    pub gait: Gait,
    /// How fast, from then on too.
    pub cadence: Cadence,
    /// Height of the swings that begin now, m; 0 = each as high as the leg's last.
    pub step_height: f64,
}

/// One tick of clock and legs; `met`: what the legs have run into.
///
/// Starts the clock when walking is wished and all feet stand; stops it, and the walk, when standing is wished and they do.
pub fn update(state: &mut State, params: &Params, wish: Wish, met: &Surprises, dt: f64) -> Transitions {
    let mut transitions = Transitions { step_height: wish.step_height, ..Transitions::default() };
    for leg in Leg::ALL {
        state.t_leg[leg] += dt;
        let timing = Timing::of(state, params);
        let (next, landed) = leg_transition(state, params, &timing, leg);
        if landed {
            state.t_leg[leg] = 0.0;
        }
        transitions.touchdown[leg] = landed;
        state.leg_phase[leg] = next;
        if met.struck[leg] && next == LegPhase::SwingUp {
            (state.t_leg[leg], state.reflexes[leg]) = (0.0, state.reflexes[leg].saturating_add(1));
            transitions.anew[leg] = true;
        } else if met.lost[leg] && next.is_stance() {
            (state.leg_phase[leg], state.t_leg[leg], state.t_unloaded[leg]) = (LegPhase::Reach, timing.T_sw, 0.0);
            state.step_length[leg] = 0.0;
            transitions.anew[leg] = true;
        }
    }

    let all_stand = state.leg_phase.0.iter().all(|phase| phase.is_stance());
    if all_stand && !wish.walk && state.mode == Mode::Walk {
        state.gait_running = false;
        state.mode = Mode::Stance;
        transitions.gait_ends = true;
    }
    // One that sways begins anew with another cadence: its base is somewhere else in each.
    let sways = row_of(state.gait, params).sway > 0.0;
    let other = wish.gait != state.gait || (sways && wish.cadence != state.cadence);
    if all_stand && wish.walk && (!state.gait_running || other) {
        // A gait that follows another waits until the sway of both is at rest.
        transitions.gait_begins = true;
        let after = if state.gait_running { Timing::of(state, params).lead_in } else { 0.0 };
        state.mode = Mode::Walk;
        (state.gait, state.cadence) = (wish.gait, wish.cadence);
        state.gait_running = true;
        // The first lift-off is at time 0.
        state.gait_clock = -Timing::of(state, params).lead_in.max(after);
    } else if all_stand && wish.walk && wish.cadence != state.cadence {
        // A trot goes on where it is in its stride, between the same two lift-offs.
        let before = Timing::of(state, params).T;
        state.cadence = wish.cadence;
        state.gait_clock *= Timing::of(state, params).T / before;
    }

    if state.gait_running {
        let as_wished = wish.gait == state.gait && wish.cadence == state.cadence;
        advance(state, params, wish.walk && as_wished, dt, &mut transitions);
    }
    transitions
}

/// Advances the clock over `dt`, lifting the legs whose phase it passes; stands still while one of them is not ready or a leg is late, and
/// before any lift-off unless one `may_lift`.
fn advance(state: &mut State, params: &Params, may_lift: bool, dt: f64, transitions: &mut Transitions) {
    let timing = Timing::of(state, params);
    let (before, after) = (state.gait_clock, state.gait_clock + dt);
    // Passed once and once only: `before` is outside, `after` inside, and the next tick's `before` is this `after`.
    let passes = |at: f64| before < at && at <= after;
    let due = timing.lift_off.0.map(|at| passes(at) || passes(at + timing.T));
    let waits = |leg: Leg| match state.leg_phase[leg] {
        LegPhase::Stance => false,
        // A swing that was begun anew may still be in the air when others are due.
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
            state.leg_phase[leg] = LegPhase::SwingUp;
            state.t_leg[leg] = 0.0;
            state.reflexes[leg] = 0;
            transitions.lift_off[leg] = true;
        }
    }
    state.gait_clock = if after >= timing.T { after - timing.T } else { after };
}

fn leg_transition(state: &State, params: &Params, timing: &Timing, leg: Leg) -> (LegPhase, bool) {
    let (t, contact) = (state.t_leg[leg], state.contact[leg]);
    let end_of_search = timing.T_sw * (1.0 + 2.0 * params.swing.reach_time);
    match state.leg_phase[leg] {
        LegPhase::Stance => (LegPhase::Stance, false),
        LegPhase::SwingUp if t >= 0.5 * timing.T_sw => (LegPhase::SwingDown, false),
        LegPhase::SwingUp => (LegPhase::SwingUp, false),
        _ if contact => (LegPhase::Stance, true),
        LegPhase::SwingDown if t >= timing.T_sw => (LegPhase::Reach, false),
        LegPhase::Reach if t >= end_of_search => (LegPhase::FaultHold, false),
        phase => (phase, false),
    }
}

/// Bounds on the vertical force of a foot, N: stance values, zero in swing, and ramps between them so that no force jumps.
///
/// Source: Raiola et al. 2020, section 6, where the upper bound goes to zero continuously before lift-off. The lower bound keeps to half the
/// upper one on the way, so that an interior point is left. While a leg unloads or swings, the lower bound of the opposite one rises to the
/// gait's residual load: the centre of mass is kept from the edge of the support triangle, where the robot would tip. It stays below the load at
/// which a foot touches no more: otherwise a light robot's feet would touch the air, by what is commanded of them.
///
/// - `mass`: of the robot, kg.
pub fn force_bounds(state: &State, params: &Params, mass: f64, leg: Leg) -> (f64, f64) {
    if !state.leg_phase[leg].is_stance() {
        return (0.0, 0.0);
    }
    let timing = Timing::of(state, params);
    let upper = params.wbc.f_z_max * loaded_part(state, &timing, leg);
    let weight = mass * GRAVITY;
    let least = params.wbc.f_z_min.min(LEAST_PART * params.contact.release_load * weight);
    let residual = (row_of(state.gait, params).residual_load * weight - least).max(0.0);
    let lower = least + residual * (1.0 - loaded_part(state, &timing, leg.opposite()));
    (lower.min(0.5 * upper), upper)
}

/// How much of its full load a foot may carry, 0 to 1.
pub fn loaded_part(state: &State, timing: &Timing, leg: Leg) -> f64 {
    if !state.leg_phase[leg].is_stance() {
        return 0.0;
    }
    let mut part = 1.0_f64;
    if state.mode == Mode::Walk {
        part = part.min((state.t_leg[leg] + 1e-3) / timing.T_ramp);
        if state.gait_running {
            part = part.min(time_to_lift_off(state, timing, leg) / timing.T_ramp);
        }
    }
    part.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn params() -> Params {
        Params::from_toml(
            "[robot]\nname=\"r\"\nurdf=\"r\"\nfeet=[\"a\",\"b\",\"c\",\"d\"]\nfoot_radius=0.02\nimu_link=\"i\"\nposture={}",
            "test",
        )
        .unwrap()
    }

    /// Walks for `ticks`, every foot touching from `late` after its planned touchdown on; gives the lift-offs (tick, leg).
    fn walk(params: &Params, gait: Gait, late: f64, ticks: i64) -> (State, Vec<(i64, Leg)>) {
        let mut state = State::new(12);
        state.mode = Mode::Stance;
        let timing = Timing::at(gait, Cadence::default(), params);
        let mut lifts = Vec::new();
        for tick in 0..ticks {
            for leg in Leg::ALL {
                state.contact[leg] = state.leg_phase[leg].is_stance() || state.t_leg[leg] >= timing.T_sw + late;
            }
            let changes = update(
                &mut state,
                params,
                Wish { walk: true, gait, cadence: Cadence::default(), step_height: 0.1 },
                &Surprises::default(),
                1e-3,
            );
            lifts.extend(Leg::ALL.into_iter().filter(|&leg| changes.lift_off[leg]).map(|leg| (tick, leg)));
        }
        (state, lifts)
    }

    #[test]
    fn timing_is_that_of_the_source() {
        let params = params();
        let trot = Timing::at(Gait::Trot, Cadence::default(), &params);
        assert!((trot.T - 1.111).abs() < 1e-3 && (trot.T_ramp - 0.0278).abs() < 1e-4, "{trot:?}");
        let crawl = Timing::at(Gait::Crawl, Cadence { swing_frequency: 2.0, duty: 0.8 }, &params);
        assert!((crawl.T - 2.5).abs() < 1e-9 && (crawl.T_ramp - 0.0625).abs() < 1e-9, "{crawl:?}");
    }

    #[test]
    fn trot_lifts_diagonals_in_turn_and_crawl_one_leg_at_a_time() {
        let (_, lifts) = walk(&params(), Gait::Trot, -0.01, 1600);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs, [Leg::LF, Leg::RH, Leg::RF, Leg::LH, Leg::LF, Leg::RH]);
        assert_eq!(lifts[0].0, lifts[1].0);
        let half = lifts[2].0 - lifts[0].0;
        assert!((half - 556).abs() <= 1, "half a stride is {half} ticks");

        let (_, lifts) = walk(&params(), Gait::Crawl, -0.01, 3700);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs, [Leg::LF, Leg::RH, Leg::RF, Leg::LH, Leg::LF]);
    }

    #[test]
    fn the_clock_waits_for_a_late_foot_and_keeps_the_order() {
        // 0.1 s late is more than the 0.056 s in which all feet stand: the other pair is due and must wait.
        let (_, lifts) = walk(&params(), Gait::Trot, 0.1, 1700);
        let legs: Vec<Leg> = lifts.iter().map(|l| l.1).collect();
        assert_eq!(legs[..4], [Leg::LF, Leg::RH, Leg::RF, Leg::LH]);
        let half = lifts[2].0 - lifts[0].0;
        assert!((half - 600).abs() <= 2, "half a stride is {half} ticks");
    }

    #[test]
    fn contact_is_ignored_in_the_first_half_of_swing() {
        let params = params();
        let mut state = State::new(12);
        state.mode = Mode::Walk;
        (state.gait_running, state.gait_clock) = (true, 0.01);
        state.leg_phase[Leg::LF] = LegPhase::SwingUp;
        state.t_leg = PerLeg::default();
        state.contact = PerLeg([true; 4]);
        let wish = Wish { walk: true, gait: Gait::Trot, cadence: Cadence::default(), step_height: 0.1 };
        let mut landed_at = None;
        for tick in 0..400 {
            if update(&mut state, &params, wish, &Surprises::default(), 1e-3).touchdown[Leg::LF] {
                landed_at = Some(tick);
                break;
            }
        }
        // 250 ticks of swing-up, and one more in which the contact counts.
        assert!(matches!(landed_at, Some(249..=251)), "{landed_at:?}");
    }

    #[test]
    fn a_foot_that_finds_no_ground_is_held_and_the_gait_stops() {
        let (state, lifts) = walk(&params(), Gait::Trot, 10.0, 3000);
        assert_eq!(state.leg_phase[Leg::LF], LegPhase::FaultHold);
        assert_eq!(lifts.len(), 2);
    }

    #[test]
    fn standing_is_reached_by_finishing_the_steps() {
        let params = params();
        let (mut state, _) = walk(&params, Gait::Trot, -0.01, 200);
        assert!(!state.leg_phase[Leg::LF].is_stance());
        for _ in 0..600 {
            for leg in Leg::ALL {
                state.contact[leg] = state.t_leg[leg] >= 0.49;
            }
            let changes = update(
                &mut state,
                &params,
                Wish { walk: false, gait: Gait::Trot, cadence: Cadence::default(), step_height: 0.1 },
                &Surprises::default(),
                1e-3,
            );
            assert_eq!(changes.lift_off, PerLeg::default());
        }
        assert_eq!((state.mode, state.gait_running), (Mode::Stance, false));
    }

    #[test]
    fn force_bounds_ramp_to_zero_before_lift_off_and_back() {
        let params = params();
        let mut state = State::new(12);
        state.mode = Mode::Stance;
        let wish = Wish { walk: true, gait: Gait::Trot, cadence: Cadence::default(), step_height: 0.1 };
        let mut last = 1000.0;
        let step = 1000.0 / 27.0;
        for _ in 0..1000 {
            for leg in Leg::ALL {
                state.contact[leg] = state.t_leg[leg] >= 0.49;
            }
            update(&mut state, &params, wish, &Surprises::default(), 1e-3);
            let (lower, upper) = force_bounds(&state, &params, 80.0, Leg::LF);
            assert!(lower <= upper && (upper - last).abs() < step, "{last} to {upper}");
            last = upper;
        }
    }
}
