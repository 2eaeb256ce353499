//! The reference of a Cartesian task: commands, modes, change of the base link, snapshots.

use crate::{DT, INFINITY, LIMITS, MOTIONS, at, check_step, limits, pose, turn, twist};
use controller::math::{Rng, log, norm};
use controller::model::Pose;
use controller::trajectory::{
    Limits, MAX_WAYPOINTS, Mode, MovingPose, PoseGoal, PoseLimits, ReferenceError, TaskReference, ValueError, Waypoint,
};
use nalgebra::{Vector3, Vector6};

const DT_NS: i64 = 5_000_000;

/// Random commands: every step is within the limits, unless the command puts the reference somewhere, and a snapshot continues with the same bits.
#[test]
fn references_are_continuous_under_random_commands() {
    let mut rng = Rng::new(5, "commands");
    let mut numbers = [f64::NAN; TaskReference::SIZE];
    for trial in 0..MOTIONS {
        let mut reference =
            TaskReference::new(&MovingPose::at_rest(&pose(&mut rng)).pose(), limits(&mut rng, trial)).unwrap();
        for tick in 0..60_i64 {
            let now_ns = -DT_NS * 30 + DT_NS * tick;
            let mut is_set = false;
            let model = MovingPose::at_rest(&pose(&mut rng)).pose();
            match rng.next_u64() % 40 {
                0 => _ = reference.set_pose(&pose(&mut rng)),
                1 => {
                    let mut t = 0.0;
                    let point = |_| {
                        t += rng.uniform(0.01, 1.0);
                        Waypoint { t, pose: pose(&mut rng) }
                    };
                    let points: Vec<Waypoint> = (0..3).map(point).collect();
                    _ = reference.set_waypoints(&points);
                }
                2..8 => _ = reference.set_velocity(&twist(&mut rng, 2.0), now_ns),
                8 => {
                    let mode = Mode::ALL[(rng.next_u64() % 2) as usize];
                    is_set = (reference.mode(), mode) == (Mode::Velocity, Mode::Position);
                    reference.set_mode(mode, &model);
                }
                9 => {
                    is_set = true;
                    reference.set_base_link(&model);
                }
                10 => {
                    let (old, new) = (*reference.limits(), limits(&mut rng, trial));
                    // A new jerk limit leaves the velocity that an acceleration still leads to; other tests lower it.
                    let jerks = (old.linear.j.min(new.linear.j), old.angular.j.min(new.angular.j));
                    if jerks.0.is_infinite() && jerks.1.is_infinite() {
                        reference.set_limits(new).unwrap();
                    }
                }
                _ => {}
            }
            let before = *reference.motion();
            let (pose, twist) = reference.update(DT, now_ns);
            if !is_set {
                check_step(&before, reference.motion(), reference.limits(), DT);
            }
            assert!(pose == reference.motion().pose() && twist == reference.motion().twist());
            if tick == 30 {
                reference.write(&mut numbers);
                let copy = TaskReference::read(&numbers).unwrap();
                let mut again = [f64::NAN; TaskReference::SIZE];
                copy.write(&mut again);
                assert_eq!(again.map(f64::to_bits), numbers.map(f64::to_bits));
                assert_eq!(reference, copy);
            }
        }
    }
}

/// The rest of a motion from a snapshot has the same bits.
#[test]
fn a_snapshot_continues_with_the_same_bits() {
    let mut rng = Rng::new(6, "snapshot");
    for mode in [Mode::Position, Mode::Velocity] {
        let mut reference = TaskReference::new(&Pose::identity(), limits(&mut rng, 1)).unwrap();
        reference.set_mode(mode, &Pose::identity());
        let now_ns = 1_700_000_000_123_456_789;
        let points = [Waypoint { t: 0.3, pose: pose(&mut rng) }, Waypoint { t: 1.0, pose: pose(&mut rng) }];
        assert_eq!(reference.set_waypoints(&points).is_ok(), mode == Mode::Position);
        assert_eq!(reference.set_velocity(&twist(&mut rng, 1.0), now_ns).is_ok(), mode == Mode::Velocity);
        let mut copy = TaskReference::new(&Pose::identity(), LIMITS).unwrap();
        for tick in 1..400 {
            let t_ns = now_ns + tick * DT_NS;
            reference.update(DT, t_ns);
            if tick == 20 {
                let mut numbers = [f64::NAN; TaskReference::SIZE];
                reference.write(&mut numbers);
                copy = TaskReference::read(&numbers).unwrap();
                assert!(TaskReference::read(&numbers[1..]).is_err());
                for (index, wrong) in [(0, 3.0), (0, 0.5), (1, 33.0), (1, -1.0), (3, -1.0), (5, f64::NAN), (13, 9.0)] {
                    let mut numbers = numbers;
                    numbers[index] = wrong;
                    assert!(TaskReference::read(&numbers).is_err(), "number {index}: {wrong}");
                }
            } else if tick > 20 {
                copy.update(DT, t_ns);
            }
            assert!(tick < 20 || reference == copy, "tick {tick}");
        }
    }
}

/// A twist is followed within the limits, is valid for 0.2 s, and then the reference comes to rest.
#[test]
fn a_twist_is_followed_until_it_times_out() {
    let mut reference = TaskReference::new(&Pose::identity(), LIMITS).unwrap();
    reference.set_mode(Mode::Velocity, &Pose::identity());
    let command = Vector6::new(0.2, 0.0, -0.9, 0.0, 0.3, 0.4);
    reference.set_velocity(&command, 0).unwrap();
    for tick in 1..40 {
        reference.update(DT, tick * DT_NS);
    }
    // The z axis is limited to 0.5 m/s after 0.2 s of 2 m/s²: 39 ticks are 0.195 s.
    let twist = reference.motion().twist();
    assert!((twist - Vector6::new(0.2, 0.0, -0.39, 0.0, 0.3, 0.4)).norm() < 1e-12, "{twist}");
    reference.update(DT, 40 * DT_NS);
    assert!((reference.motion().twist()[2] + 0.38).abs() < 1e-12);
    for tick in 41..100 {
        reference.update(DT, tick * DT_NS);
    }
    assert_eq!(reference.motion().twist(), Vector6::zeros());
    // x: 0.1 s to 0.2 m/s, 0.095 s at it, 0.1 s to rest.
    assert!((reference.motion().axes[0].p - 0.2 * 0.195).abs() < 1e-12, "{:?}", reference.motion());
    // Rotation: 0.125 s to 0.5 rad/s about (0, 0.6, 0.8), 0.07 s at it, 0.125 s to rest.
    let rotation = log(&reference.motion().pose().R) - Vector3::new(0.0, 0.6, 0.8) * (0.5 * 0.195);
    assert!(norm(&rotation) < 1e-12, "{rotation}");
}

#[test]
fn modes_decide_which_commands_count() {
    let mut rng = Rng::new(7, "modes");
    let (goal, model) = (pose(&mut rng), MovingPose::at_rest(&pose(&mut rng)));
    let mut reference = TaskReference::new(&Pose::identity(), LIMITS).unwrap();
    let rejected = Err(ReferenceError::Mode { found: "Position", expected: "Velocity" });
    assert_eq!(reference.set_velocity(&Vector6::zeros(), 0), rejected);
    reference.set_pose(&goal).unwrap();
    for _ in 0..30 {
        reference.update(DT, 0);
    }
    // Position to Velocity: the motion continues, and comes to rest.
    let moving = *reference.motion();
    reference.set_mode(Mode::Velocity, &model.pose());
    assert_eq!(*reference.motion(), moving);
    assert!(reference.set_pose(&goal).is_err());
    for _ in 0..100 {
        reference.update(DT, 0);
    }
    assert_eq!(reference.motion().twist(), Vector6::zeros());
    // Velocity to Position: the pose of the model.
    reference.set_mode(Mode::Position, &model.pose());
    reference.update(DT, 0);
    assert!(reference.motion().goal().p == model.goal().p && norm(&turn(reference.motion(), &model)) < 1e-15);
}

/// Without limits a pose is the reference of the next tick, without velocity, and a twist is followed and ends at once. Way-points give their velocity.
#[test]
fn without_limits_the_reference_is_the_command() {
    let mut rng = Rng::new(9, "no limits");
    let none = PoseLimits { linear: Limits::NONE, angular: Limits::NONE };
    let mut reference = TaskReference::new(&Pose::identity(), none).unwrap();
    let goal = pose(&mut rng);
    reference.set_pose(&goal).unwrap();
    assert_eq!(reference.update(DT, 0).1, Vector6::zeros());
    assert!(at(reference.motion(), &goal.checked().unwrap()));
    let end = PoseGoal { p: goal.p.map(|p| p + 1.0), ..goal };
    reference.set_waypoints(&[Waypoint { t: 100.0 * DT, pose: end }]).unwrap();
    (0..50).for_each(|_| _ = reference.update(DT, 0));
    // The middle of the motion: 15/8 of the mean velocity.
    assert!((reference.motion().twist()[0] - 1.875 / (100.0 * DT)).abs() < 1e-9, "{:?}", reference.motion());
    assert!((reference.motion().axes[2].p - goal.p[2] - 0.5).abs() < 1e-9);
    reference.set_mode(Mode::Velocity, &Pose::identity());
    let command = twist(&mut rng, 100.0);
    reference.set_velocity(&command, 0).unwrap();
    let before = reference.motion().axes[1].p;
    let (moved, found) = reference.update(DT, 0);
    assert!((found - command).norm() < 1e-12 && (moved.p.y - before - command[1] * DT).abs() < 1e-12);
    assert_eq!(reference.update(DT, 200_000_000).1, Vector6::zeros());
}

/// The reference stays where it is in the world, at rest; way-points are aborted.
#[test]
fn a_change_of_the_base_link_keeps_the_reference_in_the_world() {
    let mut rng = Rng::new(8, "base link");
    let (X_Wb, X_cb) = (MovingPose::at_rest(&pose(&mut rng)).pose(), MovingPose::at_rest(&pose(&mut rng)).pose());
    let mut reference = TaskReference::new(&MovingPose::at_rest(&pose(&mut rng)).pose(), LIMITS).unwrap();
    reference.set_waypoints(&[Waypoint { t: 1.0, pose: pose(&mut rng) }]).unwrap();
    for _ in 0..50 {
        reference.update(DT, 0);
    }
    let X_Wd = X_Wb.then(&reference.motion().pose());
    // X_Wc X_cb = X_Wb.
    let R_cb_inverse = X_cb.R.transpose();
    let inverse = Pose { p: -(R_cb_inverse * X_cb.p), R: R_cb_inverse };
    let X_Wc = X_Wb.then(&inverse);
    reference.set_base_link(&X_cb);
    assert!(reference.progress().is_none() && reference.motion().twist() == Vector6::zeros());
    for _ in 0..3 {
        let (X_cd, twist) = reference.update(DT, 0);
        let found = X_Wc.then(&X_cd);
        assert!((found.p - X_Wd.p).norm() < 1e-14 && (found.R - X_Wd.R).norm() < 1e-14, "{found:?} {X_Wd:?}");
        assert_eq!(twist, Vector6::zeros());
    }
}

#[test]
fn invalid_commands_change_nothing() {
    let mut reference = TaskReference::new(&Pose::identity(), LIMITS).unwrap();
    let before = reference.clone();
    let good = PoseGoal { p: [0.1, 0.2, 0.3], q: [0.0, 1.0, 0.0, 0.0] };
    let long = PoseGoal { q: [0.0, 1.00001, 0.0, 0.0], ..good };
    let lost = PoseGoal { p: [0.0, f64::NAN, 0.0], ..good };
    let lost_error =
        |error| matches!(error, ValueError::NotFinite { what: "position", index: 1, found } if found.is_nan());
    assert!(matches!(reference.set_pose(&long), Err(ReferenceError::Value(ValueError::NotUnit { .. }))));
    assert!(matches!(reference.set_pose(&lost), Err(ReferenceError::Value(error)) if lost_error(error)));
    let point = |t: f64, pose: PoseGoal| Waypoint { t, pose };
    for (points, index, found, before) in [
        (vec![point(0.0, good)], 0, 0.0, 0.0),
        (vec![point(1.0, good), point(1.0, good)], 1, 1.0, 1.0),
        (vec![point(1.0, good), point(INFINITY, good)], 1, INFINITY, 1.0),
        (vec![point(-1.0, good)], 0, -1.0, 0.0),
    ] {
        assert_eq!(reference.set_waypoints(&points), Err(ReferenceError::Time { index, found, before }));
    }
    assert!(matches!(reference.set_waypoints(&[point(f64::NAN, good)]), Err(ReferenceError::Time { index: 0, .. })));
    let error = reference.set_waypoints(&[point(1.0, good), point(2.0, lost)]);
    assert!(matches!(error, Err(ReferenceError::Waypoint { index: 1, error }) if lost_error(error)));
    for found in [0, MAX_WAYPOINTS + 1] {
        let points: Vec<Waypoint> =
            (0..found).map(|i| point(1.0 + f64::from(u8::try_from(i).unwrap()), good)).collect();
        assert_eq!(reference.set_waypoints(&points), Err(ReferenceError::Count { found, max: MAX_WAYPOINTS }));
    }
    let narrow = PoseLimits { angular: Limits { v: 0.0, ..LIMITS.angular }, ..LIMITS };
    assert_eq!(reference.set_limits(narrow), Err(ReferenceError::Limit { name: "velocity", found: 0.0 }));
    assert_eq!(reference, before);
    // A length within the tolerance is normalized.
    reference.set_pose(&PoseGoal { q: [0.0, 1.000_000_9, 0.0, 0.0], ..good }).unwrap();
    while !at(reference.motion(), &good) {
        reference.update(DT, 0);
    }
}
