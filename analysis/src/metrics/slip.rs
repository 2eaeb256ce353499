//! Slip: travel of feet in contact with the ground.

use serde::Serialize;

use crate::run::{LEGS, Run};
use crate::stats::Distribution;

/// Travel of the center of one foot during true contact. Rolling of the foot is included.
#[derive(Clone, Debug, Serialize)]
pub struct FootSlip {
    /// Name of the leg.
    pub leg: &'static str,
    /// Horizontal travel, m.
    pub travel_m: f64,
    /// Horizontal speed, m/s.
    pub speed: Option<Distribution>,
}

pub(super) fn of(run: &Run) -> Option<[FootSlip; 4]> {
    let period_s = run.period_s();
    run.has("GROUND_TRUTH").then(|| {
        std::array::from_fn(|leg| {
            let speeds: Vec<f64> =
                run.ticks.iter().filter_map(|t| t.truth.as_ref().and_then(|w| w.slip_speed(leg))).collect();
            FootSlip {
                leg: LEGS[leg],
                // The sum of no speeds is -0.0.
                travel_m: (0.0 + speeds.iter().sum::<f64>()) * period_s,
                speed: Distribution::of(speeds),
            }
        })
    })
}
