//! Swing trajectory: half an ellipse above the ground, continued downward until contact.
//!
//! In the source the ellipse angle increases at a constant rate, so the vertical velocity reference jumps from 0 to 1.3 m/s at the lift-off (4 Hz,
//! 10 cm). The vertical error of the foot is then 5 to 10 mm in the first tenth of a swing, and 0.5 mm after it. Here the first half of the swing
//! starts from rest and takes the same time; path, apex and landing are unchanged.

use super::params::SwingParams;
use crate::math::{cos, sin};
use std::f64::consts::PI;

/// Foot reference along the step and along the terrain normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwingPoint {
    /// Along the step, m.
    pub x: f64,
    /// Along the normal, m.
    pub z: f64,
    /// Velocity along the step, m/s.
    pub xd: f64,
    /// Velocity along the normal, m/s.
    pub zd: f64,
    /// Acceleration along the step, m/s².
    pub xdd: f64,
    /// Acceleration along the normal, m/s².
    pub zdd: f64,
}

/// Foot reference at time `t` (s) after lift-off.
///
/// ```text
/// s  = ( L_s/2 (1 - cos(π φ)),  H_s sin(π φ) ),   φ = φ(t/T_sw)         t < T_sw
/// s  = ( L_s,                   H_s sin(π t/T_sw) )                     up to T_sw (1 + reach), then held
/// ```
/// Source: Raiola et al. 2020, eqs. (26), (29), with `progress` for φ if the swing starts from rest, else φ = t/T_sw. The reach moves straight down,
/// because the ellipse would move the foot backward.
///
/// - `length`, `height`: `L_s`, `H_s`, m.
/// - `T_sw`: swing time, s.
/// - `params`: `reach_time` and `start_from_rest` are used.
pub fn swing_point(t: f64, T_sw: f64, length: f64, height: f64, params: &SwingParams) -> SwingPoint {
    let end = T_sw * (1.0 + params.reach_time);
    let s = t.clamp(0.0, end) / T_sw;
    let (phase, rate, growth) = if params.start_from_rest { progress(s) } else { (s, 1.0, 0.0) };
    let (angle, rate, growth) = (PI * phase, PI * rate / T_sw, PI * growth / (T_sw * T_sw));
    let (sine, cosine) = (sin(angle), cos(angle));
    let (x, xd, xdd) = if t < T_sw {
        let half = 0.5 * length;
        (half * (1.0 - cosine), half * rate * sine, half * (growth * sine + rate * rate * cosine))
    } else {
        (length, 0.0, 0.0)
    };
    let (zd, zdd) =
        if t < end { (height * rate * cosine, height * (growth * cosine - rate * rate * sine)) } else { (0.0, 0.0) };
    SwingPoint { x, z: height * sine, xd, zd, xdd, zdd }
}

/// Depth below the lift-off point at which a foot that finds no ground is held, m.
///
/// - `height`: `H_s` of the swing, m.
/// - `params`: `reach_time` is used.
pub fn held_depth(height: f64, params: &SwingParams) -> f64 {
    height * sin(PI * params.reach_time)
}

/// Completed fraction φ of the half ellipse at a fraction `s` of the swing time, and its first and second derivative.
///
/// ```text
/// φ(s) = ½ (3u² - 3u³ + u⁴),  u = 2s          s < ½: φ and φ' from 0 to ½ and 1, where φ'' = 0
/// φ(s) = s                                    s ≥ ½
/// ```
fn progress(s: f64) -> (f64, f64, f64) {
    if s >= 0.5 {
        return (s, 1.0, 0.0);
    }
    let u = 2.0 * s;
    (0.5 * u * u * (3.0 + u * (u - 3.0)), u * (6.0 + u * (4.0 * u - 9.0)), 12.0 * (1.0 - u) * (1.0 - 2.0 * u))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SWING: SwingParams = SwingParams {
        height: 0.1,
        clik_gain: 10.0,
        reach_time: 0.5,
        start_from_rest: true,
        kp: [0.0; 3],
        kd: [0.0; 3],
        inertia: false,
    };
    const PRINTED: SwingParams = SwingParams { start_from_rest: false, ..SWING };

    #[test]
    fn starts_from_rest_and_lands_without_speed_along_the_ground() {
        let start = swing_point(0.0, 0.5, 0.2, 0.1, &SWING);
        assert_eq!([start.x, start.z, start.xd, start.zd], [0.0; 4]);
        let top = swing_point(0.25, 0.5, 0.2, 0.1, &SWING);
        assert!((top.x - 0.1).abs() < 1e-12 && (top.z - 0.1).abs() < 1e-12 && top.zd.abs() < 1e-12);
        let land = swing_point(0.5, 0.5, 0.2, 0.1, &SWING);
        assert!((land.x - 0.2).abs() < 1e-12 && land.z.abs() < 1e-12 && land.xd == 0.0 && land.zd < 0.0);
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_in_swing_and_reach() {
        let d = 1e-7;
        for (params, t) in [SWING, PRINTED]
            .iter()
            .flat_map(|params| [1e-3, 0.1, 0.249, 0.251, 0.37, 0.499, 0.501, 0.6, 0.74, 0.8].map(|t| (params, t)))
        {
            let (a, b) = (swing_point(t - d, 0.5, 0.2, 0.1, params), swing_point(t + d, 0.5, 0.2, 0.1, params));
            let at = swing_point(t, 0.5, 0.2, 0.1, params);
            assert!(((b.x - a.x) / (2.0 * d) - at.xd).abs() < 1e-6, "x at {t}");
            assert!(((b.z - a.z) / (2.0 * d) - at.zd).abs() < 1e-6, "z at {t}");
            assert!(((b.xd - a.xd) / (2.0 * d) - at.xdd).abs() < 1e-5, "xd at {t}");
            assert!(((b.zd - a.zd) / (2.0 * d) - at.zdd).abs() < 1e-5, "zd at {t}");
        }
    }

    #[test]
    fn the_path_is_the_half_ellipse_at_any_time() {
        for t in [0.01, 0.1, 0.2, 0.3, 0.45] {
            let at = swing_point(t, 0.5, 0.2, 0.1, &SWING);
            let (x, z) = (at.x / 0.1 - 1.0, at.z / 0.1);
            assert!((x * x + z * z - 1.0).abs() < 1e-12, "{t}");
        }
    }

    #[test]
    fn the_acceleration_is_continuous_in_the_swing() {
        let d = 1e-6;
        let speed = |t: f64| swing_point(t, 0.5, 0.2, 0.1, &SWING);
        for at in [0.25, 0.1] {
            let (a, b, c, e) = (speed(at - 2.0 * d), speed(at - d), speed(at + d), speed(at + 2.0 * d));
            assert!(((b.xd - a.xd) - (e.xd - c.xd)).abs() / d < 1e-3, "x at {at}");
            assert!(((b.zd - a.zd) - (e.zd - c.zd)).abs() / d < 1e-3, "z at {at}");
        }
    }

    #[test]
    fn reach_ends_a_step_height_below_the_lift_off() {
        let end = swing_point(2.0, 0.5, 0.2, 0.1, &SWING);
        assert!((end.z + 0.1).abs() < 1e-12);
        assert_eq!((end.x, end.xd, end.zd), (0.2, 0.0, 0.0));
        for reach_time in [0.0, 0.2, 0.5] {
            let params = SwingParams { reach_time, ..SWING };
            let end = swing_point(2.0, 0.5, 0.2, 0.1, &params);
            assert!((end.z + held_depth(0.1, &params)).abs() < 1e-15, "{end:?}");
        }
    }

    #[test]
    fn the_printed_swing_lifts_off_at_full_vertical_speed() {
        let start = swing_point(0.0, 0.5, 0.2, 0.1, &PRINTED);
        assert!(start.xd == 0.0 && (start.zd - PI * 2.0 * 0.1).abs() < 1e-12, "{start:?}");
        // s = ( L_s/2 (1 - cos(π f t)), H_s sin(π f t) ) at t = 0.1 s, f = 2 Hz.
        let early = swing_point(0.1, 0.5, 0.2, 0.1, &PRINTED);
        assert!((early.x - 0.1 * (1.0 - cos(0.2 * PI))).abs() < 1e-12 && (early.z - 0.1 * sin(0.2 * PI)).abs() < 1e-12);
        for t in [0.25, 0.3, 0.49, 0.6] {
            assert_eq!(swing_point(t, 0.5, 0.2, 0.1, &PRINTED), swing_point(t, 0.5, 0.2, 0.1, &SWING));
        }
    }
}
