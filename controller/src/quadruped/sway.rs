//! Sway: the periodic displacement of the base from its straight path that keeps it above the supporting feet.
//!
//! A departure from the source, where a residual load on the opposite leg moves the centre of mass into the support triangle. That acts only
//! once the robot tips: a crawl with a duty factor of 0.8 has to shift its weight from one triangle to the next in 0.125 s, and falls. Here the
//! base follows the periodic motion of a linear inverted pendulum. During each swing its zero-moment point is constant, between the centre and
//! the foot opposite to the swinging one:
//!
//! ```text
//! ÿ = k² (y - z),  k² = g/h,  z constant from the middle of one four-leg stance to that of the next
//! y(t) = Σ_i z_i W_i(t)          W_i: bounded response, periodic with the stride, to z = 1 in interval i and 0 elsewhere
//! ```
//! `W` is the integral of the periodic Green's function `G(τ) = k/2 cosh(k (T/2 - |τ|)) / sinh(k T/2)` over the interval. A trot needs no sway,
//! because its two swinging feet are opposite to each other.

use super::gait::Transitions;
use super::leg::{Leg, PerLeg};
use super::robot::Robot;
use super::state::State;
use super::timing::{Timing, cyclic, gait_params};
use crate::math::sinh;
use crate::model::GRAVITY;
use crate::params::Params;

/// Natural frequency of the critically damped motion with which a sway decays when its gait ends or another gait starts, rad/s.
const REST_RATE: f64 = 5.0;

/// Updates the sway and its rate.
pub fn update(robot: &Robot, params: &Params, transitions: &Transitions, state: &mut State, dt: f64) {
    if transitions.gait_starts {
        center(robot, state);
    } else if transitions.gait_ends {
        (state.sway_rest_H, state.sway_rest_rate_H) = (state.sway_H, state.sway_rate_H);
    }
    let planned = if state.gait_running { at_clock(robot, params, state, state.gait_clock) } else { [0.0; 2] };
    for (k, planned) in planned.into_iter().enumerate() {
        let (rest, rest_rate) = (state.sway_rest_H[k], state.sway_rest_rate_H[k]);
        // Implicit integration of the rate is stable for any time step.
        let stopped =
            (rest_rate - REST_RATE * REST_RATE * rest * dt) / ((1.0 + REST_RATE * dt) * (1.0 + REST_RATE * dt));
        state.sway_rest_rate_H[k] = stopped;
        state.sway_rest_H[k] = rest + stopped * dt;
        let moved = planned + state.sway_rest_H[k];
        if dt > 0.0 {
            state.sway_rate_H[k] = (moved - state.sway_H[k]) / dt;
        }
        state.sway_H[k] = moved;
    }
}

/// At the start of a gait the references assume that the base is at rest above the centre of the feet. Its present speed and distance from there
/// become a sway that decays in the lead-in.
fn center(robot: &Robot, state: &mut State) {
    for k in 0..2 {
        let ahead = Leg::ALL.map(|leg| state.p_stance_H[leg][k] - robot.legs[leg].p_nominal_H[k]);
        let middle = ahead.iter().sum::<f64>() / 4.0;
        for leg in Leg::ALL {
            state.p_stance_H[leg][k] -= middle;
        }
        state.sway_H[k] -= middle;
        state.sway_rest_H[k] = state.sway_H[k];
        state.sway_rest_rate_H[k] = state.sway_rate_H[k] + robot.sweep[k] * state.v_H_des[k];
        state.v_H_des[k] = 0.0;
    }
}

/// Sway at a time `clock` of the gait clock, m in H. It increases in the lead-in and is then periodic with the stride.
pub fn at_clock(robot: &Robot, params: &Params, state: &State, clock: f64) -> [f64; 2] {
    let part = gait_params(state.gait, params).sway;
    if part == 0.0 {
        return [0.0; 2];
    }
    let timing = Timing::of(state, params);
    let k = (GRAVITY / robot.nominal_height).sqrt();
    let risen = (1.0 + clock / timing.lead_in).clamp(0.0, 1.0);
    let risen = risen * risen * (3.0 - 2.0 * risen);
    let mut sway = [0.0; 2];
    for leg in Leg::ALL.into_iter().filter(|leg| timing.steps(*leg)) {
        let since = cyclic(clock - timing.lift_off[leg] + timing.T_ramp, timing.T);
        let weight = 0.5 * part * risen * response(since, until_next(&timing.lift_off, leg, timing.T), timing.T, k);
        let [from, to] = [leg, leg.opposite()].map(|leg| robot.legs[leg].p_nominal_H);
        sway[0] += weight * (to.x - from.x);
        sway[1] += weight * (to.y - from.y);
    }
    sway
}

/// Time from a leg's lift-off to the next lift-off of a leg that does not lift together with it, s.
fn until_next(lift_off: &PerLeg<f64>, leg: Leg, T: f64) -> f64 {
    lift_off.0.iter().map(|at| cyclic(at - lift_off[leg], T)).filter(|gap| *gap > 1e-9).fold(T, f64::min)
}

/// `W` at the time `since` after the start of an interval of duration `length`, both in `[0, T]`.
fn response(since: f64, length: f64, T: f64, k: f64) -> f64 {
    let s = |t: f64| sinh(k * (0.5 * T - t));
    let scale = 0.5 / sinh(0.5 * k * T);
    if since < length { 1.0 - scale * (s(since) + s(length - since)) } else { scale * (s(since - length) - s(since)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_obeys_the_pendulum_equation_and_is_one_over_the_whole_stride() {
        let (T, L, k) = (2.5, 0.625, 4.0);
        let d = 1e-4;
        for t in [0.05, 0.3, 0.6, 0.7, 1.5, 2.4] {
            let [a, b, c] = [t - d, t, t + d].map(|t| response(t, L, T, k));
            let zmp = b - (a - 2.0 * b + c) / (d * d * k * k);
            let expected = if t < L { 1.0 } else { 0.0 };
            assert!((zmp - expected).abs() < 1e-5, "{t}: {zmp}");
            let whole: f64 = (0..4).map(|i| response(cyclic(t - f64::from(i) * L, T), L, T, k)).sum();
            assert!((whole - 1.0).abs() < 1e-12);
        }
        assert!((response(T, L, T, k) - response(0.0, L, T, k)).abs() < 1e-12);
    }
}
