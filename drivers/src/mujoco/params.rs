//! Parameters of a simulation.

use crate::drives::DriveParams;
use crate::floor::FloorMove;
use crate::scenario::Scenario;
use crate::sensors::NoiseParams;
use crate::start::StartParams;

/// Parameters of a simulation besides robot and ground.
#[derive(Clone, Debug, PartialEq)]
pub struct SimParams {
    /// Friction coefficient of the contacts.
    pub friction: f64,
    /// Seed of the sensor noise.
    pub seed: i64,
    /// Sensor noise.
    pub noise: NoiseParams,
    /// Lag and gains of the drives.
    pub drives: DriveParams,
    /// Moving floors.
    pub floors: Vec<FloorMove>,
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
        let Scenario { friction, seed, noise, drives, floors, start, .. } = scenario;
        SimParams {
            friction: *friction,
            seed: *seed,
            noise: noise.clone(),
            drives: drives.clone(),
            floors: floors.clone(),
            start: start.clone(),
            ..SimParams::default()
        }
    }
}

impl Default for SimParams {
    fn default() -> Self {
        SimParams {
            friction: 0.8,
            seed: 0,
            noise: NoiseParams::default(),
            drives: DriveParams::default(),
            floors: Vec::new(),
            start: StartParams::default(),
            min_height: 0.5,
            max_tilt: 0.6,
        }
    }
}
