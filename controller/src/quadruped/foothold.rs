//! Foothold planner: the landing position of a swinging foot, in the horizontal frame H.
//!
//! No task tracks the base velocity; it results from the footholds. Source: Raiola et al. 2020, eqs. (19)-(25). The step of (22) starts at the lift-off
//! position, where the ellipse starts. The step time of (19) is chosen by `foothold.step_rule`.

use super::params::{FootholdParams, StepRule};
use super::timing::Timing;
use crate::math::atan2;
use nalgebra::Vector3;

/// Input of the planner, in H.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// Backward velocity of a standing foot under the base, m/s.
    pub v_H: [f64; 2],
    /// Shift by the capture point, m.
    pub capture_H: [f64; 2],
    /// Yaw rate command, rad/s.
    pub yaw_rate: f64,
    /// Time in which the base moves by the shift that the velocity command causes, s; see [`step_time`].
    pub T_step: f64,
    /// HAA joint from the base origin, m.
    pub p_hip_H: Vector3<f64>,
    /// Virtual foothold: position of the foot while the robot stands, m.
    pub p_virtual_H: Vector3<f64>,
    /// Position of the foot at lift-off, m.
    pub p_lift_H: Vector3<f64>,
    /// Longest step, m.
    pub max_length: f64,
}

/// A step from the lift-off position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Length `L_s`, m.
    pub length: f64,
    /// Heading `ψ_s`, rad, or `None` for a step shorter than 1 mm.
    pub heading: Option<f64>,
}

/// Step time by `foothold.step_rule`, s: `T_sw`, as in (19), or `T_st/2`.
pub fn step_time(timing: &Timing, params: &FootholdParams) -> f64 {
    match params.step_rule {
        StepRule::SwingTime => timing.T_sw,
        StepRule::HalfStance => 0.5 * timing.T_st,
    }
}

/// Plans the step to the virtual foothold, shifted by the distance of the step time at the commanded velocity.
///
/// ```text
/// ΔL = T_step ( (vx, vy) + ψ̇ e_z × x_hip )         D = ΔL + (x_f0 - x_lo)
/// L_s = |D|,  ψ_s = atan2(D.y, D.x)               xy only
/// ```
pub fn plan(query: &Query) -> Step {
    let Query { v_H, capture_H, yaw_rate, T_step, p_hip_H, p_virtual_H, p_lift_H, max_length } = query;
    let dx = T_step * (v_H[0] - yaw_rate * p_hip_H.y) + capture_H[0] + p_virtual_H.x - p_lift_H.x;
    let dy = T_step * (v_H[1] + yaw_rate * p_hip_H.x) + capture_H[1] + p_virtual_H.y - p_lift_H.y;
    let length = (dx * dx + dy * dy).sqrt();
    Step { length: length.min(*max_length), heading: (length >= 1e-3).then(|| atan2(dy, dx)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUERY: Query = Query {
        v_H: [0.0, 0.0],
        capture_H: [0.0, 0.0],
        yaw_rate: 0.0,
        T_step: 0.5,
        p_hip_H: Vector3::new(0.37, 0.2, 0.0),
        p_virtual_H: Vector3::new(0.37, 0.32, -0.58),
        p_lift_H: Vector3::new(0.37, 0.32, -0.58),
        max_length: 0.3,
    };

    #[test]
    fn without_command_a_foot_at_its_virtual_foothold_stays() {
        assert_eq!(plan(&QUERY), Step { length: 0.0, heading: None });
    }

    #[test]
    fn velocity_yaw_rate_and_return_to_the_virtual_foothold_add_up() {
        let forward = plan(&Query { v_H: [0.2, 0.0], ..QUERY });
        assert!((forward.length - 0.1).abs() < 1e-12 && forward.heading == Some(0.0));
        // Turning left moves the left front foot back and to the left: 0.5 * 0.4 * (-0.2, 0.37).
        let turn = plan(&Query { yaw_rate: 0.4, ..QUERY });
        assert!((turn.length - 0.2 * (0.2f64 * 0.2 + 0.37 * 0.37).sqrt()).abs() < 1e-12);
        assert!((turn.heading.unwrap() - atan2(0.37, -0.2)).abs() < 1e-12);
        let behind = plan(&Query { p_lift_H: Vector3::new(0.31, 0.32, -0.58), ..QUERY });
        assert!((behind.length - 0.06).abs() < 1e-12);
    }

    #[test]
    fn the_step_length_is_limited() {
        assert_eq!(plan(&Query { v_H: [3.0, 0.0], ..QUERY }).length, 0.3);
    }
}
