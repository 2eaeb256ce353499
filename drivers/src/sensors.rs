//! Sensor model: noise, then resolution.

use crate::checks::{BadKey, check_range};
use controller::params::SensorParams;
use lcmtypes::RobotState;
use robot_model::math::Rng;
use serde::Deserialize;

/// The `[noise]` table of a scenario: standard deviation of each measurement; 0: no noise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseParams {
    /// Joint position, rad.
    pub position: f64,
    /// Joint velocity, rad/s.
    pub velocity: f64,
    /// Joint torque, N m.
    pub torque: f64,
    /// Orientation about each axis of the IMU, rad.
    pub orientation: f64,
    /// Gyro, rad/s.
    pub gyro: f64,
    /// Accelerometer, m/s².
    pub acceleration: f64,
}

impl NoiseParams {
    pub(crate) fn check(&self) -> Result<(), BadKey> {
        let NoiseParams { position, velocity, torque, orientation, gyro, acceleration } = *self;
        check_range("position", &[position], 0.0..=1.0)?;
        check_range("velocity", &[velocity], 0.0..=10.0)?;
        check_range("torque", &[torque], 0.0..=100.0)?;
        check_range("orientation", &[orientation], 0.0..=1.0)?;
        check_range("gyro", &[gyro], 0.0..=10.0)?;
        check_range("acceleration", &[acceleration], 0.0..=100.0)
    }
}

/// The sensors of one robot in one run.
#[derive(Clone, Debug)]
pub(crate) struct Sensors {
    pub resolution: SensorParams,
    pub noise: NoiseParams,
    pub seed: i64,
}

impl Sensors {
    /// Replaces true values by measured ones. The noise depends only on the seed and `state.seq`, not on the number of calls.
    pub(crate) fn measure(&self, state: &mut RobotState) {
        let Sensors { resolution, noise, seed } = self;
        let mut rng = Rng::new(seed.wrapping_add(state.seq.wrapping_mul(0x5851_f42d_4c95_7f2d)), "noise");
        channel(&mut state.q, &mut rng, noise.position, resolution.position);
        channel(&mut state.qd, &mut rng, noise.velocity, resolution.velocity);
        channel(&mut state.tau, &mut rng, noise.torque, resolution.torque);
        for ((q_WI_wxyz, w_WI_I), a_I) in state.q_WI_wxyz.iter_mut().zip(&mut state.w_WI_I).zip(&mut state.a_I) {
            channel(w_WI_I, &mut rng, noise.gyro, resolution.gyro);
            channel(a_I, &mut rng, noise.acceleration, resolution.acceleration);
            if noise.orientation > 0.0 {
                let turn = std::array::from_fn(|_| noise.orientation * rng.normal());
                *q_WI_wxyz = turned(*q_WI_wxyz, turn);
            }
            channel(q_WI_wxyz, &mut rng, 0.0, resolution.orientation);
        }
    }
}

fn channel(values: &mut [f64], rng: &mut Rng, deviation: f64, resolution: f64) {
    for value in values {
        if deviation > 0.0 {
            *value += deviation * rng.normal();
        }
        if resolution > 0.0 {
            // Adding zero turns -0 into 0, so that zero has one bit pattern.
            *value = (*value / resolution).round() * resolution + 0.0;
        }
    }
}

/// An orientation rotated by a small rotation vector in its own axes, rad.
fn turned([w, x, y, z]: [f64; 4], turn: [f64; 3]) -> [f64; 4] {
    let [a, b, c] = turn.map(|angle| angle / 2.0);
    let q =
        [w - x * a - y * b - z * c, x + w * a + y * c - z * b, y + w * b + z * a - x * c, z + w * c + x * b - y * a];
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q.map(|x| x / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensors(noise: NoiseParams) -> Sensors {
        Sensors { resolution: SensorParams::default(), noise, seed: 7 }
    }

    fn truth(seq: i64) -> RobotState {
        RobotState {
            seq,
            nj: 1,
            q: vec![0.123_456_789],
            qd: vec![-1e-9],
            tau: vec![48.123],
            n_imus: 1,
            q_WI_wxyz: vec![[0.6, 0.0, 0.8, 0.0]],
            w_WI_I: vec![[0.1, 0.2, 0.3]],
            a_I: vec![[0.0, 0.0, 9.81]],
            ..RobotState::default()
        }
    }

    fn measured(sensors: &Sensors, seq: i64) -> RobotState {
        let mut state = truth(seq);
        sensors.measure(&mut state);
        state
    }

    #[test]
    fn values_are_rounded_to_multiples_of_the_resolution() {
        let state = measured(&sensors(NoiseParams::default()), 0);
        let multiple = |value: f64, bits: i32| (value * f64::from(1 << bits)).fract() == 0.0;
        assert!(multiple(state.q[0], 18) && multiple(state.tau[0], 7) && multiple(state.a_I[0][2], 10));
        assert!((state.q[0] - 0.123_456_789).abs() <= 0.5 / f64::from(1 << 18));
        assert!((state.a_I[0][2] - 9.81).abs() <= 0.5 / f64::from(1 << 10));
        assert_eq!(state.qd[0].to_bits(), 0.0f64.to_bits());
    }

    #[test]
    fn without_resolution_and_noise_values_are_unchanged() {
        let zero =
            SensorParams { position: 0.0, velocity: 0.0, torque: 0.0, orientation: 0.0, gyro: 0.0, acceleration: 0.0 };
        let sensors = Sensors { resolution: zero, noise: NoiseParams::default(), seed: 7 };
        assert_eq!(measured(&sensors, 3), truth(3));
    }

    #[test]
    fn noise_depends_on_seed_and_message_only() {
        let noisy = sensors(NoiseParams { position: 0.01, orientation: 0.02, ..NoiseParams::default() });
        assert_eq!(measured(&noisy, 1), measured(&noisy, 1));
        assert_ne!(measured(&noisy, 1).q, measured(&noisy, 2).q);
        let other = Sensors { seed: 8, ..noisy.clone() };
        assert_ne!(measured(&noisy, 1).q, measured(&other, 1).q);
        assert_eq!(measured(&noisy, 1).tau, measured(&sensors(NoiseParams::default()), 1).tau);
    }

    #[test]
    fn noise_has_the_given_standard_deviation() {
        let noisy = sensors(NoiseParams { position: 0.01, orientation: 0.02, ..NoiseParams::default() });
        let n = 4000;
        let (mut position, mut angle) = (0.0, 0.0);
        for seq in 0..n {
            let state = measured(&noisy, seq);
            position += (state.q[0] - 0.123_456_789).powi(2);
            let cos = state.q_WI_wxyz[0][0] * 0.6 + state.q_WI_wxyz[0][2] * 0.8;
            angle += (2.0 * cos.min(1.0).acos()).powi(2);
        }
        // Standard error of a variance from n samples: sqrt(2 / n) = 2 %. The angle is the norm of three samples.
        let ratio = |sum: f64, expected: f64| (sum / f64::from(n as i32)) / (expected * expected);
        assert!((ratio(position, 0.01) - 1.0).abs() < 0.1, "position {}", ratio(position, 0.01));
        assert!((ratio(angle, 0.02) / 3.0 - 1.0).abs() < 0.1, "orientation {}", ratio(angle, 0.02) / 3.0);
    }
}
