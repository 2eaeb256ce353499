//! Runs the simulations of an experiment on all cores; keeps, replays and analyses each log.

use crate::row::Row;
use crate::scenario_edit::{Change, edited};
use analysis::figures::{Figure, Format};
use analysis::{Metrics, Run};
use anyhow::Context;
use drivers::robot_files::{find_shipped, read};
use drivers::simulation::{Components, Job, Setup, Summary};
use replay::engine::{Build, Options, Replay};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A progress bar: takes the completed fraction, 0 to 1; dropped when the work is done.
pub type Bar = Box<dyn Fn(f64) + Send + Sync>;

/// Opens a progress bar with a title.
pub type NewBar = Box<dyn Fn(String) -> Bar + Send + Sync>;

/// One robot, the folder for its logs, and what was collected besides rows.
pub struct Bench {
    robot: String,
    seeds: i64,
    first_seed: Option<i64>,
    dir: PathBuf,
    build: Build,
    new_bar: NewBar,
    /// Number of logs replayed, and of those that were identical.
    replayed: Mutex<(usize, usize)>,
    notes: Mutex<Vec<String>>,
    figures: Mutex<Vec<PathBuf>>,
}

/// A run to simulate: a scenario with changes.
#[derive(Clone, Debug)]
pub struct RunSpec {
    /// File name of its log, without extension.
    pub name: String,
    scenario: String,
    changes: Vec<Change>,
    preset: Option<String>,
    set: Vec<String>,
    seed: Option<i64>,
    /// Another robot than the bench's.
    robot: Option<String>,
    /// Delete the log after it was measured, unless its replay differs.
    discard: bool,
}

impl RunSpec {
    /// A scenario by its name in `scenarios/`, or by its TOML file.
    pub fn of(scenario: &str) -> Self {
        let name = file_stem(scenario);
        RunSpec {
            name,
            scenario: scenario.to_owned(),
            changes: Vec::new(),
            preset: None,
            set: Vec::new(),
            seed: None,
            robot: None,
            discard: false,
        }
    }

    /// Renames the run.
    pub fn named(self, name: impl Into<String>) -> Self {
        RunSpec { name: name.into(), ..self }
    }

    /// Runs another robot than the bench's, by its TOML file.
    pub fn robot(self, toml: &Path) -> Self {
        RunSpec { robot: Some(toml.display().to_string()), ..self }
    }

    /// Starts from a preset of the robot's parameters.
    pub fn preset(self, name: &str) -> Self {
        RunSpec { preset: Some(name.to_owned()), ..self }
    }

    /// Deletes the log after it was measured, unless its replay differs; for experiments of hundreds of runs.
    pub fn discard_log(self) -> Self {
        RunSpec { discard: true, ..self }
    }

    /// Changes a key of the scenario; the value is TOML.
    pub fn with(mut self, key: &str, value: impl std::fmt::Display) -> Self {
        self.changes.push((key.to_owned(), value.to_string()));
        self
    }

    /// Sets a parameter of the controller; the value is TOML.
    pub fn set(mut self, key: &str, value: impl std::fmt::Display) -> Self {
        self.set.push(format!("{key}={value}"));
        self
    }

    /// Sets the seed and appends it to the name.
    pub fn seed(self, seed: i64) -> Self {
        RunSpec { name: format!("{}_{seed}", self.name), seed: Some(seed), ..self }
    }
}

/// A simulated run.
pub struct Sample<T = ()> {
    /// Its log.
    pub log: PathBuf,
    /// Result of the simulation.
    pub summary: Summary,
    /// Metrics of the log.
    pub metrics: Metrics,
    /// What the experiment measured in the log besides the metrics.
    pub measured: T,
}

impl<T> Sample<T> {
    /// The robot fell, or the controller entered its safe state.
    pub fn failed(&self) -> bool {
        self.summary.failed()
    }
}

impl Bench {
    /// A bench that keeps its logs in `dir`, which is created if missing.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub fn new(robot: &str, seeds: i64, dir: &Path, build: Build, new_bar: NewBar) -> anyhow::Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        Ok(Bench {
            robot: robot.to_owned(),
            seeds,
            first_seed: None,
            dir: dir.to_owned(),
            build,
            new_bar,
            replayed: Mutex::default(),
            notes: Mutex::default(),
            figures: Mutex::default(),
        })
    }

    /// Sets the first seed of every run; a run without a seed of its own gets it too.
    pub fn starting_at(self, first_seed: Option<i64>) -> Self {
        Bench { first_seed, ..self }
    }

    /// The robot, by name or TOML file.
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Folder of the logs.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Seeds to run.
    pub fn seeds(&self) -> std::ops::Range<i64> {
        self.consecutive_seeds(self.seeds)
    }

    /// `n` seeds from the first one on.
    pub fn consecutive_seeds(&self, n: i64) -> std::ops::Range<i64> {
        let first = self.first_seed.unwrap_or(0);
        first..first.saturating_add(n)
    }

    /// Opens a progress bar.
    pub fn bar(&self, title: impl Into<String>) -> Bar {
        (self.new_bar)(title.into())
    }

    /// Adds a remark to the tables.
    pub fn note(&self, text: impl Into<String>) {
        locked(&self.notes).push(text.into());
    }

    /// Writes a figure as SVG and PNG into the folder.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, figure: &Figure) -> anyhow::Result<()> {
        let files = figure.write(self.dir(), &[Format::Svg, Format::Png], 288.0)?;
        locked(&self.figures).extend(files.into_iter().take(1));
        Ok(())
    }

    /// Remarks and figures so far.
    pub fn remarks(&self) -> (Vec<String>, Vec<PathBuf>) {
        (locked(&self.notes).clone(), locked(&self.figures).clone())
    }

    /// The row that counts the logs of this bench that replay bit for bit; `None` if nothing was simulated.
    pub fn replays(&self) -> Option<Row> {
        let (logs, identical) = *locked(&self.replayed);
        (logs > 0).then(|| Row::info("logs that replay bit for bit", count(identical), "").exactly(count(logs)))
    }

    /// Simulates one run.
    ///
    /// # Errors
    /// As [`Bench::all_with`].
    pub fn one(&self, spec: RunSpec) -> anyhow::Result<Sample> {
        self.one_with(spec, |_| ())
    }

    /// Simulates one run and measures its log with `measure`.
    ///
    /// # Errors
    /// As [`Bench::all_with`].
    pub fn one_with<T: Send>(&self, spec: RunSpec, measure: impl Fn(&Run) -> T + Sync) -> anyhow::Result<Sample<T>> {
        let title = spec.name.clone();
        let mut samples = self.all_with(&title, vec![spec], measure)?;
        samples.pop().context("a run gives a sample")
    }

    /// Simulates runs on all cores; samples are in the order of `specs`.
    ///
    /// # Errors
    /// As [`Bench::all_with`].
    pub fn all(&self, title: &str, specs: Vec<RunSpec>) -> anyhow::Result<Vec<Sample>> {
        self.all_with(title, specs, |_| ())
    }

    /// Simulates runs on all cores and measures each log with `measure`; samples are in the order of `specs`.
    ///
    /// # Errors
    /// A run that cannot be simulated, replayed or read; the message names the run. A fall is no error.
    pub fn all_with<T: Send>(
        &self,
        title: &str,
        specs: Vec<RunSpec>,
        measure: impl Fn(&Run) -> T + Sync,
    ) -> anyhow::Result<Vec<Sample<T>>> {
        let bar = self.bar(format!("{title}, {} runs", specs.len()));
        let fractions = Mutex::new(vec![0.0; specs.len()]);
        let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
        let work = || -> anyhow::Result<()> {
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                let Some(spec) = specs.get(i) else { return Ok(()) };
                let mut progress = |fraction: f64| {
                    let mut fractions = locked(&fractions);
                    fractions[i] = fraction;
                    bar(fractions.iter().sum::<f64>() / count(fractions.len()));
                };
                let sample = self.sample(spec, &measure, &mut progress).with_context(|| spec.name.clone())?;
                locked(&done).push((i, sample));
            }
        };
        std::thread::scope(|scope| {
            let threads = std::thread::available_parallelism().map_or(1, usize::from).min(specs.len());
            let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            handles.into_iter().try_for_each(|handle| handle.join().unwrap_or_else(|e| std::panic::resume_unwind(e)))
        })?;
        let mut samples = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        samples.sort_by_key(|(i, _)| *i);
        Ok(samples.into_iter().map(|(_, sample)| sample).collect())
    }

    /// Simulates, replays and analyses a run. The simulation takes about half of the time.
    fn sample<T>(
        &self,
        spec: &RunSpec,
        measure: &impl Fn(&Run) -> T,
        progress: &mut dyn FnMut(f64),
    ) -> anyhow::Result<Sample<T>> {
        let log = self.dir.join(format!("{}.mcap", spec.name));
        let scenario = self.scenario(spec)?;
        let job = Job {
            robot: spec.robot.as_deref().unwrap_or(&self.robot),
            scenario: &scenario,
            seconds: None,
            seed: spec.seed.or(self.first_seed),
            preset: spec.preset.as_deref(),
            gaits: &[],
            set: &spec.set,
            components: Components::default(),
        };
        let summary = Setup::read(&job)?.simulate(&log, &self.build, &mut |fraction| progress(0.5 * fraction))?;
        let replayed = Replay::open(&log)?.run(&Options::default(), &mut |fraction| progress(0.5 + 0.4 * fraction))?;
        {
            let (logs, identical) = &mut *locked(&self.replayed);
            *logs += 1;
            *identical += usize::from(replayed.identical);
        }
        let run = Run::read(&log, &mut |_| {})?;
        let (metrics, measured) = (Metrics::of(&run), measure(&run));
        if spec.discard && replayed.identical {
            std::fs::remove_file(&log).with_context(|| log.display().to_string())?;
        }
        progress(1.0);
        Ok(Sample { log, summary, metrics, measured })
    }

    /// Writes the changed scenario of a run beside its log.
    fn scenario(&self, spec: &RunSpec) -> anyhow::Result<PathBuf> {
        let source = if Path::new(&spec.scenario).extension().is_some_and(|end| end == "toml") {
            PathBuf::from(&spec.scenario)
        } else {
            find_shipped(&format!("scenarios/{}.toml", spec.scenario))?
        };
        let text = edited(&read(&source)?, &spec.name, &spec.changes).with_context(|| source.display().to_string())?;
        let path = self.dir.join(format!("{}.toml", spec.name));
        std::fs::write(&path, text).with_context(|| path.display().to_string())?;
        Ok(path)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Name of a robot or scenario given by name or file.
pub fn file_stem(name: &str) -> String {
    Path::new(name).file_stem().map_or(name.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// A count for a row.
#[expect(clippy::cast_precision_loss, reason = "counts of runs and ticks are far below 2^53")]
pub fn count(n: usize) -> f64 {
    n as f64
}

/// Mean of the values; NaN for none.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / n
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_seed_moves_all_seeds() {
        let dir = std::env::temp_dir().join(format!("bench_seeds_{}", std::process::id()));
        let bench = |first| {
            let bar: NewBar = Box::new(|_| Box::new(|_| ()));
            Bench::new("hyq", 3, &dir, Build::default(), bar).unwrap().starting_at(first)
        };
        assert_eq!((bench(None).seeds(), bench(Some(40)).seeds()), (0..3, 40..43));
        assert_eq!(bench(Some(40)).consecutive_seeds(12), 40..52);
        std::fs::remove_dir(&dir).unwrap();
    }
}
