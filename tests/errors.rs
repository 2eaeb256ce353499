//! Bad input ends a command with exit code 2 before anything is written. The error names the file, the key, channel or joint, the value found
//! and the values expected. These facts are asserted, the sentence around them is not. A log that is cut is replayed up to the cut: exit code 3.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, events, folder, hoof, ran, rewrite};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EVENT, ROBOT_COMMAND, RUN_INFO};
use replay::log::LogWriter;
use std::fs::File;
use std::path::{Path, PathBuf};

/// Exit code 2, nothing on standard output, and an error that contains each of `facts`: file, key, value found, values expected.
#[track_caller]
fn rejects(arguments: &str, facts: &[&str]) {
    let ran = hoof(arguments).exits(2);
    assert!(ran.stderr.starts_with("error: "), "{}", ran.stderr);
    assert_eq!(ran.stdout, "", "{arguments}");
    for fact in facts {
        assert!(ran.stderr.contains(fact), "hoof {arguments}\nfound    {}expected {fact}", ran.stderr);
    }
}

/// A folder with a valid robot and a valid scenario, for tests that make them invalid.
struct Files(PathBuf);

impl Files {
    fn new(test: &str) -> Self {
        let folder = folder(test);
        for file in ["robots/hyq/hyq.urdf", "robots/hyq/hyq.toml", "scenarios/short_flat.toml"] {
            std::fs::copy(file, folder.join(Path::new(file).file_name().unwrap())).unwrap();
        }
        Files(folder)
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

    /// Replaces `from` by `to` in `file` while `check` runs.
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
fn invalid_urdf() {
    let files = Files::new("invalid_urdf");
    let (info, sim) = (format!("robot info {}", files.path("hyq.toml")), files.sim());
    let file = files.path("hyq.urdf");
    let both = |facts: &[&str]| {
        rejects(&info, facts);
        rejects(&sim, facts);
    };
    let text = files.read("hyq.urdf");
    files.with("hyq.urdf", "</link>", "</lnk>", || both(&[&file, "\"base_link\""]));
    files.with("hyq.urdf", "name=\"", "name=", || both(&[&file, "12"]));
    files.with("hyq.urdf", "</robot>", "<link name=\"orphan\"/></robot>", || {
        both(&[&file, "base_link", "orphan"]);
    });
    files.with("hyq.urdf", "<mass value=\"", "<mass value=\"-", || both(&[&file, "mass", " -"]));
    for text in ["", "hello", &text[..text.len() / 2]] {
        files.write("hyq.urdf", text);
        both(&[&file]);
    }
    std::fs::remove_file(&file).unwrap();
    both(&[&file, "No such file"]);
    rejects(&format!("robot info {file}"), &[&file, "No such file"]);
}

#[test]
fn invalid_robot_file() {
    let files = Files::new("robot_file");
    let (info, sim) = (format!("robot info {}", files.path("hyq.toml")), files.sim());
    let file = files.path("hyq.toml");
    let with = |from: &str, to: &str, facts: &[&str]| {
        files.with("hyq.toml", from, to, || {
            for command in [&info, &sim] {
                rejects(command, &[&[&*file], facts].concat());
            }
        });
    };
    with("lf_kfe_joint", "lf_knee_joint", &["hyq", "lf_knee_joint", "lf_kfe_joint"]);
    with("lf_kfe_joint = -1.5\n", "", &["robot.posture", "lf_kfe_joint"]);
    with("\"lh_foot\"", "\"lh_hoof\"", &["hyq", "lh_hoof", "lh_foot"]);
    with("\"trunk_imu\"", "\"nose\"", &["hyq", "nose"]);
    with("duty =", "duty_factor = 0.5\nduty =", &["`duty_factor`", "`duty`", "`swing_frequency`", "42"]);
    with("duty = 0.55", "duty = 1.5", &["gait.trot.duty", "1.5", "0.5", "1"]);
    with("duty = 0.55", "duty = \"half\"", &["\"half\"", "f64"]);
    files.with("hyq.toml", "\"hyq.urdf\"", "\"horse.urdf\"", || {
        rejects(&info, &[&files.path("horse.urdf"), "No such file"])
    });
    rejects("robot info gallop", &["\"gallop\"", "robots/gallop/gallop.toml", "anymal_b", "hyq"]);
    rejects(
        &format!("sim --robot robots/hyq/hyq.urdf --scenario x --log {}", files.path("x.mcap")),
        &["robots/hyq/hyq.urdf"],
    );
    files.write("hyq.toml", b"\xff\xfe");
    rejects(&info, &[&file, "UTF-8"]);
}

#[test]
fn invalid_parameters() {
    let files = Files::new("parameters");
    let log = files.log("good.mcap");
    let (sim, replay) = (files.sim(), format!("replay {}", log.display()));
    let cases: [(&str, &[&str]); 10] = [
        ("wbc.frction=0.5", &["\"wbc.frction\"", "f_xy_max, f_z_max, f_z_min, friction,"]),
        ("friction=0.5", &["\"friction\"", "contact, foothold, gait,"]),
        ("wbc=3", &["\"wbc\"", "f_xy_max, f_z_max, f_z_min, friction,"]),
        ("wbc.friction=high", &["wbc.friction", "`high`", "`0.6`", "float"]),
        ("wbc.friction=", &["wbc.friction=", "KEY=VALUE"]),
        ("wbc.friction=-1", &["wbc.friction", "-1", "0.05 to 2"]),
        ("wbc.friction=nan", &["wbc.friction", "NaN", "0.05 to 2"]),
        ("wbc.max_iterations=2.5", &["wbc.max_iterations", "`2.5`", "`200`", "integer"]),
        ("posture.stance_kp=[1,2]", &["posture.stance_kp", "`[1,2]`", "`[500.0, 500.0, 500.0]`"]),
        ("friction", &["friction", "KEY=VALUE"]),
    ];
    for (set, facts) in cases {
        for command in [&sim, &replay] {
            rejects(&format!("{command} --set {set}"), facts);
        }
        // The key is named once, not once for each cause in the chain of errors.
        let text = hoof(&format!("{replay} --set {set}")).stderr;
        assert_eq!(text.matches(facts[0]).count(), 1, "{text}");
    }
}

#[test]
fn invalid_scenario() {
    let files = Files::new("scenario");
    let (sim, file) = (files.sim(), files.path("short_flat.toml"));
    let with = |from: &str, to: &str, facts: &[&str]| {
        files.with("short_flat.toml", from, to, || rejects(&sim, &[&[&*file], facts].concat()));
    };
    with("v_x = 0.3", "v_z = 0.3", &[".toml:18", "`v_z`", "`t_s`, `mode`, `gait`, `v_x`", "v_z = 0.3"]);
    with("duration_s = 2.0", "duration_s = -1", &[".toml:3", "duration_s", "-1", "0.001"]);
    with("friction = 0.8", "friction = nan", &[".toml:5", "friction", "NaN", "0.01", "5"]);
    with("\"flat\"", "\"moon\"", &[".toml:8", "`moon`", "`flat`"]);
    with("\"walk\"", "\"gallop\"", &["`gallop`", "`walk`"]);
    with("t_s = 1.2", "t_s = 0.05", &["operator[3].t_s", "0.05", "0.1"]);
    with("[terrain]", "[terrain", &["short_flat.toml:7"]);
    let fault = "[[fault]]\nt_s = 9.0\nduration_s = 0.1\nkind = \"nan_sensor\"\njoint = \"elbow\"\n\n[[operator]]";
    with("[[operator]]", fault, &["fault[1].joint", "\"elbow\"", "lf_haa_joint,"]);
    let push = "[[push]]\nt_s = 9.0\nduration_s = 0.1\nlink = \"tail\"\n\n[[operator]]";
    with("[[operator]]", push, &["push[1].link", "\"tail\"", "base_link, trunk,"]);
    rejects(&format!("{sim} --seconds 0"), &["--seconds", "0.001"]);
    rejects(&format!("{sim} --seconds nan"), &["--seconds", "NaN"]);
    std::fs::remove_file(&file).unwrap();
    rejects(&sim, &[&file, "No such file"]);
}

#[test]
fn paths_that_cannot_be_written() {
    let files = Files::new("places");
    let log = files.log("good.mcap");
    let log = log.display();
    let folder = files.0.display();
    let sim = "sim --robot hyq --scenario scenarios/short_flat.toml --seconds 0.1 --log";
    for end in ["run.log", "run", "mcap"] {
        rejects(&format!("{sim} {folder}/{end}"), &[&format!("{folder}/{end}"), ".lcmlog", ".mcap"]);
    }
    // No user can create a file in /proc, root included.
    rejects(&format!("{sim} /proc/hoof/run.mcap"), &["/proc/hoof: "]);
    rejects(&format!("{sim} /proc/run.mcap"), &["/proc/run.mcap: "]);
    rejects(&format!("{sim} {log}/run.mcap"), &[&format!("{log}: ")]);
    rejects(&format!("replay {log} --out /proc/run.mcap"), &["/proc/run.mcap: "]);
    rejects(&format!("replay {log} --out {log}"), &[&log.to_string()]);
    for out in [format!("{log}"), format!("{log}/report"), "/proc/report".to_owned()] {
        rejects(&format!("report {log} --out {out}"), &[&out]);
    }
    for name in ["full.mcap", "full.lcmlog"] {
        std::os::unix::fs::symlink("/dev/full", files.0.join(name)).unwrap();
        rejects(&format!("{sim} {folder}/{name}"), &[name, "No space left on device"]);
        rejects(&format!("replay {log} --out {folder}/{name}"), &[name, "No space left on device"]);
    }
}

/// No command replaces a file that it reads, also not by another name of the file.
#[test]
fn an_output_that_is_an_input() {
    let files = Files::new("in_out");
    for name in ["printed.toml", "pace.toml"] {
        let from = if name == "pace.toml" { "gaits/pace.toml" } else { "robots/hyq/printed.toml" };
        files.write(name, std::fs::read(from).unwrap());
    }
    files.log("run.mcap");
    let linked = |input: &str, name: &str| {
        std::fs::hard_link(files.path(input), files.path(name)).unwrap();
        (files.path(input), files.path(name), std::fs::read(files.path(input)).unwrap())
    };
    let is_kept = |arguments: &str, (input, output, before): &(String, String, Vec<u8>)| {
        rejects(arguments, &[output]);
        assert!(std::fs::read(input).unwrap() == *before, "{arguments}");
    };
    let gait = files.path("pace.toml");
    let sim = files.sim().replace(&files.path("run.mcap"), "");
    for input in ["hyq.toml", "hyq.urdf", "short_flat.toml", "printed.toml", "pace.toml"] {
        let file = linked(input, &format!("{input}.mcap"));
        // The gait has warnings, which come first.
        let ran = hoof(&format!("{sim}{} --preset printed --gait {gait}", file.1)).exits(2);
        assert!(ran.stderr.contains(&file.1), "{}", ran.stderr);
        assert!(std::fs::read(&file.0).unwrap() == file.2, "{input}");
    }
    let log = files.path("run.mcap");
    let plot = linked("run.mcap", "plot.svg");
    is_kept(&format!("replay {log} --set wbc.friction=0.5 --plot {}", plot.1), &plot);
    is_kept(&format!("replay {log} --sweep wbc.friction=0.5:0.6:2 --plot {}", plot.1), &plot);
    let urdf = linked("hyq.urdf", "urdf.lcmlog");
    is_kept(&format!("replay {log} --urdf {} --out {}", urdf.0, urdf.1), &urdf);
    is_kept(&format!("replay {log} --urdf {} --resim {}", urdf.0, urdf.1), &urdf);
    for name in ["metrics.json", "base_tracking.svg"] {
        let folder = format!("report_{name}");
        std::fs::create_dir(files.path(&folder)).unwrap();
        let report = linked("run.mcap", &format!("{folder}/{name}"));
        is_kept(&format!("report {log} --out {}", files.path(&folder)), &report);
    }
    files.write("types.lcm", "package p; struct t { int32_t a; }");
    let types = linked("types.lcm", "types.mat");
    is_kept(&format!("log convert {log} {} --lcm-types {}", types.1, types.0), &types);
}

/// The extension of a log selects its format, so another `--to` contradicts it.
#[test]
fn an_output_with_the_extension_of_another_format() {
    let files = Files::new("extension");
    let log = files.log("run.mcap").display().to_string();
    for (to, name) in
        [("lcmlog", "a.mcap"), ("mcap", "a.lcmlog"), ("mat", "a.mcap"), ("csv", "a.mat"), ("ticks", "a.csv")]
    {
        let out = files.path(name);
        rejects(&format!("log convert {log} --to {to} --out {out}"), &[to, &out]);
        assert!(!Path::new(&out).exists());
    }
    hoof(&format!("log convert {log} --to ticks --out {}", files.path("a.parquet"))).exits(0);
    hoof(&format!("log convert {log} --to mat --out {}", files.path("plain"))).exits(0);
}

/// A device without end is not read to its end.
#[test]
fn text_files_without_end() {
    let files = Files::new("endless");
    let endless = |name: &str| {
        std::os::unix::fs::symlink("/dev/zero", files.path(name)).unwrap();
        files.path(name)
    };
    let (toml, urdf) = (endless("endless.toml"), endless("endless.urdf"));
    rejects(&format!("robot info {toml}"), &[&toml]);
    rejects(&format!("robot init {urdf}"), &[&urdf]);
    rejects(&files.sim().replace("short_flat.toml", "endless.toml"), &[&toml]);
    rejects("robot eval hyq --state /dev/zero", &["/dev/zero"]);
    rejects("log info logs/golden/flat_trot.mcap --lcm-types /dev/zero", &["/dev/zero"]);
}

#[test]
fn files_that_are_no_log() {
    let files = Files::new("no_log");
    let good = files.log("good.mcap");
    let all = |name: &str, facts: &[&str]| {
        let path = files.path(name);
        for command in [
            format!("replay {path}"),
            format!("log info {path}"),
            format!("report {path} --out {}", files.path("report")),
        ] {
            rejects(&command, &[&[&*path], facts].concat());
        }
    };
    for ending in ["mcap", "lcmlog"] {
        all(&format!("missing.{ending}"), &["No such file"]);
        files.write(&format!("empty.{ending}"), "");
        all(&format!("empty.{ending}"), &["empty"]);
        files.write(&format!("text.{ending}"), "This is a text.\n");
        all(&format!("text.{ending}"), &["16 bytes", "54 68 69 73 20 69 73 20"]);
    }
    // A folder.
    all("", &[]);

    let part = |name: &str, keep: &[&str]| {
        let mut log = LogWriter::create(files.0.join(name)).unwrap();
        for event in events(&good).iter().filter(|event| keep.contains(&&*event.channel)) {
            log.write(&event.channel, event.t_ns, &event.data).unwrap();
        }
        log.finish().unwrap();
        files.path(name)
    };
    let no_run_info = part("no_run_info.mcap", &[CONTROLLER_INPUT]);
    rejects(&format!("replay {no_run_info}"), &[&no_run_info, RUN_INFO, "500"]);
    let no_input = part("no_input.mcap", &[RUN_INFO, EVENT]);
    rejects(&format!("replay {no_input}"), &[&no_input, CONTROLLER_INPUT]);
    rejects(&format!("report {no_input} --out {}", files.path("report")), &[&no_input, CONTROLLER_TICK]);

    let replay = format!("replay {}", good.display());
    rejects(&format!("{replay} --from 0.3 --to 0.2"), &["--from 0.3", "--to 0.2"]);
    for wrong in ["nan", "inf", "-1", "1e300", "1ms", "soon"] {
        for time in ["--from", "--to"] {
            rejects(&format!("{replay} {time} {wrong}"), &[time, wrong]);
        }
        rejects(&format!("debug {} --once --at {wrong}", good.display()), &["--at", wrong]);
    }
    hoof(&format!("{replay} --from 0.2s --to 0.3s")).exits(0);
    rejects(&format!("{replay} --jobs 0"), &["--jobs", "1..=256"]);
}

#[test]
fn a_log_with_other_message_types() {
    let files = Files::new("another_version");
    for ending in ["mcap", "lcmlog"] {
        let good = files.log(&format!("good.{ending}"));
        let other = files.0.join(format!("other.{ending}"));
        for channel in [RUN_INFO, CONTROLLER_INPUT, ROBOT_COMMAND] {
            let known = lcmtypes::channels::find(channel).unwrap();
            rewrite(&good, &other, |event| {
                if *event.channel == *channel {
                    event.data[7] ^= 1;
                }
            });
            let recorded = format!("{:016x}", known.fingerprint ^ 1);
            let today = format!("{:016x}", known.fingerprint);
            let other = other.display().to_string();
            rejects(&format!("replay {other}"), &[&other, channel, known.type_name, &recorded, &today]);
        }
        rewrite(&good, &other, |event| {
            if *event.channel == *CONTROLLER_SNAPSHOT {
                event.data[7] ^= 1;
            }
        });
        let known = lcmtypes::channels::find(CONTROLLER_SNAPSHOT).unwrap();
        let recorded = format!("{:016x}", known.fingerprint ^ 1);
        rejects(&format!("replay {}", other.display()), &[CONTROLLER_SNAPSHOT, known.type_name, &recorded]);
    }
}

#[test]
fn a_cut_log_is_replayed_up_to_the_cut() {
    let files = Files::new("cut");
    for ending in ["mcap", "lcmlog"] {
        let whole = std::fs::read(files.log(&format!("whole.{ending}"))).unwrap();
        let cut = files.path(&format!("cut.{ending}"));
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
            hoof(&format!("report {cut} --out {}", files.path("report"))).exits(3);
        }
    }
}

#[test]
fn invalid_state_of_robot_eval() {
    let files = Files::new("eval");
    let file = files.path("state.json");
    let eval = format!("robot eval hyq --state {file}");
    rejects(&eval, &[&file, "No such file"]);
    let cases: [(&str, &[&str]); 7] = [
        (r#"{"base": null, "q": {"#, &["line 1"]),
        (r#"{"base": null, "joints": {}}"#, &["`joints`", "`base`, `q`, `qd`"]),
        (r#"{"base": null}"#, &["`q`"]),
        (r#"{"base": null, "q": {"lf_haa_joint": 0}}"#, &["q.lf_hfe_joint"]),
        (r#"{"base": null, "q": {"elbow": 0}}"#, &["\"hyq\"", "\"elbow\""]),
        (r#"{"base": null, "q": {"lf_haa_joint": "bent"}}"#, &["\"bent\"", "f64"]),
        (
            r#"{"base": {"position_m": [0, 0, 0], "quaternion_wxyz": [2, 0, 0, 0]}, "q": {}}"#,
            &["base.quaternion_wxyz", "2"],
        ),
    ];
    for (state, facts) in cases {
        files.write("state.json", state);
        rejects(&eval, &[&[&*file], facts].concat());
    }
}

#[test]
fn closed_or_full_standard_output() {
    for arguments in [&["robot", "info", "hyq"][..], &["robot", "info", "hyq", "--params"], &["--version"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = ran(command().args(arguments).stdout(writer).output().unwrap());
        assert_eq!((closed.code, &*closed.stderr), (0, ""), "{arguments:?}");
    }
    let full = File::options().write(true).open("/dev/full").unwrap();
    let full = ran(command().args(["robot", "info", "hyq"]).stdout(full).output().unwrap());
    assert_eq!(full.code, 2);
    assert!(full.stderr.contains("No space left on device (os error 28)"), "{}", full.stderr);
}

#[test]
fn invalid_usage() {
    rejects("gallop", &["gallop", "--help"]);
    rejects("replay", &["<LOG>", "--help"]);
    rejects("sim --robot hyq", &["--scenario <SCENARIO>", "--log <LOG>"]);
    rejects("replay x.mcap --set", &["--set <KEY=VALUE>"]);
}
