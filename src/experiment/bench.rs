//! Where experiments are run: simulations on all cores, each log kept, replayed and analysed.

use super::scenario_edit::{Change, edited};
use super::table::Row;
use crate::progress::Progress;
use crate::robot::{read, shipped};
use crate::sim::{Job, Summary, simulate};
use analysis::figures::{Figure, Format};
use analysis::{Metrics, Run};
use anyhow::Context;
use replay::engine::{Options, Replay};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A robot on the bench.
pub struct Bench {
    robot: String,
    seeds: i64,
    dir: PathBuf,
    /// Logs replayed, and how many of them came out bit for bit.
    replayed: Mutex<(usize, usize)>,
    notes: Mutex<Vec<String>>,
    figures: Mutex<Vec<PathBuf>>,
}

/// A run to be made.
#[derive(Clone, Debug)]
pub struct Spec {
    /// Name of its log, without ending.
    pub name: String,
    scenario: String,
    changes: Vec<Change>,
    set: Vec<String>,
    seed: Option<i64>,
}

impl Spec {
    /// A scenario of the project, by its name in `scenarios/`, or one of the user's, by its file.
    pub fn of(scenario: &str) -> Self {
        let name = super::robot_name(scenario);
        Spec { name, scenario: scenario.to_owned(), changes: Vec::new(), set: Vec::new(), seed: None }
    }

    /// The same under another name.
    pub fn named(self, name: impl Into<String>) -> Self {
        Spec { name: name.into(), ..self }
    }

    /// The same with a key of the scenario changed; the value is TOML.
    pub fn with(mut self, key: &str, value: impl std::fmt::Display) -> Self {
        self.changes.push((key.to_owned(), value.to_string()));
        self
    }

    /// The same with a parameter of the controller set; the value is TOML.
    pub fn set(mut self, key: &str, value: impl std::fmt::Display) -> Self {
        self.set.push(format!("{key}={value}"));
        self
    }

    /// The same with another seed, which the name then ends in.
    pub fn seed(self, seed: i64) -> Self {
        Spec { name: format!("{}_{seed}", self.name), seed: Some(seed), ..self }
    }
}

/// A run that was made, and its figures.
pub struct Sample<T = ()> {
    /// Its log.
    pub log: PathBuf,
    /// How the simulation went.
    pub summary: Summary,
    /// What the log says.
    pub metrics: Metrics,
    /// What was asked of it besides.
    pub found: T,
}

impl<T> Sample<T> {
    /// The robot fell, or gave up.
    pub fn failed(&self) -> bool {
        self.summary.fell || self.summary.safe_state.is_some()
    }
}

impl Bench {
    /// A bench that keeps its logs in `dir`.
    pub fn new(robot: &str, seeds: i64, dir: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(dir).with_context(|| dir.display().to_string())?;
        Ok(Bench {
            robot: robot.to_owned(),
            seeds,
            dir: dir.to_owned(),
            replayed: Mutex::default(),
            notes: Mutex::default(),
            figures: Mutex::default(),
        })
    }

    /// The robot, as on the command line.
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Where the logs are.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Seeds that were asked for.
    pub fn seeds(&self) -> std::ops::Range<i64> {
        0..self.seeds
    }

    /// Adds a remark to the tables.
    pub fn note(&self, text: impl Into<String>) {
        locked(&self.notes).push(text.into());
    }

    /// Writes a figure into the folder, for paper and for screens.
    pub fn write(&self, figure: &Figure) -> anyhow::Result<()> {
        let files = figure.write(self.dir(), &[Format::Svg, Format::Png], 288.0)?;
        locked(&self.figures).extend(files.into_iter().take(1));
        Ok(())
    }

    /// Remarks and figures so far.
    pub fn remarks(&self) -> (Vec<String>, Vec<PathBuf>) {
        (locked(&self.notes).clone(), locked(&self.figures).clone())
    }

    /// The row that says how many logs of this bench replay bit for bit; none if there was no run.
    pub fn replays(&self) -> Option<Row> {
        let (logs, identical) = *locked(&self.replayed);
        (logs > 0).then(|| Row::noted("logs that replay bit for bit", count(identical), "").exactly(count(logs)))
    }

    /// One run.
    pub fn one(&self, spec: Spec) -> anyhow::Result<Sample> {
        self.one_with(spec, |_| ())
    }

    /// One run, with a question to its log.
    pub fn one_with<T: Send>(&self, spec: Spec, ask: impl Fn(&Run) -> T + Sync) -> anyhow::Result<Sample<T>> {
        let title = spec.name.clone();
        let mut samples = self.all_with(&title, vec![spec], ask)?;
        samples.pop().context("a run gives a sample")
    }

    /// Many runs on all cores; in the order asked for.
    pub fn all(&self, title: &str, specs: Vec<Spec>) -> anyhow::Result<Vec<Sample>> {
        self.all_with(title, specs, |_| ())
    }

    /// Many runs, with a question to each log.
    pub fn all_with<T: Send>(
        &self,
        title: &str,
        specs: Vec<Spec>,
        ask: impl Fn(&Run) -> T + Sync,
    ) -> anyhow::Result<Vec<Sample<T>>> {
        let bar = Progress::new(format!("{title}, {} runs", specs.len()));
        let parts = Mutex::new(vec![0.0; specs.len()]);
        let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
        let work = || -> anyhow::Result<()> {
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                let Some(spec) = specs.get(i) else { return Ok(()) };
                let mut progress = |part: f64| {
                    let mut parts = locked(&parts);
                    parts[i] = part;
                    bar.set(parts.iter().sum::<f64>() / count(parts.len()));
                };
                let sample = self.sample(spec, &ask, &mut progress).with_context(|| spec.name.clone())?;
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

    /// Simulates, replays and reads. Half of the time goes into the simulation.
    fn sample<T>(
        &self,
        spec: &Spec,
        ask: &impl Fn(&Run) -> T,
        progress: &mut dyn FnMut(f64),
    ) -> anyhow::Result<Sample<T>> {
        let log = self.dir.join(format!("{}.mcap", spec.name));
        let scenario = self.scenario(spec)?;
        let job =
            Job { robot: &self.robot, scenario: &scenario, log: &log, seconds: None, seed: spec.seed, set: &spec.set };
        let summary = simulate(&job, &mut |part| progress(0.5 * part))?;
        let replayed = Replay::open(&log)?.run(&Options::default(), &mut |part| progress(0.5 + 0.4 * part))?;
        {
            let (logs, identical) = &mut *locked(&self.replayed);
            *logs += 1;
            *identical += usize::from(replayed.identical);
        }
        let run = Run::read(&log, &mut |_| ())?;
        let (metrics, found) = (Metrics::of(&run), ask(&run));
        progress(1.0);
        Ok(Sample { log, summary, metrics, found })
    }

    /// Writes the run's scenario beside its log.
    fn scenario(&self, spec: &Spec) -> anyhow::Result<PathBuf> {
        let source = if Path::new(&spec.scenario).extension().is_some_and(|end| end == "toml") {
            PathBuf::from(&spec.scenario)
        } else {
            shipped(&format!("scenarios/{}.toml", spec.scenario))?
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

/// A count for a table.
#[expect(clippy::cast_precision_loss, reason = "counts of runs and ticks are far below 2^53")]
pub fn count(n: usize) -> f64 {
    n as f64
}

/// Mean of the values, not a number without any.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / n
}
