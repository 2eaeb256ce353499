//! The report of a synthetic run: complete, the same bytes twice, and honest about what is missing.

mod common;

use std::path::Path;

use analysis::{Error, report};
use common::{Plan, scratch, write};

fn written(dir: &Path, name: &str) -> Vec<u8> {
    std::fs::read(dir.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

#[test]
fn one_log_gives_one_report_byte_for_byte() {
    let dir = scratch("twice");
    let log = dir.join("run.mcap");
    write(&log, &Plan::default());
    let first = report(&log, &dir.join("a"), &mut |_| ()).unwrap();
    let second = report(&log, &dir.join("b"), &mut |_| ()).unwrap();
    assert!(first.lacking.is_empty());
    assert_eq!(first.files.len(), 6 * 2 + 4);
    for (a, b) in first.files.iter().zip(&second.files) {
        assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap(), "{} differs from {}", a.display(), b.display());
    }
    for file in first.files.iter().filter(|f| f.extension().is_some_and(|e| e == "svg")) {
        let bytes = std::fs::metadata(file).unwrap().len();
        assert!(bytes < 500_000, "{} has {bytes} bytes", file.display());
    }
}

#[test]
fn the_page_needs_no_other_file_and_escapes_what_it_quotes() {
    let dir = scratch("page");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan::default());
    let page = std::fs::read_to_string(report(&log, &dir, &mut |_| ()).unwrap().html).unwrap();
    assert!(page.contains("synthetic &lt;trot&gt; &amp; more") && page.contains("walk &lt;forward&gt;"));
    assert!(!page.contains("<trot>"));
    for outside in ["<img", "<script", "<link", "src=", "@import"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page.matches("url(").count(), page.matches("url(data:").count());
    assert_eq!(page.matches("<figure>").count(), 6);
}

#[test]
fn what_a_log_lacks_is_said_and_the_rest_is_drawn() {
    let dir = scratch("lacking");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan { without: &["GROUND_TRUTH", "TIMING"], gap: 1500..1600, ..Plan::default() });
    let report = report(&log, &dir, &mut |_| ()).unwrap();
    let names: Vec<&str> = report.lacking.iter().map(|lack| lack.name).collect();
    assert_eq!(names, ["path", "timing"]);
    let page = std::fs::read_to_string(&report.html).unwrap();
    assert!(page.contains("Not in the log: TIMING, GROUND_TRUTH") && page.contains("Path from above"));
    assert!(dir.join("base_tracking.png").exists() && !dir.join("path.svg").exists());
}

#[test]
fn a_cut_log_is_reported_as_far_as_it_goes() {
    let dir = scratch("cut");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan { ticks: 1500, ..Plan::default() });
    let bytes = written(&dir, "run.lcmlog");
    std::fs::write(&log, &bytes[..bytes.len() - 100]).unwrap();
    let report = report(&log, &dir, &mut |_| ()).unwrap();
    assert!(report.metrics.notes.iter().any(|note| note.contains("cut at byte")), "{:?}", report.metrics.notes);
    assert_eq!(report.metrics.run.ticks, 1500);
}

#[test]
fn an_empty_file_is_a_clear_error() {
    let dir = scratch("empty");
    let log = dir.join("run.lcmlog");
    std::fs::write(&log, b"").unwrap();
    match report(&log, &dir, &mut |_| ()) {
        Err(error @ Error::Log { .. }) => assert!(error.to_string().contains("run.lcmlog")),
        other => panic!("expected Error::Log, found {other:?}"),
    }
}
