//! Types and losses in a log.
#![allow(clippy::unwrap_used, reason = "test code")]

mod common;

use lcm_idl::TypeSet;
use lcmtypes::{ControllerInput, Message, RobotState, channels};
use replay::log::{Format, LogSummary, LogWriter, Types};

fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).unwrap();
    bytes
}

/// A channel's schema alone, parsed as one `.lcm` text, decodes its messages.
#[test]
fn an_mcap_contains_the_types_of_its_messages() {
    let path = common::path("schemas.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    let input = ControllerInput { t_ns: 1000, tick: 7, ..Default::default() };
    log.write(channels::CONTROLLER_INPUT, 1000, &encoded(&input)).unwrap();
    // A known type on a channel that the channel table does not list, and bytes that are no LCM message.
    log.write("ELSEWHERE", 2000, &encoded(&RobotState::default())).unwrap();
    log.write("BLOB", 3000, b"blob").unwrap();
    log.finish().unwrap();

    let bytes = std::fs::read(path).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
    let schema = |i: usize| messages[i].channel.schema.as_ref().unwrap();
    assert_eq!((&*schema(0).name, &*schema(0).encoding), ("hoofprint.controller_input_t", "lcm"));
    let text = std::str::from_utf8(&schema(0).data).unwrap();
    let types = TypeSet::parse([("schema", text)]).unwrap();
    let (ty, value) = types.decode(&messages[0].data).unwrap();
    assert_eq!((ty.name(), value.get("tick").and_then(|v| v.as_i64())), ("hoofprint.controller_input_t", Some(7)));
    // Only the type and its two nested types.
    assert_eq!(types.types().count(), 3);
    assert_eq!(schema(1).name, "hoofprint.robot_state_t");
    assert_eq!(messages[2].channel.schema, None);
}

/// What cannot be read in a folder of types is named, and the other types are used. A pipe is not opened: that would wait for its writer.
#[test]
fn a_folder_of_types_may_contain_anything() {
    let folder = common::path("odd_types");
    std::fs::remove_dir_all(&folder).ok();
    std::fs::create_dir_all(folder.join("folder.lcm")).unwrap();
    std::fs::write(folder.join("good.lcm"), "package p; struct good_t { int32_t a; }").unwrap();
    std::fs::write(folder.join("latin.lcm"), b"// \xe9").unwrap();
    for (link, to) in
        [("dangling.lcm", "nowhere"), ("endless.lcm", "/dev/zero"), ("loop", "."), ("self.lcm", "self.lcm")]
    {
        std::os::unix::fs::symlink(to, folder.join(link)).unwrap();
    }
    // A sparse file.
    std::fs::File::create(folder.join("large.lcm")).unwrap().set_len((64 << 20) + 1).unwrap();
    let pipe = folder.join("pipe.lcm");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let types = Types::from_files(std::slice::from_ref(&folder)).unwrap();
    let bytes = TypeSet::parse([("p", "package p; struct good_t { int32_t a; }")]).unwrap();
    let good = bytes.by_name("p.good_t").unwrap();
    let message = good.encode(&good.default_value()).unwrap();
    assert_eq!(types.of_message("ANY", &message).map(|ty| ty.name().to_owned()).as_deref(), Some("p.good_t"));
    let warned = |name: &str| types.warnings().iter().filter(|warning| warning.contains(name)).count();
    let names =
        ["good.lcm", "folder.lcm", "latin.lcm", "dangling.lcm", "endless.lcm", "self.lcm", "pipe.lcm", "large.lcm"];
    assert_eq!(names.map(warned), [0, 0, 1, 1, 1, 1, 1, 1], "{:?}", types.warnings());
}

#[test]
fn types_of_another_project_can_be_added() {
    let source = ("imu.lcm".to_owned(), "package other; struct imu_t { int64_t utime; double a[3]; }".to_owned());
    let types = TypeSet::parse([(&*source.0, &*source.1)]).unwrap();
    let imu = types.by_name("other.imu_t").unwrap();
    let path = common::path("elsewhere.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    log.add_types(&[source]).unwrap();
    log.write("IMU", 0, &imu.encode(&imu.default_value()).unwrap()).unwrap();
    log.finish().unwrap();
    let bytes = std::fs::read(path).unwrap();
    let message = mcap::MessageStream::new(&bytes).unwrap().next().unwrap().unwrap();
    assert_eq!(message.channel.schema.as_ref().unwrap().name, "other.imu_t");
}

#[test]
fn a_summary_counts_messages_and_losses() {
    for (name, format) in [("summary.lcmlog", Format::LcmLog), ("summary.mcap", Format::Mcap)] {
        let path = common::path(name);
        let mut log = LogWriter::create(&path).unwrap();
        for seq in (0..100).filter(|seq| ![17, 18, 60].contains(seq)) {
            let state = RobotState { t_ns: seq * 10_000_000, seq, ..Default::default() };
            log.write(channels::ROBOT_STATE, state.t_ns, &encoded(&state)).unwrap();
        }
        log.write("BLOB", 5_000_000, b"blob").unwrap();
        log.finish().unwrap();

        let summary = LogSummary::read(&path).unwrap();
        assert_eq!((summary.format, summary.events, summary.lost), (format, 98, 3));
        assert_eq!((summary.damaged, summary.cut, summary.bytes_skipped), (0, false, 0));
        assert_eq!(summary.bytes, std::fs::metadata(&path).unwrap().len());
        assert_eq!(summary.duration_s, 990_000_000.0 * 1e-9);
        let [blob, state] = &summary.channels[..] else { panic!("{:?}", summary.channels) };
        assert_eq!(
            (&*blob.name, &blob.type_name, &blob.fingerprint, blob.count, blob.bytes),
            ("BLOB", &None, &None, 1, 4)
        );
        assert_eq!(state.type_name.as_deref(), Some("hoofprint.robot_state_t"));
        assert_eq!(state.fingerprint.as_deref(), Some(&*format!("{:016x}", RobotState::FINGERPRINT)));
        assert_eq!((state.count, state.lost), (97, Some(3)));
        assert!((state.rate_hz - 96.0 / 0.99).abs() < 1e-9, "{}", state.rate_hz);
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!(json["channels"][1]["type"], "hoofprint.robot_state_t");
    }
}
