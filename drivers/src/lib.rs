//! What touches a robot, a simulator or a person: the simulator, the scenario that happens in it, and what goes wrong.
//!
//! - [`Scenario`]: operator, terrain, sensors, drives, pushes and faults of a run, from TOML (`scenarios/`).
//! - [`Terrain`]: the ground, made from a seed.
//! - [`Simulator`]: what the other side of a controller can do; [`MujocoSim`] does it.
//! - [`FaultInjection`]: what spoils messages on their way.
//! - [`command_mux`]: which of several operators a robot follows.
//! - [`teleop`]: a person's keys, pad or lines, made into commands.
//! - [`lockstep`]: simulator, controller and log in one process.
//! - [`live`]: the same controller as processes that meet over LCM: the real-time executor, the hardware under it.
//!
//! No control is computed here but the joint loop that a drive has, and the controller sees nothing but messages. Nothing
//! outside [`live`] reads a clock: time comes from the caller. Start with `tests/physics.rs`: a robot is put down and held.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod command_mux;
mod drives;
mod error;
pub mod fault_injection;
mod floor;
pub mod live;
pub mod lockstep;
mod mjcf;
mod mujoco;
pub mod operator_script;
pub mod parameter_requests;
mod rng;
pub mod robot_files;
pub mod run_info;
pub mod scenario;
mod sensors;
pub mod shipped;
pub mod simulation;
mod simulator;
mod stage_clock;
mod start;
pub mod teleop;
pub mod terrain;
mod watch;

pub use drives::DriveParams;
pub use error::DriverError;
pub use fault_injection::FaultInjection;
pub use floor::FloorMove;
pub use mujoco::{MujocoSim, SimParams};
pub use rng::Rng;
pub use scenario::Scenario;
pub use sensors::NoiseParams;
pub use simulator::Simulator;
pub use start::{StartParams, StartPosture};
pub use terrain::Terrain;
pub use watch::{ModeEvent, ModeWatch};
