//! `hoof report`: figures, tables, metrics and a page, from a log.

use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use analysis::{Report, Stage, tables};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof report run.mcap --out report && xdg-open report/report.html")]
pub struct Args {
    /// Log to report
    log: PathBuf,
    /// Directory to write to; made if need be
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the metrics as JSON instead of tables
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let report = write(&args.log, &args.out)?;
    if args.json {
        say_json(&serde_json::json!({ "report": report.html, "metrics": report.metrics }))?;
    } else {
        say(tables::text(&report.metrics).trim_end())?;
        for lack in &report.lacking {
            say(format!("not drawn: {}, which needs {}", lack.title, lack.needs))?;
        }
        say(format!("\nreport: {}", report.html.display()))?;
    }
    Ok(if report.metrics.notes.is_empty() { Outcome::Good } else { Outcome::DataLoss })
}

/// Writes the report with a progress bar.
pub fn write(log: &Path, out: &Path) -> anyhow::Result<Report> {
    let bar = Progress::new("report");
    Ok(analysis::report(log, out, &mut |p| {
        #[expect(clippy::cast_precision_loss, reason = "a part for a bar")]
        let part = p.done as f64 / p.total.max(1) as f64;
        // Reading and drawing take about as long.
        bar.set(match p.stage {
            Stage::Read => 0.5 * part,
            Stage::Draw => 0.5 + 0.5 * part,
        });
    })?)
}
