//! Golden logs: runs that the controller must replay bit for bit, and how a change of behaviour is accepted.
//!
//! A directory contains the logs, the manifest `corpus.toml`, and a `README.md` generated from it. A golden log contains the channels that
//! a replay needs ([`CHANNELS`]). The digests of every tick represent all other outputs, of which it contains every [`SAMPLE_TICKS`]th tick
//! to show the values.
//!
//! A field log becomes a small regression test: [`Part`] selects the ticks around an incident, with the snapshot before them.
//!
//! [`check`] replays all golden logs. After an intended change, [`accept`] replays the inputs of one and stores the new outputs in it;
//! the commit then shows the log, the reason, and the first difference.

mod keep;

pub use keep::{CHANNELS, Part, SAMPLE_TICKS, trim_to_golden};

use crate::Error;
use crate::engine::{Divergence, Options, Replay};
use controller::{Component, LoadError};
use keep::{copy, copy_inputs, copy_part, copy_ticks, is_kept, shown_ticks};
use lcmtypes::RunInfo;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "corpus.toml";
const README: &str = "README.md";

/// Result of the check of a golden log.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct CorpusResult {
    /// Name in the manifest.
    pub name: String,
    /// All recorded outputs are identical.
    pub identical: bool,
    /// Computed ticks.
    pub ticks: u64,
    /// The first difference.
    pub first_divergence: Option<Divergence>,
    /// Largest difference of two floats in the log, ulp.
    pub largest_ulp: Option<u64>,
    /// The file was changed after it was accepted: its SHA-256 differs from the manifest.
    pub altered: bool,
    /// Why the log could not be replayed.
    pub error: Option<String>,
}

/// Result of [`accept`].
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Accepted {
    /// Result of the check before.
    pub before: CorpusResult,
    /// Previous size of the file, bytes.
    pub bytes_before: u64,
    /// New size of the file, bytes.
    pub bytes: u64,
}

/// The manifest.
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
    /// Purpose of the log, or reason of its last acceptance.
    why: String,
}

/// The golden logs of a directory.
pub struct Corpus<'a> {
    dir: PathBuf,
    manifest: Manifest,
    load: Box<crate::engine::Load<'a>>,
}

/// Replays every golden log of a directory in the order of the manifest, with `jobs` threads each.
///
/// # Errors
/// [`Error::Manifest`] for an invalid manifest. A log that cannot be replayed is a result, not an error.
pub fn check(dir: impl AsRef<Path>, jobs: usize) -> Result<Vec<CorpusResult>, Error> {
    Ok(Corpus::open_with(dir, controller::load)?.check(jobs))
}

/// Records a golden log again: same inputs, outputs of this build.
///
/// # Errors
/// [`Error::UnknownGolden`], or an error of the replay; the log is then unchanged.
pub fn accept(dir: impl AsRef<Path>, name: &str, why: &str) -> Result<Accepted, Error> {
    Corpus::open_with(dir, controller::load)?.accept(name, why)
}

/// Makes a golden log from a run: `name.mcap`, trimmed by [`trim_to_golden`], and an entry in the manifest.
///
/// # Errors
/// [`Error::Manifest`] if the name exists, or an I/O error.
pub fn add(dir: impl AsRef<Path>, log: &Path, name: &str, why: &str, more: &[&str]) -> Result<u64, Error> {
    Corpus::open_with(dir, controller::load)?.add(log, name, why, more)
}

/// [`add`] for a part of the run.
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

impl<'a> Corpus<'a> {
    /// Reads the manifest of a directory; a directory without one is an empty corpus.
    ///
    /// # Errors
    /// [`Error::Io`] if the directory does not exist, [`Error::Manifest`] for an invalid manifest.
    pub fn open_with(
        dir: impl AsRef<Path>,
        load: impl Fn(&RunInfo) -> Result<Component, LoadError> + Sync + 'a,
    ) -> Result<Self, Error> {
        let dir = dir.as_ref();
        std::fs::read_dir(dir).map_err(|source| io(dir, source))?;
        let path = dir.join(MANIFEST);
        let manifest = match crate::read_text(&path) {
            Ok(text) => toml::from_str(&text).map_err(|error| manifest_error(&path, error.to_string()))?,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Manifest::default(),
            Err(source) => return Err(io(&path, source)),
        };
        let corpus = Corpus { dir: dir.into(), manifest, load: Box::new(load) };
        let mut names = BTreeSet::new();
        for golden in &corpus.manifest.log {
            if !names.insert(&golden.name) {
                return Err(manifest_error(&path, format!("two logs have the name \"{}\"", golden.name)));
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
        let place =
            self.manifest.log.iter().position(|golden| golden.name == name).ok_or_else(|| self.unknown(name))?;
        let before = self.check_one(&self.manifest.log[place], 1);
        let path = self.dir.join(&self.manifest.log[place].file);
        let bytes_before = length(&path)?;
        let steps = ["inputs", "replayed", "accepted"].map(|step| path.with_extension(format!("{step}.mcap")));
        let recorded = self.record(&path, &steps);
        // Remove temporary files; the last was renamed to the log unless a step failed.
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
            return Err(manifest_error(&self.dir.join(MANIFEST), format!("the name \"{name}\" exists already")));
        }
        // The name becomes a file name.
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

    /// Replays the inputs of a log and replaces the log by the result.
    fn record(&self, path: &Path, [inputs, replayed, trimmed]: &[PathBuf; 3]) -> Result<(), Error> {
        let whole = copy_inputs(path, inputs)?;
        let options = Options { out: Some(replayed.clone()), ..Options::default() };
        Replay::open_with(inputs, &*self.load)?.run(&options, &mut |_| {})?;
        copy(replayed, trimmed, |event| is_kept(event, |channel| whole.contains(channel)))?;
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
                // A golden log must be complete; one that can be checked only in part is an error.
                let whole = report.complete && report.skipped_ticks == 0;
                CorpusResult {
                    name,
                    identical: report.identical && whole && !altered,
                    ticks: report.ticks,
                    largest_ulp: report.largest_ulp,
                    altered,
                    error: match whole {
                        false => Some(
                            "the log is damaged, cut, or lacks inputs or outputs: `hoof log verify` gives the reasons"
                                .to_owned(),
                        ),
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

    /// Purpose of a golden log, or reason of its last acceptance.
    pub fn why(&self, name: &str) -> Option<&str> {
        self.manifest.log.iter().find(|golden| golden.name == name).map(|golden| &*golden.why)
    }

    /// Writes two logs for comparison: the sampled ticks of a golden log as recorded and as replayed by this build.
    ///
    /// # Errors
    /// [`Error::UnknownGolden`], or an error of the replay.
    pub fn sides(&self, name: &str, before: &Path, after: &Path) -> Result<(), Error> {
        let path = self.file(name).ok_or_else(|| self.unknown(name))?;
        let [inputs, replayed] = ["inputs", "replayed"].map(|step| after.with_extension(format!("{step}.mcap")));
        copy_inputs(&path, &inputs)?;
        let options = Options { out: Some(replayed.clone()), ..Options::default() };
        Replay::open_with(&inputs, &*self.load)?.run(&options, &mut |_| {})?;
        let ticks = shown_ticks(&path)?;
        copy_ticks(&path, before, &ticks)?;
        copy_ticks(&replayed, after, &ticks)?;
        [inputs, replayed].iter().try_for_each(|step| std::fs::remove_file(step).map_err(|source| io(step, source)))
    }

    fn unknown(&self, name: &str) -> Error {
        let known = self.manifest.log.iter().map(|golden| golden.name.as_str()).collect::<Vec<_>>().join(", ");
        Error::UnknownGolden { path: self.dir.join(MANIFEST), name: name.into(), known }
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
            writeln!(readme, "| {name} | {} | {why} |", bytes.div_ceil(1000))
                .expect("writing to a string does not fail");
        }
        let path = self.dir.join(README);
        std::fs::write(&path, readme).map_err(|source| io(&path, source))
    }
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
