//! The robot side of a controller: simulator, scenarios, fault injection, live runs and operator input.
//!
//! - [`Scenario`]: operator script, terrain, sensors, drives, pushes and faults of a run, from TOML (`scenarios/`).
//! - [`Terrain`]: the ground, generated from a seed.
//! - [`Simulator`]: interface of a simulated robot; [`MujocoSim`] implements it.
//! - [`FaultInjection`]: errors of sensors, messages, clocks and drives.
//! - [`lockstep`]: simulator, controller and log in one process; [`simulation`]: a complete lockstep run from files to a finished log.
//! - [`robot_files`], [`shipped`], [`run_info`]: the files of a robot and of the project, and RUN_INFO.
//! - [`command_mux`]: selects one of several operators.
//! - [`teleop`]: operator commands from keyboard, gamepad or text lines.
//! - [`components`]: several controllers in one run, each with its own rate, and the release of their results.
//! - [`live`]: real-time processes over LCM: executor, hardware interface, simulator as a driver.
//!
//! The only control computed here is the joint loop of the drives; the controller receives messages only. Simulated time comes from the
//! caller: outside [`live`], clocks are read only for TIMING and the wall time of a run. Read on in `tests/physics.rs`.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod checks;
pub mod command_mux;
pub mod components;
mod drives;
mod error;
pub mod fault_injection;
mod fault_limits;
mod floor;
pub mod live;
pub mod lockstep;
pub mod mesh;
mod mjcf;
mod mujoco;
pub mod operator_script;
pub mod parameter_requests;
pub mod robot_files;
pub mod robot_info;
pub mod run_info;
pub mod scenario;
mod sensors;
pub mod shipped;
pub mod simulation;
mod simulator;
mod stage_clock;
mod start;
mod task_requests;
pub mod teleop;
pub mod terrain;
mod watch;

pub use drives::DriveParams;
pub use error::DriverError;
pub use fault_injection::FaultInjection;
pub use floor::FloorMove;
pub use mujoco::{MujocoSim, SimParams};
pub use scenario::Scenario;
pub use sensors::NoiseParams;
pub use simulator::Simulator;
pub use stage_clock::StageClock;
pub use start::{StartParams, StartPosture};
pub use terrain::Terrain;
pub use watch::{ModeEvent, ModeWatch};
