//! Golden logs: runs that today's controller must repeat bit for bit, and the way by which a change of behaviour is accepted.
//!
//! A folder holds the logs, `corpus.toml` that lists them, and a `README.md` made from it. A golden log is trimmed to what a replay
//! needs to start ([`CHANNELS`]) and to judge: the digests of every tick stand for all other outputs.
//!
//! A log of the field becomes a small regression test: [`Part`] cuts out the ticks around an incident, with the recorded state before them.
//!
//! [`check`] replays all of them. When a change of behaviour is meant, [`accept`] replays the inputs of one and writes today's outputs
//! into it; the commit then shows the log, the reason, and the first place where it changed.

use crate::Error;
use crate::engine::ticks::{Beside, Ticks, integer_at};
use crate::engine::{Divergence, Options, Replay};
use crate::log::{Event, LogReader, LogWriter};
use controller::{Controller, LoadError};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, Message, RunInfo};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What every golden log keeps.
pub const CHANNELS: [&str; 5] = [
    channels::RUN_INFO,
    channels::CONTROLLER_INPUT,
    channels::CONTROLLER_TICK,
    channels::CONTROLLER_SNAPSHOT,
    channels::EVENT,
];

const MANIFEST: &str = "corpus.toml";
const README: &str = "README.md";

/// How a golden log fared.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct CorpusResult {
    /// Name in the manifest.
    pub name: String,
    /// Every bit that the log holds came out again.
    pub identical: bool,
    /// Ticks that were computed again.
    pub ticks: u64,
    /// Where replay and record part first.
    pub first_divergence: Option<Divergence>,
    /// Largest distance of two floats anywhere, in floats; of a log that keeps digests alone only the states tell.
    pub largest_ulp: Option<u64>,
    /// The file is not the one that was added or accepted last: its SHA-256 is not that of the manifest.
    pub altered: bool,
    /// Why the log could not be replayed.
    pub error: Option<String>,
}

/// A part of a log, for a small regression test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Middle of what must be in it, s since the first tick of the log.
    pub around_s: f64,
    /// How much of the log must be in it at least, s; it begins behind a recorded state, so it may be more.
    pub span_s: f64,
}

/// What [`accept`] has done.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Accepted {
    /// How the log fared before.
    pub before: CorpusResult,
    /// Length of the file before, bytes.
    pub bytes_before: u64,
    /// Length of the file now, bytes.
    pub bytes: u64,
}

/// The manifest: what is in the folder, and why.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default)]
    log: Vec<Golden>,
}

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Golden {
    name: String,
    file: String,
    bytes: u64,
    /// SHA-256 of the file, hexadecimal.
    #[serde(default)]
    sha256: String,
    /// What the log is for, or why it was recorded anew.
    why: String,
}

/// The golden logs of a folder.
pub struct Corpus<'a> {
    dir: PathBuf,
    manifest: Manifest,
    load: Box<crate::engine::Load<'a>>,
}

/// Replays every golden log of a folder, in the order of its manifest, with `jobs` threads each.
///
/// # Errors
/// [`Error::Manifest`] if there is no usable manifest. A log that cannot be replayed is a result, not an error.
pub fn check(dir: impl AsRef<Path>, jobs: usize) -> Result<Vec<CorpusResult>, Error> {
    Ok(Corpus::open_with(dir, controller::load)?.check(jobs))
}

/// Records a golden log anew: its inputs, today's outputs.
///
/// # Errors
/// [`Error::UnknownGolden`], or what stops the replay. The old log stays then.
pub fn accept(dir: impl AsRef<Path>, name: &str, why: &str) -> Result<Accepted, Error> {
    Corpus::open_with(dir, controller::load)?.accept(name, why)
}

/// Makes a golden log of a run: `name.mcap` in the folder, trimmed to [`CHANNELS`] and `more`, and a line in the manifest.
///
/// # Errors
/// [`Error::Manifest`] if the name is taken, or what stops reading or writing.
pub fn add(dir: impl AsRef<Path>, log: &Path, name: &str, why: &str, more: &[&str]) -> Result<u64, Error> {
    Corpus::open_with(dir, controller::load)?.add(log, name, why, more)
}

/// As [`add`], of a part of the run only.
///
/// # Errors
/// As [`add`]; [`Error::BeyondEnd`] if the log ends before the part.
pub fn add_part(
    dir: impl AsRef<Path>,
    log: &Path,
    part: Part,
    name: &str,
    why: &str,
    more: &[&str],
) -> Result<u64, Error> {
    Corpus::open_with(dir, controller::load)?.add_part(log, Some(part), name, why, more)
}

/// Copies of a log what a golden log keeps: [`CHANNELS`] and `more`. Gives back the number of events.
///
/// # Errors
/// [`Error::SameFile`], or those of [`LogReader`] and [`LogWriter`].
pub fn trim_to_golden(log: &Path, out: &Path, more: &[&str]) -> Result<u64, Error> {
    copy(log, out, |channel| CHANNELS.contains(&channel) || more.contains(&channel))
}

impl<'a> Corpus<'a> {
    /// Reads the manifest of a folder; a folder without one is an empty corpus.
    ///
    /// # Errors
    /// [`Error::Io`] if there is no such folder, [`Error::Manifest`] if its manifest cannot be used.
    pub fn open_with(
        dir: impl AsRef<Path>,
        load: impl Fn(&RunInfo) -> Result<Box<dyn Controller>, LoadError> + 'a,
    ) -> Result<Self, Error> {
        let dir = dir.as_ref();
        std::fs::read_dir(dir).map_err(|source| io(dir, source))?;
        let path = dir.join(MANIFEST);
        let manifest = match std::fs::read_to_string(&path) {
            Ok(text) => toml::from_str(&text).map_err(|error| manifest_error(&path, error.to_string()))?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Manifest::default(),
            Err(source) => return Err(io(&path, source)),
        };
        let corpus = Corpus { dir: dir.into(), manifest, load: Box::new(load) };
        let mut names = BTreeSet::new();
        for golden in &corpus.manifest.log {
            if !names.insert(&golden.name) {
                return Err(manifest_error(&path, format!("two logs named \"{}\"", golden.name)));
            }
        }
        Ok(corpus)
    }

    /// [`check`]
    pub fn check(&self, jobs: usize) -> Vec<CorpusResult> {
        self.manifest.log.iter().map(|golden| self.check_one(golden, jobs)).collect()
    }

    /// [`accept`]
    ///
    /// # Errors
    /// As [`accept`].
    pub fn accept(&mut self, name: &str, why: &str) -> Result<Accepted, Error> {
        let Some(place) = self.manifest.log.iter().position(|golden| golden.name == name) else {
            let known = self.manifest.log.iter().map(|golden| golden.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(Error::UnknownGolden { path: self.dir.join(MANIFEST), name: name.into(), known });
        };
        let before = self.check_one(&self.manifest.log[place], 1);
        let path = self.dir.join(&self.manifest.log[place].file);
        let bytes_before = length(&path)?;
        let steps = ["inputs", "replayed", "accepted"].map(|step| path.with_extension(format!("{step}.mcap")));
        let recorded = self.record(&path, &steps);
        // The last step has become the log, unless something went wrong: then all of them are in the way.
        let leftover = steps.iter().filter(|step| step.exists()).map(std::fs::remove_file).find_map(Result::err);
        recorded?;
        leftover.map_or(Ok(()), |source| Err(io(&self.dir, source)))?;
        let bytes = length(&path)?;
        let golden = &mut self.manifest.log[place];
        (golden.bytes, golden.sha256, golden.why) = (bytes, sha256(&path)?, why.to_owned());
        self.write()?;
        Ok(Accepted { before, bytes_before, bytes })
    }

    /// [`add`]
    ///
    /// # Errors
    /// As [`add`].
    pub fn add(&mut self, log: &Path, name: &str, why: &str, more: &[&str]) -> Result<u64, Error> {
        self.add_part(log, None, name, why, more)
    }

    /// [`add`], or [`add_part`].
    ///
    /// # Errors
    /// As those.
    pub fn add_part(
        &mut self,
        log: &Path,
        part: Option<Part>,
        name: &str,
        why: &str,
        more: &[&str],
    ) -> Result<u64, Error> {
        if self.manifest.log.iter().any(|golden| golden.name == name) {
            return Err(manifest_error(&self.dir.join(MANIFEST), format!("a log named \"{name}\" is there")));
        }
        // It becomes the name of a file in this folder.
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') {
            let why = format!("name \"{name}\": expected letters, digits, _ and -");
            return Err(manifest_error(&self.dir.join(MANIFEST), why));
        }
        let file = format!("{name}.mcap");
        let path = self.dir.join(&file);
        match part {
            None => trim_to_golden(log, &path, more)?,
            Some(part) => copy_part(log, &path, part, more)?,
        };
        let (bytes, sha256) = (length(&path)?, sha256(&path)?);
        self.manifest.log.push(Golden { name: name.into(), file, bytes, sha256, why: why.into() });
        self.manifest.log.sort_by(|a, b| a.name.cmp(&b.name));
        self.write()?;
        Ok(bytes)
    }

    /// Replays the inputs of a log, and puts what comes out in its place.
    fn record(&self, path: &Path, [inputs, replayed, trimmed]: &[PathBuf; 3]) -> Result<(), Error> {
        let kept = copy_inputs(path, inputs)?;
        let options = Options { out: Some(replayed.clone()), ..Options::default() };
        Replay::open_with(inputs, &*self.load)?.run(&options, &mut |_| {})?;
        copy(replayed, trimmed, |channel| CHANNELS.contains(&channel) || kept.contains(channel))?;
        std::fs::rename(trimmed, path).map_err(|source| io(path, source))
    }

    fn check_one(&self, golden: &Golden, jobs: usize) -> CorpusResult {
        let options = Options { jobs, ..Options::default() };
        let path = self.dir.join(&golden.file);
        let altered = !golden.sha256.is_empty() && sha256(&path).is_ok_and(|found| found != golden.sha256);
        let report = Replay::open_with(path, &*self.load).and_then(|replay| replay.run(&options, &mut |_| {}));
        let name = golden.name.clone();
        match report {
            Ok(report) => {
                // A golden log has no holes: one that could be judged in part only has gone bad.
                let whole =
                    report.damaged == 0 && !report.cut && report.skipped_ticks == 0 && report.missing_input_ticks == 0;
                CorpusResult {
                    name,
                    identical: report.identical && whole && !altered,
                    ticks: report.ticks,
                    largest_ulp: report.largest_ulp,
                    altered,
                    error: match whole {
                        false => Some("the log is damaged, cut, or lacks inputs".to_owned()),
                        true if altered && report.identical => Some("not the file that was accepted".to_owned()),
                        true => None,
                    },
                    first_divergence: report.first_divergence,
                }
            }
            Err(error) => CorpusResult {
                name,
                identical: false,
                ticks: 0,
                first_divergence: None,
                largest_ulp: None,
                altered,
                error: Some(error.to_string()),
            },
        }
    }

    /// File of a golden log.
    pub fn file(&self, name: &str) -> Option<PathBuf> {
        self.manifest.log.iter().find(|golden| golden.name == name).map(|golden| self.dir.join(&golden.file))
    }

    /// Replays the inputs of a golden log into a log with all outputs of today's controller.
    ///
    /// # Errors
    /// [`Error::UnknownGolden`], or what stops the replay.
    pub fn today(&self, name: &str, out: &Path) -> Result<(), Error> {
        let unknown =
            || Error::UnknownGolden { path: self.dir.join(MANIFEST), name: name.into(), known: String::new() };
        let path = self.file(name).ok_or_else(unknown)?;
        let inputs = out.with_extension("inputs.mcap");
        copy_inputs(&path, &inputs)?;
        let options = Options { out: Some(out.into()), ..Options::default() };
        let replayed = Replay::open_with(&inputs, &*self.load).and_then(|replay| replay.run(&options, &mut |_| {}));
        std::fs::remove_file(&inputs).map_err(|source| io(&inputs, source))?;
        replayed.map(drop)
    }

    fn write(&self) -> Result<(), Error> {
        let path = self.dir.join(MANIFEST);
        let text = toml::to_string(&self.manifest).map_err(|error| manifest_error(&path, error.to_string()))?;
        std::fs::write(&path, text).map_err(|source| io(&path, source))?;
        let mut readme = String::from(
            "# Golden logs\n\nRuns that the controller must repeat bit for bit: `hoof corpus check`. Made from `corpus.toml`.\n\n\
             | log | kB | why |\n|---|---|---|\n",
        );
        for Golden { name, bytes, why, .. } in &self.manifest.log {
            writeln!(readme, "| {name} | {} | {why} |", bytes.div_ceil(1000)).expect("a string takes everything");
        }
        let path = self.dir.join(README);
        std::fs::write(&path, readme).map_err(|source| io(&path, source))
    }
}

/// Copies the events of some channels.
fn copy(log: &Path, out: &Path, mut keep: impl FnMut(&str) -> bool) -> Result<u64, Error> {
    copy_events(log, out, |event| keep(&event.channel))
}

fn copy_events(log: &Path, out: &Path, mut keep: impl FnMut(&Event) -> bool) -> Result<u64, Error> {
    Error::unless_apart(log, out)?;
    let events = LogReader::open(log)?.events();
    let mut out = LogWriter::create(out)?;
    for event in events {
        let event = event?;
        if keep(&event) {
            out.write(&event.channel, event.t_ns, &event.data)?;
        }
    }
    out.finish()
}

/// Copies the ticks around an incident: RUN_INFO, the recorded state before them, and of every tick what a golden log keeps.
fn copy_part(log: &Path, out: &Path, part: Part, more: &[&str]) -> Result<u64, Error> {
    let (from_s, to_s) = (part.around_s - 0.5 * part.span_s, part.around_s + 0.5 * part.span_s);
    let (mut first_t_ns, mut start, mut last) = (None, None, None);
    let mut ticks = Ticks::open(log, Beside::Nothing)?;
    while let Some(tick) = ticks.next()? {
        let Some(input) = &tick.input else { continue };
        let since_s = input.t_ns.saturating_sub(*first_t_ns.get_or_insert(input.t_ns)) as f64 * 1e-9;
        if since_s > to_s {
            break;
        }
        last = Some((tick.tick, since_s));
        if tick.snapshot().is_some() && since_s < from_s {
            start = Some(tick.tick);
        }
    }
    let Some((last, last_s)) = last else { return Err(Error::NoInput { path: log.into() }) };
    if last_s < part.around_s {
        return Err(Error::BeyondEnd { path: log.into(), from_s: part.around_s, last_s });
    }
    let within = |tick: i64| start.is_none_or(|start| tick > start) && tick <= last;
    copy_events(log, out, |event| {
        let tick = integer_at(&event.data, 16);
        let is_start = *event.channel == *channels::CONTROLLER_SNAPSHOT && start.is_some() && tick == start;
        let kept = CHANNELS.contains(&&*event.channel) || more.contains(&&*event.channel);
        *event.channel == *channels::RUN_INFO || is_start || kept && tick.is_some_and(within)
    })
}

/// Copies what does not come from the controller, so that a changed output type does not stand in the way. A log that begins
/// within a run keeps the states that it can start from. Gives back the channels that the log has.
fn copy_inputs(log: &Path, out: &Path) -> Result<BTreeSet<String>, Error> {
    let mut first_tick = None;
    for event in LogReader::open(log)?.events() {
        let event = event?;
        if *event.channel == *channels::CONTROLLER_INPUT {
            first_tick = ControllerInput::decode(&event.data).ok().map(|input| input.tick);
            break;
        }
    }
    let mut kept = BTreeSet::new();
    copy(log, out, |channel| {
        kept.insert(channel.to_owned());
        match channels::find(channel) {
            Some(known) if known.name == channels::CONTROLLER_SNAPSHOT => first_tick != Some(0),
            Some(known) => known.stage.is_none() || known.class == Class::ReplayInput,
            None => true,
        }
    })?;
    Ok(kept)
}

/// SHA-256 of a file, hexadecimal.
fn sha256(path: &Path) -> Result<String, Error> {
    let bytes = std::fs::read(path).map_err(|source| io(path, source))?;
    Ok(Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect())
}

fn length(path: &Path) -> Result<u64, Error> {
    std::fs::metadata(path).map(|metadata| metadata.len()).map_err(|source| io(path, source))
}

fn io(path: &Path, source: std::io::Error) -> Error {
    Error::Io { path: path.into(), source }
}

fn manifest_error(path: &Path, why: String) -> Error {
    Error::Manifest { path: path.into(), why }
}
