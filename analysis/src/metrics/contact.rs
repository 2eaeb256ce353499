//! Contact estimate compared with ground truth: flags, touchdowns, forces.

use lcmtypes::LegState;
use serde::Serialize;

use crate::run::{LEGS, Run, Tick};
use crate::stats::{Distribution, ErrorStats};

/// A touchdown is not false if true contact follows within this time, s.
const EARLY_S: f64 = 0.05;
/// A touchdown detected later than this after true contact counts as missed, ms.
const MISSED_MS: f64 = 20.0;

/// Estimated and true contact.
#[derive(Clone, Debug, Serialize)]
pub struct ContactMetrics {
    /// Legs in the order LF RF LH RH.
    pub legs: [LegContact; 4],
    /// Touchdowns of all legs together.
    pub touchdowns: Touchdowns,
}

/// Contact of one leg. Counts are ticks; "found" is the estimated flag, "true" is the flag of the simulator.
#[derive(Clone, Debug, Serialize)]
pub struct LegContact {
    /// Name of the leg.
    pub leg: &'static str,
    /// True contact, detected.
    pub true_found: u64,
    /// True contact, not detected.
    pub true_missed: u64,
    /// No contact, none detected.
    pub none_none: u64,
    /// No contact, but contact detected.
    pub none_found: u64,
    /// Fraction of ticks in which estimate and ground truth agree.
    pub accuracy: Option<f64>,
    /// Estimated − true normal force during true contact, N.
    pub force_error_contact_n: Option<ErrorStats>,
    /// Estimated − true normal force without contact, N.
    pub force_error_air_n: Option<ErrorStats>,
    /// Touchdowns of the leg.
    pub touchdowns: Touchdowns,
}

/// Ends of swings, compared with the first true contact in the second half of the swing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Touchdowns {
    /// Swings that ended in stance.
    pub count: u64,
    /// False touchdowns: without true contact before the end of the swing or within 50 ms after it.
    pub false_count: u64,
    /// Missed touchdowns: detected more than 20 ms after true contact.
    pub missed_count: u64,
    /// Start of stance − first true contact, ms, of all but the false ones; negative: detected early.
    pub delay_ms: Option<Distribution>,
}

impl ContactMetrics {
    /// `None` without ground truth or without estimate.
    pub(crate) fn of(run: &Run) -> Option<Self> {
        if !run.has("GROUND_TRUTH") || !run.has("CONTACT_ESTIMATE") {
            return None;
        }
        let swings: [Vec<Option<f64>>; 4] = std::array::from_fn(|leg| touchdown_delays_ms(&run.ticks, leg));
        let legs = std::array::from_fn(|leg| leg_contact(run, leg, &swings[leg]));
        Some(Self { legs, touchdowns: summarize(&swings.concat()) })
    }
}

fn leg_contact(run: &Run, leg: usize, swings: &[Option<f64>]) -> LegContact {
    let mut counts = [[0_u64; 2]; 2];
    let mut force_errors = [Vec::new(), Vec::new()];
    for tick in &run.ticks {
        let (Some(truth), Some(estimate)) = (&tick.truth, &tick.contact) else { continue };
        let touches = usize::from(truth.contact[leg]);
        counts[touches][usize::from(estimate.contact[leg])] += 1;
        force_errors[touches].extend(tick.true_normal_force(leg).map(|f| estimate.f_normal[leg] - f));
    }
    let [[none_none, none_found], [true_missed, true_found]] = counts;
    let total = none_none + none_found + true_missed + true_found;
    let [air, contact] = force_errors;
    LegContact {
        leg: LEGS[leg],
        true_found,
        true_missed,
        none_none,
        none_found,
        accuracy: (total > 0).then(|| (none_none + true_found) as f64 / total as f64),
        force_error_contact_n: ErrorStats::of(contact),
        force_error_air_n: ErrorStats::of(air),
        touchdowns: summarize(swings),
    }
}

fn summarize(delays_ms: &[Option<f64>]) -> Touchdowns {
    Touchdowns {
        count: delays_ms.len() as u64,
        false_count: delays_ms.iter().filter(|delay| delay.is_none()).count() as u64,
        missed_count: delays_ms.iter().flatten().filter(|delay| **delay > MISSED_MS).count() as u64,
        delay_ms: Distribution::of(delays_ms.iter().flatten().copied()),
    }
}

/// One entry per swing that ended in stance: the delay of the touchdown, ms, or `None` for a false touchdown.
///
/// Contact in the first half of a swing is ignored, as in the controller: the foot has not left the ground yet.
pub(crate) fn touchdown_delays_ms(ticks: &[Tick], leg: usize) -> Vec<Option<f64>> {
    let mut delays = Vec::new();
    let mut descending = false;
    let mut first_contact_s = None;
    for (i, tick) in ticks.iter().enumerate() {
        let Some(legs) = &tick.legs else { continue };
        match legs.state[leg] {
            LegState::STATE_SWING_DOWN | LegState::STATE_REACH => {
                descending = true;
                if first_contact_s.is_none() && touches(tick, leg) {
                    first_contact_s = Some(tick.t_s);
                }
            }
            LegState::STATE_STANCE if descending => {
                let soon = ticks[i..].iter().take_while(|later| later.t_s <= tick.t_s + EARLY_S);
                let contact_s = first_contact_s.or_else(|| soon.into_iter().find(|t| touches(t, leg)).map(|t| t.t_s));
                delays.push(contact_s.map(|t_s| (tick.t_s - t_s) * 1e3));
                (descending, first_contact_s) = (false, None);
            }
            _ => (descending, first_contact_s) = (false, None),
        }
    }
    delays
}

fn touches(tick: &Tick, leg: usize) -> bool {
    tick.truth.as_ref().is_some_and(|truth| truth.contact[leg])
}
