//! Quadruped locomotion without a planner: trot and crawl over uneven ground, with joint sensors and an IMU only.
//!
//! Source: G. Raiola, E. Mingo Hoffman, M. Focchi, N. Tsagarakis, C. Semini, *A simple yet effective whole-body locomotion framework for
//! quadruped robots*, Frontiers in Robotics and AI, 2020. Comments cite its equations by number and say where the code departs from them.
//!
//! Steps of a tick, in the order of `controller.rs`:
//!
//! | step | module | result |
//! |---|---|---|
//! | check the input | [`checks`] | fault, or none |
//! | choose the mode | [`modes`] | stand, walk, sit, ... |
//! | estimate | [`estimation`], [`terrain`] | base orientation, dynamics, contacts, height, ground |
//! | filter the operator's command | `operator` | velocity, trunk and gait requests |
//! | move the leg state machines | [`recovery`], [`gait`] | lift-offs and touchdowns |
//! | compute references | [`mod@reference`], [`foothold`], [`swing`], [`sway`] | footholds, foot and joint references |
//! | build and solve the quadratic programs | [`tasks`], [`wbc`] | accelerations, contact forces, torques |
//! | write the messages | [`wire`] | command, estimates, status |
//!
//! While the robot stands up or sits down, [`stand_sit`] replaces gait, references and quadratic programs. [`state`] is what one tick hands to
//! the next.

pub mod checks;
mod controller;
mod digests;
mod dump;
pub mod envelope;
pub mod estimation;
mod fields;
pub mod foot_load;
pub mod foothold;
pub mod gait;
pub mod ground;
pub mod leg;
mod leg_postures;
mod leg_reach;
pub mod modes;
mod operator;
pub mod params;
mod plausible;
pub mod recovery;
pub mod reference;
pub mod robot;
pub mod stack_table;
pub mod stand_sit;
pub mod state;
pub mod sway;
pub mod swing;
pub mod tasks;
pub mod terrain;
pub mod timing;
pub mod trunk;
pub mod wbc;
pub mod wire;

pub use controller::{NAME, Quadruped};
pub use plausible::{Implausible, implausible};
