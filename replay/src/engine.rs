//! Replay: runs the controller that a log describes on the recorded inputs, and compares every output bit.
//!
//! A log contains the input that the controller consumed in each tick (CONTROLLER_INPUT), its outputs, one digest per stage of the tick,
//! and about once per second its whole state. A replay therefore needs only the log, can start at any snapshot, and reports the first
//! stage and field that differ. There is no tolerance.
//!
//! - *Different* and *absent* are separate: a channel that is not in the log is counted, not compared.
//! - After a gap in the inputs the state is unknown; the replay continues from the next snapshot.
//! - The replay restores every snapshot that differs, so a log gives the same report whether it is replayed in one thread or in segments by
//!   several. With changes ([`Options::set`], ...) or a log to write ([`Options::out`]) the replayed state is kept instead.
//! - PARAMETER_CHANGE in the log applies in the same tick; a parameter that is overridden keeps its override.
//! - A [`Cursor`] goes to any tick and returns all its quantities.
//!
//! A run can have several components. Each is replayed on its own: the messages of the others that it consumed are in its inputs. `RunMessages` shows the
//! log as one component sees it, with plain channel names.
//!
//! The engine knows no specific controller: [`controller::load`] builds it from the RUN_INFO of the log.

mod account;
mod builder;
mod compare;
mod components;
mod continuity;
mod cursor;
mod expected;
mod inputs;
mod judgement;
mod options;
mod origin;
mod out;
mod outputs;
mod parallel;
mod parameter_changes;
mod published;
mod release_rule;
mod release_violation;
mod report;
mod run_messages;
mod seek;
mod segment;
mod state_types;
mod stepper;
pub(crate) mod ticks;
mod what_if;

pub use account::{Account, OtherType, RejectedChange, Unused, UnusedMessage};
pub(crate) use compare::show;
pub use compare::{Divergence, FieldDifference, Index};
pub use continuity::OtherParameters;
pub use cursor::{Cursor, Moment};
pub use inputs::{brief, lines, of_bytes};
pub(crate) use judgement::Judgement;
pub use options::{Load, Options};
pub use origin::{Build, Deviation};
pub use outputs::MissingOutputs;
pub use release_violation::{ReleaseFault, ReleaseViolation, ReleaseViolations};
pub use report::{ComponentReport, ReplayReport};
pub(crate) use run_messages::RunMessages;
pub use what_if::{DEFAULT_BOUND, Departure, Sample, TimedOverride, WhatIf, When};

use crate::Error;
use crate::log::{LogReader, RunClock};
use builder::Builder;
use controller::{Component, LoadError};
use lcmtypes::{ComponentInfo, EXTERNAL, Message, RunInfo, channels};
use out::Out;
use segment::{Segment, Source, Step};
use std::path::{Path, PathBuf};
use std::time::Instant;
use stepper::Stepper;
use ticks::{Beside, Ticks};
use what_if::Collector;

/// Largest number of components of a run; each takes a pass through the log.
const MAX_COMPONENTS: usize = 64;

/// A log that can be replayed.
pub struct Replay<'a> {
    path: PathBuf,
    /// The run as its component sees it: [`RunInfo::of_component`].
    info: RunInfo,
    /// RUN_INFO of the log.
    recorded: RunInfo,
    /// Component; `None`: all of them, and the first one where only one is possible.
    component: Option<usize>,
    clock: RunClock,
    messages: RunMessages,
    load: Box<Load<'a>>,
}

impl<'a> Replay<'a> {
    /// Opens a log and reads its RUN_INFO and [`RunClock`].
    ///
    /// # Errors
    /// As [`LogReader::open`]; [`Error::NoRunInfo`]; [`Error::Load`] for a run with more than 64 components; [`Error::OtherTypeVersion`] if the type of RUN_INFO differs from this build's.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::open_with(path, controller::load)
    }

    /// [`Replay::open`] with another function that builds the controller.
    ///
    /// # Errors
    /// As [`Replay::open`].
    pub fn open_with(
        path: impl AsRef<Path>,
        load: impl Fn(&RunInfo) -> Result<Component, LoadError> + Sync + 'a,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let (info, clock) = (run_info(path)?, RunClock::read(path)?);
        if let Some(ComponentInfo { name, .. }) = info.components.get(MAX_COMPONENTS) {
            let what = format!("the run has {} components, expected at most {MAX_COMPONENTS}", info.components.len());
            let source = Box::new(LoadError::Component { component: name.clone(), what });
            return Err(Error::Load { path: path.into(), source });
        }
        let messages = RunMessages::of(&info).with_snapshots_like(first_snapshot(&load, &info).as_deref());
        let (path, recorded) = (path.to_owned(), info.clone());
        Ok(Replay { path, info, recorded, component: None, clock, messages, load: Box::new(load) })
    }

    /// The replay of one component alone.
    ///
    /// # Errors
    /// [`Error::NoComponent`]; [`Error::ExternalComponent`].
    pub fn of_component(self, name: &str) -> Result<Self, Error> {
        let Some(index) = self.recorded.find_component(name) else {
            let known = self.recorded.components.into_iter().map(|component| component.name).collect();
            return Err(Error::NoComponent { path: self.path, name: name.to_owned(), known });
        };
        if self.recorded.components[index].kind == EXTERNAL {
            return Err(Error::ExternalComponent { path: self.path, name: name.to_owned() });
        }
        let info = self.recorded.of_component(index);
        let messages = RunMessages::of_component(&self.recorded, index);
        let messages = messages.with_snapshots_like(first_snapshot(&*self.load, &info).as_deref());
        Ok(Replay { info, messages, component: Some(index), ..self })
    }

    /// The replay of a component of the same log.
    fn view(&self, index: usize) -> Replay<'_> {
        let load = &*self.load;
        let info = self.recorded.of_component(index);
        let snapshot = first_snapshot(load, &info);
        Replay {
            path: self.path.clone(),
            info,
            recorded: self.recorded.clone(),
            component: Some(index),
            clock: self.clock,
            messages: RunMessages::of_component(&self.recorded, index).with_snapshots_like(snapshot.as_deref()),
            load: Box::new(load),
        }
    }

    /// Converts times of the log to times since the run's first tick.
    pub fn clock(&self) -> &RunClock {
        &self.clock
    }

    /// RUN_INFO of the log as the component sees it: [`RunInfo::of_component`].
    pub fn info(&self) -> &RunInfo {
        &self.info
    }

    /// The components of the run.
    pub fn components(&self) -> &[ComponentInfo] {
        &self.recorded.components
    }

    /// Whether [`Replay::run`] with these options replays one component of several: a selected one, or the first one for a what-if replay or a copy of
    /// the log.
    pub fn is_in_part(&self, options: &Options) -> bool {
        let is_one = self.component.is_some() || options.is_what_if() || options.out.is_some();
        is_one && self.recorded.components.len() > 1
    }

    /// Replays the log: all components, apart from [`Replay::is_in_part`]. `progress` receives the fraction that was done, 0 to 1.
    ///
    /// # Errors
    /// - [`Error::Load`]: the controller cannot be built, or a parameter of [`Options::set`] does not exist.
    /// - [`Error::OtherTypeVersion`]: the type of a consumed or compared message differs from this build's.
    /// - [`Error::NoInput`], [`Error::SeveralRuns`], [`Error::Decode`], [`Error::Restore`]: the log does not contain exactly one run.
    /// - [`Error::Io`], [`Error::SameFile`] and the errors of [`crate::log::LogWriter`] for [`Options::out`].
    /// - [`Error::Component`] with one of these for a component that is not the first one.
    pub fn run(&self, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<ReplayReport, Error> {
        if self.recorded.components.len() > 1 && !self.is_in_part(options) {
            return components::run(self, options, progress);
        }
        Ok(self.run_one(options, progress)?.0)
    }

    /// Replays one component. Returns the report, and the last tick that was read.
    fn run_one(&self, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<(ReplayReport, i64), Error> {
        let begin = Instant::now();
        let builder = self.builder(options)?;
        let what_if = options.is_what_if();
        if !options.timed_overrides.is_empty() && options.out.is_some() {
            return Err(Error::ParameterChangesInLog);
        }
        // A written log must be one continuous run.
        let keep_state = what_if || options.out.is_some();
        let mut out = match &options.out {
            Some(path) => {
                Error::check_distinct_files(&self.path, path)?;
                Some(Out::create(path, &self.merged(&builder.info), &self.messages, &builder.overridden)?)
            }
            None => None,
        };
        let mut segment = Segment::find(&self.path, &self.messages, self.clock, options)?;
        let beside = if out.is_some() { Beside::InPlace } else { Beside::Nothing };
        // A written log has everything that is before the part too.
        let chunk = segment.chunk.filter(|_| out.is_none());
        let mut ticks = Ticks::open_at(&self.path, &self.messages, beside, chunk)?;
        let bytes = file_length(&self.path)?;
        let source = Source { ticks: &mut ticks, segment: &mut segment, bytes, changes: Vec::new() };
        let (counts, found) = if keep_state {
            let collector = what_if.then(|| Collector::new(options.bound.unwrap_or(DEFAULT_BOUND)));
            let overrides = builder.timed_overrides(&options.timed_overrides)?;
            let mut stepper = Stepper::new(&builder, true)?.with_overrides(overrides).with_collector(collector);
            run_serial(source, &mut stepper, out.as_mut(), progress)?;
            let not_reached = stepper.pending_overrides() as u64;
            (stepper.counts, stepper.what_if.map(|collector| collector.finish(not_reached)))
        } else {
            let steppers =
                (0..options.jobs.max(1)).map(|_| Stepper::new(&builder, false)).collect::<Result<_, Error>>()?;
            (parallel::run(source, steppers, progress)?, None)
        };
        if let Some(mut out) = out {
            out.rest(ticks.rest())?;
            out.finish()?;
        }
        let account = ticks.account()?;
        let Some(last_tick) = segment.last_tick else {
            return Err(Error::NoInput { path: self.path.clone() });
        };
        let mut report =
            counts.report(self.info.component().to_owned(), account, ticks.health(), begin.elapsed().as_secs_f64());
        report.deviations = origin::deviations(&self.info, &builder.info, options.here.as_ref());
        report.what_if = found;
        report.qualify(&self.messages);
        Ok((report, last_tick))
    }

    /// RUN_INFO of the log with the changed description of the component.
    fn merged(&self, changed: &RunInfo) -> RunInfo {
        let Some(index) = self.component.filter(|index| *index > 0) else { return changed.clone() };
        let mut info = RunInfo { components: self.recorded.components.clone(), ..changed.clone() };
        info.n_components = self.recorded.n_components;
        info.components[index].clone_from(&changed.components[0]);
        info
    }

    /// Builds controllers with all overrides that hold from the start.
    ///
    /// # Errors
    /// [`Error::Load`]: unknown parameter or invalid value.
    fn builder<'b>(&'b self, options: &Options) -> Result<Builder<'b>, Error> {
        Ok(Builder::new(&self.path, &*self.load, self.changed(options)?, options))
    }

    /// RUN_INFO with all overrides that hold from the start.
    fn changed(&self, options: &Options) -> Result<RunInfo, Error> {
        let mut info = self.with_params(&self.info, &options.set)?;
        if let Some(urdf) = &options.urdf {
            info.urdf.clone_from(urdf);
        }
        Ok(info)
    }

    fn with_params(&self, info: &RunInfo, set: &[(String, String)]) -> Result<RunInfo, Error> {
        let mut info = info.clone();
        if !set.is_empty() {
            let params = controller::params::apply_overrides(info.params(), set)
                .map_err(|source| Error::Load { path: self.path.clone(), source: Box::new(source.into()) })?;
            info = info.with_params(params);
        }
        Ok(info)
    }
}

/// The state of a component before its first tick, for its types; `None` if it cannot be built: the replay says why.
fn first_snapshot(load: &dyn Fn(&RunInfo) -> Result<Component, LoadError>, info: &RunInfo) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    load(info).ok()?.snapshot(&mut bytes);
    Some(bytes)
}

/// Runs a stepper through all steps in the calling thread.
fn run_serial(
    mut source: Source,
    stepper: &mut Stepper,
    mut out: Option<&mut Out>,
    progress: &mut dyn FnMut(f64),
) -> Result<(), Error> {
    while let Some(step) = source.next()? {
        match step {
            Step::Restore(tick, snapshot, changes) => stepper.start(tick, &snapshot, &changes)?,
            Step::Tick(mut tick) => {
                if tick.tick % 1024 == 0 {
                    progress(source.fraction_read());
                }
                let outbox = stepper.tick(&tick)?;
                if let Some(out) = &mut out {
                    out.tick(&mut tick, outbox)?;
                }
            }
        }
    }
    Ok(())
}

/// Reads the first RUN_INFO of a log that decodes; another program may have sent messages on this channel.
pub(crate) fn run_info(path: &Path) -> Result<RunInfo, Error> {
    let known = channels::find(channels::RUN_INFO).expect("the channel table contains RUN_INFO");
    let (mut count, mut rejected) = (0_u64, None);
    for event in LogReader::open(path)?.events() {
        let event = event?;
        if *event.channel == *known.name {
            let decoded = ticks::same_version(path, &event, known).and_then(|()| {
                RunInfo::decode(&event.data).map_err(|source| Error::Decode {
                    path: path.into(),
                    channel: known.name.into(),
                    offset: event.offset,
                    source: source.into(),
                })
            });
            match decoded {
                Ok(info) => return Ok(info),
                Err(error) => rejected = rejected.or(Some(error)),
            }
        }
        count += 1;
    }
    Err(rejected.unwrap_or_else(|| Error::NoRunInfo { path: path.into(), events: count }))
}

fn file_length(path: &Path) -> Result<u64, Error> {
    let (path, _) = crate::log::split_run(path);
    std::fs::metadata(&path).map(|m| m.len()).map_err(|source| Error::Io { path, source })
}
