//! Where experiments are run: simulations with their logs kept, several seeds at a time, and what the analysis finds in them.

use crate::progress::Progress;
use crate::robot::shipped;
use crate::sim::{Job, Summary, simulate};
use analysis::Metrics;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicI64, Ordering};

/// A robot on the bench.
pub struct Bench {
    robot: String,
    seeds: i64,
    dir: PathBuf,
}

/// A run that was made, and its figures.
pub struct Sample {
    /// How the simulation went.
    pub summary: Summary,
    /// What the log says.
    pub metrics: Metrics,
}

impl Bench {
    /// A bench that keeps its logs in `dir`.
    pub fn new(robot: &str, seeds: i64, dir: &Path) -> anyhow::Result<Self> {
        std::fs::create_dir_all(dir)?;
        Ok(Bench { robot: robot.to_owned(), seeds, dir: dir.to_owned() })
    }

    /// Where the logs are.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Seeds that were asked for.
    pub fn seeds(&self) -> i64 {
        self.seeds
    }

    /// One run of a scenario of the project (by its name in `scenarios/`), with its report beside the log.
    pub fn one(&self, scenario: &str, set: &[String]) -> anyhow::Result<Sample> {
        let bar = Progress::new(scenario.to_owned());
        let sample = self.sample(scenario, scenario, None, set, &mut |part| bar.set(part))?;
        drop(bar);
        crate::report::write(&self.log(scenario), &self.dir.join(format!("{scenario}_report")))?;
        Ok(sample)
    }

    /// A scenario with the seeds 0, 1, …, on all cores; in the order of the seeds.
    pub fn seeded(&self, scenario: &str, set: &[String]) -> anyhow::Result<Vec<Sample>> {
        let bar = Progress::new(format!("{scenario}, {} seeds", self.seeds));
        let (next, done) = (AtomicI64::new(0), Mutex::new(Vec::new()));
        let work = || -> anyhow::Result<()> {
            loop {
                let seed = next.fetch_add(1, Ordering::Relaxed);
                if seed >= self.seeds {
                    return Ok(());
                }
                let sample = self.sample(&format!("{scenario}_{seed}"), scenario, Some(seed), set, &mut |_| ())?;
                let mut done = done.lock().expect("no thread panics while it holds the lock");
                done.push((seed, sample));
                #[expect(clippy::cast_precision_loss, reason = "a part for a bar")]
                bar.set(done.len() as f64 / self.seeds as f64);
            }
        };
        std::thread::scope(|scope| {
            let threads = std::thread::available_parallelism().map_or(1, usize::from);
            let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            handles.into_iter().try_for_each(|handle| handle.join().expect("a run reports errors, it does not panic"))
        })?;
        let mut samples = done.into_inner().expect("every thread has ended");
        samples.sort_by_key(|(seed, _)| *seed);
        Ok(samples.into_iter().map(|(_, sample)| sample).collect())
    }

    fn log(&self, name: &str) -> PathBuf {
        self.dir.join(format!("{name}.mcap"))
    }

    fn sample(
        &self,
        name: &str,
        scenario: &str,
        seed: Option<i64>,
        set: &[String],
        progress: &mut dyn FnMut(f64),
    ) -> anyhow::Result<Sample> {
        let (log, scenario) = (self.log(name), shipped(&format!("scenarios/{scenario}.toml"))?);
        let job = Job { robot: &self.robot, scenario: &scenario, log: &log, seconds: None, seed, set };
        let summary = simulate(&job, progress)?;
        let metrics = Metrics::of(&analysis::Run::read(&log, &mut |_| ())?);
        Ok(Sample { summary, metrics })
    }
}
