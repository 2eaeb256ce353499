//! Poses that move to targets.

use crate::{MOTIONS, at, check_step, limits, pose, turn, vector};
use controller::math::quaternion::{from_rotation_vector, product};
use controller::math::{Rng, norm};
use controller::trajectory::{Axis, MovingPose, PoseGoal};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// From rest the rotation is about one axis and takes the time of one coordinate, for every angle up to π, which is reached about one axis too.
#[test]
fn a_rotation_from_rest_is_about_one_axis() {
    let mut rng = Rng::new(1, "geodesic");
    for trial in 0..MOTIONS {
        let limits = limits(&mut rng, trial);
        let (start, mut goal) = (pose(&mut rng), pose(&mut rng));
        if trial % 10 == 0 {
            let axis = Vector3::from(vector(&mut rng, 1.0));
            goal.q = product(from_rotation_vector((axis * (PI / norm(&axis))).into()), start.q);
        }
        let (mut motion, target) = (MovingPose::at_rest(&start), MovingPose::at_rest(&goal));
        let way = turn(&motion, &target);
        let mut coordinate = Axis::default();
        let dt = 0.01;
        for _ in 0..300 {
            let before = motion;
            motion.follow(&target, &limits, dt);
            coordinate = coordinate.follow(&Axis::at_rest(norm(&way)), &limits.angular, dt);
            check_step(&before, &motion, &limits, dt);
            let off = turn(&before, &motion).cross(&way) / norm(&way);
            assert!(norm(&off) < 1e-9, "{before:?} {motion:?}");
            let left = norm(&turn(&motion, &target));
            assert!((left - (norm(&way) - coordinate.p)).abs() < 1e-7, "{left} {way:?} {coordinate:?}");
        }
    }
}

/// Goals that change during the motion: the limits hold, and the last goal is reached exactly.
#[test]
fn poses_are_reached_within_the_limits() {
    let mut rng = Rng::new(2, "poses");
    for trial in 0..MOTIONS {
        let limits = limits(&mut rng, trial);
        let (mut motion, mut goal) = (MovingPose::at_rest(&pose(&mut rng)), PoseGoal::IDENTITY);
        let changes = 1 + rng.next_u64() % 4;
        let mut ticks = 0;
        while ticks < 40 * changes || !at(&motion, &goal) {
            if ticks % 40 == 0 && ticks < 40 * changes {
                goal = pose(&mut rng);
            }
            let before = motion;
            motion.follow(&MovingPose::at_rest(&goal), &limits, 0.02);
            check_step(&before, &motion, &limits, 0.02);
            ticks += 1;
            assert!(ticks < 10_000, "{motion:?} does not reach {goal:?}: {limits:?}");
        }
    }
}
