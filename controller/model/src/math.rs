//! Transcendental functions, filters, rotations and quaternions. Everything uses the crate `libm`: every machine and build gives the same
//! bits.

pub mod quaternion;
mod random;
mod rotation;
mod walked_distance;

pub use random::Rng;
pub use rotation::{Rx, Ry, Rz, log, rotation_of_rpy, rpy_of, wrap_angle, z_onto};
pub use walked_distance::WalkedDistance;

use nalgebra::Vector3;

/// Sine; `x` in rad.
#[inline]
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine; `x` in rad.
#[inline]
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Sine and cosine: the same values as [`sin`] and [`cos`], in less time; `x` in rad.
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Hyperbolic sine.
#[inline]
pub fn sinh(x: f64) -> f64 {
    libm::sinh(x)
}

/// Angle of the point (x, y), rad, in (-π, π].
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Arc sine, rad; `x` is limited to [-1, 1] first.
#[inline]
pub fn asin(x: f64) -> f64 {
    libm::asin(x.clamp(-1.0, 1.0))
}

/// Euclidean length.
#[inline]
pub fn norm(v: &Vector3<f64>) -> f64 {
    (v.x * v.x + v.y * v.y + v.z * v.z).sqrt()
}

/// Moves `x` towards `target` by at most `max_change`.
#[inline]
pub fn ramp(x: f64, target: f64, max_change: f64) -> f64 {
    x + (target - x).clamp(-max_change, max_change)
}

/// One step of a first-order low-pass filter by implicit Euler: stable at any `dt`. Times in s.
#[inline]
pub fn low_pass(x: f64, target: f64, time_constant: f64, dt: f64) -> f64 {
    x + (target - x) * (dt / (time_constant + dt))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramp_and_filter_do_not_overshoot() {
        assert_eq!(ramp(0.0, 1.0, 0.25), 0.25);
        assert_eq!(ramp(0.9, 1.0, 0.25), 1.0);
        assert!(low_pass(0.0, 1.0, 0.1, 1e3) < 1.0);
    }
}
