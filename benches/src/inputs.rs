//! What a log says: how to build its controller, and what to feed it.

use anyhow::{Context, Result, bail};
use controller::params::apply_overrides;
use controller::quadruped::Quadruped;
use controller::stack;
use lcmtypes::{ControllerInput, Message, RunInfo, channels};
use replay::log::LogReader;
use std::path::Path;

/// A stack of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Stack {
    /// One weighted level.
    S1,
    /// Three levels of strict priority.
    S3,
}

impl Stack {
    /// As it stands in tables.
    pub fn name(self) -> &'static str {
        match self {
            Stack::S1 => "S1",
            Stack::S3 => "S3",
        }
    }

    fn formula(self) -> &'static str {
        match self {
            Stack::S1 => stack::S1,
            Stack::S3 => stack::S3,
        }
    }
}

/// A run as its log tells it.
pub struct Run {
    /// Robot and parameters.
    pub info: RunInfo,
    /// What the controller consumed, tick by tick.
    pub inputs: Vec<ControllerInput>,
}

impl Run {
    /// Reads a log.
    pub fn read(path: &Path) -> Result<Self> {
        let (mut info, mut inputs) = (None, Vec::new());
        for event in LogReader::open(path)?.events() {
            let event = event?;
            let what = || format!("{}: {} at byte {}", path.display(), event.channel, event.offset);
            match &*event.channel {
                channels::RUN_INFO => info = Some(RunInfo::decode(&event.data).with_context(what)?),
                channels::CONTROLLER_INPUT => {
                    inputs.push(ControllerInput::decode(&event.data).with_context(what)?);
                }
                _ => {}
            }
        }
        let Some(info) = info else { bail!("{}: no RUN_INFO in it", path.display()) };
        if inputs.is_empty() {
            bail!("{}: no CONTROLLER_INPUT in it", path.display());
        }
        Ok(Run { info, inputs })
    }

    /// The controller of the run, with this stack of tasks.
    pub fn controller(&self, stack: Stack) -> Result<Quadruped> {
        let formula = [("stack.formula".to_owned(), stack.formula().to_owned())];
        let params = apply_overrides(&self.info.params, &formula)?;
        Ok(Quadruped::new(&self.info.urdf, &params)?)
    }
}
