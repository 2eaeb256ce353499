//! The `[[fault]]` entry of a scenario.

use super::{FaultKind, FaultWindow, Quantity};
use crate::checks::{BadKey, Window, check_range, to_ns};
use controller::params::exact::optional_array;
use controller::quadruped::leg::Leg;
use serde::Deserialize;

/// Name of a leg in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) enum LegName {
    LF,
    RF,
    LH,
    RH,
}

impl From<LegName> for Leg {
    fn from(name: LegName) -> Leg {
        match name {
            LegName::LF => Leg::LF,
            LegName::RF => Leg::RF,
            LegName::LH => Leg::LH,
            LegName::RH => Leg::RH,
        }
    }
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FaultName {
    NanSensor,
    FalseReading,
    DropOperator,
    DropState,
    DelayState,
    DropCommand,
    LateProcess,
    ClockJump,
    ImuBias,
    StuckEncoder,
    TorqueLoss,
    FalseTouch,
}

/// A `[[fault]]` entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FaultEntry {
    t_s: f64,
    duration_s: f64,
    kind: FaultName,
    joint: Option<String>,
    factor: Option<f64>,
    quantity: Option<Quantity>,
    offset: Option<f64>,
    leg: Option<LegName>,
    #[serde(rename = "force_N")]
    force: Option<f64>,
    after_lift_off_s: Option<f64>,
    length_s: Option<f64>,
    delay_s: Option<f64>,
    jump_s: Option<f64>,
    #[serde(rename = "gyro_rad_s", default, deserialize_with = "optional_array")]
    gyro: Option<[f64; 3]>,
    #[serde(rename = "orientation_rad", default, deserialize_with = "optional_array")]
    orientation: Option<[f64; 3]>,
}

impl FaultEntry {
    /// Checks the entry. Keys of another kind of fault are an error.
    pub(crate) fn resolve(self) -> Result<FaultWindow, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        check_range("duration_s", &[self.duration_s], 0.0..=36_000.0)?;
        let FaultEntry { t_s, duration_s, kind, joint, factor, leg, force, after_lift_off_s, length_s, .. } = self;
        let FaultEntry { delay_s, jump_s, gyro, orientation, quantity, offset, .. } = self;
        let missing = |key, expected: &str| BadKey { key, found: "missing".to_owned(), expected: expected.to_owned() };

        let false_reading = matches!(kind, FaultName::FalseReading);
        let has_joint =
            false_reading || matches!(kind, FaultName::NanSensor | FaultName::StuckEncoder | FaultName::TorqueLoss);
        let false_touch = matches!(kind, FaultName::FalseTouch);
        let imu_bias = matches!(kind, FaultName::ImuBias);
        let keys = [
            ("joint", joint.is_some(), has_joint),
            ("factor", factor.is_some(), matches!(kind, FaultName::TorqueLoss)),
            ("quantity", quantity.is_some(), false_reading),
            ("offset", offset.is_some(), false_reading),
            ("leg", leg.is_some(), false_touch),
            ("force_N", force.is_some(), false_touch),
            ("after_lift_off_s", after_lift_off_s.is_some(), false_touch),
            ("length_s", length_s.is_some(), false_touch),
            ("delay_s", delay_s.is_some(), matches!(kind, FaultName::DelayState)),
            ("jump_s", jump_s.is_some(), matches!(kind, FaultName::ClockJump)),
            ("gyro_rad_s", gyro.is_some(), imu_bias),
            ("orientation_rad", orientation.is_some(), imu_bias),
        ];
        if let Some((key, ..)) = keys.into_iter().find(|(_, given, belongs)| *given && !belongs) {
            let expected = "no such key for this kind of fault".to_owned();
            return Err(BadKey { key, found: "given".to_owned(), expected });
        }
        let joint = || joint.ok_or_else(|| missing("joint", "a joint name"));
        let kind = match kind {
            FaultName::NanSensor => FaultKind::NanSensor { joint: joint()? },
            FaultName::FalseReading => {
                let quantity = quantity.ok_or_else(|| missing("quantity", "position, velocity or torque"))?;
                let offset = offset.ok_or_else(|| missing("offset", "the sensor offset"))?;
                check_range("offset", &[offset], -1e6..=1e6)?;
                FaultKind::FalseReading { joint: joint()?, quantity, offset }
            }
            FaultName::DropOperator => FaultKind::DropOperator,
            FaultName::DropState => FaultKind::DropState,
            FaultName::DelayState => {
                let delay = delay_s.ok_or_else(|| missing("delay_s", "the delay, s"))?;
                check_range("delay_s", &[delay], 0.0..=10.0)?;
                FaultKind::DelayState { delay_ns: to_ns(delay) }
            }
            FaultName::DropCommand => FaultKind::DropCommand,
            FaultName::LateProcess => FaultKind::LateProcess,
            FaultName::ClockJump => {
                let jump = jump_s.ok_or_else(|| missing("jump_s", "the jump of the clock, s, positive: ahead"))?;
                check_range("jump_s", &[jump], -1e6..=1e6)?;
                FaultKind::ClockJump { jump_ns: to_ns(jump) }
            }
            FaultName::ImuBias => {
                let (gyro, orientation) = (gyro.unwrap_or_default(), orientation.unwrap_or_default());
                check_range("gyro_rad_s", &gyro, -100.0..=100.0)?;
                check_range("orientation_rad", &orientation, -4.0..=4.0)?;
                FaultKind::ImuBias { gyro, orientation }
            }
            FaultName::StuckEncoder => FaultKind::StuckEncoder { joint: joint()? },
            FaultName::TorqueLoss => {
                let factor = factor.ok_or_else(|| missing("factor", "the remaining fraction of the torque"))?;
                check_range("factor", &[factor], 0.0..=1.0)?;
                FaultKind::TorqueLoss { joint: joint()?, factor }
            }
            FaultName::FalseTouch => {
                let force = force.ok_or_else(|| missing("force_N", "the contact force, N"))?;
                let (after, length) = (after_lift_off_s.unwrap_or(0.05), length_s.unwrap_or(0.01));
                check_range("force_N", &[force], 0.0..=10_000.0)?;
                check_range("after_lift_off_s", &[after], 0.0..=10.0)?;
                check_range("length_s", &[length], 0.0..=10.0)?;
                FaultKind::FalseTouch { leg: leg.map(Leg::from), force, swing: Window::new(after, length) }
            }
        };
        Ok(FaultWindow { window: Window::new(t_s, duration_s), kind })
    }
}
