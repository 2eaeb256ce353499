//! Controllers of legged robots, and what they are built from: rigid-body model, stack of tasks, quadratic programs, gait, estimation.
//!
//! A controller is a function of parameters, state and input. This crate reads no clock, no file and no environment variable, starts no thread,
//! and allocates nothing in a tick. Therefore the inputs in a log are enough to run a controller again bit for bit.
//!
//! Where to start:
//!
//! | module | contents |
//! |---|---|
//! | [`runtime`] | [`Component`]: delivered messages, what holds of them, snapshots; executors and the replay engine use it |
//! | [`interface`] | the [`Controller`] trait |
//! | [`quadruped`] | the locomotion controller |
//! | [`hold`] | a controller that moves the joints to a posture and holds it |
//! | [`sequence`] | several controllers in one run |
//! | [`handover`] | parameter changes while a controller runs |
//! | [`params`] | the parameters file |
//! | [`safety`] | faults, joint checks and command limits |
//! | [`stack`], [`qp`] | stacks of tasks and the quadratic programs built from them |
//! | [`tasks`], [`constraints`], [`contact`] | the parts of a stack, for any robot |
//! | [`trajectory`] | references of tasks within limits: on-line generator, way-points, velocity commands |
//! | [`posture`] | a controller that moves any robot to a named posture |
//! | [`cartesian`] | a Cartesian server: inverse kinematics for a stack of tasks, moved by requests |
//! | [`tour`] | a planner that visits named postures |
//! | [`model`] | the crate `robot-model`: rigid-body model and dynamics from a URDF |
//! | [`robot_init`] | a first parameter file for a quadruped from its URDF |
//!
//! Each file imports the file that defines an item, for example `crate::error::LoadError`, not the re-export in this file. `scripts/circles.sh`
//! reports circular imports.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]

pub mod cartesian;
pub mod constraints;
pub mod contact;
mod dense;
pub mod digest;
pub mod dump;
pub mod error;
pub mod handover;
pub mod hold;
pub mod interface;
mod load;
pub mod outbox;
pub mod params;
pub mod posture;
pub mod qp;
pub mod quadruped;
pub mod robot_init;
pub mod runtime;
pub mod safety;
pub mod sequence;
mod shared;
pub mod stack;
pub mod tasks;
pub mod time;
pub mod tour;
pub mod trajectory;

pub use dump::Dump;
pub use error::{LoadError, RestoreError};
pub use interface::{Controller, NoProbe, Probe};
pub use lcmtypes::channels::Stage;
pub use load::{listens_to, load, load_controller};
pub use outbox::Outbox;
pub use robot_model as model;
pub use robot_model::math;
pub use runtime::{Component, Delivery, Unpacked};
