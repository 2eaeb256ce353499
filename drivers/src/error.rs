//! Errors of this crate.

use std::path::PathBuf;

/// Errors of scenarios, robot files, simulations, commands and live runs.
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
    /// The controller `quadruped` for a robot without feet.
    #[error(
        "robot {robot} is not a quadruped (it has no robot.feet): the controller quadruped cannot move it; take a scenario with controller = \"hold\" or \
         \"posture\", such as scenarios/hold.toml"
    )]
    NoFeet {
        /// Name of the robot.
        robot: String,
    },
    /// A robot has no preset of this name.
    #[error(
        "robot {robot}: no preset {name:?}, which would be the file {name}.toml beside the robot's; presets of this robot: {}",
        if known.is_empty() { "none".to_owned() } else { known.join(", ") }
    )]
    UnknownPreset {
        /// The robot, by name or file.
        robot: String,
        /// The preset.
        name: String,
        /// Names of its presets.
        known: Vec<String>,
    },
    /// A URDF file was given where parameters are required.
    #[error("{}: a URDF alone has no feet, posture and gains; give the name of a robot or its TOML file", path.display())]
    UrdfAlone {
        /// The URDF.
        path: PathBuf,
    },
    /// The description of a robot is invalid.
    #[error(transparent)]
    Description(#[from] robot_model::DescriptionError),
    /// A `[[component]]` entry of a run file is invalid.
    #[error("[[component]] {name:?}: {what}")]
    Component {
        /// Name of the component.
        name: String,
        /// Key, what was found and what was expected.
        what: String,
    },
    /// A file of the project is missing.
    #[error("{name} not found; searched the working directory{}", folders.iter().map(|f| format!(", {}", f.display())).collect::<String>())]
    NotShipped {
        /// Path below the root of the project.
        name: String,
        /// Folders searched besides the working directory.
        folders: Vec<PathBuf>,
    },
    /// A parameter override without `=`, key or value.
    #[error("parameter {text:?}: expected KEY=VALUE, such as swing.height=0.12")]
    Override {
        /// The text.
        text: String,
    },
    /// The URDF is invalid.
    #[error(transparent)]
    Urdf(#[from] robot_model::ModelError),
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
        source: Box<controller::LoadError>,
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
        /// File, or name of the text.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Error of the parser.
        error: String,
        /// The line.
        text: String,
    },
    /// A value of a scenario is missing, not allowed or out of range.
    #[error("{file}:{line}: {key} is {found}, expected {expected}")]
    Value {
        /// File, or name of the text.
        file: String,
        /// Line on which the table of the key begins, from 1.
        line: usize,
        /// The key; entries of a list count from 1.
        key: String,
        /// The value, or `missing` or `given`.
        found: String,
        /// The allowed values.
        expected: String,
    },
    /// A scenario or a robot file names a link or joint that the robot does not have.
    #[error("{wanted_by}: the robot has no {what} \"{name}\", it has: {}", known.join(", "))]
    Unknown {
        /// Key that names it.
        wanted_by: String,
        /// `link` or `joint`.
        what: &'static str,
        /// The name.
        name: String,
        /// Names that the robot has.
        known: Vec<String>,
    },
    /// An object has the name of a link, so that a push could not tell them apart.
    #[error("object.name is \"{name}\", which is a link of the robot; expected a name that no link has")]
    ObjectNamedAsLink {
        /// The name.
        name: String,
    },
    /// More contacts have floors of their own than MuJoCo has contact bits.
    #[error("[[floor]] names {found} contacts, expected at most {most}")]
    TooManyFloors {
        /// Number of contacts with a floor of their own.
        found: usize,
        /// Largest number.
        most: usize,
    },
    /// A run starts with a lying robot, but the robot has no posture for it.
    #[error("start.posture is \"lying\", but the parameters of {robot} have no [robot.lying]")]
    NoLyingPosture {
        /// Name of the robot.
        robot: String,
    },
    /// MuJoCo rejects the model.
    #[error("MuJoCo rejects the model of {robot}: {error}")]
    Model {
        /// Name of the robot.
        robot: String,
        /// Error of MuJoCo.
        error: String,
    },
    /// The mass in the simulator differs from that of the URDF.
    #[error("the mass of the simulated {robot} is {found} kg, expected {expected} kg as in its URDF")]
    Mass {
        /// Name of the robot.
        robot: String,
        /// Total mass in the simulator, kg.
        found: f64,
        /// Total mass of the URDF, kg.
        expected: f64,
    },
    /// An array of a command has the wrong length.
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
    /// A command has a non-finite value.
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
    /// A command has an unknown mode.
    #[error("ROBOT_COMMAND of tick {tick}: mode is {found}, expected 0 (idle), 1 (torque) or 2 (damping)")]
    CommandMode {
        /// Tick of the command.
        tick: i64,
        /// The mode.
        found: i8,
    },
    /// A weld begins while its object is elsewhere: the constraint would throw it.
    #[error(
        "weld[{number}]: its object is {distance:.3} m from the pose in the link, expected at most {expected} m; place the object there (position_m)"
    )]
    FarWeld {
        /// Number of the entry, from 1.
        number: usize,
        /// Distance found, m.
        distance: f64,
        /// Largest distance, m.
        expected: f64,
    },
    /// The simulation diverged.
    #[error("the simulation diverged at {t_s} s: generalized coordinate {index} is {found}")]
    Diverged {
        /// Simulated time, s.
        t_s: f64,
        /// Index in the generalized positions, followed by the velocities.
        index: usize,
        /// The value.
        found: f64,
    },
    /// A socket of the real-time thread cannot be opened.
    #[error("{url}: cannot open a socket to send on: {source}")]
    Socket {
        /// Network.
        url: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The driver on the network has another robot than the run.
    #[error("the driver on this network has another robot: {difference}; no command was sent")]
    OtherRobot {
        /// The difference.
        difference: String,
    },
    /// A second process with the same role is on the network.
    #[error("another run on this network started earlier: end it, or use another port (--lcm-url)")]
    SecondRun,
    /// A second driver is on the network.
    #[error("another driver on this network started earlier: end it, or use another port (--lcm-url)")]
    SecondDriver,
    /// A thread cannot be started.
    #[error("cannot start the {what} thread: {source}")]
    Thread {
        /// Purpose of the thread.
        what: &'static str,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// An error of the bus.
    #[error(transparent)]
    Bus(#[from] lcmtypes::bus::BusError),
    /// A message cannot be encoded.
    #[error(transparent)]
    Encode(#[from] lcmtypes::EncodeError),
    /// A controller's message cannot be decoded.
    #[error(transparent)]
    Decode(#[from] lcmtypes::DecodeError),
    /// The log cannot be written, or the network cannot be received from.
    #[error(transparent)]
    Log(#[from] replay::Error),
}
