//! The contact estimator against the simulator: flags, touchdowns, forces.

use lcmtypes::LegState;
use serde::Serialize;

use crate::run::{LEGS, Run, Tick};
use crate::stats::{Distribution, ErrorStats};

/// True contact after a touchdown that is still counted as its cause: the foot was judged down a little early, s.
const EARLY_S: f64 = 0.05;
/// A touchdown judged later than this after true contact counts as missed, ms.
const MISSED_MS: f64 = 20.0;

/// Estimated against true contact.
#[derive(Clone, Debug, Serialize)]
pub struct ContactMetrics {
    /// Legs in the order LF RF LH RH.
    pub legs: [LegContact; 4],
    /// Touchdowns of all legs together.
    pub touchdowns: Touchdowns,
}

/// Contact of one leg. Counts are ticks; "found" is the estimated flag, "true" the simulator's.
#[derive(Clone, Debug, Serialize)]
pub struct LegContact {
    /// Name of the leg.
    pub leg: &'static str,
    /// True contact, found.
    pub true_found: u64,
    /// True contact, not found.
    pub true_missed: u64,
    /// No contact, none found.
    pub none_none: u64,
    /// No contact, one found.
    pub none_found: u64,
    /// Share of ticks in which flag and truth agree.
    pub accuracy: Option<f64>,
    /// Estimated − true normal force while the foot truly touches, N.
    pub force_error_contact_n: Option<ErrorStats>,
    /// Estimated − true normal force while it does not, N: what the estimator makes of a swinging leg.
    pub force_error_air_n: Option<ErrorStats>,
    /// Its touchdowns.
    pub touchdowns: Touchdowns,
}

/// Ends of swings, against the first true contact of the second half of the swing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Touchdowns {
    /// Swings that ended in stance.
    pub count: u64,
    /// Of these, those without true contact before or within 50 ms after: false touchdowns.
    pub false_count: u64,
    /// Of these, those judged more than 20 ms after true contact: missed when they came.
    pub missed_count: u64,
    /// Stance − first true contact, ms, of the others; negative = judged early.
    pub delay_ms: Option<Distribution>,
}

impl ContactMetrics {
    /// `None` without truth or without estimate.
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

/// One entry a swing that ended in stance: the delay of that end, or `None` for a false touchdown.
///
/// The first half of a swing is left out, as the controller leaves it out: a foot that scuffs while it lifts is not landing.
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
