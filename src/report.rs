//! `hoof report`: figures, tables, metrics and an HTML page from one or several logs; checks of limits.

use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use analysis::check::{Limits, Verdict};
use analysis::figures::Several;
use analysis::{Metrics, Plots, Report, ReportOptions, Run, Stage, plots, tables};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    hoof report run.mcap --out report && xdg-open report/report.html\n  \
    hoof report before.mcap after.mcap --out compared          overlaid figures, metrics side by side\n  \
    hoof report seed*.mcap --out seeds --several band          mean, standard deviation and extremes over runs\n  \
    hoof report --print-plots > plots.toml                     a file to select figures, sizes and fields of any channel\n  \
    hoof report run.mcap --check limits.toml                   exit code 1 if a limit is violated\n\n\
    A file of limits; each key is a path in metrics.json:\n  \
    [limits]\n  \
    \"tracking.pitch.std\" = 0.01                    maximum\n  \
    \"locomotion.distance_m\" = { min = 3.0 }\n  \
    \"tracking.feet.LF.x.rms\" = { max = 0.02 }\n  \
    \"safety.fell\" = { equals = false }")]
pub struct Args {
    /// Logs to report; several logs are overlaid in the figures
    #[arg(value_name = "LOG", required_unless_present = "print_plots")]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    one_run: crate::log::OneRun,
    /// Folder to write to; created if missing
    #[arg(long, value_name = "DIR", required_unless_present_any = ["check", "print_plots", "json"])]
    out: Option<PathBuf>,
    /// TOML file that selects figures, sizes and fields; `--print-plots` prints the default
    #[arg(long, value_name = "FILE")]
    plots: Option<PathBuf>,
    /// Print the default selection of figures, with an explanation of every key
    #[arg(long)]
    print_plots: bool,
    /// How figures show several logs
    #[arg(long, value_enum)]
    several: Option<Choice>,
    /// Name of a log in figures and tables, in the order of the logs; default: its file name
    #[arg(long = "name", value_name = "NAME")]
    names: Vec<String>,
    /// Check the metrics of each log against limits; writes nothing without `--out`
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
    /// Print the metrics as JSON instead of tables; writes nothing without `--out`
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Choice {
    /// One line per log
    Lines,
    /// Mean, standard deviation and extremes over the logs
    Band,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.print_plots {
        say(plots::DEFAULT.trim_end())?;
        return Ok(Outcome::Good);
    }
    let limits = args.check.as_deref().map(Limits::read).transpose()?;
    let runs = match &args.out {
        Some(out) => written(args, out)?,
        None => measured(args)?,
    };
    let mut failed = false;
    let mut verdicts = Vec::new();
    if let Some(limits) = &limits {
        for (name, metrics) in &runs {
            let of_run = limits.check(metrics)?;
            failed |= of_run.iter().any(|verdict| !verdict.pass);
            if !args.json {
                say_verdicts(name, &of_run)?;
            }
            verdicts.push(serde_json::json!({ "name": name, "limits": of_run }));
        }
    }
    if args.json {
        let report = args.out.as_ref().map(|out| out.join("report.html"));
        let mut json = match &runs[..] {
            [(_, metrics)] => serde_json::json!({ "report": report, "metrics": metrics }),
            several => {
                let each: Vec<_> = several
                    .iter()
                    .map(|(name, metrics)| serde_json::json!({ "name": name, "metrics": metrics }))
                    .collect();
                serde_json::json!({ "report": report, "runs": each })
            }
        };
        if limits.is_some() {
            json["check"] = verdicts.into();
            json["pass"] = (!failed).into();
        }
        say_json(&json)?;
    }
    let lossy = runs.iter().any(|(_, metrics)| !metrics.notes.is_empty());
    Ok(match (failed, lossy) {
        (true, _) => Outcome::Failed,
        (false, true) => Outcome::DataLoss,
        (false, false) => Outcome::Good,
    })
}

/// Writes the report and prints its tables.
fn written(args: &Args, out: &Path) -> anyhow::Result<Vec<(String, Metrics)>> {
    let plots = args.plots.as_deref().map_or_else(|| Ok(Plots::default()), Plots::read)?;
    let plots = match args.several {
        Some(Choice::Lines) => plots.with_several(Several::Lines),
        Some(Choice::Band) => plots.with_several(Several::Band),
        None => plots,
    };
    let inputs = args.plots.iter().chain(&args.check).cloned().collect();
    let report = write_with(&args.logs(), out, &ReportOptions { plots, names: args.names.clone(), inputs })?;
    if !args.json {
        match &report.runs[..] {
            [(_, metrics)] => say(tables::text(metrics).trim_end())?,
            several => {
                let each: Vec<_> = several.iter().map(|(name, metrics)| (name.clone(), metrics)).collect();
                say(tables::comparison(&each).text().trim_end())?;
            }
        }
        for figure in &report.not_drawn {
            say(format!("not drawn: {}; missing: {}", figure.title, figure.needs))?;
        }
        say(format!("\nreport: {}", report.html.display()))?;
    }
    Ok(report.runs)
}

/// Computes the metrics only, for a check.
fn measured(args: &Args) -> anyhow::Result<Vec<(String, Metrics)>> {
    let name = |log: &Path| log.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let mut runs = Vec::new();
    for log in &args.logs() {
        let bar = Progress::new("metrics");
        let run = Run::read(log, &mut |p| bar.set(part(&p)))?;
        runs.push((name(log), Metrics::of(&run)));
    }
    Ok(runs)
}

fn say_verdicts(name: &str, verdicts: &[Verdict]) -> anyhow::Result<()> {
    let kept = verdicts.iter().filter(|verdict| verdict.pass).count();
    say(format!("{name}: {kept} of {} limits met", verdicts.len()))?;
    for Verdict { key, found, expected, pass } in verdicts {
        let found = if found.is_null() { "not in the log".to_owned() } else { found.to_string() };
        say(format!("  {} {key} = {found}, expected {expected}", if *pass { "pass" } else { "FAIL" }))?;
    }
    Ok(())
}

/// Writes the report of a log with a progress bar.
pub fn write(log: &Path, out: &Path) -> anyhow::Result<Report> {
    write_with(&[log.to_owned()], out, &ReportOptions::default())
}

impl Args {
    /// The logs, or the selected run of each.
    fn logs(&self) -> Vec<PathBuf> {
        self.logs.iter().map(|log| self.one_run.of(log)).collect()
    }
}

fn write_with(logs: &[PathBuf], out: &Path, options: &ReportOptions) -> anyhow::Result<Report> {
    let bar = Progress::new("report");
    let (mut read, logs_total) = (0.0, logs.len() as f64);
    Ok(analysis::report_with(logs, out, options, &mut |p| {
        let part = part(&p);
        // Reading and drawing take about the same time. Logs are read one after the other.
        bar.set(match p.stage {
            Stage::Read => {
                let now = 0.5 * (read + part) / logs_total;
                read += if part >= 1.0 { 1.0 } else { 0.0 };
                now
            }
            Stage::Draw => 0.5 + 0.5 * part,
        });
    })?)
}

fn part(progress: &analysis::Progress) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a part for a bar")]
    let part = progress.done as f64 / progress.total.max(1) as f64;
    part
}
