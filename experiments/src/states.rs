//! Feeds the logged inputs of a run to controllers with other parameters.

use anyhow::Context;
use controller::params::apply_overrides;
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::AssumedBase;
use controller::{Controller, Outbox, Unpacked};
use lcmtypes::{ControllerInput, GroundTruth, Message, RobotCommand, RunInfo, TickInput, channels};
use replay::log::LogReader;
use std::path::Path;

/// The controller inputs of a run, each with the true position and velocity of the base.
pub struct States {
    info: RunInfo,
    /// One entry per tick, in order.
    pub ticks: Vec<(TickInput, AssumedBase)>,
}

impl States {
    /// Reads a log of the simulator.
    ///
    /// # Errors
    /// A log that cannot be read, or that has no RUN_INFO, no CONTROLLER_INPUT, or no GROUND_TRUTH before its first input.
    pub fn read(log: &Path) -> anyhow::Result<Self> {
        let (mut info, mut ticks, mut place) = (None, Vec::new(), None);
        let mut unpacked = Unpacked::default();
        for event in LogReader::open(log)?.events() {
            let event = event?;
            match &*event.channel {
                channels::RUN_INFO => info = Some(RunInfo::decode(&event.data)?),
                channels::GROUND_TRUTH => {
                    let GroundTruth { p_WB, v_WB, .. } = GroundTruth::decode(&event.data)?;
                    place = Some(AssumedBase { p_WB: p_WB.into(), v_WB: v_WB.into() });
                }
                channels::CONTROLLER_SNAPSHOT => unpacked.restore(&event.data),
                channels::CONTROLLER_INPUT => {
                    let place = place.with_context(|| {
                        format!("{}: CONTROLLER_INPUT before the first GROUND_TRUTH", log.display())
                    })?;
                    ticks.push((unpacked.update(&ControllerInput::decode(&event.data)?).clone(), place));
                }
                _ => {}
            }
        }
        let info = info.with_context(|| format!("{}: no RUN_INFO", log.display()))?;
        anyhow::ensure!(!ticks.is_empty(), "{}: no CONTROLLER_INPUT", log.display());
        Ok(States { info, ticks })
    }

    /// Builds the run's controller with some parameters changed.
    ///
    /// # Errors
    /// An unknown key or an invalid value.
    pub fn controller(&self, set: &[(&str, &str)]) -> anyhow::Result<Quadruped> {
        let set: Vec<_> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        Ok(Quadruped::new(&self.info.urdf, &apply_overrides(self.info.params(), &set)?)?)
    }
}

/// A controller that is stepped through logged inputs, and its last command.
pub struct OpenLoop {
    /// The controller.
    pub controller: Quadruped,
    out: Outbox,
    command: RobotCommand,
}

impl OpenLoop {
    /// Starts with a controller that has made no tick.
    pub fn new(controller: Quadruped) -> Self {
        OpenLoop { controller, out: Outbox::new(), command: RobotCommand::default() }
    }

    /// Steps one tick and returns its joint torques, N m, URDF order; `None` if the command is not in torque mode.
    ///
    /// # Errors
    /// A tick without ROBOT_COMMAND.
    pub fn torques(&mut self, input: &TickInput) -> anyhow::Result<Option<&[f64]>> {
        self.controller.step(input, &mut self.out);
        let bytes = self.out.get(channels::ROBOT_COMMAND).context("a tick without ROBOT_COMMAND")?;
        self.command = RobotCommand::decode(bytes)?;
        Ok((self.command.mode == RobotCommand::MODE_TORQUE).then_some(&self.command.tau))
    }
}
