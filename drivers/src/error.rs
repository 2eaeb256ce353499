//! What can go wrong in a driver.

use std::path::PathBuf;

/// Why a scenario, a simulator or a command is unusable.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriverError {
    /// A file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A folder for a log cannot be created.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// No robot has this name.
    #[error(
        "no robot \"{name}\": found neither robots/{name}/{name}.toml nor a .toml or .urdf file; known robots: {}", known.join(", ")
    )]
    UnknownRobot {
        /// The name.
        name: String,
        /// Names below `robots/`.
        known: Vec<String>,
    },
    /// A URDF file was given where parameters are required.
    #[error("{}: a URDF alone has no feet, posture and gains; give the name of a robot or its TOML file", path.display())]
    UrdfAlone {
        /// The URDF.
        path: PathBuf,
    },
    /// A file of the project is missing.
    #[error("{name} not found; searched the working directory{}", folders.iter().map(|f| format!(", {}", f.display())).collect::<String>())]
    NotShipped {
        /// Path below the root of the project.
        name: String,
        /// Folders searched besides the working directory.
        folders: Vec<PathBuf>,
    },
    /// A parameter override without `=`.
    #[error("parameter {text}: expected KEY=VALUE")]
    Override {
        /// The text.
        text: String,
    },
    /// The URDF is invalid.
    #[error(transparent)]
    Urdf(#[from] controller::model::ModelError),
    /// Parameters are invalid.
    #[error(transparent)]
    Params(#[from] controller::params::ParamsError),
    /// Parameters in a file are invalid.
    #[error("{file}: {source}")]
    ParamsFile {
        /// The file.
        file: String,
        /// The error.
        source: controller::params::ParamsError,
    },
    /// The controller cannot be built for a robot.
    #[error("{robot}: {source}")]
    Controller {
        /// The robot, by name or file.
        robot: String,
        /// The error.
        source: controller::LoadError,
    },
    /// A scenario does not fit the robot.
    #[error("{file}: {source}")]
    InScenario {
        /// Scenario file.
        file: String,
        /// The error.
        source: Box<DriverError>,
    },
    /// A scenario is not TOML, has an unknown key, or a value of the wrong kind.
    #[error("{file}:{line}: {error}, in `{text}`")]
    Parse {
        /// File, or what the text is.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What the parser says.
        error: String,
        /// The line.
        text: String,
    },
    /// A value of a scenario makes no sense.
    #[error("{file}:{line}: {key} is {found}, expected {expected}")]
    Value {
        /// File, or what the text is.
        file: String,
        /// Line on which the table of the key begins, from 1.
        line: usize,
        /// The key; entries of a list count from 1.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        expected: String,
    },
    /// A scenario or a robot's file names a link or joint that the robot lacks.
    #[error("{wanted_by}: the robot has no {what} \"{name}\", it has: {}", known.join(", "))]
    Unknown {
        /// Key that names it.
        wanted_by: String,
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
        /// Names there are.
        known: Vec<String>,
    },
    /// A robot is to lie on the ground and has no posture for it.
    #[error("start.posture is \"lying\", and the file of {robot} has no [robot.lying]")]
    NoLyingPosture {
        /// Name of the robot.
        robot: String,
    },
    /// The simulator refuses its model.
    #[error("MuJoCo refuses the model of {robot}: {error}")]
    Model {
        /// Name of the robot.
        robot: String,
        /// What MuJoCo says.
        error: String,
    },
    /// The simulator's robot is not the one of the URDF.
    #[error("the simulated {robot} weighs {found} kg, its URDF says {expected} kg")]
    Mass {
        /// Name of the robot.
        robot: String,
        /// Total mass in the simulator, kg.
        found: f64,
        /// Total mass of the URDF, kg.
        expected: f64,
    },
    /// A command is of another size than the robot.
    #[error("ROBOT_COMMAND of tick {tick}: {field} has {found} entries, expected {expected}")]
    CommandSize {
        /// Tick of the command.
        tick: i64,
        /// Array of the message.
        field: &'static str,
        /// Its length.
        found: usize,
        /// Number of actuated joints.
        expected: usize,
    },
    /// A command holds NaN or an infinity.
    #[error("ROBOT_COMMAND of tick {tick}: {field} of joint {joint} is {found}, expected a finite number")]
    CommandNotFinite {
        /// Tick of the command.
        tick: i64,
        /// Array of the message.
        field: &'static str,
        /// Joint.
        joint: String,
        /// The value.
        found: f64,
    },
    /// A command asks for a mode that is none.
    #[error("ROBOT_COMMAND of tick {tick}: mode is {found}, expected 0 (idle), 1 (torque) or 2 (damping)")]
    CommandMode {
        /// Tick of the command.
        tick: i64,
        /// The mode.
        found: i8,
    },
    /// The simulation blew up.
    #[error("the simulation is not finite after {t_s} s: position {index} of the generalized coordinates is {found}")]
    Diverged {
        /// Simulated time, s.
        t_s: f64,
        /// Index in the generalized positions or, after those, velocities.
        index: usize,
        /// The value.
        found: f64,
    },
    /// A socket of the real-time thread cannot be made.
    #[error("{url}: no socket to send on: {source}")]
    Socket {
        /// Network.
        url: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// There can be no further thread.
    #[error("no thread for the {what}: {source}")]
    Thread {
        /// What it was to do.
        what: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
    /// The bus refuses.
    #[error(transparent)]
    Bus(#[from] lcmtypes::bus::BusError),
    /// A message cannot be encoded.
    #[error(transparent)]
    Encode(#[from] lcmtypes::EncodeError),
    /// A controller's message cannot be decoded.
    #[error(transparent)]
    Decode(#[from] lcmtypes::DecodeError),
    /// The log cannot be written, or the network not heard.
    #[error(transparent)]
    Log(#[from] replay::Error),
}
