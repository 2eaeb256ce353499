//! Swing trajectory: half an ellipse over the ground, continued downward until contact.

use crate::math::{cos, sin};
use std::f64::consts::PI;

/// Reference along the step and along the terrain normal, in the swing frame.
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
}

/// Reference at time `t` since lift-off.
///
/// ```text
/// s  = ( L_s/2 (1 - cos(π t/T_sw)),  H_s sin(π t/T_sw) )                t < T_sw
/// s  = ( L_s,                        H_s sin(π t/T_sw) )                up to T_sw (1 + reach), then held
/// ```
/// Source: Raiola et al. 2020, eqs. (26), (29); the reach goes straight down, since the ellipse would pull the foot back.
///
/// - `length`, `height`: `L_s`, `H_s`, m; `T_sw`: swing time, s; `reach`: in swing times, at most 0.5.
pub fn swing_point(t: f64, T_sw: f64, length: f64, height: f64, reach: f64) -> SwingPoint {
    let rate = PI / T_sw;
    let end = T_sw * (1.0 + reach);
    let t_held = t.min(end);
    let (x, xd) = if t < T_sw {
        (0.5 * length * (1.0 - cos(rate * t)), 0.5 * length * rate * sin(rate * t))
    } else {
        (length, 0.0)
    };
    let zd = if t < end { height * rate * cos(rate * t) } else { 0.0 };
    SwingPoint { x, z: height * sin(rate * t_held), xd, zd }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_and_lands_on_the_ground_with_no_speed_along_it() {
        let start = swing_point(0.0, 0.5, 0.2, 0.1, 0.5);
        assert_eq!((start.x, start.z, start.xd), (0.0, 0.0, 0.0));
        let top = swing_point(0.25, 0.5, 0.2, 0.1, 0.5);
        assert!((top.x - 0.1).abs() < 1e-12 && (top.z - 0.1).abs() < 1e-12 && top.zd.abs() < 1e-12);
        let land = swing_point(0.5, 0.5, 0.2, 0.1, 0.5);
        assert!((land.x - 0.2).abs() < 1e-12 && land.z.abs() < 1e-12 && land.xd == 0.0 && land.zd < 0.0);
    }

    #[test]
    fn velocity_is_the_derivative_also_where_the_reach_begins_and_ends() {
        let d = 1e-7;
        for t in [0.1, 0.37, 0.499, 0.501, 0.6, 0.74, 0.8] {
            let (a, b) = (swing_point(t - d, 0.5, 0.2, 0.1, 0.5), swing_point(t + d, 0.5, 0.2, 0.1, 0.5));
            let at = swing_point(t, 0.5, 0.2, 0.1, 0.5);
            assert!(((b.x - a.x) / (2.0 * d) - at.xd).abs() < 1e-6, "x at {t}");
            assert!(((b.z - a.z) / (2.0 * d) - at.zd).abs() < 1e-6, "z at {t}");
        }
    }

    #[test]
    fn reach_ends_a_step_height_below_the_lift_off() {
        let end = swing_point(2.0, 0.5, 0.2, 0.1, 0.5);
        assert!((end.z + 0.1).abs() < 1e-12);
        assert_eq!((end.x, end.xd, end.zd), (0.2, 0.0, 0.0));
    }
}
