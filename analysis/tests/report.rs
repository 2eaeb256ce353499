//! Reports of synthetic runs: complete, repeatable, and with a list of what is missing.

mod common;

use std::path::Path;

use analysis::figures::{Format, Several};
use analysis::{Error, Plots, ReportOptions, report, report_with};
use common::{Plan, scratch, write};

/// The built-in figures, as SVG only.
fn quick() -> ReportOptions {
    let plots = Plots { formats: vec![Format::Svg], ..Plots::default() };
    ReportOptions { plots, ..ReportOptions::default() }
}

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
    assert!(first.not_drawn.is_empty());
    // Figures in three formats; metrics and timeline; two tables in three formats; text, animation and page.
    assert_eq!(first.files.len(), 15 * 3 + 2 + 2 * 3 + 3);
    for (a, b) in first.files.iter().zip(&second.files) {
        assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap(), "{} differs from {}", a.display(), b.display());
    }
    for file in first.files.iter().filter(|f| f.extension().is_some_and(|e| e == "svg")) {
        let bytes = std::fs::metadata(file).unwrap().len();
        assert!(bytes < 500_000, "{} has {bytes} bytes", file.display());
    }
}

#[test]
fn the_page_is_self_contained_and_escapes_text_from_the_log() {
    let dir = scratch("page");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan::default());
    let page = std::fs::read_to_string(report_with(&[log], &dir, &quick(), &mut |_| ()).unwrap().html).unwrap();
    assert!(page.contains("synthetic &lt;trot&gt; &amp; more") && page.contains("walk &lt;forward&gt;"));
    assert!(!page.contains("<trot>"));
    for outside in ["<img", "<link", "src=", "@import", "fetch(", "import "] {
        assert!(!page.contains(outside), "{outside}");
    }
    let namespace = "http://www.w3.org/2000/svg";
    assert_eq!(page.matches("http").count(), page.matches(namespace).count());
    assert_eq!(page.matches("url(").count(), page.matches("url(data:").count());
    assert_eq!(page.matches("<figure>").count(), 15 + 1, "every figure and the walk");
}

#[test]
fn figures_with_missing_channels_are_listed_and_the_others_are_drawn() {
    let dir = scratch("not_drawn");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan { without: &["GROUND_TRUTH", "TIMING"], gap: 1500..1600, ..Plan::default() });
    let report = report_with(&[log], &dir, &quick(), &mut |_| ()).unwrap();
    let names: Vec<&str> = report.not_drawn.iter().map(|missing| missing.name.as_str()).collect();
    assert_eq!(names, ["path", "contact_estimation", "foot_slip", "timing", "timing_distribution"]);
    let page = std::fs::read_to_string(&report.html).unwrap();
    assert!(page.contains("Not in the log: TIMING, GROUND_TRUTH") && page.contains("Path from above"));
    assert!(dir.join("base_tracking.svg").exists() && !dir.join("path.svg").exists());
}

#[test]
fn a_rejected_urdf_is_a_note_and_omits_only_the_animation() {
    let dir = scratch("urdf");
    let log = dir.join("run.lcmlog");
    let urdf = "<robot name=\"r\"><link name=\"base\"/><joint name=\"j\" type=\"planar\"><parent link=\"base\"/><child link=\"l\"/></joint></robot>";
    write(&log, &Plan { ticks: 1500, urdf, ..Plan::default() });
    let report = report_with(&[log], &dir, &quick(), &mut |_| ()).unwrap();
    assert_eq!((report.not_drawn.len(), report.metrics.notes.len()), (0, 1), "{:?}", report.metrics.notes);
    assert!(report.metrics.notes[0].contains("URDF in RUN_INFO"), "{:?}", report.metrics.notes);
    let energy = report.metrics.energy.unwrap();
    assert_eq!((energy.joints[0].joint.as_str(), energy.max_torque_use), ("joint 0", None));
    assert!(!dir.join("walk.svg").exists() && dir.join("joint_torque.svg").exists());
}

#[test]
fn a_cut_log_is_reported_up_to_the_cut() {
    let dir = scratch("cut");
    let log = dir.join("run.lcmlog");
    write(&log, &Plan { ticks: 1500, ..Plan::default() });
    let bytes = written(&dir, "run.lcmlog");
    std::fs::write(&log, &bytes[..bytes.len() - 100]).unwrap();
    let report = report_with(&[log], &dir, &quick(), &mut |_| ()).unwrap();
    assert!(report.metrics.notes.iter().any(|note| note.contains("cut at byte")), "{:?}", report.metrics.notes);
    assert_eq!(report.metrics.run.ticks, 1500);
}

#[test]
fn an_empty_file_is_an_error_of_the_log() {
    let dir = scratch("empty");
    let log = dir.join("run.lcmlog");
    std::fs::write(&log, b"").unwrap();
    match report(&log, &dir, &mut |_| ()) {
        Err(error @ Error::Log { .. }) => assert!(error.to_string().contains("run.lcmlog")),
        other => panic!("expected Error::Log, found {other:?}"),
    }
}

#[test]
fn files_contain_hash_and_revision_of_the_log() {
    let dir = scratch("metadata");
    let log = dir.join("run.mcap");
    write(&log, &Plan { ticks: 1500, ..Plan::default() });
    let hash = report(&log, &dir, &mut |_| ()).unwrap().metrics.run.log_sha256;
    assert_eq!(hash.len(), 64);
    let svg = String::from_utf8(written(&dir, "gait.svg")).unwrap();
    assert!(
        svg.contains(&format!("LogSHA256: {hash}"))
            && svg.contains("Revision: 0123abc")
            && svg.contains("Log: run.mcap")
    );
    let holds = |bytes: &[u8], text: &[u8]| bytes.windows(text.len()).any(|window| window == text);
    let png = written(&dir, "gait.png");
    assert!(holds(&png, format!("tEXtLogSHA256\0{hash}").as_bytes()) && holds(&png, b"tEXtRevision\x000123abc"));
    assert!(holds(&written(&dir, "gait.pdf"), format!("/LogSHA256 ({hash})").as_bytes()));
    let latex = String::from_utf8(written(&dir, "tracking.tex")).unwrap();
    assert!(latex.contains(&hash) && latex.contains("\\midrule\nroll [rad] & $0.0040$ & $0.0000$"), "{latex}");
}

#[test]
fn several_logs_are_overlaid() {
    let dir = scratch("several");
    let logs = ["before", "after"].map(|name| dir.join(format!("{name}.lcmlog")));
    write(&logs[0], &Plan { ticks: 2500, ..Plan::default() });
    write(&logs[1], &Plan { ticks: 2000, seed: 8, live: true, ..Plan::default() });
    for several in [Several::Lines, Several::Band] {
        let options = ReportOptions { plots: quick().plots.with_several(several), ..ReportOptions::default() };
        let report = report_with(&logs, &dir.join(format!("{several:?}")), &options, &mut |_| ()).unwrap();
        assert_eq!(report.not_drawn, []);
        let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&report.metrics_json).unwrap()).unwrap();
        assert_eq!(
            (json["runs"][1]["name"].as_str(), json["runs"][1]["metrics"]["run"]["seed"].as_i64()),
            (Some("after"), Some(8))
        );
        let svg = String::from_utf8(written(&report.html.with_file_name(""), "base_tracking.svg")).unwrap();
        let entries = match several {
            Several::Lines => ["before", "after", "reference of before"],
            Several::Band => ["mean of 2 logs", "± standard deviation", "smallest to largest"],
        };
        for text in entries {
            assert!(svg.contains(&format!(">{text}</text>")), "{text}");
        }
        let csv = String::from_utf8(written(&report.html.with_file_name(""), "comparison.csv")).unwrap();
        assert!(csv.starts_with("quantity,unit,before,after,mean,std\n"), "{csv}");
    }
}

#[test]
fn plots_select_figures_fields_and_widths() {
    let dir = scratch("plots");
    let log = dir.join("run.mcap");
    write(&log, &Plan { ticks: 1500, ..Plan::default() });
    let text = "formats = [\"svg\"]\nwidth_mm = 88\n\
                [[figure]]\nname = \"mine\"\nfields = [\"CONTROLLER_INPUT.state.q[3]\", \"GROUND_TRUTH.contact[0]\"]\n\
                [[figure]]\nname = \"none\"\nfields = [\"BASE_TRACKING.nothing\"]\n\
                [[figure]]\nkind = \"joint_tracking\"\njoints = [\"j1\", \"j7\"]\nfrom_s = 0.5\nto_s = 0.75\n";
    let options = ReportOptions { plots: Plots::parse(text, "plots.toml").unwrap(), ..ReportOptions::default() };
    let report = report_with(&[log], &dir, &options, &mut |_| ()).unwrap();
    let [missing] = &report.not_drawn[..] else { panic!("{:?}", report.not_drawn) };
    assert_eq!((missing.name.as_str(), missing.needs.as_str()), ("none", "field BASE_TRACKING.nothing"));
    let svg = String::from_utf8(written(&dir, "mine.svg")).unwrap();
    // 88 mm are 332.6 units of 1/96 inch.
    assert!(svg.contains("width=\"332.6\"") && svg.contains(">CONTROLLER_INPUT.state.q[3]</text>"));
    let joints = String::from_utf8(written(&dir, "joint_tracking.svg")).unwrap();
    assert!(joints.contains(">j7</text>") && !joints.contains(">j2</text>"));
    assert!(!dir.join("mine.png").exists());
}

/// The push of the synthetic run lasts from 3.0 s to 3.3 s of 4.0 s. Panels are between 56 units from the left and 10 units from the right edge.
#[test]
fn figure_10_marks_the_push_in_every_panel() {
    let dir = scratch("figure10");
    let text = "formats = [\"svg\"]\nwidth_mm = 88\n[[figure]]\nkind = \"figure10\"\n";
    let options = ReportOptions { plots: Plots::parse(text, "plots.toml").unwrap(), ..ReportOptions::default() };
    let drawn = |name: &str, without: &'static [&'static str]| {
        let log = dir.join(format!("{name}.lcmlog"));
        write(&log, &Plan { without, ..Plan::default() });
        let out = dir.join(name);
        let not_drawn = report_with(&[log], &out, &options, &mut |_| ()).unwrap().not_drawn;
        (not_drawn, std::fs::read_to_string(out.join("figure10.svg")).unwrap_or_default())
    };
    let (not_drawn, svg) = drawn("all", &[]);
    assert_eq!(not_drawn, []);
    for label in ["roll [rad]", "pitch [rad]", "yaw [rad]", "error [rad]", "reference", "truth", "push"] {
        assert_eq!(svg.matches(&format!(">{label}</text>")).count(), 1, "{label}");
    }
    assert!(!svg.contains(">height [m]</text>"));
    let width = 88.0 * 96.0 / 25.4 - 56.0 - 10.0;
    let number = |text: &str| text.parse::<f64>().unwrap();
    let attribute =
        |line: &str, name: &str| number(line.split(&format!(" {name}=\"")).nth(1).unwrap().split('"').next().unwrap());
    let pushes = |svg: &str| -> Vec<(f64, f64)> {
        let shades = svg.lines().filter(|line| line.starts_with("<rect") && line.contains("#cc79a7"));
        // The legend has one too, outside the panels.
        let panels = shades.filter(|line| attribute(line, "height") > 50.0);
        panels.map(|line| (attribute(line, "x"), attribute(line, "width"))).collect()
    };
    let marked = pushes(&svg);
    assert_eq!(marked.len(), 4, "{marked:?}");
    for (x, wide) in marked {
        // Numbers in the file have two decimals.
        assert!((x - (56.0 + 0.75 * width)).abs() < 0.01 && (wide - 0.075 * width).abs() < 0.01, "{x} {wide}");
    }
    // The log of a real robot: the estimate is the measurement, and pushes are unknown.
    let (not_drawn, svg) = drawn("real", &["GROUND_TRUTH"]);
    assert_eq!((not_drawn.len(), pushes(&svg).len()), (0, 0));
    assert!(svg.contains(">error [rad]</text>") && !svg.contains(">truth</text>"));
    let (not_drawn, svg) = drawn("no_reference", &["BASE_TRACKING"]);
    assert_eq!((not_drawn[0].needs.as_str(), svg.as_str()), ("BASE_TRACKING", ""));
}

#[test]
fn other_robots_and_logs_with_few_channels_give_the_possible_figures() {
    for (name, joints, without) in [
        ("arm", 19, &["LEG_STATE", "CONTACT_ESTIMATE", "GROUND_TRUTH", "WBC_SOLUTION", "BASE_TRACKING"] as &[_]),
        ("no_joints", 0, &[]),
        (
            "inputs",
            12,
            &[
                "LEG_STATE",
                "CONTACT_ESTIMATE",
                "GROUND_TRUTH",
                "WBC_SOLUTION",
                "BASE_TRACKING",
                "CONTROLLER_TICK",
                "ROBOT_COMMAND",
                "TIMING",
                "RUN_INFO",
            ],
        ),
        (
            "truth",
            12,
            &[
                "LEG_STATE",
                "CONTACT_ESTIMATE",
                "WBC_SOLUTION",
                "BASE_TRACKING",
                "CONTROLLER_TICK",
                "CONTROLLER_INPUT",
                "ROBOT_COMMAND",
                "TIMING",
            ],
        ),
        (
            "timing",
            12,
            &[
                "LEG_STATE",
                "CONTACT_ESTIMATE",
                "GROUND_TRUTH",
                "WBC_SOLUTION",
                "BASE_TRACKING",
                "CONTROLLER_TICK",
                "CONTROLLER_INPUT",
                "ROBOT_COMMAND",
                "RUN_INFO",
            ],
        ),
    ] {
        let dir = scratch(&format!("robust_{name}"));
        let log = dir.join("run.mcap");
        write(&log, &Plan { ticks: 1800, joints, without, gap: 1200..1300, ..Plan::default() });
        let report = report_with(&[log], &dir, &quick(), &mut |_| ()).unwrap();
        let page = std::fs::read_to_string(&report.html).unwrap();
        for channel in without {
            assert!(report.metrics.missing_channels.contains(channel), "{name}: {channel}");
        }
        for missing in &report.not_drawn {
            assert!(page.contains(&format!("Figure “{}” is not drawn", missing.title)), "{name}: {}", missing.title);
        }
        assert_eq!(
            page.matches("<svg ").count(),
            15 - report.not_drawn.len() + usize::from(dir.join("walk.svg").exists()),
            "{name}"
        );
        assert!(!page.contains("NaN") && !page.contains(">inf"), "{name}");
        let drawn = |figure: &str| report.not_drawn.iter().all(|missing| missing.name != figure);
        assert_eq!(drawn("joint_torque"), joints > 0 && !["truth", "timing"].contains(&name), "{name}");
        assert_eq!(drawn("timing"), !["inputs", "truth"].contains(&name), "{name}");
        assert!(page.contains("100 ticks are missing in the log"), "{name}");
    }
}
