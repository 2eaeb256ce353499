//! Replay: the recorded inputs go through the controller that the log describes, and every bit that comes out is compared.
//!
//! A log holds what the controller consumed in each tick (CONTROLLER_INPUT), what it put out, one digest per stage of the tick, and
//! about once a second its whole state. So a replay needs nothing else, can start anywhere, and names the first stage and field in
//! which it departs from the record. There is no tolerance.
//!
//! - What *differs* is kept apart from what is *absent*: a channel that is not in the log is counted, not judged.
//! - After a gap in the inputs the state is unknown; the replay goes on from the next recorded state.
//! - At each recorded state the comparison starts afresh, so a log gives the same report whether it is replayed in one go or in
//!   stretches by several threads. With changes ([`Options::set`] and its kin) or a log to write ([`Options::out`]) the state is carried
//!   through instead.
//! - Parameters that changed on the way (PARAMETER_CHANGE) change in the replay too, in the same tick; those that are asked to be other stay so.
//! - A [`Cursor`] goes to any tick and shows everything in it.
//!
//! Nothing here knows a controller: it is built by [`controller::load`] from the RUN_INFO of the log.

mod builder;
mod compare;
mod cursor;
mod inputs;
mod origin;
mod out;
mod report;
mod runner;
mod shared;
mod stretch;
pub(crate) mod ticks;
mod what_if;

pub(crate) use compare::show;
pub use compare::{Divergence, FieldDifference, Index};
pub use cursor::{Cursor, Moment};
pub use inputs::{brief, lines, of_bytes};
pub use origin::{Build, Deviation};
pub use report::ReplayReport;
pub use what_if::{Change, DEFAULT_BOUND, Departure, Sample, WhatIf, When};

use crate::Error;
use crate::log::{LogReader, RunClock};
use builder::Builder;
use controller::{Controller, LoadError};
use lcmtypes::{Message, RunInfo, channels};
use out::Out;
use report::Tally;
use runner::Runner;
use std::path::{Path, PathBuf};
use std::time::Instant;
use stretch::{Feed, Part, Stretch};
use ticks::{Beside, Ticks};
use what_if::Collector;

/// How a log is to be replayed.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Parameters to change, as dotted key and TOML value: what would the controller have done on the same inputs?
    pub set: Vec<(String, String)>,
    /// Parameters to change on the way.
    pub changes: Vec<Change>,
    /// Text of another URDF; it must have the joints of the log's.
    pub urdf: Option<String>,
    /// Largest difference of a joint's torques up to which the recorded inputs stand for a changed controller, N m.
    pub bound: Option<f64>,
    /// This build, to be held against the one that wrote the log.
    pub here: Option<Build>,
    /// Begin at the last snapshot at or before this time, s since the run's first tick.
    pub from_s: Option<f64>,
    /// End behind the last tick at or before this time, s since the run's first tick.
    pub to_s: Option<f64>,
    /// Threads; 0 and 1 mean the calling one. More do not change the report. With changes or `out` there is only one.
    pub jobs: usize,
    /// Write a log like the replayed one with the outputs of the replay in the place of the recorded ones.
    pub out: Option<PathBuf>,
}

impl Options {
    /// Whether anything is asked to be other than it was.
    fn asks_what_if(&self) -> bool {
        !self.set.is_empty() || !self.changes.is_empty() || self.urdf.is_some()
    }
}

/// Builds a controller from a run's description.
pub type Load<'a> = dyn Fn(&RunInfo) -> Result<Box<dyn Controller>, LoadError> + Sync + 'a;

/// A log that can be replayed.
pub struct Replay<'a> {
    path: PathBuf,
    info: RunInfo,
    clock: RunClock,
    load: Box<Load<'a>>,
}

impl<'a> Replay<'a> {
    /// Opens a log and reads its RUN_INFO.
    ///
    /// # Errors
    /// As [`LogReader::open`]; [`Error::NoRunInfo`]; [`Error::OtherTypeVersion`] if RUN_INFO has changed since.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::open_with(path, controller::load)
    }

    /// [`Replay::open`] with another way to build the controller.
    ///
    /// # Errors
    /// As [`Replay::open`].
    pub fn open_with(
        path: impl AsRef<Path>,
        load: impl Fn(&RunInfo) -> Result<Box<dyn Controller>, LoadError> + Sync + 'a,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let (info, clock) = (run_info(path)?, RunClock::read(path)?);
        Ok(Replay { path: path.into(), info, clock, load: Box::new(load) })
    }

    /// Converts times of the log to times since the run's first tick.
    pub fn clock(&self) -> &RunClock {
        &self.clock
    }

    /// What the log says of its run.
    pub fn info(&self) -> &RunInfo {
        &self.info
    }

    /// Replays the log. `progress` is told now and then which part of the file has been read, 0 to 1.
    ///
    /// # Errors
    /// - [`Error::Load`]: the controller cannot be built, or a parameter of [`Options::set`] does not exist.
    /// - [`Error::OtherTypeVersion`]: a type has changed since the log was written.
    /// - [`Error::NoInput`], [`Error::SeveralRuns`], [`Error::Decode`], [`Error::Restore`]: the log is not that of one run.
    /// - [`Error::Io`], [`Error::SameFile`] and what [`crate::log::LogWriter`] says of [`Options::out`].
    pub fn run(&self, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<ReplayReport, Error> {
        let begin = Instant::now();
        let builder = Builder::new(self, options)?;
        let what_if = options.asks_what_if();
        if !options.changes.is_empty() && options.out.is_some() {
            return Err(Error::ParameterChangesInLog);
        }
        // A log that is written must be one run from its beginning to its end.
        let own_state = what_if || options.out.is_some();
        let mut out = match &options.out {
            Some(path) => {
                Error::check_distinct_files(&self.path, path)?;
                Some(Out::create(path, &builder.info)?)
            }
            None => None,
        };
        let mut stretch = Stretch::find(&self.path, self.clock, options)?;
        let mut ticks = Ticks::open(&self.path, if out.is_some() { Beside::InPlace } else { Beside::Nothing })?;
        let bytes = file_length(&self.path)?;
        let feed = Feed { ticks: &mut ticks, stretch: &mut stretch, bytes, changes: Vec::new() };
        let alone = own_state || options.jobs < 2;
        let (tally, found) = if alone {
            let collector = what_if.then(|| Collector::new(options.bound.unwrap_or(DEFAULT_BOUND)));
            let later = builder.later(&options.changes)?;
            let mut runner = Runner::new(&builder, own_state)?.then(later).collecting(collector);
            run_alone(feed, &mut runner, out.as_mut(), progress)?;
            let not_reached = runner.still_to_come() as u64;
            (runner.tally, runner.what_if.map(|collector| collector.finish(not_reached)))
        } else {
            let runners = (0..options.jobs).map(|_| Runner::new(&builder, false)).collect::<Result<_, Error>>()?;
            (shared::run(feed, runners, progress)?, None)
        };
        if let Some(mut out) = out {
            out.rest(ticks.rest())?;
            out.finish()?;
        }
        if !stretch.has_input {
            return Err(Error::NoInput { path: self.path.clone() });
        }
        let mut report = tally.report(ticks.late, ticks.health(), begin.elapsed().as_secs_f64());
        report.deviations = origin::deviations(&self.info, &builder.info, options.here.as_ref(), &ticks.consumed());
        report.what_if = found;
        Ok(report)
    }

    /// The run's description with all that is to be other from the beginning on.
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
            info.params = controller::params::apply_overrides(&info.params, set)
                .map_err(|source| Error::Load { path: self.path.clone(), source: Box::new(source.into()) })?;
        }
        Ok(info)
    }
}

/// Leads a runner through all parts.
fn run_alone(
    mut feed: Feed,
    runner: &mut Runner,
    mut out: Option<&mut Out>,
    progress: &mut dyn FnMut(f64),
) -> Result<(), Error> {
    while let Some(part) = feed.next()? {
        match part {
            Part::Start(tick, snapshot, changes) => runner.start(tick, &snapshot, &changes)?,
            Part::Tick(mut tick) => {
                if tick.tick % 1024 == 0 {
                    progress(feed.read());
                }
                let outbox = runner.tick(&tick)?;
                if let Some(out) = &mut out {
                    out.tick(&mut tick, outbox)?;
                }
            }
        }
    }
    Ok(())
}

/// Reads on until RUN_INFO is found.
pub(crate) fn run_info(path: &Path) -> Result<RunInfo, Error> {
    let known = channels::find(channels::RUN_INFO).expect("it stands in the table");
    let mut count = 0_u64;
    for event in LogReader::open(path)?.events() {
        let event = event?;
        if *event.channel == *known.name {
            ticks::same_version(path, &event, known)?;
            return RunInfo::decode(&event.data).map_err(|source| Error::Decode {
                path: path.into(),
                channel: known.name.into(),
                offset: event.offset,
                source: source.into(),
            });
        }
        count += 1;
    }
    Err(Error::NoRunInfo { path: path.into(), events: count })
}

fn file_length(path: &Path) -> Result<u64, Error> {
    std::fs::metadata(path).map(|m| m.len()).map_err(|source| Error::Io { path: path.into(), source })
}
