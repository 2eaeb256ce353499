//! Golden logs: runs that today's controller must repeat bit for bit, and the way by which a change of behaviour is accepted.
//!
//! A folder holds the logs, `corpus.toml` that lists them, and a `README.md` made from it. A golden log is trimmed to what a replay
//! needs to start ([`CHANNELS`]) and to judge: the digests of every tick stand for all other outputs.
//!
//! [`check`] replays all of them. When a change of behaviour is meant, [`accept`] replays the inputs of one and writes today's outputs
//! into it; the commit then shows the log, the reason, and the first place where it changed.

use crate::Error;
use crate::engine::{Divergence, Options, Replay};
use crate::log::{LogReader, LogWriter};
use controller::{Controller, LoadError};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, Message, RunInfo};
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
    /// Why the log could not be replayed.
    pub error: Option<String>,
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
        (golden.bytes, golden.why) = (bytes, why.to_owned());
        self.write()?;
        Ok(Accepted { before, bytes_before, bytes })
    }

    /// [`add`]
    ///
    /// # Errors
    /// As [`add`].
    pub fn add(&mut self, log: &Path, name: &str, why: &str, more: &[&str]) -> Result<u64, Error> {
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
        trim_to_golden(log, &path, more)?;
        let bytes = length(&path)?;
        self.manifest.log.push(Golden { name: name.into(), file, bytes, why: why.into() });
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
        let report = Replay::open_with(path, &*self.load).and_then(|replay| replay.run(&options, &mut |_| {}));
        let name = golden.name.clone();
        match report {
            Ok(report) => {
                // A golden log has no holes: one that could be judged in part only has gone bad.
                let whole =
                    report.damaged == 0 && !report.cut && report.skipped_ticks == 0 && report.missing_input_ticks == 0;
                CorpusResult {
                    name,
                    identical: report.identical && whole,
                    ticks: report.ticks,
                    first_divergence: report.first_divergence,
                    error: (!whole).then(|| "the log is damaged, cut, or lacks inputs".to_owned()),
                }
            }
            Err(error) => CorpusResult {
                name,
                identical: false,
                ticks: 0,
                first_divergence: None,
                error: Some(error.to_string()),
            },
        }
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
    Error::unless_apart(log, out)?;
    let events = LogReader::open(log)?.events();
    let mut out = LogWriter::create(out)?;
    for event in events {
        let event = event?;
        if keep(&event.channel) {
            out.write(&event.channel, event.t_ns, &event.data)?;
        }
    }
    out.finish()
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

fn length(path: &Path) -> Result<u64, Error> {
    std::fs::metadata(path).map(|metadata| metadata.len()).map_err(|source| io(path, source))
}

fn io(path: &Path, source: std::io::Error) -> Error {
    Error::Io { path: path.into(), source }
}

fn manifest_error(path: &Path, why: String) -> Error {
    Error::Manifest { path: path.into(), why }
}
