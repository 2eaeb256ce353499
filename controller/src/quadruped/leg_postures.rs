//! Joint positions for positions of the feet below a level base.

use super::leg::Leg;
use super::robot::Robot;
use crate::model::{BaseState, Kinematics, point_jacobian_linear};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Height between two postures of the path, m.
pub const WAYPOINT: f64 = 0.01;
/// Distance of the path from the joint limits, rad.
const LIMIT_MARGIN: f64 = 0.03;
/// Distance of a foot from its waypoint at which the waypoint counts as reached, m.
const REACHED: f64 = 1e-6;
/// Largest change of a joint in an iteration towards a waypoint, rad.
const MAX_NEWTON_STEP: f64 = 0.2;
/// Distance along the ground between folded and lying feet below which the feet do not step, m.
const SMALL_STEP: f64 = 0.05;

/// Postures with the feet above their virtual footholds, in steps of [`WAYPOINT`], until the base height would be below `height` or a joint is at its
/// limit. The first is the standing posture.
pub fn folding(robot: &Robot, height: f64) -> Vec<Vec<f64>> {
    let mut kin = Kinematics::new(&robot.model);
    let mut J = DMatrix::zeros(3, robot.model.nv());
    let mut path: Vec<Vec<f64>> = Vec::new();
    let mut q = robot.q_nominal.clone();
    let mut raised = 0.0;
    while robot.nominal_height - raised >= height {
        for leg in Leg::ALL {
            let target = robot.legs[leg].p_nominal_H + Vector3::z() * raised;
            if !reach(robot, leg, &target, &mut q, &mut kin, &mut J) {
                return path;
            }
        }
        path.push(q.clone());
        raised += WAYPOINT;
    }
    path
}

/// Moves the joints of a leg in `q` until its contact point is at `target` below a level base; returns false if it cannot reach it.
fn reach(
    robot: &Robot,
    leg: Leg,
    target: &Vector3<f64>,
    q: &mut [f64],
    kin: &mut Kinematics,
    J: &mut DMatrix<f64>,
) -> bool {
    let of_robot = &robot.legs[leg];
    let zero = Vector3::zeros();
    for _ in 0..100 {
        let off = target - contact_point(robot, leg, q, kin);
        if off.norm() < REACHED {
            return true;
        }
        point_jacobian_linear(&robot.model, kin, of_robot.foot, &zero, J.as_view_mut());
        let J_leg = Matrix3::from_fn(|row, k| J[(row, 6 + of_robot.joints[k])]);
        let damped = J_leg * J_leg.transpose() + Matrix3::identity() * 1e-6;
        let Some(inverse) = damped.try_inverse() else { return false };
        let step = J_leg.transpose() * (inverse * off);
        for (k, &joint) in of_robot.joints.iter().enumerate() {
            let limits = &robot.model.joints[joint];
            let (lower, upper) = (limits.lower + LIMIT_MARGIN, limits.upper - LIMIT_MARGIN);
            let moved = q[joint] + step[k].clamp(-MAX_NEWTON_STEP, MAX_NEWTON_STEP);
            q[joint] = moved.min(upper).max(lower);
        }
    }
    false
}

/// The folded posture with the feet where they are in the lying posture, along the ground. The folded posture itself if a leg cannot reach that, if no
/// foot is farther than [`SMALL_STEP`] from it, or if the mean of the feet is: on feet that have all stepped to one side the base would fall to the other.
pub fn widened(robot: &Robot, folded: &[f64], lying: &[f64]) -> Vec<f64> {
    let mut kin = Kinematics::new(&robot.model);
    let mut J = DMatrix::zeros(3, robot.model.nv());
    let mut q = folded.to_vec();
    let (mut longest, mut mean) = (0.0_f64, Vector3::zeros());
    for leg in Leg::ALL {
        let at = |kin: &mut Kinematics, q: &[f64]| contact_point(robot, leg, q, kin);
        let (from, to) = (at(&mut kin, folded), at(&mut kin, lying));
        let step = Vector3::new(to.x - from.x, to.y - from.y, 0.0);
        longest = longest.max(step.norm());
        mean += step / 4.0;
        if !reach(robot, leg, &(from + step), &mut q, &mut kin, &mut J) {
            return folded.to_vec();
        }
    }
    if longest > SMALL_STEP && mean.norm() <= SMALL_STEP { q } else { folded.to_vec() }
}

/// Contact point of a leg below a level base at the origin, m.
fn contact_point(robot: &Robot, leg: Leg, q: &[f64], kin: &mut Kinematics) -> Vector3<f64> {
    let zero = Vector3::zeros();
    let level = BaseState { p_WB: zero, R_WB: Matrix3::identity(), v_WB: zero, w_WB_W: zero };
    kin.update(&robot.model, &level, q, &vec![0.0; q.len()]);
    kin.p_WF(&robot.model, robot.legs[leg].foot) - Vector3::z() * robot.foot_radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    #[test]
    fn feet_step_outward_and_not_to_one_side() {
        let (urdf, params) =
            (include_str!("../../../robots/hyq/hyq.urdf"), include_str!("../../../robots/hyq/hyq.toml"));
        let params = Params::from_toml(params, "hyq.toml").unwrap();
        let robot = Robot::new(urdf, &params.robot).unwrap();
        let folded = folding(&robot, params.stand.fold * robot.nominal_height).pop().unwrap();
        // The axes are mirrored: equal angles turn all legs outward or all inward.
        let turned = |angles: [f64; 4]| {
            let mut q = folded.clone();
            for (leg, angle) in Leg::ALL.into_iter().zip(angles) {
                q[robot.legs[leg].joints[0]] += angle;
            }
            q
        };
        let out = turned([-0.3; 4]);
        assert_ne!(widened(&robot, &folded, &out), folded);
        let left = turned([-0.3, 0.3, -0.3, 0.3]);
        assert_eq!(widened(&robot, &folded, &left), folded);
    }
}
