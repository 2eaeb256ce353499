//! Terrain estimation: the plane through the last contact points of the feet.
//!
//! ```text
//! z = c + g_x x + g_y y        least squares over the four points, low-passed
//! n = (-g_x, -g_y, 1)/|.|      normal: friction cones, contact threshold, swing plane, inclination of the base
//! ```
//! All points are relative to the base origin, in W axes, so no base position is needed. The point of a standing foot is its present position. The
//! point of a swinging foot moves against the base velocity, which the standing legs measure. W axes are used so that a rotation of the
//! base does not rotate the filtered plane. Source: Raiola et al. 2020, section 3.4, which refers to other work for the estimator.

use super::estimation::{BaseEstimate, Estimate};
use super::ground;
use super::leg::Leg;
use super::state::State;
use crate::math::{Rx, Ry, low_pass};
use crate::params::Params;
use nalgebra::{Matrix3, Vector3};

/// The frame in which the references of standing feet are given.
#[derive(Clone, Copy, Debug)]
pub enum GroundFrame {
    /// The estimated ground, given by its gradient in H. The base may tilt relative to it.
    Ground([f64; 2]),
    /// The base without its commanded tilt: orientation of these axes in H, and their angular velocity relative to H, in H. References in this frame
    /// bring the base parallel to the ground without an estimate of the ground.
    Base(Matrix3<f64>, Vector3<f64>),
}

impl GroundFrame {
    /// The estimated ground, or the base if the estimator is off.
    pub fn of(params: &Params, base: &BaseEstimate, state: &State) -> Self {
        if params.terrain.estimator {
            return GroundFrame::Ground(ground::turned(state.gradient_W, base.rpy[2]));
        }
        let [roll, pitch] = state.rp_des;
        let w_H = base.R_WH.transpose() * base.w_WB_W - Vector3::z() * base.yaw_rate;
        GroundFrame::Base(base.R_HB * (Ry(pitch) * Rx(roll)).transpose(), w_H)
    }

    /// Converts position and velocity of a contact point on level ground to position and velocity in H.
    ///
    /// - `p_CF_H`: centre of the foot relative to the contact point, m.
    pub fn carry(&self, p: Vector3<f64>, v: Vector3<f64>, p_CF_H: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        match self {
            GroundFrame::Ground(gradient) => {
                let lifted = |a: Vector3<f64>| Vector3::new(a.x, a.y, a.z + ground::rise(*gradient, &a));
                (lifted(p), lifted(v))
            }
            GroundFrame::Base(R_HS, w_H) => {
                let p_H = R_HS * p;
                (p_H, R_HS * v + w_H.cross(&(p_H + p_CF_H)))
            }
        }
    }
}

/// Updates the contact points, the velocity estimate and the gradient.
pub fn update(params: &Params, estimate: &Estimate, state: &mut State, dt: f64) {
    let v_WB = base_velocity(estimate, state);
    for leg in Leg::ALL {
        if state.leg_state[leg].is_stance() {
            state.p_ground_W[leg] = estimate.legs[leg].p_BF_W;
        } else {
            state.p_ground_W[leg] -= v_WB * dt;
        }
    }
    let v_H = estimate.base.R_WH.transpose() * v_WB;
    for (est, v) in state.v_H_est.iter_mut().zip([v_H.x, v_H.y]) {
        *est = low_pass(*est, v, params.recovery.velocity_time_constant, dt);
    }
    if !params.terrain.estimator {
        return;
    }
    let limit = params.terrain.max_gradient;
    if let Some(plane) = fit(&state.p_ground_W.0) {
        for (g, found) in state.gradient_W.iter_mut().zip(plane) {
            *g = low_pass(*g, found.clamp(-limit, limit), params.terrain.time_constant, dt);
        }
    }
}

/// Velocity of the base relative to the standing feet, m/s in W: the mean over the standing legs, or zero without any.
fn base_velocity(estimate: &Estimate, state: &State) -> Vector3<f64> {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for (leg, of_leg) in estimate.legs.iter() {
        if state.leg_state[leg].is_stance() {
            sum -= of_leg.v_BF_W;
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { sum }
}

/// Gradient of the least-squares plane, or `None` if the points are (nearly) on a line.
fn fit(points: &[Vector3<f64>; 4]) -> Option<[f64; 2]> {
    let mean = points.iter().fold(Vector3::zeros(), |sum, p| sum + p) / 4.0;
    let (mut xx, mut xy, mut yy, mut xz, mut yz) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for p in points {
        let d = p - mean;
        xx += d.x * d.x;
        xy += d.x * d.y;
        yy += d.y * d.y;
        xz += d.x * d.z;
        yz += d.y * d.z;
    }
    let det = xx * yy - xy * xy;
    (det > 1e-4).then(|| [(xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_of_the_plane_through_four_points_is_exact() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.4 + 0.17 * x - 0.05 * y);
        let [gx, gy] = fit(&[at(0.4, 0.3), at(0.5, -0.2), at(-0.3, 0.35), at(-0.4, -0.3)]).unwrap();
        assert!((gx - 0.17).abs() < 1e-12 && (gy + 0.05).abs() < 1e-12, "{gx} {gy}");
        // One foot 4 cm above the others, on a rectangle of 0.8 by 0.6 m. By hand: 0.04/4 over half a side.
        let mut square = [(0.4, 0.3), (0.4, -0.3), (-0.4, 0.3), (-0.4, -0.3)].map(|(x, y)| Vector3::new(x, y, 0.0));
        square[0].z = 0.04;
        let [gx, gy] = fit(&square).unwrap();
        assert!((gx - 0.01 / 0.4).abs() < 1e-12 && (gy - 0.01 / 0.3).abs() < 1e-12, "{gx} {gy}");
        assert_eq!(fit(&[0.1, 0.2, 0.3, 0.4].map(|x| Vector3::new(x, x, 0.0))), None);
    }

    /// For both frames the velocity is the derivative of the position, also while H rotates; in the frame of the base this includes the foot centre.
    #[test]
    fn the_velocity_of_a_converted_foot_is_the_derivative_of_its_position() {
        let (p, v, w) = (Vector3::new(0.4, 0.3, -0.55), Vector3::new(-0.2, 0.1, 0.02), Vector3::new(0.3, -0.4, 0.2));
        let p_CF_H = Vector3::new(0.0, 0.0, 0.02);
        let d = 1e-6;
        let R_HB = |t: f64| nalgebra::Rotation3::new(w * t).into_inner() * Ry(0.1) * Rx(-0.2);
        let at = |t: f64| GroundFrame::Base(R_HB(t), w).carry(p + v * t, v, &p_CF_H);
        let centre = |t: f64| at(t).0 + R_HB(t) * R_HB(0.0).transpose() * p_CF_H;
        let error = (centre(d) - centre(-d)) / (2.0 * d) - at(0.0).1;
        assert!(error.norm() < 1e-8, "{error}");

        let ground = GroundFrame::Ground([0.1, -0.2]);
        let at = |t: f64| ground.carry(p + v * t, v, &p_CF_H);
        let error = (at(d).0 - at(-d).0) / (2.0 * d) - at(0.0).1;
        assert!(error.norm() < 1e-8 && (at(0.0).0.z - (-0.55 + 0.04 - 0.06)).abs() < 1e-12, "{error}");
    }
}
