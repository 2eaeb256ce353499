//! Bad input: exit code 2, nothing done, and a message that names the file and the key, channel or joint, what was found and what was
//! expected. A log that is cut is no bad input: what is there is replayed, and exit code 3 says that it was not all.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, events, folder, hoof, ran, rewrite};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EVENT, ROBOT_COMMAND, RUN_INFO};
use replay::log::LogWriter;
use std::fs::File;
use std::path::{Path, PathBuf};

/// The command ends with exit code 2 and an error that says every one of `words`.
#[track_caller]
fn refuses(arguments: &str, words: &[&str]) {
    let ran = hoof(arguments).exits(2);
    assert!(ran.stderr.starts_with("error: "), "{}", ran.stderr);
    assert_eq!(ran.stdout, "", "{arguments}");
    for word in words {
        assert!(ran.stderr.contains(word), "hoof {arguments}\nfound    {}expected {word}", ran.stderr);
    }
}

/// A folder with a robot and a scenario that are good, to be spoiled.
struct Bench(PathBuf);

impl Bench {
    fn new(test: &str) -> Self {
        let folder = folder(test);
        for file in ["robots/hyq/hyq.urdf", "robots/hyq/hyq.toml", "scenarios/short_flat.toml"] {
            std::fs::copy(file, folder.join(Path::new(file).file_name().unwrap())).unwrap();
        }
        Bench(folder)
    }

    fn path(&self, file: &str) -> String {
        self.0.join(file).display().to_string()
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.0.join(file)).unwrap()
    }

    fn write(&self, file: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.0.join(file), bytes).unwrap();
    }

    /// `file` with `from` changed to `to`, for the time of `check`.
    #[track_caller]
    fn with(&self, file: &str, from: &str, to: &str, check: impl Fn()) {
        let text = self.read(file);
        assert!(text.contains(from), "{file} has no {from}");
        self.write(file, text.replacen(from, to, 1));
        check();
        self.write(file, text);
    }

    /// `hoof sim` in this folder.
    fn sim(&self) -> String {
        format!(
            "sim --robot {} --scenario {} --log {}",
            self.path("hyq.toml"),
            self.path("short_flat.toml"),
            self.path("run.mcap")
        )
    }

    /// A run of half a second.
    fn log(&self, name: &str) -> PathBuf {
        let log = self.0.join(name);
        let scenario = "--robot hyq --scenario scenarios/short_flat.toml --seconds 0.5";
        hoof(&format!("sim {scenario} --log {}", log.display())).exits(0);
        log
    }
}

#[test]
fn urdf() {
    let bench = Bench::new("urdf");
    let (info, sim) = (format!("robot info {}", bench.path("hyq.toml")), bench.sim());
    let file = bench.path("hyq.urdf");
    let both = |words: &[&str]| {
        refuses(&info, words);
        refuses(&sim, words);
    };
    let text = bench.read("hyq.urdf");
    bench.with("hyq.urdf", "</link>", "</lnk>", || both(&[&file, "link \"base_link\"", "not properly nested"]));
    bench.with("hyq.urdf", "name=\"", "name=", || both(&[&file, "not a URDF", "Line: 12"]));
    bench.with("hyq.urdf", "</robot>", "<link name=\"orphan\"/></robot>", || {
        both(&[&file, "links [\"base_link\", \"orphan\"] have no parent joint, expected one root"]);
    });
    bench.with("hyq.urdf", "<mass value=\"", "<mass value=\"-", || both(&[&file, "link \"", "mass", "is -"]));
    for text in ["", "hello", &text[..text.len() / 2]] {
        bench.write("hyq.urdf", text);
        both(&[&file, "not a URDF"]);
    }
    std::fs::remove_file(&file).unwrap();
    both(&[&file, "No such file"]);
    refuses(&format!("robot info {file}"), &[&file, "No such file"]);
}

#[test]
fn robot_file() {
    let bench = Bench::new("robot_file");
    let (info, sim) = (format!("robot info {}", bench.path("hyq.toml")), bench.sim());
    let file = bench.path("hyq.toml");
    let with = |from: &str, to: &str, words: &[&str]| {
        bench.with("hyq.toml", from, to, || {
            for command in [&info, &sim] {
                refuses(command, &[&[&*file], words].concat());
            }
        });
    };
    with("lf_kfe_joint", "lf_knee_joint", &["robot \"hyq\" has no joint \"lf_knee_joint\"; near: lf_kfe_joint"]);
    with("lf_kfe_joint = -1.5\n", "", &["robot.posture does not name joint lf_kfe_joint"]);
    with("\"lh_foot\"", "\"lh_hoof\"", &["robot \"hyq\" has no link \"lh_hoof\"; near: lh_foot"]);
    with("\"trunk_imu\"", "\"nose\"", &["has no link \"nose\""]);
    with(
        "duty =",
        "duty_factor = 0.5\nduty =",
        &["unknown field `duty_factor`, expected one of `duty`, `swing_frequency`", "line 42"],
    );
    with("duty = 0.55", "duty = 1.5", &["parameter gait.trot.duty is 1.5, expected at least 0.5 and below 1"]);
    with("duty = 0.55", "duty = \"half\"", &["invalid type: string \"half\", expected f64"]);
    bench.with("hyq.toml", "\"hyq.urdf\"", "\"horse.urdf\"", || {
        refuses(&info, &[&bench.path("horse.urdf"), "No such file"])
    });
    refuses("robot info gallop", &["no robot \"gallop\"", "robots/gallop/gallop.toml", "known: ", "hyq"]);
    refuses(
        &format!("sim --robot robots/hyq/hyq.urdf --scenario x --log {}", bench.path("x.mcap")),
        &["robots/hyq/hyq.urdf: a URDF alone"],
    );
    bench.write("hyq.toml", b"\xff\xfe");
    refuses(&info, &[&file, "UTF-8"]);
}

#[test]
fn parameters() {
    let bench = Bench::new("parameters");
    let log = bench.log("good.mcap");
    let (sim, replay) = (bench.sim(), format!("replay {}", log.display()));
    let cases = [
        (
            "wbc.frction=0.5",
            "unknown parameter \"wbc.frction\", in [wbc] there are: f_xy_max, f_z_max, f_z_min, friction,",
        ),
        ("friction=0.5", "unknown parameter \"friction\", at the top there are: contact, foothold, gait,"),
        ("wbc=3", "unknown parameter \"wbc\", in [wbc] there are:"),
        ("wbc.friction=high", "parameter wbc.friction: found `high`, expected a value like `0.6` (float)"),
        ("wbc.friction=", "parameter wbc.friction: found ``, expected a value like `0.6` (float)"),
        ("wbc.friction=-1", "parameter wbc.friction is -1, expected a positive number"),
        ("wbc.friction=nan", "parameter wbc.friction is NaN, expected a positive number"),
        ("wbc.max_iterations=2.5", "parameter wbc.max_iterations: found `2.5`, expected a value like `200` (integer)"),
        (
            "posture.stance_kp=[1,2]",
            "parameter posture.stance_kp: found `[1,2]`, expected a value like `[500.0, 500.0, 500.0]`",
        ),
        ("friction", "parameter friction: expected KEY=VALUE"),
    ];
    for (set, words) in cases {
        for command in [&sim, &replay] {
            refuses(&format!("{command} --set {set}"), &[words]);
        }
        // Once, not once a link of the chain of errors.
        let text = hoof(&format!("{replay} --set {set}")).stderr;
        assert_eq!(text.matches(words).count(), 1, "{text}");
    }
}

#[test]
fn scenario() {
    let bench = Bench::new("scenario");
    let (sim, file) = (bench.sim(), bench.path("short_flat.toml"));
    let with = |from: &str, to: &str, words: &[&str]| {
        bench.with("short_flat.toml", from, to, || refuses(&sim, &[&[&*file], words].concat()));
    };
    with(
        "v_x = 0.3",
        "v_z = 0.3",
        &[".toml:18: unknown field `v_z`, expected one of `t_s`, `mode`, `gait`, `v_x`", "in `v_z = 0.3`"],
    );
    with("duration_s = 2.0", "duration_s = -1", &[".toml:3: duration_s is -1, expected at least 0.001"]);
    with("friction = 0.8", "friction = nan", &[".toml:5: friction is NaN, expected at least 0.01 and at most 5"]);
    with("\"flat\"", "\"moon\"", &[".toml:8: unknown variant `moon`, expected one of `flat`"]);
    with("\"walk\"", "\"gallop\"", &["unknown variant `gallop`, expected"]);
    with("t_s = 1.2", "t_s = 0.05", &["operator[3].t_s is 0.05, expected at least 0.1"]);
    with("[terrain]", "[terrain", &["short_flat.toml:7"]);
    let fault = "[[fault]]\nt_s = 9.0\nduration_s = 0.1\nkind = \"nan_sensor\"\njoint = \"elbow\"\n\n[[operator]]";
    with("[[operator]]", fault, &["fault[1].joint: the robot has no joint \"elbow\", it has: lf_haa_joint,"]);
    let push = "[[push]]\nt_s = 9.0\nduration_s = 0.1\nlink = \"tail\"\n\n[[operator]]";
    with("[[operator]]", push, &["push[1].link: the robot has no link \"tail\", it has: base_link, trunk,"]);
    refuses(&format!("{sim} --seconds 0"), &["--seconds 0: expected at least 0.001"]);
    refuses(&format!("{sim} --seconds nan"), &["--seconds NaN"]);
    std::fs::remove_file(&file).unwrap();
    refuses(&sim, &[&file, "No such file"]);
}

#[test]
fn places_that_cannot_be_written() {
    let bench = Bench::new("places");
    let log = bench.log("good.mcap");
    let log = log.display();
    let folder = bench.0.display();
    let sim = "sim --robot hyq --scenario scenarios/short_flat.toml --seconds 0.1 --log";
    for end in ["run.log", "run", "mcap"] {
        refuses(
            &format!("{sim} {folder}/{end}"),
            &[&format!("{folder}/{end}: the name of a log ends with .lcmlog or .mcap")],
        );
    }
    // Nobody can make a file in /proc, not even root.
    refuses(&format!("{sim} /proc/hoof/run.mcap"), &["/proc/hoof: "]);
    refuses(&format!("{sim} /proc/run.mcap"), &["/proc/run.mcap: "]);
    refuses(&format!("{sim} {log}/run.mcap"), &[&format!("{log}: ")]);
    refuses(&format!("replay {log} --out /proc/run.mcap"), &["/proc/run.mcap: "]);
    refuses(&format!("replay {log} --out {log}"), &["a log cannot be read and written at the same time"]);
    for out in [format!("{log}"), format!("{log}/report"), "/proc/report".to_owned()] {
        refuses(&format!("report {log} --out {out}"), &["cannot write", &out]);
    }
    for name in ["full.mcap", "full.lcmlog"] {
        std::os::unix::fs::symlink("/dev/full", bench.0.join(name)).unwrap();
        refuses(&format!("{sim} {folder}/{name}"), &[name, "No space left on device"]);
        refuses(&format!("replay {log} --out {folder}/{name}"), &[name, "No space left on device"]);
    }
}

#[test]
fn what_is_no_log() {
    let bench = Bench::new("no_log");
    let good = bench.log("good.mcap");
    let all = |name: &str, words: &[&str]| {
        let path = bench.path(name);
        for command in [
            format!("replay {path}"),
            format!("log info {path}"),
            format!("report {path} --out {}", bench.path("report")),
        ] {
            refuses(&command, &[&[&*path], words].concat());
        }
    };
    for ending in ["mcap", "lcmlog"] {
        all(&format!("missing.{ending}"), &["No such file"]);
        bench.write(&format!("empty.{ending}"), "");
        all(&format!("empty.{ending}"), &["the file is empty"]);
        bench.write(&format!("text.{ending}"), "This is a text.\n");
        all(
            &format!("text.{ending}"),
            &["neither an LCM event log nor MCAP: 16 bytes, beginning with 54 68 69 73 20 69 73 20"],
        );
    }
    all("", &["not a regular file"]);

    let part = |name: &str, keep: &[&str]| {
        let mut log = LogWriter::create(bench.0.join(name)).unwrap();
        for event in events(&good).iter().filter(|event| keep.contains(&&*event.channel)) {
            log.write(&event.channel, event.t_ns, &event.data).unwrap();
        }
        log.finish().unwrap();
        bench.path(name)
    };
    let no_run_info = part("no_run_info.mcap", &[CONTROLLER_INPUT]);
    refuses(&format!("replay {no_run_info}"), &["no RUN_INFO among its 500 events"]);
    let no_input = part("no_input.mcap", &[RUN_INFO, EVENT]);
    refuses(&format!("replay {no_input}"), &["no CONTROLLER_INPUT, so there is nothing to replay"]);
    refuses(
        &format!("report {no_input} --out {}", bench.path("report")),
        &[&no_input, "expected at least one of", CONTROLLER_TICK],
    );

    let replay = format!("replay {}", good.display());
    refuses(&format!("{replay} --from 0.3 --to 0.2"), &["--from 0.3 is after --to 0.2"]);
    refuses(&format!("{replay} --to nan"), &["--to NaN"]);
    refuses(&format!("{replay} --jobs 0"), &["--jobs", "0 is not in 1..=256"]);
}

#[test]
fn a_log_of_another_type_version() {
    let bench = Bench::new("another_version");
    for ending in ["mcap", "lcmlog"] {
        let good = bench.log(&format!("good.{ending}"));
        let other = bench.0.join(format!("other.{ending}"));
        for channel in [RUN_INFO, CONTROLLER_INPUT, ROBOT_COMMAND] {
            let known = lcmtypes::channels::find(channel).unwrap();
            rewrite(&good, &other, |event| {
                if *event.channel == *channel {
                    event.data[7] ^= 1;
                }
            });
            let version = format!(
                "log of another type version: channel {channel}, {}: fingerprint {:016x} in the log, {:016x} today",
                known.type_name,
                known.fingerprint ^ 1,
                known.fingerprint
            );
            refuses(&format!("replay {}", other.display()), &[&other.display().to_string(), &version]);
        }
        rewrite(&good, &other, |event| {
            if *event.channel == *CONTROLLER_SNAPSHOT {
                event.data[7] ^= 1;
            }
        });
        refuses(&format!("replay {}", other.display()), &["CONTROLLER_SNAPSHOT of tick 0", "fingerprint"]);
    }
}

#[test]
fn a_log_that_is_cut_is_replayed_as_far_as_it_goes() {
    let bench = Bench::new("cut");
    for ending in ["mcap", "lcmlog"] {
        let whole = std::fs::read(bench.log(&format!("whole.{ending}"))).unwrap();
        let cut = bench.path(&format!("cut.{ending}"));
        for length in [whole.len() / 2, whole.len() * 3 / 4, whole.len() - 1] {
            std::fs::write(&cut, &whole[..length]).unwrap();
            for jobs in [1, 2] {
                let report = hoof(&format!("replay {cut} --jobs {jobs} --json")).exits(3).json();
                assert_eq!((&report["identical"], &report["cut"]), (&true.into(), &true.into()), "{report:#}");
                let ticks = report["ticks"].as_u64().unwrap();
                assert!(
                    (100..=500).contains(&ticks) && (ticks >= 499 || length < whole.len() - 1),
                    "{ticks} of 500 ticks"
                );
            }
            assert_eq!(hoof(&format!("log info {cut} --json")).exits(3).json()["cut"], true);
            let report = hoof(&format!("report {cut} --out {}", bench.path("report"))).exits(3);
            assert!(report.stdout.contains("the log is cut at byte"), "{}", report.stdout);
        }
    }
}

#[test]
fn state_of_robot_eval() {
    let bench = Bench::new("eval");
    let file = bench.path("state.json");
    let eval = format!("robot eval hyq --state {file}");
    refuses(&eval, &[&file, "No such file"]);
    let cases = [
        (r#"{"base": null, "q": {"#, "EOF while parsing an object at line 1"),
        (r#"{"base": null, "joints": {}}"#, "unknown field `joints`, expected one of `base`, `q`, `qd`"),
        (r#"{"base": null}"#, "missing field `q`"),
        (
            r#"{"base": null, "q": {"lf_haa_joint": 0}}"#,
            "q.lf_hfe_joint: found nothing, expected a number for every movable joint",
        ),
        (r#"{"base": null, "q": {"elbow": 0}}"#, "robot \"hyq\" has no joint \"elbow\""),
        (r#"{"base": null, "q": {"lf_haa_joint": "bent"}}"#, "invalid type: string \"bent\", expected f64"),
        (
            r#"{"base": {"position_m": [0, 0, 0], "quaternion_wxyz": [2, 0, 0, 0]}, "q": {}}"#,
            "base.quaternion_wxyz: found length 2, expected length one to a thousandth",
        ),
    ];
    for (state, words) in cases {
        bench.write("state.json", state);
        refuses(&eval, &[&file, words]);
    }
}

#[test]
fn standard_output_that_nobody_reads_or_that_is_full() {
    for arguments in [&["robot", "info", "hyq"][..], &["robot", "info", "hyq", "--params"], &["--version"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = ran(command().args(arguments).stdout(writer).output().unwrap());
        assert_eq!((closed.code, &*closed.stderr), (0, ""), "{arguments:?}");
    }
    let full = File::options().write(true).open("/dev/full").unwrap();
    let full = ran(command().args(["robot", "info", "hyq"]).stdout(full).output().unwrap());
    assert_eq!((full.code, &*full.stderr), (2, "error: standard output: No space left on device (os error 28)\n"));
}

#[test]
fn usage() {
    refuses("gallop", &["unrecognized subcommand 'gallop'", "--help"]);
    refuses("replay", &["<LOG>", "--help"]);
    refuses("sim --robot hyq", &["--scenario <SCENARIO>", "--log <LOG>"]);
    refuses("replay x.mcap --set", &["--set <KEY=VALUE>"]);
}
