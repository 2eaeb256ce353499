//! Replay: the recorded inputs go through the controller that the log describes, and every bit that comes out is compared.
//!
//! A log holds what the controller consumed in each tick (CONTROLLER_INPUT), what it put out, one digest per stage of the tick, and
//! about once a second its whole state. So a replay needs nothing else, can start anywhere, and names the first stage and field in
//! which it departs from the record. There is no tolerance.
//!
//! - What *differs* is kept apart from what is *absent*: a channel that is not in the log is counted, not judged.
//! - After a gap in the inputs the state is unknown; the replay goes on from the next recorded state.
//! - At each recorded state the comparison starts afresh, so a log gives the same report whether it is replayed in one go or in
//!   stretches by several threads. With other parameters ([`Options::set`]) or a log to write ([`Options::out`]) the state is carried
//!   through instead.
//!
//! Nothing here knows a controller: it is built by [`controller::load`] from the RUN_INFO of the log.

mod compare;
mod report;
mod runner;
mod ticks;

pub(crate) use compare::show;
pub use compare::{Divergence, Index};
pub use report::ReplayReport;

use crate::Error;
use crate::log::{LogReader, LogWriter};
use controller::{Controller, LoadError, RestoreError};
use lcmtypes::{Message, RunInfo, TextFile, channels};
use report::Tally;
use runner::Runner;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Instant;
use ticks::{Tick, Ticks};

/// Ticks that wait for a thread: two stretches from one snapshot to the next, as they usually are.
const QUEUE: usize = 2048;

/// How a log is to be replayed.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Parameters to change, as dotted key and TOML value: what would the controller have done on the same inputs?
    pub set: Vec<(String, String)>,
    /// Begin at the last snapshot at or before this time, s since the first tick of the log.
    pub from_s: Option<f64>,
    /// End behind the last tick at or before this time, s since the first tick of the log.
    pub to_s: Option<f64>,
    /// Threads; 0 and 1 mean the calling one. More do not change the report. With `set` or `out` there is only one.
    pub jobs: usize,
    /// Write a log like the replayed one with the outputs of the replay in the place of the recorded ones.
    pub out: Option<PathBuf>,
}

/// Builds a controller from a run's description.
pub type Load<'a> = dyn Fn(&RunInfo) -> Result<Box<dyn Controller>, LoadError> + 'a;

/// A log that can be replayed.
pub struct Replay<'a> {
    path: PathBuf,
    info: RunInfo,
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
        load: impl Fn(&RunInfo) -> Result<Box<dyn Controller>, LoadError> + 'a,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let info = run_info(path)?;
        Ok(Replay { path: path.into(), info, load: Box::new(load) })
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
    /// - [`Error::Io`], [`Error::SameFile`] and what [`LogWriter`] says of [`Options::out`].
    pub fn run(&self, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<ReplayReport, Error> {
        let begin = Instant::now();
        let info = self.with_overrides(&options.set)?;
        // A log that is written must be one run from its beginning to its end.
        let own_state = !options.set.is_empty() || options.out.is_some();
        let mut out = match &options.out {
            Some(path) => {
                Error::unless_apart(&self.path, path)?;
                Some(Out::create(path, &info)?)
            }
            None => None,
        };
        let mut stretch = Stretch::find(&self.path, options)?;
        let mut ticks = Ticks::open(&self.path, out.is_some())?;
        let mut feed = Feed { ticks: &mut ticks, stretch: &mut stretch, progress, bytes: file_length(&self.path)? };
        let alone = own_state || options.jobs < 2;
        let tally = if alone {
            let mut runner = Runner::new(self.controller(&info)?, own_state);
            self.run_alone(&mut feed, &mut runner, out.as_mut())?;
            runner.tally
        } else {
            self.run_shared(&mut feed, &info, options.jobs)?
        };
        if let Some(mut out) = out {
            out.rest(ticks.rest())?;
            out.log.finish()?;
        }
        if stretch.first_t_ns.is_none() {
            return Err(Error::NoInput { path: self.path.clone() });
        }
        Ok(tally.report(ticks.late, ticks.health(), begin.elapsed().as_secs_f64()))
    }

    fn run_alone(&self, feed: &mut Feed, runner: &mut Runner, mut out: Option<&mut Out>) -> Result<(), Error> {
        while let Some(part) = feed.next()? {
            match part {
                Part::Start(tick, snapshot) => {
                    runner.restore(tick, &snapshot).map_err(|source| self.restore_error(tick, source))?;
                }
                Part::Tick(mut tick) => {
                    let outbox = runner.tick(&tick).map_err(|source| self.restore_error(tick.tick, source))?;
                    if let Some(out) = &mut out {
                        out.tick(&mut tick, outbox)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Deals the stretches between snapshots to threads, in turn.
    fn run_shared(&self, feed: &mut Feed, info: &RunInfo, jobs: usize) -> Result<Tally, Error> {
        let controllers = (0..jobs).map(|_| self.controller(info)).collect::<Result<Vec<_>, _>>()?;
        std::thread::scope(|scope| {
            let (queues, threads): (Vec<SyncSender<Part>>, Vec<_>) = controllers
                .into_iter()
                .map(|controller| {
                    let (queue, parts) = sync_channel(QUEUE);
                    (queue, scope.spawn(move || work(Runner::new(controller, false), &parts)))
                })
                .unzip();
            let dealt = deal(feed, &queues);
            drop(queues);
            let mut tally = Tally::default();
            for thread in threads {
                let done = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                tally.add(done.map_err(|(tick, source)| self.restore_error(tick, source))?);
            }
            dealt.map(|()| tally)
        })
    }

    fn controller(&self, info: &RunInfo) -> Result<Box<dyn Controller>, Error> {
        (self.load)(info).map_err(|source| Error::Load { path: self.path.clone(), source: source.into() })
    }

    fn with_overrides(&self, set: &[(String, String)]) -> Result<RunInfo, Error> {
        let mut info = self.info.clone();
        if !set.is_empty() {
            info.params = controller::params::apply_overrides(&info.params, set)
                .map_err(|source| Error::Load { path: self.path.clone(), source: Box::new(source.into()) })?;
        }
        Ok(info)
    }

    fn restore_error(&self, tick: i64, source: RestoreError) -> Error {
        Error::Restore { path: self.path.clone(), tick, source: source.into() }
    }
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

/// The part of a log that is to be replayed.
struct Stretch {
    /// Tick whose snapshot the replay starts from.
    start: Option<i64>,
    to_ns: Option<i64>,
    first_t_ns: Option<i64>,
}

impl Stretch {
    /// With [`Options::from_s`] the log is read once more, up to there.
    fn find(path: &Path, options: &Options) -> Result<Self, Error> {
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        let mut stretch = Stretch { start: None, to_ns: options.to_s.map(nanoseconds), first_t_ns: None };
        let Some(from_ns) = options.from_s.map(nanoseconds) else { return Ok(stretch) };
        let mut ticks = Ticks::open(path, false)?;
        let mut first = None;
        while let Some(tick) = ticks.next()? {
            let Some(t_ns) = tick.input.as_ref().map(|input| input.t_ns) else { continue };
            if t_ns.saturating_sub(*first.get_or_insert(t_ns)) > from_ns {
                break;
            }
            if tick.snapshot().is_some() {
                stretch.start = Some(tick.tick);
            }
        }
        Ok(stretch)
    }
}

/// What a runner is given.
enum Part {
    /// Take over the state that was recorded after a tick.
    Start(i64, Vec<u8>),
    Tick(Box<Tick>),
}

/// The parts of the stretch that is to be replayed.
struct Feed<'f> {
    ticks: &'f mut Ticks,
    stretch: &'f mut Stretch,
    progress: &'f mut dyn FnMut(f64),
    bytes: u64,
}

impl Feed<'_> {
    fn next(&mut self) -> Result<Option<Part>, Error> {
        while let Some(tick) = self.ticks.next()? {
            let t_ns = tick.input.as_ref().map(|input| input.t_ns);
            self.stretch.first_t_ns = self.stretch.first_t_ns.or(t_ns);
            let since = t_ns.zip(self.stretch.first_t_ns).map(|(t, first)| t.saturating_sub(first));
            if since.zip(self.stretch.to_ns).is_some_and(|(since, to)| since > to) {
                return Ok(None);
            }
            if tick.tick % 1024 == 0 {
                (self.progress)(self.ticks.offset as f64 / self.bytes.max(1) as f64);
            }
            match self.stretch.start {
                Some(start) if tick.tick < start => {}
                Some(start) if tick.tick == start => {
                    return Ok(tick.snapshot().map(|snapshot| Part::Start(start, snapshot.to_vec())));
                }
                _ => return Ok(Some(Part::Tick(Box::new(tick)))),
            }
        }
        (self.progress)(1.0);
        Ok(None)
    }
}

/// Hands each stretch from one snapshot to the next to another queue. Ends early when a thread has given up.
fn deal(feed: &mut Feed, queues: &[SyncSender<Part>]) -> Result<(), Error> {
    let mut turn = queues.iter().cycle();
    let Some(mut queue) = turn.next() else { return Ok(()) };
    while let Some(part) = feed.next()? {
        let snapshot = match &part {
            Part::Tick(tick) => tick.snapshot().map(|snapshot| (tick.tick, snapshot.to_vec())),
            Part::Start(..) => None,
        };
        if queue.send(part).is_err() {
            break;
        }
        if let (Some((tick, snapshot)), Some(next)) = (snapshot, turn.next()) {
            queue = next;
            if queue.send(Part::Start(tick, snapshot)).is_err() {
                break;
            }
        }
    }
    Ok(())
}

fn work(mut runner: Runner, parts: &Receiver<Part>) -> Result<Tally, (i64, RestoreError)> {
    for part in parts {
        match part {
            Part::Start(tick, snapshot) => runner.restore(tick, &snapshot).map_err(|source| (tick, source))?,
            Part::Tick(tick) => drop(runner.tick(&tick).map_err(|source| (tick.tick, source))?),
        }
    }
    Ok(runner.tally)
}

/// The log of a replay: what the replayed log holds, with the outputs of the replay.
struct Out {
    log: LogWriter,
    info: Vec<u8>,
    bytes: Vec<u8>,
}

impl Out {
    fn create(path: &Path, info: &RunInfo) -> Result<Self, Error> {
        // The outputs are of today's types, and so are the texts that explain them.
        let text_file = |(name, text): &(&str, &str)| TextFile { name: (*name).into(), text: (*text).into() };
        let lcm_types: Vec<_> = lcmtypes::SOURCES.iter().map(text_file).collect();
        let info = RunInfo { num_lcm_types: lcm_types.len() as i32, lcm_types, ..info.clone() };
        let mut bytes = Vec::new();
        encode(path, &info, &mut bytes)?;
        Ok(Out { log: LogWriter::create(path)?, info: bytes, bytes: Vec::new() })
    }

    fn tick(&mut self, tick: &mut Tick, outbox: Option<&controller::Outbox>) -> Result<(), Error> {
        self.rest(std::mem::take(&mut tick.others))?;
        if let Some(input) = &tick.input {
            self.bytes.clear();
            encode(Path::new(channels::CONTROLLER_INPUT), input, &mut self.bytes)?;
            self.log.write(channels::CONTROLLER_INPUT, tick.t_log_ns, &self.bytes)?;
        }
        for (channel, bytes) in outbox.iter().flat_map(|outbox| outbox.iter()) {
            self.log.write(channel, tick.t_log_ns, bytes)?;
        }
        Ok(())
    }

    fn rest(&mut self, events: Vec<crate::log::Event>) -> Result<(), Error> {
        for event in events {
            let is_info = *event.channel == *channels::RUN_INFO;
            self.log.write(&event.channel, event.t_ns, if is_info { &self.info } else { &event.data })?;
        }
        Ok(())
    }
}

fn encode(path: &Path, message: &impl Message, out: &mut Vec<u8>) -> Result<(), Error> {
    message.encode(out).map_err(|source| Error::Encode { path: path.into(), source: source.into() })
}
