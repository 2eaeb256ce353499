//! The on-line trajectory generator of one coordinate: limits, arrival, time. Expected durations: `scripts/trajectory_fixtures.py`.

use crate::{INFINITY, MOTIONS};
use controller::math::Rng;
use controller::trajectory::{AxesReference, Axis, Limits, ReferenceError};

/// Relative tolerance of limits: rounding of a difference of positions near 1 m over a step of 0.1 ms.
const TOLERANCE: f64 = 1e-9;

/// A number from 10^low to 10^high.
fn magnitude(rng: &mut Rng, low: f64, high: f64) -> f64 {
    libm::pow(10.0, rng.uniform(low, high))
}

/// Limits of one of the three kinds.
fn limits(rng: &mut Rng, kind: usize) -> Limits {
    let (v, a, j) = (magnitude(rng, -1.0, 0.7), magnitude(rng, -0.5, 1.5), magnitude(rng, 0.0, 3.0));
    [Limits { v, a, j }, Limits { v, a, j: INFINITY }, Limits { v, a: INFINITY, j: INFINITY }][kind % 3]
}

/// Whether the step from one state to the next is within the limits.
fn check_step(from: &Axis, to: &Axis, limits: &Limits, dt: f64) {
    let within = |x: f64, limit: f64| assert!(x.abs() <= limit * (1.0 + TOLERANCE), "{from:?} {to:?} {limits:?} {dt}");
    within(to.v, limits.v);
    within(to.p - from.p, limits.v * dt);
    within(to.a, limits.a);
    if limits.a.is_finite() {
        within(to.v - from.v, limits.a * dt);
    }
    if limits.j.is_finite() {
        within(to.a - from.a, limits.j * dt);
        // Position and velocity are the integrals of the acceleration: the rest is at most what a jerk of the full size can give in a step.
        within(to.v - from.v - 0.5 * (from.a + to.a) * dt, 0.25 * limits.j * dt * dt + 1e-12);
        within(to.p - from.p - 0.5 * (from.v + to.v) * dt, 0.25 * limits.a * dt * dt + 1e-12);
    }
}

/// Longest time that a motion over `distance` from rest can take: that with each limit alone.
fn longest(distance: f64, limits: &Limits) -> f64 {
    let Limits { v, a, j } = *limits;
    distance / v + 2.0 * (distance / a).sqrt() + 4.0 * libm::cbrt(distance / (2.0 * j))
}

#[test]
fn motions_take_the_shortest_time() {
    let cases: Vec<[f64; 8]> = serde_json::from_str(include_str!("../data/trajectory_durations.json")).unwrap();
    assert_eq!(cases.len(), 400);
    let dt = 1e-3;
    for [p, v, a, goal, v_max, a_max, j_max, duration] in cases {
        let limits = Limits { v: v_max, a: a_max, j: j_max };
        let (mut axis, mut ticks) = (Axis { p, v, a }, 0);
        while axis != Axis::at_rest(goal) {
            let next = axis.step_to(goal, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            (axis, ticks) = (next, ticks + 1);
            assert!(ticks < 100_000, "{axis:?} does not reach {goal}");
        }
        let late = f64::from(ticks) * dt - duration;
        // The motion ends in a tick.
        assert!((-1e-9..=1.01 * dt).contains(&late), "{late} s late: {p} {v} {a} to {goal}, {limits:?}");
    }
}

#[test]
fn a_motion_from_rest_keeps_its_limits_and_does_not_overshoot() {
    let mut rng = Rng::new(1, "from rest");
    for motion in 0..MOTIONS {
        let (limits, dt) = (limits(&mut rng, motion), magnitude(&mut rng, -4.0, -1.5));
        let (start, goal) = (rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0));
        // Also steps that are long for the motion.
        let dt = dt.max(longest((goal - start).abs(), &limits) / 1000.0);
        let (mut axis, mut time) = (Axis::at_rest(start), 0.0);
        while axis != Axis::at_rest(goal) {
            let next = axis.step_to(goal, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            let (way, before) =
                ((next.p - start) * (goal - start).signum(), (axis.p - start) * (goal - start).signum());
            assert!(way >= before - 1e-12 && way <= (goal - start).abs() + 1e-12, "{axis:?} {next:?} to {goal}");
            axis = if limits.j.is_infinite() { Axis { a: 0.0, ..next } } else { next };
            time += dt;
            assert!(time <= longest((goal - start).abs(), &limits) + 4.0 * dt, "{axis:?} to {goal}, {limits:?}, {dt}");
        }
    }
}

#[test]
fn goals_may_change_at_any_time() {
    let mut rng = Rng::new(2, "changing goals");
    for motion in 0..MOTIONS {
        let (limits, dt) = (limits(&mut rng, motion), magnitude(&mut rng, -3.5, -2.0));
        let (mut axis, mut goal) = (Axis::at_rest(rng.uniform(-1.0, 1.0)), 0.0);
        for tick in 0..200 {
            if tick % 40 == 0 {
                goal = axis.p + rng.uniform(-1.0, 1.0) * magnitude(&mut rng, -4.0, 0.0);
            }
            let next = axis.step_to(goal, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            axis = next;
        }
        let (mut ticks, dt) = (0, dt.max(5e-3));
        while axis.p != goal || axis.v != 0.0 {
            let next = axis.step_to(goal, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            (axis, ticks) = (next, ticks + 1);
            assert!(ticks < 20_000, "{axis:?} does not reach {goal}: {limits:?}");
        }
    }
}

#[test]
fn lowered_limits_are_reached_as_fast_as_they_allow() {
    let mut rng = Rng::new(3, "lowered limits");
    for motion in 0..MOTIONS {
        let (wide, dt) = (limits(&mut rng, motion), magnitude(&mut rng, -3.5, -2.0));
        let mut part = || rng.uniform(0.05, 1.0);
        let narrow = Limits { v: wide.v * part(), a: wide.a * part(), j: wide.j * part() };
        let mut axis = Axis::at_rest(0.0);
        for _ in 0..rng.next_u64() % 200 {
            axis = axis.step_to(5.0, &wide, dt);
        }
        let (excess, a) = ((axis.v.abs() - narrow.v).max(0.0) + axis.a * axis.a / narrow.j, axis.a.abs());
        // To the acceleration limit, then to the velocity limit as in a motion from rest to rest in velocity.
        let time = if narrow.a.is_infinite() {
            0.0
        } else {
            2.0 * a / narrow.j + excess / narrow.a + 2.0 * (excess / narrow.j).sqrt()
        };
        let mut left = time + 2.0 * dt;
        for _ in 0..400 {
            let next = axis.step_to(5.0, &narrow, dt);
            if narrow.j.is_finite() {
                let (before, after) = (axis.a.abs(), next.a.abs());
                assert!(after <= narrow.a.max(before - narrow.j * dt) + TOLERANCE, "{axis:?} {next:?} {narrow:?}");
                assert!((next.a - axis.a).abs() <= narrow.j * dt * (1.0 + TOLERANCE), "{axis:?} {next:?} {narrow:?}");
            } else if narrow.a.is_finite() {
                let slowest = narrow.v.max(axis.v.abs() - narrow.a * dt);
                assert!(next.v.abs() <= slowest + TOLERANCE, "{axis:?} {next:?} {narrow:?}");
            }
            (axis, left) = (next, left - dt);
            assert!(left > 0.0 || axis.v <= narrow.v * (1.0 + TOLERANCE), "{axis:?} {narrow:?} {wide:?}");
        }
    }
}

#[test]
fn a_velocity_is_reached_within_the_limits() {
    let mut rng = Rng::new(4, "velocities");
    for motion in 0..MOTIONS {
        let (limits, dt) = (limits(&mut rng, motion), magnitude(&mut rng, -3.0, -1.5));
        let (mut axis, mut target) = (Axis::default(), 0.0);
        for tick in 0..300 {
            if tick % 100 == 0 && tick < 200 {
                target = rng.uniform(-2.0, 2.0) * limits.v;
            }
            let next = axis.step_to_velocity(target, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            axis = next;
        }
        let (v, a, j) = (limits.v, limits.a, limits.j);
        if 100.0 * dt > 4.0 * (v / a + a / j) {
            assert_eq!(axis.v, target.clamp(-v, v), "{limits:?}");
        }
    }
}

/// The velocity `size sin²(1.5 t)`: within the limits it is followed exactly; beyond them it is not, and the limits hold.
#[test]
fn a_moving_target_is_followed_within_the_limits() {
    let dt = 1e-3;
    for (size, is_followed) in [(0.1, true), (1.0, false)] {
        let limits = Limits { v: 0.5, a: 2.0, j: 20.0 };
        let mut axis = Axis::default();
        for tick in 1..=3000 {
            let t = f64::from(tick) * dt;
            let (s, c) = libm::sincos(1.5 * t);
            let target = Axis { p: size * (1.5 * t - s * c) / 3.0, v: size * s * s, a: size * 3.0 * s * c };
            let next = axis.follow(&target, &limits, dt);
            check_step(&axis, &next, &limits, dt);
            assert!(!is_followed || next == target, "{t} s: {next:?}, expected {target:?}");
            axis = next;
        }
    }
}

/// From rest over 1 m: `2 √(d/a)`, `4 ∛(d/(2 j))`, and with both limits `a/j + √((a/j)² + 4 d/a)`.
#[test]
fn an_infinite_velocity_limit_leaves_the_other_limits() {
    let dt = 1e-3;
    for (a, j, duration) in [
        (2.0, INFINITY, 2.0_f64.sqrt()),
        (INFINITY, 20.0, 4.0 * libm::cbrt(1.0 / 40.0)),
        (2.0, 20.0, 0.1 + 2.01_f64.sqrt()),
    ] {
        let limits = Limits { v: INFINITY, a, j };
        let (mut axis, mut ticks) = (Axis::default(), 0);
        while axis != Axis::at_rest(1.0) && ticks < 10_000 {
            let next = axis.follow(&Axis::at_rest(1.0), &limits, dt);
            check_step(&axis, &next, &limits, dt);
            axis = if j.is_infinite() && (next.p, next.v) == (1.0, 0.0) { Axis::at_rest(1.0) } else { next };
            ticks += 1;
        }
        let late = f64::from(ticks) * dt - duration;
        assert!((-1e-9..=2.01 * dt).contains(&late), "{late} s late: {limits:?}");
    }
}

#[test]
fn a_step_without_duration_changes_nothing() {
    let axis = Axis { p: 0.1, v: 0.2, a: 0.3 };
    for kind in 0..3 {
        let limits = limits(&mut Rng::new(5, "zero"), kind);
        assert_eq!(axis.step_to(1.0, &limits, 0.0), axis);
        assert_eq!(axis.step_to_velocity(1.0, &limits, 0.0), axis);
        assert_eq!(axis.follow(&Axis::at_rest(axis.p), &limits, 0.0), axis);
    }
}

#[test]
fn invalid_limits_are_rejected() {
    let valid = Limits::NONE;
    assert_eq!(valid.check(), Ok(()));
    for (name, limits) in [
        ("velocity", Limits { v: 0.0, ..valid }),
        ("velocity", Limits { v: f64::NAN, ..valid }),
        ("acceleration", Limits { a: 0.0, ..valid }),
        ("jerk", Limits { j: -1.0, ..valid }),
    ] {
        assert!(
            matches!(limits.check(), Err(ReferenceError::Limit { name: found, .. }) if found == name),
            "{limits:?}"
        );
    }
}

/// Joints reach their goals within the limits; a snapshot in the middle continues with the same bits.
#[test]
fn joint_references_move_within_their_limits_and_restart_from_a_snapshot() {
    let mut rng = Rng::new(6, "joints");
    let dt = 2e-3;
    for kind in 0..9 {
        let limits = limits(&mut rng, kind);
        let mut reference = AxesReference::new(&[0.0; 9], limits).unwrap();
        let mut restarted = AxesReference::new(&[1.0; 9], Limits::NONE).unwrap();
        let goals: Vec<f64> = (0..9).map(|_| rng.uniform(-1.0, 1.0)).collect();
        let rest: Vec<Axis> = goals.iter().copied().map(Axis::at_rest).collect();
        let is_at_goal = |reference: &AxesReference| {
            reference.axes().iter().zip(&rest).all(|(axis, rest)| (axis.p, axis.v) == (rest.p, rest.v))
        };
        reference.set_goals(&goals).unwrap();
        let mut numbers = vec![f64::NAN; reference.size()];
        for tick in 0..20_000 {
            let before = reference.axes().to_vec();
            reference.update(dt);
            for (from, to) in before.iter().zip(reference.axes()) {
                check_step(from, to, &limits, dt);
            }
            if tick == 100 {
                reference.write(&mut numbers);
                restarted.read(&numbers).unwrap();
            } else if tick > 100 {
                restarted.update(dt);
                assert_eq!(reference, restarted);
            }
        }
        assert!(is_at_goal(&reference));
        numbers[3] = f64::NAN;
        assert!(restarted.read(&numbers).is_err() && restarted.read(&numbers[1..]).is_err());
        assert_eq!(reference, restarted);
        assert_eq!(reference.set_goals(&goals[1..]), Err(ReferenceError::Length { found: 8, expected: 9 }));
        assert!(reference.set_goals(&[f64::INFINITY; 9]).is_err() && is_at_goal(&reference));
        // A restart keeps the goals; without limits they are the references of the next tick, without velocity.
        reference.restart(&[0.5; 9]);
        assert!(reference.axes().iter().all(|axis| *axis == Axis::at_rest(0.5)));
        reference.set_limits(Limits::NONE).unwrap();
        reference.update(dt);
        assert_eq!(reference.axes(), rest);
    }
}
