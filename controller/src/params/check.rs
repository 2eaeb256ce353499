//! The range of every parameter: what gets past here can reach a `clamp`, a count or the quadratic program.

use super::{Params, ParamsError, RobotConfig};
use crate::stack::Formula;

/// What a number must fulfil, and how to say it. Those here hold for the parameters and for what the operator sets while walking.
type Range = (fn(f64) -> bool, &'static str);

/// Range of a duty factor.
pub const DUTY: Range = (|x| (0.5..1.0).contains(&x), "at least 0.5 and below 1");
/// Range of a swing frequency, Hz.
pub const SWING_FREQUENCY: Range = (|x| (0.5..=10.0).contains(&x), "0.5 to 10");
/// Range of a step height, m.
pub const STEP_HEIGHT: Range = (|x| (0.01..=0.25).contains(&x), "0.01 to 0.25");
/// No gain, time or limit is larger: what is computed with it stays far from infinity. The solver's tolerance and its like are small numbers.
const MOST: Range = (|x| x <= 1e9, "at most 1e9");

impl Params {
    /// # Errors
    /// The first value out of its range, by its key.
    pub(super) fn check(&self) -> Result<(), ParamsError> {
        Formula::parse(&self.stack.formula)?;
        let positive = [
            ("robot.foot_radius", self.robot.foot_radius),
            ("gait.trot.velocity_gain", self.gait.trot.velocity_gain),
            ("gait.crawl.velocity_gain", self.gait.crawl.velocity_gain),
            ("foothold.max_step_length", self.foothold.max_step_length),
            ("foothold.command_time_constant", self.foothold.command_time_constant),
            ("foothold.max_acceleration", self.foothold.max_acceleration),
            ("swing.clik_gain", self.swing.clik_gain),
            ("terrain.time_constant", self.terrain.time_constant),
            ("recovery.velocity_time_constant", self.recovery.velocity_time_constant),
            ("posture.max_stance_lead", self.posture.max_stance_lead),
            ("posture.blend_time_constant", self.posture.blend_time_constant),
            ("wbc.regularization", self.wbc.regularization),
            ("wbc.friction", self.wbc.friction),
            ("wbc.f_xy_max", self.wbc.f_xy_max),
            ("wbc.f_z_max", self.wbc.f_z_max),
            ("wbc.f_z_min", self.wbc.f_z_min),
            ("wbc.qdd_max", self.wbc.qdd_max),
            ("wbc.tolerance", self.wbc.tolerance),
            ("safety.max_tilt", self.safety.max_tilt),
            ("safety.max_state_age", self.safety.max_state_age),
            ("safety.max_operator_age", self.safety.max_operator_age),
            ("safety.velocity_factor", self.safety.velocity_factor),
            ("safety.torque_factor", self.safety.torque_factor),
            ("safety.max_flight_time", self.safety.max_flight_time),
            ("safety.damping", self.safety.damping),
            ("stand.stiffness", self.stand.stiffness),
            ("stand.joint_speed", self.stand.joint_speed),
            ("stand.rise_speed", self.stand.rise_speed),
            ("stand.max_error", self.stand.max_error),
            ("stand.patience", self.stand.patience),
            ("hold.kp", self.hold.kp),
            ("hold.kd", self.hold.kd),
            ("hold.duration", self.hold.duration),
        ];
        for (key, found) in positive {
            within(key, &[found], "a positive number", |x| x > 0.0 && x.is_finite())?;
            within(key, &[found], MOST.1, MOST.0)?;
        }
        let RobotConfig { sensors, posture, lying, .. } = &self.robot;
        let Params { gait, foothold, swing, contact, terrain, recovery, trunk, posture: p, wbc, stand, safety, .. } =
            self;
        let not_negative: [(_, &[f64]); 29] = [
            ("robot.sensors.position", &[sensors.position]),
            ("robot.sensors.velocity", &[sensors.velocity]),
            ("robot.sensors.torque", &[sensors.torque]),
            ("robot.sensors.orientation", &[sensors.orientation]),
            ("robot.sensors.gyro", &[sensors.gyro]),
            ("robot.sensors.acceleration", &[sensors.acceleration]),
            ("foothold.max_speed", &[foothold.max_speed]),
            ("foothold.max_yaw_rate", &[foothold.max_yaw_rate]),
            ("contact.min_jacobian_det", &[contact.min_jacobian_det]),
            ("foothold.speed_trim_gain", &[foothold.speed_trim_gain]),
            ("foothold.max_speed_trim", &[foothold.max_speed_trim]),
            ("recovery.capture_gain", &[recovery.capture_gain]),
            ("recovery.max_capture", &[recovery.max_capture]),
            ("recovery.reflex_retraction", &[recovery.reflex_retraction]),
            ("recovery.lost_contact_time", &[recovery.lost_contact_time]),
            ("trunk.kp", &trunk.kp),
            ("trunk.kd", &trunk.kd),
            ("trunk.height_gain", &[trunk.height_gain]),
            ("trunk.max_height_correction", &[trunk.max_height_correction]),
            ("trunk.max_orientation_rate", &[trunk.max_orientation_rate]),
            ("trunk.max_orientation", &[trunk.max_orientation]),
            ("trunk.max_height_rate", &[trunk.max_height_rate]),
            ("trunk.max_height_offset", &[trunk.max_height_offset]),
            ("posture.swing_kp", &p.swing_kp),
            ("posture.swing_kd", &p.swing_kd),
            ("posture.stance_kp", &p.stance_kp),
            ("posture.stance_kd", &p.stance_kd),
            ("safety.position_margin", &[safety.position_margin]),
            ("stand.damping", &[stand.damping]),
        ];
        for (key, found) in not_negative {
            within(key, found, "a number that is not negative", |x| x >= 0.0 && x.is_finite())?;
            within(key, found, MOST.1, MOST.0)?;
        }
        for &q in posture.values() {
            within("robot.posture", &[q], "a finite angle", f64::is_finite)?;
        }
        for &q in lying.values() {
            within("robot.lying", &[q], "a finite angle", f64::is_finite)?;
        }
        for (key, row) in [("gait.trot.duty", &gait.trot), ("gait.crawl.duty", &gait.crawl)] {
            within(key, &[row.duty], DUTY.1, DUTY.0)?;
        }
        for (key, row) in [("gait.trot.swing_frequency", &gait.trot), ("gait.crawl.swing_frequency", &gait.crawl)] {
            within(key, &[row.swing_frequency], SWING_FREQUENCY.1, SWING_FREQUENCY.0)?;
        }
        within("swing.height", &[swing.height], STEP_HEIGHT.1, STEP_HEIGHT.0)?;
        within("terrain.max_gradient", &[terrain.max_gradient], "0 to 0.6", |x| (0.0..=0.6).contains(&x))?;
        for (key, found) in [
            ("gait.trot.lift_off_phase", &gait.trot.lift_off_phase),
            ("gait.crawl.lift_off_phase", &gait.crawl.lift_off_phase),
        ] {
            within(key, found, "at least 0 and below 1", |x| (0.0..1.0).contains(&x))?;
        }
        for (key, found) in [("gait.trot.sway", gait.trot.sway), ("gait.crawl.sway", gait.crawl.sway)] {
            within(key, &[found], "0 to 0.5", |x| (0.0..=0.5).contains(&x))?;
        }
        for (key, found) in [("gait.trot.ramp", gait.trot.ramp), ("gait.crawl.ramp", gait.crawl.ramp)] {
            within(key, &[found], "0 to 0.5", |x| (0.0..=0.5).contains(&x))?;
        }
        for (key, found) in [
            ("gait.trot.residual_load", gait.trot.residual_load),
            ("gait.crawl.residual_load", gait.crawl.residual_load),
        ] {
            within(key, &[found], "0 to 0.2", |x| (0.0..=0.2).contains(&x))?;
        }
        within("foothold.freeze_fraction", &[foothold.freeze_fraction], "0 to 1", |x| (0.0..=1.0).contains(&x))?;
        within("safety.min_height", &[safety.min_height], "at least 0 and below 1", |x| (0.0..1.0).contains(&x))?;
        within("stand.fold", &[stand.fold], "above 0 and at most 0.9", |x| x > 0.0 && x <= 0.9)?;
        within("swing.reach_time", &[swing.reach_time], "0 to 0.5", |x| (0.0..=0.5).contains(&x))?;
        for (key, found, least) in [
            ("contact.debounce", f64::from(contact.debounce), 1.0),
            ("wbc.max_iterations", f64::from(wbc.max_iterations), 1.0),
            ("safety.max_qp_failures", f64::from(safety.max_qp_failures), 0.0),
        ] {
            let expected = if least > 0.0 { "at least 1" } else { "at least 0" };
            within(key, &[found], expected, |x| x >= least)?;
        }
        for (key, found) in [
            ("contact.touch_load", contact.touch_load),
            ("contact.release_load", contact.release_load),
            ("recovery.reflex_load", recovery.reflex_load),
        ] {
            within(key, &[found], "above 0 and at most 1, a part of the weight", |x| x > 0.0 && x <= 1.0)?;
        }
        if contact.release_load > contact.touch_load {
            return Err(ParamsError::OutOfRange {
                key: "contact.release_load",
                found: contact.release_load,
                expected: "at most contact.touch_load",
            });
        }
        if self.wbc.f_z_min >= self.wbc.f_z_max {
            return Err(ParamsError::OutOfRange {
                key: "wbc.f_z_min",
                found: self.wbc.f_z_min,
                expected: "less than wbc.f_z_max",
            });
        }
        Ok(())
    }
}

/// An error that names the first of `found` that does not fit.
fn within(
    key: &'static str,
    found: &[f64],
    expected: &'static str,
    fits: impl Fn(f64) -> bool,
) -> Result<(), ParamsError> {
    match found.iter().find(|x| !fits(**x)) {
        Some(&found) => Err(ParamsError::OutOfRange { key, found, expected }),
        None => Ok(()),
    }
}
