//! Parameters of a simulation.

use crate::drives::DriveParams;
use crate::floor::FloorMove;
use crate::scenario::{Object, Scenario, Weld};
use crate::sensors::NoiseParams;
use crate::start::StartParams;

/// Parameters of a simulation besides robot and ground.
#[derive(Clone, Debug, PartialEq)]
pub struct SimParams {
    /// Friction coefficient of the contacts.
    pub friction: f64,
    /// Physics steps per control tick, at least 1.
    pub physics_steps: u32,
    /// Seed of the sensor noise.
    pub seed: i64,
    /// Sensor noise.
    pub noise: NoiseParams,
    /// Lag and gains of the drives.
    pub drives: DriveParams,
    /// Moving floors.
    pub floors: Vec<FloorMove>,
    /// Objects beside the robot.
    pub objects: Vec<Object>,
    /// Links that hold objects.
    pub welds: Vec<Weld>,
    /// Initial pose of the robot.
    pub start: StartParams,
    /// Base height above the ground below which the robot has fallen, as a fraction of its initial height.
    pub min_height: f64,
    /// Roll or pitch beyond which the robot has fallen, rad.
    pub max_tilt: f64,
}

impl SimParams {
    /// The parameters of a scenario; fall limits have their defaults.
    pub fn of(scenario: &Scenario) -> Self {
        let Scenario { friction, physics_steps, seed, noise, drives, floors, objects, welds, start, .. } = scenario;
        SimParams {
            friction: *friction,
            physics_steps: *physics_steps,
            seed: *seed,
            noise: noise.clone(),
            drives: drives.clone(),
            floors: floors.clone(),
            objects: objects.clone(),
            welds: welds.clone(),
            start: start.clone(),
            ..SimParams::default()
        }
    }
}

impl Default for SimParams {
    fn default() -> Self {
        SimParams {
            friction: 0.8,
            physics_steps: 1,
            seed: 0,
            noise: NoiseParams::default(),
            drives: DriveParams::default(),
            floors: Vec::new(),
            objects: Vec::new(),
            welds: Vec::new(),
            start: StartParams::default(),
            min_height: 0.5,
            max_tilt: 0.6,
        }
    }
}
