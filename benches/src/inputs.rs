//! Controller and inputs of a log.

use anyhow::{Context, Result, bail};
use controller::Unpacked;
use controller::params::apply_overrides;
use controller::quadruped::Quadruped;
use controller::stack;
use lcmtypes::{ControllerInput, Message, RunInfo, TickInput, channels};
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
    /// Name in tables.
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

/// A run, read from its log.
pub struct Run {
    /// Description of the run: robot and parameters.
    pub info: RunInfo,
    /// Inputs of the controller, tick by tick.
    pub inputs: Vec<TickInput>,
}

impl Run {
    /// Reads a log.
    pub fn read(path: &Path) -> Result<Self> {
        let (mut info, mut inputs) = (None, Vec::<ControllerInput>::new());
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
        let Some(info) = info else { bail!("{}: the log has no RUN_INFO", path.display()) };
        if inputs.is_empty() {
            bail!("{}: the log has no CONTROLLER_INPUT", path.display());
        }
        Ok(Run { info, inputs: Unpacked::all(&inputs) })
    }

    /// Builds the controller of the run with this stack of tasks.
    pub fn controller(&self, stack: Stack) -> Result<Quadruped> {
        let formula = [("stack.formula".to_owned(), stack.formula().to_owned())];
        let params = apply_overrides(self.info.params(), &formula)?;
        Ok(Quadruped::new(&self.info.urdf, &params)?)
    }
}
