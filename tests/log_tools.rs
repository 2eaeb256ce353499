//! `hoof log` on golden logs, on damaged logs, and on logs of another project.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, events, folder, hoof, rewrite};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, RUN_INFO};
use replay::log::LogWriter;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

const GOLDEN: [&str; 2] = ["logs/golden/flat_trot.mcap", "logs/golden/rough_trot.mcap"];

/// A copy of a golden log in another format.
fn converted(folder: &Path, name: &str) -> PathBuf {
    let out = folder.join(name);
    hoof(&format!("log convert {} {}", GOLDEN[1], out.display())).exits(0);
    out
}

fn bytes(path: impl AsRef<Path>) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn conversion_is_lossless_in_both_directions() {
    let folder = folder("conversion");
    for (i, golden) in GOLDEN.into_iter().enumerate() {
        let path = |ending: &str| folder.join(format!("{i}.{ending}"));
        let (a, b, c) = (path("lcmlog"), path("mcap"), path("again.lcmlog"));
        for (from, to) in [(Path::new(golden), &a), (&a, &b), (&b, &c)] {
            let copied = hoof(&format!("log convert {} {} --json", from.display(), to.display())).exits(0).json();
            assert_eq!(copied["events"], events(from).len());
        }
        // MCAP -> event log -> MCAP and event log -> MCAP -> event log: the same bytes.
        assert!(bytes(golden) == bytes(&b), "{golden}");
        assert!(bytes(&a) == bytes(&c), "{golden}");
        let strip = |path: &Path| {
            let of = |e: replay::log::Event| (e.channel, e.t_ns, e.number, e.data);
            events(path).into_iter().map(of).collect::<Vec<_>>()
        };
        assert!(strip(Path::new(golden)) == strip(&a), "{golden}");
    }
}

/// Event numbers of any size and times in nanoseconds are kept in an MCAP; an event log reports how many times it rounded.
#[test]
fn event_numbers_are_kept_and_rounded_times_are_counted() {
    let folder = folder("numbers");
    let (log, mcap, again) = (folder.join("a.lcmlog"), folder.join("a.mcap"), folder.join("b.lcmlog"));
    let mut out = LogWriter::create(&log).unwrap();
    for number in [0, 1, i64::from(u32::MAX), i64::from(u32::MAX) + 1, 7, -1, i64::MIN, i64::MAX] {
        out.write_numbered("CH", 5000, number, b"data").unwrap();
    }
    out.finish().unwrap();
    hoof(&format!("log convert {} {}", log.display(), mcap.display())).exits(0);
    hoof(&format!("log convert {} {}", mcap.display(), again.display())).exits(0);
    assert!(bytes(&log) == bytes(&again));

    let mut out = LogWriter::create(&mcap).unwrap();
    out.write("CH", 5001, b"data").unwrap();
    out.finish().unwrap();
    let copied = hoof(&format!("log convert {} {} --json", mcap.display(), log.display())).exits(3).json();
    assert_eq!((&copied["events"], &copied["times_rounded"]), (&1.into(), &1.into()));
}

#[test]
fn an_excerpt_replays_from_the_middle_of_the_run() {
    let folder = folder("excerpt");
    let run = folder.join("run.mcap");
    let sim = "sim --robot hyq --scenario scenarios/short_flat.toml --seconds 2";
    hoof(&format!("{sim} --log {}", run.display())).exits(0);
    for ending in ["mcap", "lcmlog"] {
        let excerpt = folder.join(format!("excerpt.{ending}"));
        let trim = format!("log trim {} {}", run.display(), excerpt.display());
        hoof(&format!("{trim} --around 1.4s --before 0.2 --after 0.3")).exits(0);
        let report = hoof(&format!("replay {} --json", excerpt.display())).exits(0).json();
        assert_eq!((&report["identical"], &report["skipped_ticks"]), (&true.into(), &0.into()), "{report:#}");
        // Snapshots are at whole seconds: from the one at 1 s to 1.7 s.
        assert_eq!(report["ticks"], 700);
        let report = hoof(&format!("log verify {} --json", excerpt.display())).exits(0).json();
        assert_eq!((&report["good"], &report["replay"]["first_tick"]), (&true.into(), &1001.into()));
        assert!(bytes(&excerpt).len() < 5_000_000);
    }
    // A recorder can run long before the controller starts: times count from the first tick, as in a replay.
    let (early, excerpt) = (folder.join("early.mcap"), folder.join("early_excerpt.mcap"));
    rewrite(&run, &early, |event| event.t_ns += if *event.channel == *RUN_INFO { 0 } else { 5_000_000_000 });
    hoof(&format!("log trim {} {} --around 1.4s --before 0.2 --after 0.3", early.display(), excerpt.display()))
        .exits(0);
    let report = hoof(&format!("replay {} --json", excerpt.display())).exits(0).json();
    assert_eq!((&report["identical"], &report["ticks"]), (&true.into(), &700.into()), "{report:#}");

    let nowhere = folder.join("nowhere.mcap");
    let late = hoof(&format!("log trim {} {} --around 9", run.display(), nowhere.display())).exits(2);
    assert!(["run.mcap", "9 s", "1.999 s"].iter().all(|part| late.stderr.contains(part)), "{}", late.stderr);
    assert!(!nowhere.exists(), "the output was created");
}

#[test]
fn filter_and_trim_copy_the_selected_events() {
    let folder = folder("filter");
    let log = converted(&folder, "run.lcmlog");
    let out = folder.join("out.mcap");
    let filter = format!("log filter {} {}", log.display(), out.display());
    let copied =
        hoof(&format!("{filter} --channels EVENT|CONTROLLER_TICK --from 0.5 --to 0.6s --json")).exits(0).json();
    let found = events(&out);
    assert_eq!(found.len(), 101);
    assert!(found.iter().all(|e| &*e.channel == CONTROLLER_TICK && (500_000_000..=600_000_000).contains(&e.t_ns)));
    assert_eq!((&copied["events"], &copied["left_out"]), (&101.into(), &(events(&log).len() - 101).into()));
    hoof(&format!("{filter} --exclude CONTROLLER.*")).exits(0);
    let left: Vec<_> = events(&out).iter().map(|e| e.channel.to_string()).collect();
    assert!(left.iter().any(|name| name == RUN_INFO) && !left.iter().any(|name| name.starts_with("CONTROLLER")));
    hoof(&format!("log trim {} {} --to 0.1", log.display(), out.display())).exits(0);
    assert_eq!(events(&out).iter().filter(|e| &*e.channel == CONTROLLER_INPUT).count(), 101);
    assert_eq!(hoof(&format!("replay {} --json", out.display())).exits(0).json()["ticks"], 101);
    // A selection with the inputs keeps what a replay needs, without --only.
    let channels = |which: &str| {
        hoof(&format!("{filter} {which}")).exits(0);
        events(&out).iter().map(|e| e.channel.to_string()).collect::<std::collections::BTreeSet<_>>()
    };
    let kept = channels("--channels CONTROLLER_INPUT|ROBOT_COMMAND");
    assert!([RUN_INFO, "CONTROLLER_SNAPSHOT"].iter().all(|name| kept.contains(*name)), "{kept:?}");
    hoof(&format!("replay {}", out.display())).exits(0);
    let only = [CONTROLLER_INPUT.to_owned(), "ROBOT_COMMAND".to_owned()];
    assert!(channels("--channels CONTROLLER_INPUT|ROBOT_COMMAND --only").iter().eq(&only));
    assert!(!channels("--channels CONTROLLER_.* --exclude CONTROLLER_SNAPSHOT").contains("CONTROLLER_SNAPSHOT"));
    for (arguments, parts) in [
        (format!("{filter} --channels ("), ["\"(\"", "channel"]),
        (format!("{filter} --from 3 --to 2"), ["--from 3", "--to 2"]),
        (format!("{filter} --from soon"), ["--from", "soon"]),
        (format!("log filter {0} {0}", log.display()), ["run.lcmlog", "same file"]),
        (format!("log convert {0} {0} --to mat", log.display()), ["run.lcmlog", "same file"]),
        (format!("log cat {} --follow --run 1", log.display()), ["--follow", "--run"]),
        (format!("log trim {} {}", log.display(), out.display()), ["--from", "--around"]),
    ] {
        let ran = hoof(&arguments).exits(2);
        assert!(parts.iter().all(|part| ran.stderr.contains(part)), "{arguments}: {}", ran.stderr);
    }
}

/// A log whose messages have other versions of the types is trimmed by the times of its events.
#[test]
fn a_log_of_other_types_is_trimmed_by_time() {
    let folder = folder("trim_other_types");
    let (old, out) = (folder.join("old.mcap"), folder.join("out.mcap"));
    rewrite(Path::new(GOLDEN[0]), &old, |event| event.data[7] ^= 1);
    hoof(&format!("log trim {} {} --from 0.2 --to 0.3", old.display(), out.display())).exits(0);
    let found = events(&out);
    assert_eq!(found.iter().filter(|e| &*e.channel == CONTROLLER_INPUT).count(), 101);
    assert_eq!(found.iter().filter(|e| &*e.channel == RUN_INFO).count(), 1);
    hoof(&format!("log trim {} {} --around 0.2", old.display(), folder.join("no.mcap").display())).exits(2);
}

/// A run that the log does not contain is an error of every command that reads it.
#[test]
fn a_run_that_a_log_lacks_is_an_error() {
    let out = folder("no_such_run").join("out.mcap");
    for command in ["log info", "log cat", "log verify", "replay"] {
        let stderr = hoof(&format!("{command} {} --run 2", GOLDEN[0])).exits(2).stderr;
        assert!(["no run 2", "runs in the log: 1"].iter().all(|part| stderr.contains(part)), "{command}: {stderr}");
    }
    hoof(&format!("log filter {} {} --run 2", GOLDEN[0], out.display())).exits(2);
    hoof(&format!("log convert {} {} --to-types lcmtypes --run 2", GOLDEN[0], out.display())).exits(2);
}

#[test]
fn merge_sorts_by_time_and_recover_copies_every_readable_event() {
    let folder = folder("merge");
    let log = converted(&folder, "run.lcmlog");
    let path = |name: &str| folder.join(name);
    let split = |which: &str, out: &str| {
        hoof(&format!("log filter {} {} {which}", log.display(), path(out).display())).exits(0);
    };
    split("--channels CONTROLLER_TICK", "ticks.mcap");
    split("--exclude CONTROLLER_TICK", "rest.lcmlog");
    let merged = path("merged.lcmlog");
    let logs = format!("{} {}", path("rest.lcmlog").display(), path("ticks.mcap").display());
    hoof(&format!("log merge {logs} --out {}", merged.display())).exits(0);
    let times: Vec<_> = events(&merged).iter().map(|e| e.t_ns).collect();
    assert!(times.is_sorted() && times.len() == events(&log).len());
    assert!(events(&merged).iter().map(|e| e.number).eq(0..times.len() as i64));
    hoof(&format!("replay {}", merged.display())).exits(0);
    hoof(&format!("log diff {} {}", log.display(), merged.display())).exits(0);

    let mut damaged = bytes(&log);
    let middle = damaged.len() / 2;
    // From the sync word of an event on: zeros inside its data would not be damage.
    let at = middle + damaged[middle..].windows(4).position(|word| word == [0xed, 0xa1, 0xda, 0x01]).unwrap();
    damaged[at..at + 1000].fill(0);
    damaged.truncate(at * 3 / 2);
    std::fs::write(path("damaged.lcmlog"), &damaged).unwrap();
    let recovered = path("recovered.mcap");
    let command = format!("log recover {} {} --json", path("damaged.lcmlog").display(), recovered.display());
    let copied = hoof(&command).exits(3).json();
    assert_eq!(copied["events"], events(&recovered).len());
    let skipped = copied["bytes_skipped"].as_u64().unwrap();
    // The first zeros are in the data of an event, which has no checksum in this format.
    assert!((500..4000).contains(&skipped), "{skipped} bytes");
    assert_eq!((&copied["cut"], copied["damaged"].as_u64().unwrap() > 0), (&true.into(), true));
}

#[test]
fn verify_lists_each_gap() {
    let folder = folder("verify");
    let log = folder.join("holes.mcap");
    let mut out = LogWriter::create(&log).unwrap();
    let missing = |tick: i64| [17, 18, 19, 1500].contains(&tick);
    for event in events(Path::new(GOLDEN[0])) {
        let tick = event.data.get(16..24).map_or(-1, |b| i64::from_be_bytes(b.try_into().unwrap()));
        if &*event.channel != CONTROLLER_INPUT || !missing(tick) {
            out.write(&event.channel, event.t_ns, &event.data).unwrap();
        }
    }
    out.finish().unwrap();
    let report = hoof(&format!("log verify {} --json", log.display())).exits(1).json();
    assert_eq!((&report["good"], &report["lost"]), (&false.into(), &4.into()));
    let channel = report["channels"].as_array().unwrap().iter().find(|c| c["name"] == CONTROLLER_INPUT).unwrap();
    let gap = |i: usize| {
        [&channel["gaps"][i]["first"], &channel["gaps"][i]["last"], &channel["gaps"][i]["t_ns"]]
            .map(|v| v.as_i64().unwrap())
    };
    assert_eq!((gap(0), gap(1)), ([17, 19, 20_000_000], [1500, 1500, 1_501_000_000]));
    assert_eq!((&report["replay"]["complete"], &report["replay"]["missing"]), (&false.into(), &4.into()));
    let text = hoof(&format!("log verify {}", log.display())).exits(1).stdout;
    assert!(text.contains("0.020000 s") && text.contains("17 to 19"), "{text}");
    for golden in GOLDEN {
        assert_eq!(hoof(&format!("log verify {golden} --json")).exits(0).json()["replay"]["complete"], true);
    }
    std::fs::write(&log, &bytes(GOLDEN[0])[..100_000]).unwrap();
    hoof(&format!("log verify {}", log.display())).exits(3);
}

#[test]
fn diff_reports_the_first_field_and_counts_missing_messages_separately() {
    let folder = folder("diff");
    let log = folder.join("other.mcap");
    let mut ticks = 0;
    rewrite(Path::new(GOLDEN[0]), &log, |event| {
        if &*event.channel == CONTROLLER_TICK {
            ticks += 1;
            if ticks == 1235 {
                // The last byte of digest_parameters.
                *event.data.last_mut().unwrap() ^= 1;
            }
        }
    });
    let diff = hoof(&format!("log diff {} {} --json", GOLDEN[0], log.display())).exits(1).json();
    let channel = |name: &str, diff: &Value| {
        diff["channels"].as_array().unwrap().iter().find(|c| c["name"] == name).unwrap().clone()
    };
    let tick = channel(CONTROLLER_TICK, &diff);
    assert_eq!((&tick["different"], &tick["first"]["number"]), (&1.into(), &1234.into()));
    assert_eq!(tick["first"]["field"], "digest_parameters");
    assert_eq!(channel(CONTROLLER_INPUT, &diff)["identical"], true);

    let mut out = LogWriter::create(&log).unwrap();
    for event in events(Path::new(GOLDEN[0])).iter().filter(|e| &*e.channel != CONTROLLER_TICK || e.t_ns != 40_000_000)
    {
        out.write(&event.channel, event.t_ns, &event.data).unwrap();
    }
    out.finish().unwrap();
    let diff = hoof(&format!("log diff {} {} --json", GOLDEN[0], log.display())).exits(1).json();
    let tick = channel(CONTROLLER_TICK, &diff);
    assert_eq!((&tick["left_only"], &tick["different"]), (&1.into(), &0.into()));
    assert_eq!(tick["first"]["number"], 40);
    hoof(&format!("log diff {0} {0}", GOLDEN[0])).exits(0);
}

/// A log of types that are unknown to this stack.
#[test]
fn logs_of_other_projects() {
    let folder = folder("elsewhere");
    let types = folder.join("types/deeper");
    std::fs::create_dir_all(&types).unwrap();
    let text = "package other; struct imu_t { int64_t utime; int32_t n; double a[n]; string name; boolean ok; }";
    std::fs::write(types.join("imu_t.lcm"), text).unwrap();
    let set = lcm_idl::TypeSet::parse([("imu", text)]).unwrap();
    let imu = set.by_name("other.imu_t").unwrap();
    let log = folder.join("other.lcmlog");
    let mut out = LogWriter::create(&log).unwrap();
    for i in 0..3_i64 {
        let mut value = imu.default_value();
        value.set("utime", i).unwrap();
        value.set("n", 2_i32).unwrap();
        *value.get_mut("a").unwrap() = vec![f64::NAN, -0.5 * i as f64].into();
        value.set("name", "a \"b\"").unwrap();
        out.write("IMU", i * 1000, &imu.encode(&value).unwrap()).unwrap();
    }
    out.finish().unwrap();
    let given = format!("--lcm-types {}", folder.join("types").display());

    let unknown = hoof(&format!("log cat {} --json", log.display())).exits(0).stdout;
    let first: Value = serde_json::from_str(unknown.lines().next().unwrap()).unwrap();
    assert_eq!((&first["type"], first["bytes"].as_str().unwrap().len()), (&Value::Null, 2 * imu_length(&log)));
    let known = hoof(&format!("log cat {} --json {given}", log.display())).exits(0).stdout;
    assert!(
        known.lines().nth(2).unwrap().ends_with(
            r#""type":"other.imu_t","fields":{"utime":2,"n":2,"a":["NaN",-1.0],"name":"a \"b\"","ok":false}}"#
        ),
        "{known}"
    );
    // The types are written into an MCAP, which needs no --lcm-types afterwards.
    let mcap = folder.join("other.mcap");
    hoof(&format!("log convert {} {} {given}", log.display(), mcap.display())).exits(0);
    assert_eq!(hoof(&format!("log cat {} --json", mcap.display())).exits(0).stdout, known);
    let info = hoof(&format!("log info {} --json", mcap.display())).exits(0).json();
    assert_eq!(info["channels"][0]["type"], "other.imu_t");
    for to in ["csv", "parquet", "mat", "mcap --encoding ros2"] {
        hoof(&format!("log convert {} --to {to}", mcap.display())).exits(0);
        assert_eq!(hoof(&format!("log convert {} --to {to}", log.display())).code, 3, "{to}: types are unknown");
        hoof(&format!("log convert {} --to {to} {given}", log.display())).exits(0);
    }
    let csv = std::fs::read_to_string(folder.join("other_csv/IMU.csv")).unwrap();
    let row = csv.lines().nth(2).unwrap();
    assert_eq!(csv.lines().next().unwrap(), "log_t_ns,utime,n,a[0],a[1],name,ok");
    assert_eq!(row, r#"1000,1,2,NaN,-0.5,"a ""b""",false"#);
    for (arguments, parts) in [("--lcm-types /none", ["/none", "No such file"]), ("--lcm-types docs", ["docs", ".lcm"])]
    {
        let ran = hoof(&format!("log info {} {arguments}", log.display())).exits(2);
        assert!(parts.iter().all(|part| ran.stderr.contains(part)), "{}", ran.stderr);
    }
}

/// Names in a foreign log cannot control the terminal or forge a line of output.
#[test]
fn names_from_a_log_are_printed_escaped() {
    let folder = folder("escaped");
    let log = folder.join("foreign.mcap");
    let mut out = LogWriter::create(&log).unwrap();
    for t_ns in [0, 5] {
        out.write("A\u{1b}]0;title\u{7}\nZ\u{9b}", t_ns, b"0123456789").unwrap();
    }
    out.finish().unwrap();
    let (log, out) = (log.display(), folder.join("out.mcap"));
    let commands = [
        format!("log info {log}"),
        format!("log cat {log}"),
        format!("log verify {log}"),
        format!("log diff {log} {}", GOLDEN[0]),
        format!("log convert {log} {} --encoding ros2", out.display()),
    ];
    for command in commands {
        let ran = hoof(&command);
        for text in [&ran.stdout, &ran.stderr] {
            assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{command}: {text:?}");
            assert!(!text.lines().any(|line| line.starts_with('Z')), "{command}: {text:?}");
        }
    }
    assert!(hoof(&format!("log info {log}")).exits(0).stdout.contains("A\\u{1b}]0;title\\u{7}\\nZ\\u{9b}"));
}

fn imu_length(log: &Path) -> usize {
    events(log)[0].data.len()
}

/// `--follow` prints appended messages, and ends when an MCAP is complete.
#[test]
fn cat_follows_a_log_that_is_being_written() {
    let folder = folder("follow");
    let log = folder.join("growing.mcap");
    let mut out = LogWriter::create(&log).unwrap();
    out.write("CH", 0, b"first").unwrap();
    out.flush().unwrap();
    let log_name = log.display().to_string();
    let mut cat = command();
    cat.args(["log", "cat", "--follow", "--json", &log_name]).stdout(Stdio::piped());
    let mut cat = cat.spawn().unwrap();
    let mut lines = BufReader::new(cat.stdout.take().unwrap()).lines();
    let mut next = || serde_json::from_str::<Value>(&lines.next().unwrap().unwrap()).unwrap();
    assert_eq!(next()["bytes"], "6669727374");
    for i in 1..4 {
        out.write("CH", i * 1000, b"more").unwrap();
        out.flush().unwrap();
        assert_eq!(next()["number"], i);
    }
    out.finish().unwrap();
    assert!(cat.wait().unwrap().success());
    assert!(lines.next().is_none());
}
