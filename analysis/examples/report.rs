//! The report of a log: `cargo run --release -p analysis --example report LOG OUT_DIR`.

use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [log, out_dir] = arguments.as_slice() else { return Err("usage: report LOG OUT_DIR".into()) };
    let report = analysis::report(log.as_ref(), out_dir.as_ref(), &mut |_| ())?;
    let text = analysis::tables::text(&report.metrics);
    Ok(writeln!(std::io::stdout(), "{text}\n{}", report.html.display())?)
}
