//! The list of all tables of the parameters file.

use super::error::ParamsError;
use super::robot::RobotConfig;
use crate::hold::params::HoldParams;
use crate::qp::QpParams;
use crate::quadruped::params::{
    ContactParams, FootholdParams, GaitParams, PostureParams, RecoveryParams, StandParams, SwingParams, TerrainParams,
    TrunkParams, WbcParams,
};
use crate::safety::SafetyParams;
use crate::stack::{Formula, StackParams};
use serde::{Deserialize, Serialize};

/// Every parameter of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Feet, posture and sensors of the robot.
    pub robot: RobotConfig,
    /// Gait timing and force ramps.
    #[serde(default)]
    pub gait: GaitParams,
    /// Foothold planner, filter and limits of the velocity command.
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
    /// Reactions to disturbances.
    #[serde(default)]
    pub recovery: RecoveryParams,
    /// Trunk orientation task and height of the base.
    #[serde(default)]
    pub trunk: TrunkParams,
    /// Posture task.
    #[serde(default)]
    pub posture: PostureParams,
    /// Tasks, their weights and priorities.
    #[serde(default)]
    pub stack: StackParams,
    /// Choice of the QP solver.
    #[serde(default)]
    pub qp: QpParams,
    /// Constraints and solver settings of the quadratic programs.
    #[serde(default)]
    pub wbc: WbcParams,
    /// Standing up and sitting down.
    #[serde(default)]
    pub stand: StandParams,
    /// Limits that lead to the safe state, and the damping in it.
    #[serde(default)]
    pub safety: SafetyParams,
    /// The hold controller.
    #[serde(default)]
    pub hold: HoldParams,
}

impl Params {
    /// Reads and checks a TOML text.
    ///
    /// - `source_name`: file name or description of the text, for errors.
    ///
    /// # Errors
    /// The text is not TOML, has unknown or missing keys, or values of the wrong type or out of range.
    pub fn from_toml(text: &str, source_name: &str) -> Result<Self, ParamsError> {
        let params: Params = toml::from_str(text)
            .map_err(|e| ParamsError::Parse { source_name: source_name.to_owned(), error: e.to_string() })?;
        params.check()?;
        Ok(params)
    }

    /// Writes every parameter as TOML, defaults included. [`Params::from_toml`] reads the same bits back.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain structs of numbers, strings and tables always serialize")
    }

    /// Checks the range of each parameter, and that the formula of the stack can be parsed.
    fn check(&self) -> Result<(), ParamsError> {
        let Params {
            robot,
            gait,
            foothold,
            swing,
            contact,
            terrain,
            recovery,
            trunk,
            posture,
            stack,
            qp: _,
            wbc,
            stand,
            safety,
            hold,
        } = self;
        Formula::parse(&stack.formula)?;
        robot.check()?;
        gait.check()?;
        foothold.check()?;
        swing.check()?;
        contact.check()?;
        terrain.check()?;
        recovery.check()?;
        trunk.check()?;
        posture.check()?;
        wbc.check()?;
        stand.check()?;
        safety.check()?;
        hold.check()
    }
}

#[cfg(test)]
mod tests {
    use super::super::apply_overrides;
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
            "parameter wbc.friction: found `high`, expected a value like `0.6` (float)"
        );
        assert_eq!(
            text("qp.solver", "clarabell"),
            "parameter qp.solver: found `clarabell`, expected `active_set` or `clarabel`"
        );
        assert!(
            text("stack.tasks", "{}")
                .ends_with(", in [stack.tasks] there is none: a parameters file adds what is to be there")
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
