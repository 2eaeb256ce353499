//! Motions through way-points.

use crate::{DT, LIMITS, at, check_step, limits, pose, turn};
use controller::math::{Rng, norm};
use controller::model::Pose;
use controller::trajectory::{MAX_WAYPOINTS, MovingPose, Progress, TaskReference, Waypoint};

/// Way-points within the limits are reached at their times, at rest; the reference is the closed form in between.
#[test]
fn way_points_are_reached_at_their_times() {
    let mut rng = Rng::new(3, "way-points");
    for trial in 0..500 {
        let start = pose(&mut rng);
        let mut limits = LIMITS;
        if trial % 2 == 1 {
            (limits.linear.j, limits.angular.j) = (50.0, 100.0);
        }
        let count = 1 + trial % MAX_WAYPOINTS;
        let mut reference = TaskReference::new(&MovingPose::at_rest(&start).pose(), limits).unwrap();
        let (mut points, mut t) = (Vec::new(), 0_i32);
        for _ in 0..count {
            // Up to 2 m and π: 1.875 d / T = 0.94 m/s would be the peak for T = 4 s.
            t += 2000 + i32::try_from(rng.next_u64() % 500).unwrap();
            points.push(Waypoint { t: f64::from(t) * DT, pose: pose(&mut rng) });
        }
        reference.set_waypoints(&points).unwrap();
        let mut from = reference.motion().goal();
        let mut tick = 0;
        for (index, point) in points.iter().enumerate() {
            let begin = f64::from(tick) * DT;
            while f64::from(tick + 1) * DT <= point.t {
                let before = *reference.motion();
                reference.update(DT, 0);
                check_step(&before, reference.motion(), &limits, DT);
                tick += 1;
                if let Some(Progress { fraction, .. }) = reference.progress().filter(|at| at.segment == index) {
                    let x = (f64::from(tick) * DT - begin) / (point.t - begin);
                    assert!((fraction - x).abs() < 1e-9);
                    let s = 10.0 * x * x * x - 15.0 * x * x * x * x + 6.0 * x * x * x * x * x;
                    let p = from.p[0] + s * (point.pose.p[0] - from.p[0]);
                    assert!((reference.motion().axes[0].p - p).abs() < 1e-9, "{p} {:?}", reference.motion());
                }
            }
            let (found, expected) = (reference.motion(), MovingPose::at_rest(&point.pose));
            for (axis, p) in found.axes.iter().zip(point.pose.p) {
                assert!((axis.p - p).abs() < 1e-12, "way-point {index}: {found:?}");
            }
            assert!(
                norm(&turn(found, &expected)) < 1e-12 && found.twist().norm() < 1e-12,
                "way-point {index}: {found:?}"
            );
            from = point.pose;
        }
        reference.update(DT, 0);
        assert!(at(reference.motion(), &reference.motion().goal()) && reference.progress().is_none());
        assert_eq!(reference.motion().goal().p, points[count - 1].pose.p);
    }
}

/// Way-points beyond the limits: the reference lags and ends in the last way-point.
#[test]
fn fast_way_points_end_in_the_last_one() {
    let mut rng = Rng::new(4, "fast");
    for trial in 0..1000 {
        let limits = limits(&mut rng, trial);
        let mut reference = TaskReference::new(&Pose::identity(), limits).unwrap();
        let last = pose(&mut rng);
        let points = [Waypoint { t: 0.1, pose: pose(&mut rng) }, Waypoint { t: 0.5, pose: last }];
        reference.set_waypoints(&points).unwrap();
        let mut ticks = 0;
        while reference.progress().is_some() || !at(reference.motion(), &last.checked().unwrap()) {
            let before = *reference.motion();
            reference.update(DT, 0);
            check_step(&before, reference.motion(), &limits, DT);
            ticks += 1;
            assert!(ticks < 40_000, "{:?}", reference.motion());
        }
    }
}
