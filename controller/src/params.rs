//! What can be set: one TOML text a run, read once, checked once, written whole into the log.
//!
//! A robot's file (`robots/NAME/NAME.toml`) names what is particular to it; everything left out has the default of the source,
//! Raiola et al. 2020 (cited "Raiola" below), or one stated here. [`Params::to_toml`] writes every key, so a log never depends
//! on defaults of a build.

mod check;
mod overrides;

pub use check::{DUTY, STEP_HEIGHT, SWING_FREQUENCY};
pub use overrides::apply_overrides;

use crate::qp::QpParams;
use crate::stack::StackParams;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Why parameters are unusable.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// Not TOML, an unknown key, a missing key, or a value of the wrong type. The text of the parser names line and key.
    #[error("{source_name}: {error}")]
    Parse {
        /// File, or what the text is.
        source_name: String,
        /// What the parser says, with line and column.
        error: String,
    },
    /// An override names no parameter.
    #[error("unknown parameter \"{key}\"{hint}")]
    UnknownKey {
        /// The key as given.
        key: String,
        /// Names that are near it, or the keys of its section.
        hint: String,
    },
    /// An override has a value of the wrong kind.
    #[error("parameter {key}: found `{found}`, expected {expected}")]
    BadValue {
        /// The key.
        key: String,
        /// The value as given.
        found: String,
        /// Kind of the present value.
        expected: String,
    },
    /// No formula.
    #[error(transparent)]
    Stack(#[from] crate::stack::StackError),
    /// A value outside its range.
    #[error("parameter {key} is {found}, expected {expected}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Its value.
        found: f64,
        /// The range.
        expected: &'static str,
    },
}

/// Every parameter of the quadruped controller and what drivers need to know of the robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// The robot: feet, posture, sensors.
    pub robot: RobotConfig,
    /// Gait timing and force ramps.
    #[serde(default)]
    pub gait: GaitParams,
    /// Foothold planner and limits of the velocity command.
    #[serde(default)]
    pub foothold: FootholdParams,
    /// Swing trajectory and closed-loop inverse kinematics.
    #[serde(default)]
    pub swing: SwingParams,
    /// Contact estimation.
    #[serde(default)]
    pub contact: ContactParams,
    /// Terrain estimation.
    #[serde(default)]
    pub terrain: TerrainParams,
    /// Reactions to what was not planned.
    #[serde(default)]
    pub recovery: RecoveryParams,
    /// Trunk orientation and height.
    #[serde(default)]
    pub trunk: TrunkParams,
    /// Postural task.
    #[serde(default)]
    pub posture: PostureParams,
    /// Tasks, their weights and priorities.
    #[serde(default)]
    pub stack: StackParams,
    /// Which solver of quadratic programs.
    #[serde(default)]
    pub qp: QpParams,
    /// Limits of the quadratic programs.
    #[serde(default)]
    pub wbc: WbcParams,
    /// Getting up and sitting down.
    #[serde(default)]
    pub stand: StandParams,
    /// When to give up, and how.
    #[serde(default)]
    pub safety: SafetyParams,
}

/// The robot: what its URDF does not say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name of the robot.
    pub name: String,
    /// URDF file, beside the TOML file.
    pub urdf: String,
    /// Foot links in the order LF RF LH RH; the link's origin is the centre of the foot sphere.
    pub feet: [String; 4],
    /// Radius of the foot sphere, m.
    pub foot_radius: f64,
    /// Link whose axes the IMU measures in.
    pub imu_link: String,
    /// Nominal standing posture: joint name -> rad.
    pub posture: BTreeMap<String, f64>,
    /// Posture in which the robot lies on the ground without torque: joint name -> rad. Without it, its legs are folded under it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub lying: BTreeMap<String, f64>,
    /// Resolution of the simulated sensors.
    #[serde(default)]
    pub sensors: SensorParams,
}

/// Resolution of the simulated sensors: a value read is a whole multiple of it. 0 = as computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParams {
    /// Joint position, rad.
    pub position: f64,
    /// Joint velocity, rad/s.
    pub velocity: f64,
    /// Joint torque, N m.
    pub torque: f64,
    /// Component of the orientation quaternion.
    pub orientation: f64,
    /// Gyro, rad/s.
    pub gyro: f64,
    /// Accelerometer, m/s².
    pub acceleration: f64,
}

impl Default for SensorParams {
    /// Powers of two near what a 19-bit encoder, a load cell and a tactical IMU resolve; so many low bits are zero that a log compresses well.
    fn default() -> Self {
        let fraction = |bits: i32| 1.0 / f64::from(1u32 << bits);
        SensorParams {
            position: fraction(18),
            velocity: fraction(12),
            torque: fraction(7),
            orientation: fraction(24),
            gyro: fraction(14),
            acceleration: fraction(10),
        }
    }
}

/// Timing of the gaits. Source: Raiola, Fig. 4 and Table 2, but for the crawl: with the 0.80 and 2 Hz printed the weight has to go from one support
/// triangle to the next in 0.125 s, and it falls where the feet do not stand as planned; here it has 0.36 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaitParams {
    /// Trot: diagonal pairs.
    pub trot: GaitTiming,
    /// Crawl: one leg at a time, LF RH RF LH.
    pub crawl: GaitTiming,
}

/// Timing of one gait. Swing time `1/f_sw`, stride `T = T_sw/(1 - δ)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaitTiming {
    /// Duty factor δ = T_st/T.
    pub duty: f64,
    /// Swing frequency `f_sw = 1/T_sw`, Hz.
    pub swing_frequency: f64,
    /// Phase of the stride at which each leg lifts off, LF RF LH RH.
    pub lift_off_phase: [f64; 4],
    /// How far the zero-moment point goes from the centre towards the foot opposite to a swinging one, as a part of half their distance.
    #[serde(default)]
    pub sway: f64,
    /// Least vertical force of the foot opposite to one that swings or unloads, as a part of the weight.
    #[serde(default)]
    pub residual_load: f64,
    /// Length of the ramps with which a leg takes up and gives up load, as a part of the time in which all four legs stand; 0 = none.
    #[serde(default = "half")]
    pub ramp: f64,
    /// Factor on the commanded velocity where legs are to carry it out, for a gait that goes slower than commanded.
    #[serde(default = "one")]
    pub velocity_gain: f64,
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

impl Default for GaitParams {
    fn default() -> Self {
        GaitParams {
            trot: GaitTiming {
                duty: 0.55,
                swing_frequency: 2.0,
                lift_off_phase: [0.0, 0.5, 0.5, 0.0],
                sway: 0.0,
                residual_load: 0.0,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
            crawl: GaitTiming {
                duty: 0.88,
                swing_frequency: 3.0,
                lift_off_phase: [0.0, 0.5, 0.75, 0.25],
                sway: 0.25,
                residual_load: 0.05,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
        }
    }
}

/// Foothold planner and the ramp of the velocity command. Source: Raiola, eqs. (19)-(25).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FootholdParams {
    /// Longest step, m.
    pub max_step_length: f64,
    /// Time constant of the velocity command's filter, s.
    pub command_time_constant: f64,
    /// Fastest change of the commanded velocity, m/s².
    pub max_acceleration: f64,
    /// Largest commanded speed, m/s.
    pub max_speed: f64,
    /// Largest commanded yaw rate, rad/s.
    pub max_yaw_rate: f64,
    /// Gain of the integral that trims the commanded velocity until the base goes as commanded, 1/s; 0 = none.
    pub speed_trim_gain: f64,
    /// Largest trim, m/s.
    pub max_speed_trim: f64,
    /// Part of the swing, at its end, in which step length and heading are kept.
    pub freeze_fraction: f64,
}

impl Default for FootholdParams {
    fn default() -> Self {
        FootholdParams {
            max_step_length: 0.3,
            command_time_constant: 0.1,
            max_acceleration: 0.5,
            max_speed: 0.6,
            max_yaw_rate: 0.8,
            speed_trim_gain: 0.4,
            max_speed_trim: 0.1,
            freeze_fraction: 0.2,
        }
    }
}

/// Swing ellipse and closed-loop inverse kinematics. Source: Raiola, eqs. (26)-(30), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SwingParams {
    /// Step height `H_s`, m.
    pub height: f64,
    /// CLIK gain P, 1/s.
    pub clik_gain: f64,
    /// Time after `T_sw`, in swing times, that a foot may search for the ground.
    pub reach_time: f64,
}

impl Default for SwingParams {
    fn default() -> Self {
        SwingParams { height: 0.1, clik_gain: 10.0, reach_time: 0.5 }
    }
}

/// Contact estimation. Source: Raiola, eq. (18) and section 4.3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactParams {
    /// Normal force above which a foot touches, N.
    pub threshold: f64,
    /// Normal force below which a foot that touches does so no more, N.
    pub release: f64,
    /// Take the acceleration of the swing reference into account. The source neglects it, and so a light robot's feet touch air.
    pub inertia_compensation: bool,
    /// Samples in a row above the threshold before it counts.
    pub debounce: i32,
    /// Smallest |det J_leg| at which a force is computed, m³; below, the last one is kept.
    pub min_jacobian_det: f64,
}

impl Default for ContactParams {
    fn default() -> Self {
        ContactParams {
            threshold: 50.0,
            release: 25.0,
            inertia_compensation: true,
            debounce: 3,
            min_jacobian_det: 1e-4,
        }
    }
}

/// Terrain estimation. Source: Raiola, section 3.4, which leaves the estimator to other work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TerrainParams {
    /// Take the plane through the last contact points as the ground: it tilts the base, the swing plane and the friction cones. Without it the
    /// ground counts as level, and the height of the feet under a tilted base follows the base: a stack without the trunk's roll and pitch
    /// (`trunk[2]`) then lets the posture bring the base parallel to the ground.
    pub estimator: bool,
    /// Time constant of the plane's filter, s.
    pub time_constant: f64,
    /// Steepest ground that is believed, rise over run.
    pub max_gradient: f64,
}

impl Default for TerrainParams {
    fn default() -> Self {
        TerrainParams { estimator: true, time_constant: 0.5, max_gradient: 0.4 }
    }
}

/// Reactions to what was not planned: pushes, steps that the swing runs into, ground that gives way. Beyond Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecoveryParams {
    /// Move footholds by the capture point, `√(h/g) (v - v_cmd)`.
    pub capture_point: bool,
    /// Part of it that is taken.
    pub capture_gain: f64,
    /// Largest shift of a foothold by it, m.
    pub max_capture: f64,
    /// Time constant of the velocity estimate's filter, s.
    pub velocity_time_constant: f64,
    /// Lift a foot anew from where it has run into something in the first half of its swing. Off: on stairs of 0.10 m it has cost more than it saved.
    pub step_reflex: bool,
    /// Force against the step that counts as running into something, N.
    pub reflex_force: f64,
    /// How far the foot is drawn back by it, m.
    pub reflex_retraction: f64,
    /// A standing foot that carries nothing for this long searches for the ground, s; 0 = it stays where it is.
    pub lost_contact_time: f64,
}

impl Default for RecoveryParams {
    fn default() -> Self {
        RecoveryParams {
            capture_point: true,
            capture_gain: 1.0,
            max_capture: 0.15,
            velocity_time_constant: 0.05,
            step_reflex: false,
            reflex_force: 50.0,
            reflex_retraction: 0.03,
            lost_contact_time: 0.05,
        }
    }
}

/// Trunk orientation task and height. Source: Raiola, eqs. (8), (16)-(17), (31)-(32), section 5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrunkParams {
    /// Stiffness about the x, y, z axes of W, 1/s².
    pub kp: [f64; 3],
    /// Damping, 1/s.
    pub kd: [f64; 3],
    /// Gain of the height integrator, 1/s. The source has 10, at which the base begins to bounce where feet land at different heights.
    pub height_gain: f64,
    /// Limit of the height integral, m.
    pub max_height_correction: f64,
    /// Fastest change of the roll and pitch references, rad/s.
    pub max_orientation_rate: f64,
    /// Largest roll and pitch reference, rad.
    pub max_orientation: f64,
    /// Fastest change of the height reference, m/s.
    pub max_height_rate: f64,
    /// Largest offset of the height reference, m.
    pub max_height_offset: f64,
}

impl Default for TrunkParams {
    fn default() -> Self {
        TrunkParams {
            kp: [1000.0; 3],
            kd: [100.0; 3],
            height_gain: 2.0,
            max_height_correction: 0.1,
            max_orientation_rate: 0.5,
            max_orientation: 0.35,
            max_height_rate: 0.1,
            max_height_offset: 0.12,
        }
    }
}

/// Postural task. Source: Raiola, eq. (9), section 5; gains per leg joint HAA HFE KFE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PostureParams {
    /// Swing stiffness: 1/s², or N m/rad with [`PostureParams::swing_inertia`].
    pub swing_kp: [f64; 3],
    /// Swing damping: 1/s, or N m s/rad.
    pub swing_kd: [f64; 3],
    /// Swing gains are torques: premultiply them by the inverse of the leg's inertia (Raiola, appendix).
    pub swing_inertia: bool,
    /// Stance stiffness: 1/s², or N m/rad with [`PostureParams::stance_inertia`].
    pub stance_kp: [f64; 3],
    /// Stance damping: 1/s, or N m s/rad. Critical at the source's stiffness; its own 20 lets the base bounce with the trot's half stride.
    pub stance_kd: [f64; 3],
    /// Stance gains are torques, as [`PostureParams::swing_inertia`].
    pub stance_inertia: bool,
    /// Largest lead of a standing leg's joint reference over the joint, rad.
    pub max_stance_lead: f64,
    /// Time constant with which the reference of a landed leg goes from its touchdown value to the nominal posture, s.
    pub blend_time_constant: f64,
}

impl Default for PostureParams {
    fn default() -> Self {
        PostureParams {
            swing_kp: [300.0; 3],
            swing_kd: [8.0, 12.0, 5.0],
            swing_inertia: true,
            stance_kp: [500.0; 3],
            stance_kd: [45.0; 3],
            stance_inertia: false,
            max_stance_lead: 0.15,
            blend_time_constant: 0.25,
        }
    }
}

/// Quadratic programs of the stack. Source: Raiola, eqs. (10)-(15), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WbcParams {
    /// Regularization λ of accelerations and forces.
    pub regularization: f64,
    /// Friction coefficient μ.
    pub friction: f64,
    /// Largest tangential force of a foot, N.
    pub f_xy_max: f64,
    /// Largest vertical force of a foot, N.
    pub f_z_max: f64,
    /// Smallest vertical force of a stance foot, N.
    pub f_z_min: f64,
    /// Largest joint acceleration, rad/s².
    pub qdd_max: f64,
    /// Iterations of the solver.
    pub max_iterations: u32,
    /// Tolerance of the solver on feasibility and gap.
    pub tolerance: f64,
}

impl Default for WbcParams {
    fn default() -> Self {
        WbcParams {
            regularization: 1e-6,
            friction: 0.8,
            f_xy_max: 1000.0,
            f_z_max: 1000.0,
            f_z_min: 20.0,
            qdd_max: 500.0,
            max_iterations: 200,
            tolerance: 1e-8,
        }
    }
}

/// Getting up from the ground and sitting down: joint-space moves with the joint loop of the drives. Beyond Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StandParams {
    /// Stiffness of a joint over its effort, 1/rad.
    pub stiffness: f64,
    /// Damping of a joint over its effort, s/rad.
    pub damping: f64,
    /// Peak speed of a joint while legs fold, rad/s.
    pub joint_speed: f64,
    /// Peak speed of the base while it rises or is lowered, m/s.
    pub rise_speed: f64,
    /// Height of the base over the feet where legs are folded, as a part of that of standing; more where the joints' limits ask for it.
    pub fold: f64,
    /// Error of a joint at which its reference waits for it, rad. From half of that on it slows down.
    pub max_error: f64,
    /// A move that has waited this long is given up, s.
    pub patience: f64,
}

impl Default for StandParams {
    fn default() -> Self {
        StandParams {
            stiffness: 3.0,
            damping: 0.1,
            joint_speed: 1.0,
            rise_speed: 0.2,
            fold: 0.45,
            max_error: 0.4,
            patience: 2.0,
        }
    }
}

/// When to give up, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyParams {
    /// Largest roll or pitch of the base, rad.
    pub max_tilt: f64,
    /// Oldest joint state that a tick may act on, s.
    pub max_state_age: f64,
    /// Oldest operator command that is followed, s; an older one counts as the wish to stand.
    pub max_operator_age: f64,
    /// How far a joint may be beyond its limits in the URDF, rad.
    pub position_margin: f64,
    /// Largest speed of a joint over its limit in the URDF.
    pub velocity_factor: f64,
    /// Largest measured torque of a joint over its effort in the URDF.
    pub torque_factor: f64,
    /// Least height of the base over the feet while standing or walking, as a part of the nominal one.
    pub min_height: f64,
    /// Longest time without a foot on the ground while standing or walking, s.
    pub max_flight_time: f64,
    /// Ticks in a row that may repeat the last torque when the quadratic program fails.
    pub max_qp_failures: i32,
    /// Damping of the joints in the safe state, N m s/rad.
    pub damping: f64,
}

impl Default for SafetyParams {
    fn default() -> Self {
        SafetyParams {
            max_tilt: 0.6,
            max_state_age: 0.01,
            max_operator_age: 0.5,
            position_margin: 0.2,
            velocity_factor: 3.0,
            torque_factor: 1.5,
            min_height: 0.5,
            max_flight_time: 0.5,
            max_qp_failures: 5,
            damping: 8.0,
        }
    }
}

impl Params {
    /// Reads and checks a TOML text; `source_name` stands in errors.
    ///
    /// # Errors
    /// Not TOML, unknown or missing keys, values of the wrong kind or out of range.
    pub fn from_toml(text: &str, source_name: &str) -> Result<Self, ParamsError> {
        let params: Params = toml::from_str(text)
            .map_err(|e| ParamsError::Parse { source_name: source_name.to_owned(), error: e.to_string() })?;
        params.check()?;
        Ok(params)
    }

    /// Every parameter as TOML, defaults included. [`Params::from_toml`] reads it back to the same bits.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain structs of numbers, strings and tables always serialize")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = r#"
        [robot]
        name = "box"
        urdf = "box.urdf"
        feet = ["a", "b", "c", "d"]
        foot_radius = 0.02
        imu_link = "imu"
        posture = { j1 = 0.1 }
    "#;

    fn overridden(key: &str, value: &str) -> Result<Params, ParamsError> {
        let text = apply_overrides(ROBOT, &[(key.to_owned(), value.to_owned())])?;
        Params::from_toml(&text, "test")
    }

    #[test]
    fn full_text_reads_back_to_the_same_parameters() {
        let params = Params::from_toml(ROBOT, "test").unwrap();
        assert_eq!(Params::from_toml(&params.to_toml(), "test").unwrap(), params);
    }

    #[test]
    fn overrides_reach_numbers_arrays_and_switches() {
        assert_eq!(overridden("gait.trot.swing_frequency", "4").unwrap().gait.trot.swing_frequency, 4.0);
        assert_eq!(overridden("trunk.kp", "[1, 2.5, 3]").unwrap().trunk.kp, [1.0, 2.5, 3.0]);
        assert!(!overridden("posture.swing_inertia", "false").unwrap().posture.swing_inertia);
        assert_eq!(overridden("robot.posture.j1", "-0.5").unwrap().robot.posture["j1"], -0.5);
    }

    #[test]
    fn errors_name_the_key_and_what_was_expected() {
        let text = |key, value| overridden(key, value).unwrap_err().to_string();
        assert!(text("gait.trott.duty", "0.6").contains("\"gait.trott.duty\", in [gait] there are: crawl, trot"));
        assert!(text("wbc.mu", "0.6").contains("friction"));
        assert!(text("gait.trot", "1").contains("in [gait.trot] there are: duty"));
        assert_eq!(
            text("wbc.friction", "high"),
            "parameter wbc.friction: found `high`, expected a value like `0.8` (float)"
        );
        assert!(text("trunk.kp", "[1.0, 2.0]").contains("expected a value like `[1000.0, 1000.0, 1000.0]`"));
        assert_eq!(text("gait.trot.duty", "1.5"), "parameter gait.trot.duty is 1.5, expected at least 0.5 and below 1");
        // Each of these would reach a `clamp`, a count or the QP as nonsense.
        for (key, value) in [
            ("foothold.max_yaw_rate", "-1"),
            ("trunk.max_orientation", "nan"),
            ("trunk.kp", "[1, inf, 1]"),
            ("posture.stance_kd", "[1, 1, -1]"),
            ("gait.crawl.lift_off_phase", "[0, 0.5, 1, 0.25]"),
            ("swing.reach_time", "0.6"),
            ("contact.debounce", "0"),
            ("wbc.max_iterations", "0"),
            ("safety.max_qp_failures", "-1"),
            ("robot.posture.j1", "nan"),
        ] {
            let text = text(key, value);
            let named = key.strip_suffix(".j1").unwrap_or(key);
            assert!(text.starts_with(&format!("parameter {named} is ")), "{text}");
        }
        let unknown = Params::from_toml(&format!("{ROBOT}\n[wbc]\nmu = 0.5"), "box.toml").unwrap_err().to_string();
        assert!(unknown.contains("box.toml") && unknown.contains("unknown field `mu`"), "{unknown}");
    }
}
