//! Compares a changed controller with the recorded one on the same inputs.
//!
//! The recorded inputs are the response to the recorded commands. A what-if replay is therefore valid while the two commands are close,
//! until the first tick at which the torques of a joint differ by more than a bound.

use lcmtypes::{ControllerTick, Message, RobotCommand, WbcSolution, channels};

/// Default bound: largest torque difference of a joint for which a what-if replay is valid, N m.
pub const DEFAULT_BOUND: f64 = 20.0;

/// Largest number of samples of a what-if replay.
const MAX_SAMPLES: usize = 1 << 13;

/// A parameter override from a tick or time on.
#[derive(Debug, Clone, PartialEq)]
pub struct TimedOverride {
    /// First tick or time.
    pub when: When,
    /// Dotted key.
    pub key: String,
    /// TOML value.
    pub value: String,
}

/// A tick or a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When {
    /// The tick of this number.
    Tick(i64),
    /// The first tick at or after this time, s since the run's first tick.
    Seconds(f64),
}

impl When {
    /// Whether a tick is at or after this.
    pub(super) fn is_reached(self, tick: i64, since_s: f64) -> bool {
        match self {
            When::Tick(at) => tick >= at,
            When::Seconds(at) => since_s >= at,
        }
    }
}

/// Results of a what-if replay. Statistics are of the changed controller, up to the departure.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct WhatIf {
    /// The bound, N m.
    pub bound: f64,
    /// First tick at which a torque exceeds the bound; `None` if none does, or the log contains no ROBOT_COMMAND.
    pub departure: Option<Departure>,
    /// Number of ticks before it, over which the following is computed.
    pub ticks: u64,
    /// Largest difference of a joint's torques, N m.
    pub tau_difference_max: f64,
    /// Root mean square of the differences of all joints, N m.
    pub tau_difference_rms: f64,
    /// Root mean square of the new torques of all joints, N m.
    pub tau_rms: f64,
    /// Ticks without a QP solution.
    pub qp_failed_ticks: u64,
    /// Mean iterations of the QP solver.
    pub qp_iterations: f64,
    /// Mean residuals of contact (m/s²), trunk and posture (rad/s²).
    pub residuals: [f64; 3],
    /// Ticks in which the new controller damped the joints.
    pub damped_ticks: u64,
    /// Timed overrides that are later than the replayed part.
    pub changes_not_reached: u64,
    /// Torques of every tick of the whole replay, or evenly spaced ones: at most 8192.
    #[serde(skip)]
    pub samples: Vec<Sample>,
}

/// The tick from which a what-if replay is not valid.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Departure {
    /// Tick.
    pub tick: i64,
    /// Its time, ns.
    pub t_ns: i64,
    /// The same, s since the run's first tick.
    pub t_s: f64,
    /// Joint, URDF order.
    pub joint: usize,
    /// New torque minus recorded one, N m.
    pub by: f64,
}

/// Torques of a tick, by joint, N m.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Time of the tick, s since the run's first tick.
    pub t_s: f64,
    /// As recorded; empty without a recorded command.
    pub recorded: Vec<f32>,
    /// Replayed.
    pub replayed: Vec<f32>,
}

/// Collects [`WhatIf`] tick by tick.
pub(super) struct Collector {
    bound: f64,
    departure: Option<Departure>,
    ticks: u64,
    max: f64,
    sum_difference: f64,
    sum_tau: f64,
    values: u64,
    compared: u64,
    failed: u64,
    iterations: f64,
    residuals: [f64; 3],
    damped: u64,
    samples: Vec<Sample>,
    /// One sample is kept every so many ticks.
    stride: u64,
    /// Ticks up to the next sample.
    until_sample: u64,
}

impl Collector {
    pub fn new(bound: f64) -> Self {
        Collector {
            bound,
            departure: None,
            ticks: 0,
            max: 0.0,
            sum_difference: 0.0,
            sum_tau: 0.0,
            values: 0,
            compared: 0,
            failed: 0,
            iterations: 0.0,
            residuals: [0.0; 3],
            damped: 0,
            samples: Vec::new(),
            stride: 1,
            until_sample: 0,
        }
    }

    /// Adds a sample if one is due. If there are too many, every second is dropped and the stride doubles, so that memory is bounded.
    fn sample(&mut self, sample: impl FnOnce() -> Sample) {
        if self.until_sample > 0 {
            self.until_sample -= 1;
            return;
        }
        if self.samples.len() == MAX_SAMPLES {
            let mut index = 0;
            self.samples.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride *= 2;
            // The number of samples was even, so this one is due with the double stride too.
        }
        self.samples.push(sample());
        self.until_sample = self.stride - 1;
    }

    /// Adds a tick: the recorded command, if any, and the replayed outputs.
    pub fn tick(&mut self, (tick, t_ns, t_s): (i64, i64, f64), recorded: Option<&[u8]>, outbox: &controller::Outbox) {
        let command = |bytes: Option<&[u8]>| bytes.and_then(|bytes| RobotCommand::decode(bytes).ok());
        let recorded = command(recorded).map(|command| command.tau).unwrap_or_default();
        let Some(new) = command(outbox.get(channels::ROBOT_COMMAND)) else { return };
        #[expect(clippy::cast_possible_truncation, reason = "samples are for figures")]
        let samples = |tau: &[f64]| tau.iter().map(|tau| *tau as f32).collect();
        self.sample(|| Sample { t_s, recorded: samples(&recorded), replayed: samples(&new.tau) });
        if self.departure.is_some() {
            return;
        }
        let differences = new.tau.iter().zip(&recorded).map(|(new, old)| new - old);
        let largest = differences.clone().enumerate().max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()));
        if let Some((joint, by)) = largest
            && by.abs() > self.bound
        {
            self.departure = Some(Departure { tick, t_ns, t_s, joint, by });
            return;
        }
        self.ticks += 1;
        self.max = self.max.max(largest.map_or(0.0, |(_, by)| by.abs()));
        for by in differences {
            self.sum_difference += by * by;
            self.compared += 1;
        }
        self.sum_tau += new.tau.iter().map(|tau| tau * tau).sum::<f64>();
        self.values += new.tau.len() as u64;
        if let Some(Ok(wbc)) = outbox.get(channels::WBC_SOLUTION).map(WbcSolution::decode) {
            let failed = [WbcSolution::STATUS_FAILED, WbcSolution::STATUS_INFEASIBLE].contains(&wbc.status);
            self.failed += u64::from(failed);
            self.iterations += f64::from(wbc.iterations);
            self.residuals.iter_mut().zip(wbc.residual).for_each(|(sum, residual)| *sum += residual);
        }
        if let Some(Ok(status)) = outbox.get(channels::CONTROLLER_TICK).map(ControllerTick::decode) {
            self.damped += u64::from(status.mode == ControllerTick::MODE_DAMPING);
        }
    }

    /// The results. `changes_not_reached`: as in [`WhatIf`].
    pub fn finish(self, changes_not_reached: u64) -> WhatIf {
        let mean = |sum: f64, n: u64| if n > 0 { sum / n as f64 } else { 0.0 };
        WhatIf {
            bound: self.bound,
            departure: self.departure,
            ticks: self.ticks,
            tau_difference_max: self.max,
            tau_difference_rms: mean(self.sum_difference, self.compared).sqrt(),
            tau_rms: mean(self.sum_tau, self.values).sqrt(),
            qp_failed_ticks: self.failed,
            qp_iterations: mean(self.iterations, self.ticks),
            residuals: self.residuals.map(|sum| mean(sum, self.ticks)),
            damped_ticks: self.damped,
            changes_not_reached,
            samples: self.samples,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_evenly_spaced_and_bounded() {
        for ticks in [0, 1, MAX_SAMPLES, MAX_SAMPLES + 1, 5 * MAX_SAMPLES + 3] {
            let mut collector = Collector::new(1.0);
            for tick in 0..ticks {
                collector.sample(|| Sample { t_s: tick as f64, recorded: Vec::new(), replayed: Vec::new() });
            }
            let times: Vec<f64> = collector.samples.iter().map(|sample| sample.t_s).collect();
            let stride = collector.stride as usize;
            assert!(
                times.len() <= MAX_SAMPLES && times.len() >= ticks.min(MAX_SAMPLES / 2),
                "{ticks}: {}",
                times.len()
            );
            assert!(times.iter().zip((0..ticks).step_by(stride)).all(|(t_s, tick)| *t_s == tick as f64), "{ticks}");
            assert_eq!(times.len(), ticks.div_ceil(stride));
        }
    }
}
