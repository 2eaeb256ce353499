//! What the robot can follow: the speed that its steps allow, and the poses of the trunk that its legs reach.
//!
//! - Speed: in a stride every foot moves as far as the base, so `|v + ψ̇ e_z × p_foot| T ≤ foothold.max_step_length` for each foot. Velocity and yaw
//!   rate beyond it are scaled by one factor, which keeps the direction. A gait in which a leg never lifts off stays in place.
//! - Reach: for roll, pitch and height of the trunk the feet must be within reach of the legs, with a margin to the singular posture and to the
//!   effort limits. While the robot walks this holds at both ends of the stance, and at the top of the swing the legs must not be folded.
//!
//! A reference moves towards the request and stops at the limit of the legs. If the present pose becomes unreachable, for example because the robot
//! starts to walk, the reference returns towards the nominal pose.

use super::estimation::Estimate;
use super::leg::{Leg, PerLeg};
use super::params::{FootholdParams, Gait};
use super::robot::Robot;
use super::state::{Cadence, Mode, State};
use super::timing::Timing;
use crate::math::{Rx, Ry};
use crate::params::Params;
use nalgebra::Vector3;

/// Smallest [`super::leg_reach::Posture::volume`] of a leg of a standing robot.
const VOLUME_STANDING: f64 = 0.02;
/// Smallest volume of a leg of a walking robot, relative to that of the nominal posture: steps on uneven ground and after a push need more length of
/// the leg.
const VOLUME_WALKING: f64 = 0.44;
/// Smallest [`super::leg_reach::LegReach::extent`] of a leg at the top of its swing: nearer to the hip the joints of a folded leg move too fast.
const EXTENT_SWING: f64 = 0.2;
/// Volume of a stance leg below which a walking base stops.
const VOLUME_STOP: f64 = 0.1;
/// Largest ratio of a joint torque to its effort limit, unless [`TORQUE_GROWTH`] allows more.
const TORQUE: f64 = 0.95;
/// Largest ratio of a joint torque to the largest one of the nominal posture, if that is near the effort limit.
const TORQUE_GROWTH: f64 = 1.15;
/// Shortest half step that the pose of a walking robot must allow, as a fraction of `foothold.max_step_length`.
const RESERVE: f64 = 0.15;
/// Largest displacement of a foot by the sway of the base, as a fraction of `GaitTiming::sway` times its distance from the base.
const SWAY: f64 = 0.5;
/// Distance of a stance foot from its virtual foothold beyond which the base stops, as a fraction of `foothold.max_step_length`.
const OVERREACH: f64 = 0.8;

/// The references of trunk and velocity that the legs have to reach together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// Roll and pitch relative to the ground, rad.
    pub rp: [f64; 2],
    /// Height above the nominal height, m.
    pub height_offset: f64,
    /// Velocity in H, m/s.
    pub v_H: [f64; 2],
    /// Yaw rate, rad/s.
    pub yaw_rate: f64,
}

impl Followed {
    /// Level at the nominal height, at rest. It counts as reachable for every robot.
    const NOMINAL: Followed = Followed { rp: [0.0; 2], height_offset: 0.0, v_H: [0.0; 2], yaw_rate: 0.0 };

    /// The references in use.
    pub fn of(state: &State) -> Self {
        let State { rp_des, height_offset, v_H_des, yaw_rate_des, .. } = *state;
        Followed { rp: rp_des, height_offset, v_H: v_H_des, yaw_rate: yaw_rate_des }
    }

    /// Largest difference of a component, in its own unit.
    fn difference(&self, other: &Followed) -> f64 {
        let parts = |of: &Followed| [of.rp[0], of.rp[1], of.height_offset, of.v_H[0], of.v_H[1], of.yaw_rate];
        parts(self).into_iter().zip(parts(other)).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
    }
}

/// Longest path of the base in a second for which no step is longer than `foothold.max_step_length`, m/s; 0 if a leg never lifts off.
pub fn step_speed(foothold: &FootholdParams, timing: &Timing) -> f64 {
    if Leg::ALL.into_iter().all(|leg| timing.steps(leg)) { foothold.max_step_length / timing.T } else { 0.0 }
}

/// Speed of the base above its fastest foot at a velocity (m/s in H) and a yaw rate (rad/s), m/s.
pub fn fastest(robot: &Robot, v_H: [f64; 2], yaw_rate: f64) -> f64 {
    Leg::ALL.into_iter().fold(0.0, |most: f64, leg| {
        let p = robot.legs[leg].p_nominal_H;
        let [x, y] = [v_H[0] - yaw_rate * p.y, v_H[1] + yaw_rate * p.x];
        most.max((x * x + y * y).sqrt())
    })
}

/// Largest speed in the plane and largest yaw rate, each alone, in a gait with the timing of the parameters: m/s and rad/s.
pub fn pace(robot: &Robot, params: &Params, gait: Gait) -> (f64, f64) {
    let timing = Timing::at(gait, Cadence::default(), params);
    let steps = step_speed(&params.foothold, &timing);
    let farthest = Leg::ALL.into_iter().fold(0.0, |most: f64, leg| {
        let p = robot.legs[leg].p_nominal_H;
        most.max((p.x * p.x + p.y * p.y).sqrt())
    });
    (params.foothold.max_speed.min(steps), params.foothold.max_yaw_rate.min(steps / farthest))
}

/// Factor, at most 1, by which a velocity (m/s in H) and a yaw rate (rad/s) are reduced so that no step is too long.
pub fn step_factor(robot: &Robot, params: &Params, timing: &Timing, v_H: [f64; 2], yaw_rate: f64) -> f64 {
    let longest = fastest(robot, v_H, yaw_rate);
    let limit = step_speed(&params.foothold, timing);
    if longest > limit { limit / longest } else { 1.0 }
}

/// Whether a walking base must stop: a stance foot is at the end of its workspace and would move on outward.
pub fn overreached(robot: &Robot, params: &Params, estimate: &Estimate, state: &State) -> bool {
    let limit = OVERREACH * params.foothold.max_step_length;
    state.mode == Mode::Walk
        && Leg::ALL.into_iter().filter(|leg| state.leg_state[*leg].is_stance()).any(|leg| {
            let nominal = robot.legs[leg].p_nominal_H;
            let [x, y] = [state.p_stance_H[leg][0] - nominal.x, state.p_stance_H[leg][1] - nominal.y];
            let [vx, vy] =
                [state.v_H_des[0] - state.yaw_rate_des * nominal.y, state.v_H_des[1] + state.yaw_rate_des * nominal.x];
            // The foot moves against the base.
            let outward = x * vx + y * vy < 0.0;
            let volume = super::leg_reach::volume(&estimate.legs[leg].J_leg);
            outward && (x * x + y * y > limit * limit || volume < VOLUME_STOP)
        })
}

/// Positions of the virtual footholds, xy in H, m.
pub fn virtual_feet(robot: &Robot) -> PerLeg<[f64; 2]> {
    PerLeg(Leg::ALL.map(|leg| [robot.legs[leg].p_nominal_H.x, robot.legs[leg].p_nominal_H.y]))
}

/// Positions of the feet relative to the base origin, xy in H, m. While the robot walks they are the virtual footholds. While it stands they are
/// measured, and shifted equally so that their centre is that of the virtual footholds.
pub fn feet(robot: &Robot, estimate: &Estimate, walks: bool) -> PerLeg<[f64; 2]> {
    let nominal = virtual_feet(robot);
    if walks {
        return nominal;
    }
    let R_HW = estimate.base.R_WH.transpose();
    let measured = Leg::ALL.map(|leg| {
        let p = R_HW * estimate.legs[leg].p_BF_W;
        [p.x, p.y]
    });
    let mean = |of: &[[f64; 2]; 4], k: usize| of.iter().map(|p| p[k]).sum::<f64>() / 4.0;
    let shift = [0, 1].map(|k| mean(&nominal.0, k) - mean(&measured, k));
    PerLeg(measured.map(|p| [p[0] + shift[0], p[1] + shift[1]]))
}

/// Whether the legs reach the ground with these references.
///
/// - `walk`: timing of the gait; `None` while the robot stands.
/// - `feet`: see [`feet`].
pub fn is_reachable(
    robot: &Robot,
    params: &Params,
    walk: Option<&Timing>,
    feet: &PerLeg<[f64; 2]>,
    followed: &Followed,
) -> bool {
    let Followed { rp: [roll, pitch], height_offset, v_H, yaw_rate } = *followed;
    if Followed::NOMINAL == *followed {
        return true;
    }
    let R_BT = (Ry(pitch) * Rx(roll)).transpose();
    let up_B = R_BT * Vector3::z();
    let load = robot.weight / if walk.is_some() { 2.0 } else { 4.0 };
    let outward = 1.0 + walk.map_or(0.0, |timing| SWAY * timing.sway);
    let reserve = RESERVE * params.foothold.max_step_length;
    Leg::ALL.into_iter().all(|leg| {
        let of_robot = &robot.legs[leg];
        let [x, y] = feet[leg];
        let half_step = walk.map_or([0.0; 2], |timing| {
            let half = [v_H[0] - yaw_rate * y, v_H[1] + yaw_rate * x].map(|v| 0.5 * timing.T_st * v);
            let length = (half[0] * half[0] + half[1] * half[1]).sqrt();
            if length > reserve {
                half
            } else if length > 1e-6 {
                half.map(|x| x * (reserve / length))
            } else {
                [reserve, 0.0]
            }
        });
        let sides: &[f64] = if walk.is_some() { &[1.0, -1.0] } else { &[0.0] };
        let nominal = of_robot.reach.nominal();
        let least = if walk.is_some() { VOLUME_WALKING * nominal.volume } else { VOLUME_STANDING };
        let most = TORQUE.max(TORQUE_GROWTH * nominal.torque * load);
        let top = Vector3::new(x, y, of_robot.p_nominal_H.z - height_offset + robot.foot_radius + params.swing.height);
        let folds = roll != 0.0 || pitch != 0.0 || height_offset < 0.0;
        if walk.is_some() && folds && of_robot.reach.extent(&(R_BT * top)) < EXTENT_SWING {
            return false;
        }
        sides.iter().all(|side| {
            let p = Vector3::new(
                outward * x + side * half_step[0],
                outward * y + side * half_step[1],
                of_robot.p_nominal_H.z - height_offset + robot.foot_radius,
            );
            of_robot
                .reach
                .reach(&(R_BT * p), &up_B)
                .is_some_and(|posture| posture.volume >= least && posture.torque * load <= most)
        })
    })
}

/// The next references: `candidate` if the legs reach it, else `now`, else `back`.
///
/// A change below 1e-6 is checked only every 32 ticks, to save time.
pub fn advance(
    now: Followed,
    candidate: Followed,
    back: Followed,
    tick: i64,
    fits: impl Fn(&Followed) -> bool,
) -> Followed {
    let settled = candidate.difference(&now) < 1e-6 && tick % 32 != 0;
    if settled || fits(&candidate) {
        candidate
    } else if fits(&now) {
        now
    } else {
        back
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::apply_overrides;
    use crate::quadruped::params::{GaitTiming, NEVER};

    fn robot(name: &str, set: &[(&str, &str)]) -> (Robot, Params) {
        let folder = format!("{}/../robots/{name}", env!("CARGO_MANIFEST_DIR"));
        let set: Vec<_> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let text = std::fs::read_to_string(format!("{folder}/{name}.toml")).unwrap();
        let params = Params::from_toml(&apply_overrides(&text, &set).unwrap(), name).unwrap();
        let urdf = std::fs::read_to_string(format!("{folder}/{}", params.robot.urdf)).unwrap();
        (Robot::new(&urdf, &params.robot).unwrap(), params)
    }

    #[test]
    fn the_speed_is_limited_to_the_longest_step_in_a_stride_and_keeps_its_direction() {
        let (robot, params) = robot("hyq", &[]);
        let at = |gait, cadence| Timing::at(gait, cadence, &params);
        let crawl = at(Gait::CRAWL, Cadence::default());
        // 0.3 m in a stride of 1/3 s / (1 - 0.88).
        assert!((step_speed(&params.foothold, &crawl) - 0.108).abs() < 1e-12);
        assert_eq!(step_factor(&robot, &params, &crawl, [0.1, 0.0], 0.0), 1.0);
        assert!((step_factor(&robot, &params, &crawl, [0.0, -0.216], 0.0) - 0.5).abs() < 1e-12);
        assert!(step_factor(&robot, &params, &crawl, [0.1, 0.0], 0.1) < 1.0);
        // A slower swing and a higher duty factor lower the limit.
        let slow = at(Gait::TROT, Cadence { swing_frequency: 1.0, duty: 0.8 });
        assert!((step_speed(&params.foothold, &slow) - 0.06).abs() < 1e-12);
        let (speed, yaw_rate) = pace(&robot, &params, Gait::CRAWL);
        assert!((speed - 0.108).abs() < 1e-12 && (0.15..0.25).contains(&yaw_rate), "{speed} {yaw_rate}");
        assert!(pace(&robot, &params, Gait::TROT).0 >= 0.5);
    }

    /// Three legs never lift off: the step speed is 0, so every command is scaled to 0, also with another cadence.
    #[test]
    fn a_gait_with_a_leg_that_never_lifts_off_stays_in_place() {
        let (robot, mut params) = robot("hyq", &[]);
        let one = GaitTiming { lift_off_phase: [0.0, NEVER, NEVER, NEVER], ..params.gait.crawl.clone() };
        let three = GaitTiming { lift_off_phase: [0.0, 0.5, NEVER, 0.25], ..params.gait.crawl.clone() };
        params.gait.further.extend([("one".to_owned(), one), ("three".to_owned(), three)]);
        for name in ["one", "three"] {
            let gait = params.gait.named(name).unwrap();
            assert_eq!(pace(&robot, &params, gait), (0.0, 0.0), "{name}");
            for cadence in [Cadence::default(), Cadence { swing_frequency: 8.0, duty: 0.6 }] {
                let timing = Timing::at(gait, cadence, &params);
                assert_eq!(step_speed(&params.foothold, &timing), 0.0, "{name}");
                for (v_H, yaw_rate) in [([0.1, 0.0], 0.0), ([0.0, -0.2], 0.0), ([0.0, 0.0], 0.3), ([0.2, 0.1], -0.5)] {
                    assert_eq!(step_factor(&robot, &params, &timing, v_H, yaw_rate), 0.0, "{name} {v_H:?} {yaw_rate}");
                }
                assert_eq!(step_factor(&robot, &params, &timing, [0.0; 2], 0.0), 1.0, "{name}: rest is allowed");
            }
        }
    }

    #[test]
    fn single_axes_are_reachable_and_corners_with_a_raised_trunk_are_not() {
        let pose = |roll, pitch, height_offset| Followed { rp: [roll, pitch], height_offset, ..Followed::NOMINAL };
        for (name, pitch, height) in [("hyq", 0.35, 0.12), ("anymal_b", 0.2, 0.05)] {
            let (robot, params) = robot(name, &[]);
            let feet = virtual_feet(&robot);
            for gait in [Gait::TROT, Gait::CRAWL] {
                let timing = Timing::at(gait, Cadence::default(), &params);
                let fits = |pose: Followed| is_reachable(&robot, &params, Some(&timing), &feet, &pose);
                for sign in [1.0, -1.0] {
                    let single =
                        [pose(0.34 * sign, 0.0, 0.0), pose(0.0, 0.95 * pitch * sign, 0.0), pose(0.0, 0.0, -0.115)];
                    assert!(single.into_iter().all(fits), "{name} {gait:?} {sign}");
                    assert!(!fits(pose(0.2 * sign, 0.2, 0.1)) && !fits(pose(0.2, -0.2 * sign, 0.1)), "{name} {gait:?}");
                }
                assert!(fits(pose(0.0, 0.0, 0.95 * height)), "{name} {gait:?}");
            }
            assert!(is_reachable(&robot, &params, None, &feet, &pose(0.11, -0.11, 0.055)), "{name}");
        }
    }

    #[test]
    fn weak_joints_limit_the_pose_and_the_nominal_pose_is_always_accepted() {
        let (mut robot, params) = robot("hyq", &[]);
        let feet = virtual_feet(&robot);
        let low = Followed { height_offset: -0.1, ..Followed::NOMINAL };
        assert!(is_reachable(&robot, &params, None, &feet, &low));
        robot.weight *= 3.5;
        assert!(!is_reachable(&robot, &params, None, &feet, &low));
        robot.weight *= 100.0;
        assert!(is_reachable(&robot, &params, None, &feet, &Followed::NOMINAL));
    }

    #[test]
    fn a_reference_stops_at_the_limit_and_returns_if_the_limit_moves() {
        let at = |height_offset| Followed { height_offset, ..Followed::NOMINAL };
        let below = |limit: f64| move |pose: &Followed| pose.height_offset <= limit;
        let next = |limit| advance(at(0.05), at(0.051), at(0.049), 1, below(limit)).height_offset;
        assert_eq!([next(0.1), next(0.0505), next(0.04)], [0.051, 0.05, 0.049]);
    }
}
