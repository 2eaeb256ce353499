//! The states of a log: what the controller consumed, fed to controllers that are built otherwise.

use anyhow::Context;
use controller::params::apply_overrides;
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::BasePlace;
use controller::{Controller, Outbox};
use lcmtypes::{ControllerInput, GroundTruth, Message, RobotCommand, RunInfo, channels};
use replay::log::LogReader;
use std::path::Path;

/// Inputs of a run in the order of its ticks, and where the base truly was.
pub struct States {
    info: RunInfo,
    /// One a tick.
    pub ticks: Vec<(ControllerInput, BasePlace)>,
}

impl States {
    /// Reads a log of the simulator.
    ///
    /// # Errors
    /// A log that cannot be read, or without RUN_INFO, CONTROLLER_INPUT or GROUND_TRUTH.
    pub fn read(log: &Path) -> anyhow::Result<Self> {
        let (mut info, mut ticks, mut place) = (None, Vec::new(), None);
        for event in LogReader::open(log)?.events() {
            let event = event?;
            match &*event.channel {
                channels::RUN_INFO => info = Some(RunInfo::decode(&event.data)?),
                channels::GROUND_TRUTH => {
                    let GroundTruth { p_WB, v_WB, .. } = GroundTruth::decode(&event.data)?;
                    place = Some(BasePlace { p_WB: p_WB.into(), v_WB: v_WB.into() });
                }
                channels::CONTROLLER_INPUT => {
                    let place =
                        place.with_context(|| format!("{}: an input before any ground truth", log.display()))?;
                    ticks.push((ControllerInput::decode(&event.data)?, place));
                }
                _ => {}
            }
        }
        let info = info.with_context(|| format!("{}: no RUN_INFO", log.display()))?;
        anyhow::ensure!(!ticks.is_empty(), "{}: no CONTROLLER_INPUT", log.display());
        Ok(States { info, ticks })
    }

    /// The run's controller with other values of some parameters.
    pub fn controller(&self, set: &[(&str, &str)]) -> anyhow::Result<Quadruped> {
        let set: Vec<_> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        Ok(Quadruped::new(&self.info.urdf, &apply_overrides(&self.info.params, &set)?)?)
    }
}

/// A controller that is led through the states, and what it commands.
pub struct Led {
    /// The controller.
    pub controller: Quadruped,
    out: Outbox,
    command: RobotCommand,
}

impl Led {
    pub fn new(controller: Quadruped) -> Self {
        Led { controller, out: Outbox::new(), command: RobotCommand::default() }
    }

    /// Torques of a tick, N m; none unless it balances.
    pub fn torques(&mut self, input: &ControllerInput) -> anyhow::Result<Option<&[f64]>> {
        self.controller.step(input, &mut self.out);
        let bytes = self.out.get(channels::ROBOT_COMMAND).context("a tick without ROBOT_COMMAND")?;
        self.command = RobotCommand::decode(bytes)?;
        Ok((self.command.mode == RobotCommand::MODE_TORQUE).then_some(&self.command.tau))
    }
}
