//! A scenario: terrain, operator script, sensors, drives, pushes, moving floors and faults of a run, as TOML.
//!
//! ```toml
//! name = "push"
//! duration_s = 5.0
//! seed = 1
//! friction = 0.8
//! controller = "hold"   # optional: hold, posture, or quadruped, the default
//! physics_steps = 2     # optional: physics steps per control tick, 1 to 20
//!
//! [terrain]
//! kind = "flat"
//!
//! [start]               # initial pose of the robot; optional
//! posture = "lying"     # or "standing"; also: roll, pitch (rad), joints = { lf_kfe_joint = -1.0 }
//!
//! [[operator]]          # each key holds until a later entry changes it
//! t_s = 0.0
//! mode = "stand"        # walk, sit, idle (no torque), damping (emergency stop)
//!
//! [[operator]]
//! t_s = 1.0
//! mode = "walk"
//! gait = "crawl"        # trot, crawl, or another gait of the run
//! v_x = 0.2
//!
//! [[push]]
//! t_s = 2.5
//! duration_s = 0.2
//! force_W = [0.0, 150.0, 0.0]
//!
//! [noise]               # standard deviations; each key is optional
//! position = 0.0005     # joints, rad
//! velocity = 0.02       # joints, rad/s
//! gyro = 0.005          # rad/s
//!
//! [drives]
//! lag_s = 0.005         # first-order lag of every torque
//! gain = { lf_kfe_joint = 0.8 }
//! gain_in_air = true    # gains apply only while the foot of the leg has no contact
//!
//! [[floor]]             # only with flat terrain
//! t_s = 3.0             # the floor moves when the foot is next in the air
//! leg = "LF"            # or contact = "wheel_1": a contact of the robot
//! height_m = -0.05
//!
//! [[object]]            # a thing beside the robot; a fixture, such as a table, has no mass_kg
//! name = "crate"
//! shape = "box"         # or "cylinder" with radius_m and length_m
//! size_m = [0.4, 0.3, 0.2]
//! mass_kg = 5.0
//! friction = 0.5        # of its contacts with ground and robot; default: that of the scenario
//! position_m = [1.0, 0.0, 0.1]
//! rpy_rad = [0.0, 0.0, 0.3]
//!
//! [[weld]]              # a link holds an object at a pose in the link
//! t_s = 1.0
//! duration_s = 2.0
//! link = "arm1_8"
//! object = "crate"
//! position_m = [0.0, 0.0, 0.15]
//!
//! [[fault]]             # nan_sensor, stuck_encoder, torque_loss (joint), drop_state, drop_command, late_process, false_touch,
//! t_s = 4.0             # delay_state (delay_s), clock_jump (jump_s), imu_bias (gyro_rad_s, orientation_rad), drop_operator,
//! duration_s = 0.5      # false_reading (joint, quantity = "position" | "velocity" | "torque", offset)
//! kind = "torque_loss"
//! joint = "rh_kfe_joint"
//! factor = 0.2
//!
//! [[parameter]]         # a parameter change while the controller runs; an unknown key is an error, a rejected value an EVENT
//! t_s = 4.5
//! key = "trunk.kp"
//! value = [800.0, 800.0, 800.0]
//!
//! [[task]]              # a request to a task of the controller cartesian_ik; operations: task_request_t.lcm
//! t_s = 2.0
//! task = "left_hand"
//! operation = "waypoints"   # pose, waypoints, velocity, mode, base_link, activate, weight, gain, limits, reset, posture
//! relative = true           # poses relative to the present reference; also: name, values
//! poses = [{ time_s = 2.0, position_m = [0.1, 0.0, 0.2] }, { time_s = 4.0, q_wxyz = [0.7071067811865476, 0.0, 0.0, 0.7071067811865476] }]
//! ```
//!
//! A scenario is checked completely when it is read. Only names of links and joints are checked later, against the robot.

mod file;
mod object;

pub use crate::checks::Window;
pub use object::{Object, ObjectShape, Weld};

use crate::DriverError;
use crate::checks::to_ns;
use crate::drives::DriveParams;
use crate::fault_injection::FaultWindow;
use crate::floor::FloorMove;
use crate::operator_script::OperatorScript;
use crate::sensors::NoiseParams;
use crate::start::StartParams;
use crate::terrain::TerrainParams;
use controller::quadruped::params::GaitParams;
use lcmtypes::{ParameterRequest, TaskRequest};
use std::path::Path;

/// The description of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Short name.
    pub name: String,
    /// Length of the run, s.
    pub duration_s: f64,
    /// Seed of terrain and noise.
    pub seed: i64,
    /// Friction coefficient of feet and ground.
    pub friction: f64,
    /// Controller of the run, as [`controller::load`] expects it.
    pub controller: String,
    /// Physics steps per control tick; the joint loops of the drives run in each of them.
    pub physics_steps: u32,
    /// The ground.
    pub terrain: TerrainParams,
    /// Noise of the sensors.
    pub noise: NoiseParams,
    /// Lag and gains of the drives.
    pub drives: DriveParams,
    /// Initial pose of the robot.
    pub start: StartParams,
    /// The operator commands, in order of time.
    pub operator: OperatorScript,
    /// Pushes, in the order of the file.
    pub pushes: Vec<Push>,
    /// Moving floors, in the order of the file.
    pub floors: Vec<FloorMove>,
    /// Objects beside the robot, in the order of the file.
    pub objects: Vec<Object>,
    /// Links that hold objects, in the order of the file.
    pub welds: Vec<Weld>,
    /// Faults, in the order of the file.
    pub faults: Vec<FaultWindow>,
    /// Parameter changes, in order of time.
    pub parameters: Vec<ParameterRequest>,
    /// Requests to tasks of a Cartesian server, in order of time.
    pub tasks: Vec<TaskRequest>,
}

/// A force and torque on a link for a limited time.
#[derive(Clone, Debug, PartialEq)]
pub struct Push {
    /// When it acts.
    pub window: Window,
    /// Link or object whose body it acts on, at the centre of mass; `None` for the base.
    pub link: Option<String>,
    /// Force in W, N.
    pub f_W: [f64; 3],
    /// Torque in W, N m.
    pub tau_W: [f64; 3],
}

impl Scenario {
    /// Reads and checks a file.
    ///
    /// - `gaits`: the gaits of the run, to which operator commands may change.
    ///
    /// # Errors
    /// The file cannot be read, is not TOML, has an unknown key, or a value of the wrong type or out of range. The message names file,
    /// line and key.
    pub fn load(path: &Path, gaits: &GaitParams) -> Result<Self, DriverError> {
        let text = replay::read_text(path).map_err(|source| DriverError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string(), gaits)
    }

    /// Reads and checks a text.
    ///
    /// - `source_name`: name of the text in errors.
    /// - `gaits`: the gaits of the run, to which operator commands may change.
    ///
    /// # Errors
    /// As [`Scenario::load`], without I/O errors.
    pub fn parse(text: &str, source_name: &str, gaits: &GaitParams) -> Result<Self, DriverError> {
        file::parse(text, source_name, gaits)
    }

    /// Length of the run, ns.
    pub fn duration_ns(&self) -> i64 {
        to_ns(self.duration_s)
    }

    /// The pushes that act at `t_ns`.
    pub fn pushes_at(&self, t_ns: i64) -> impl Iterator<Item = &Push> {
        self.pushes.iter().filter(move |push| push.window.contains(t_ns))
    }

    /// Start and end of pushes and faults, and scheduled floor moves, as texts for EVENT, in order of time (ns).
    pub fn timeline(&self) -> Vec<(i64, String)> {
        let mut events = Vec::new();
        let mut add = |window: Window, what: String| {
            events.push((window.start_ns, format!("{what} begins")));
            events.push((window.end_ns, format!("{what} ends")));
        };
        for Push { window, link, f_W, tau_W } in &self.pushes {
            let link = link.as_deref().unwrap_or("the base");
            add(*window, format!("push of {f_W:?} N and {tau_W:?} N m on {link}"));
        }
        for Weld { window, link, object, .. } in &self.welds {
            add(*window, format!("weld of {object} to {link}"));
        }
        for FaultWindow { window, kind } in &self.faults {
            add(*window, format!("fault {kind}"));
        }
        for FloorMove { t_ns, contact, height, .. } in &self.floors {
            events.push((*t_ns, format!("floor under {contact} moves to {height} m when the foot is next in the air")));
        }
        events.sort_by_key(|event| event.0);
        events
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str =
        "name = \"small\"\nduration_s = 2.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n";

    /// The error of a text with an invalid value: line, key, value found, values expected.
    fn value_error(text: &str) -> (usize, String, String, String) {
        match Scenario::parse(text, "small.toml", &GaitParams::default()).unwrap_err() {
            DriverError::Value { file, line, key, found, expected } if file == "small.toml" => {
                (line, key, found, expected)
            }
            error => panic!("{error}"),
        }
    }

    /// The error of a text that does not parse: line, and the text of that line.
    fn parse_error(text: &str) -> (usize, String, String) {
        match Scenario::parse(text, "small.toml", &GaitParams::default()).unwrap_err() {
            DriverError::Parse { file, line, text, error } if file == "small.toml" => (line, text, error),
            error => panic!("{error}"),
        }
    }

    #[track_caller]
    fn bad_value(text: &str, line: usize, key: &str, found: &str) -> String {
        let error = value_error(text);
        assert_eq!((error.0, &*error.1, &*error.2), (line, key, found));
        error.3
    }

    #[test]
    fn defaults_are_as_documented() {
        let scenario = Scenario::parse(SMALL, "small.toml", &GaitParams::default()).unwrap();
        assert_eq!((scenario.seed, scenario.friction, scenario.duration_ns()), (0, 0.8, 2_000_000_000));
        assert!(scenario.pushes.is_empty() && scenario.faults.is_empty());
    }

    #[test]
    fn an_unknown_key_is_an_error_with_line_and_known_keys() {
        let (line, text, error) = parse_error(&format!("{SMALL}v_z = 1.0\n"));
        assert_eq!((line, &*text), (8, "v_z = 1.0"));
        assert!(["v_z", "v_x", "step_height"].iter().all(|key| error.contains(key)), "{error}");
        let (line, _, error) = parse_error(&SMALL.replace("\"flat\"", "\"moon\""));
        assert!(line == 4 && error.contains("moon") && error.contains("flat"), "{error}");
        assert_eq!(parse_error(&SMALL.replace("2.0", "\"2\"")).0, 2);
    }

    #[test]
    fn a_value_out_of_range_is_an_error_with_line_and_key() {
        let expected = bad_value(&SMALL.replace("2.0", "-2.0"), 2, "duration_s", "-2");
        assert!(expected.contains("0.001") && expected.contains("36000"), "{expected}");
        let late = format!("{SMALL}[[operator]]\nt_s = 1.5\n[[operator]]\n# earlier\nt_s = 1.0\n");
        assert!(bad_value(&late, 12, "operator[3].t_s", "1").contains("1.5"));
        bad_value(&format!("{SMALL}v_x = nan\n"), 8, "operator[1].v_x", "NaN");
        let fault =
            format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"torque_loss\"\njoint = \"knee\"\n");
        bad_value(&fault, 8, "fault[1].factor", "missing");
        let push = format!("{SMALL}[[push]]\nt_s = 1.0\nduration_s = -0.1\n");
        bad_value(&push, 10, "push[1].duration_s", "-0.1");
    }

    #[test]
    fn an_unknown_parameter_is_an_error_with_its_line() {
        let text = |key: &str| format!("{SMALL}[[parameter]]\nt_s = 0.5\nkey = \"{key}\"\nvalue = 1.0\n");
        for key in ["nope.x", "trunk.kpp", "trunk", "x", "gait.trot"] {
            let expected = bad_value(&text(key), 10, "parameter[1].key", key);
            assert!(expected.contains("keys of"), "{expected}");
        }
        // Whether the robot's file has these, and whether the value fits, is found when the run starts.
        for key in ["trunk.kp", "wbc.friction", "stack.tasks.hand.kp", "robot.posture.knee"] {
            assert_eq!(
                Scenario::parse(&text(key), "small.toml", &GaitParams::default()).unwrap().parameters[0].key,
                key
            );
        }
    }

    #[test]
    fn drives_floors_and_faults_are_checked() {
        bad_value(&format!("{SMALL}[drives]\nlag_s = -0.005\n"), 9, "drives.lag_s", "-0.005");
        bad_value(&format!("{SMALL}[drives]\ngain = {{ knee = 20.0 }}\n"), 9, "drives.gain", "20");
        bad_value(&format!("{SMALL}[drives]\ngain_in_air = true\n"), 9, "drives.gain_in_air", "true");
        let floor = "[[floor]]\nt_s = 1.0\nleg = \"LF\"\nheight_m = -0.05\n";
        let scenario = Scenario::parse(&format!("{SMALL}{floor}"), "small.toml", &GaitParams::default()).unwrap();
        assert_eq!(
            scenario.floors,
            [FloorMove { t_ns: 1_000_000_000, contact: "LF".to_owned(), key: "leg", height: -0.05 }]
        );
        let text = &scenario.timeline()[0].1;
        assert!(text.contains("LF") && text.contains("-0.05 m"), "{text}");
        let rough = format!("{}{floor}", SMALL.replace("flat", "rough"));
        assert_eq!(value_error(&rough).1, "floor[1].height_m");
        let touch = format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"false_touch\"\n");
        bad_value(&touch, 8, "fault[1].force_N", "missing");
        let needless = format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"drop_state\"\nleg = \"LF\"\n");
        bad_value(&needless, 12, "fault[1].leg", "given");
    }

    #[test]
    fn an_array_of_another_length_is_an_error_with_its_line() {
        let rough = SMALL.replace("flat", "rough");
        let push = format!("{SMALL}[[push]]\nt_s = 0.5\nduration_s = 0.1\n");
        let bias = format!("{SMALL}[[fault]]\nt_s = 1.0\nduration_s = 0.1\nkind = \"imu_bias\"\n");
        for (text, key, length) in [
            (&rough, "extent_m", 2),
            (&rough, "height_m", 2),
            (&rough, "plate_height_m", 2),
            (&push, "force_W", 3),
            (&push, "torque_W", 3),
            (&bias, "gyro_rad_s", 3),
            (&bias, "orientation_rad", 3),
        ] {
            for wrong in [length - 1, length + 1] {
                let array = format!("{key} = {:?}\n", vec![1.0; wrong]);
                let (text, line) = match text.split_once("kind = \"rough\"\n") {
                    Some((before, after)) => (format!("{before}kind = \"rough\"\n{array}{after}"), 5),
                    None => (format!("{text}{array}"), text.lines().count() + 1),
                };
                assert_eq!(parse_error(&text).0, line, "{array}");
            }
        }
    }

    #[test]
    fn windows_are_half_open_and_on_the_timeline() {
        let text = format!(
            "{SMALL}[[push]]\nt_s = 0.5\nduration_s = 0.1\nforce_W = [0.0, 60.0, 0.0]\n\
             [[fault]]\nt_s = 0.25\nduration_s = 1.0\nkind = \"drop_state\"\n"
        );
        let scenario = Scenario::parse(&text, "small.toml", &GaitParams::default()).unwrap();
        let pushes = |t_ns| scenario.pushes_at(t_ns).count();
        assert_eq!([499_999_999, 500_000_000, 599_999_999, 600_000_000].map(pushes), [0, 1, 1, 0]);
        let times: Vec<i64> = scenario.timeline().iter().map(|event| event.0 / 1_000_000).collect();
        assert_eq!(times, [250, 500, 600, 1250]);
        assert!(scenario.timeline()[1].1.contains("[0.0, 60.0, 0.0] N"), "{:?}", scenario.timeline()[1]);
    }
}
