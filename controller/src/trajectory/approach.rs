//! Motion of one coordinate to a goal within limits of velocity and acceleration.

/// The next position and velocity on the way to a goal, at which the motion ends at rest.
///
/// With velocity `v` now and `w` after the step, the way of the step is `(v + w) dt / 2`, and the way to stop from `w` is `w² / (2 a)`. `w` is the
/// solution of `(v + w) dt / 2 + w² / (2 a) = goal - q`, within the limits of velocity and acceleration.
///
/// - `v_max`, `a`: largest velocity and acceleration.
/// - `dt`: duration of the step, s.
pub fn approach((q, v): (f64, f64), goal: f64, v_max: f64, a: f64, dt: f64) -> (f64, f64) {
    let left = goal - q - 0.5 * v * dt;
    // The last condition matters for a goal that changes, with limits at which the velocity can change by more than `v_max` in a step.
    if left.abs() <= 0.5 * a * dt * dt && v.abs() <= a * dt && (goal - q).abs() <= v_max * dt {
        return (goal, 0.0);
    }
    let fastest = a * ((0.25 * dt * dt + 2.0 * left.abs() / a).sqrt() - 0.5 * dt);
    let wanted = fastest.min(v_max) * if left < 0.0 { -1.0 } else { 1.0 };
    let next = wanted.max(v - a * dt).min(v + a * dt);
    (q + 0.5 * (v + next) * dt, next)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of 1 rad with 0.5 rad/s and 2 rad/s²: 0.25 s to accelerate and to brake, 1.75 s at full speed. Closed form: 2.25 s.
    #[test]
    fn a_motion_takes_the_time_of_its_limits_and_ends_at_the_goal() {
        let (v_max, a, dt) = (0.5, 2.0, 1e-3);
        let (mut at, mut steps, mut fastest) = ((0.0, 0.0), 0, 0.0_f64);
        while at != (1.0, 0.0) && steps < 10_000 {
            let next = approach(at, 1.0, v_max, a, dt);
            assert!((next.1 - at.1).abs() <= a * dt * (1.0 + 1e-12) && next.0 <= 1.0 + 1e-12, "{at:?} {next:?}");
            (at, steps, fastest) = (next, steps + 1, fastest.max(next.1));
        }
        assert_eq!(fastest, v_max);
        assert!((2250..=2252).contains(&steps), "{steps}");
    }

    /// From 0.5 rad/s away from the goal: 0.25 s to stop after 0.0625 m, then back. The references stay continuous.
    #[test]
    fn a_new_goal_behind_the_motion_is_reached_without_a_step() {
        let (a, dt) = (2.0, 1e-3);
        let (mut at, mut highest) = ((0.0, 0.5), 0.0_f64);
        for _ in 0..5000 {
            let next = approach(at, -0.1, 0.5, a, dt);
            assert!((next.1 - at.1).abs() <= a * dt * (1.0 + 1e-12));
            at = next;
            highest = highest.max(at.0);
        }
        assert_eq!(at, (-0.1, 0.0));
        assert!((highest - 0.0625).abs() < 1e-3, "{highest}");
    }
}
