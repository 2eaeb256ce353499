//! Data frames of a synthetic log.

mod common;

use analysis::export::ExportFormat;
use analysis::fields::Field;
use analysis::{Error, Frames, Run};
use common::{Plan, RPY_ERROR, scratch, write};
use lcmtypes::{ComponentState, ControllerInput, Message, OperatorCommand, RobotState, Running, TickInput};
use polars::prelude::{ParquetReader, SerReader};

#[test]
fn a_channel_is_a_frame_with_one_column_per_field() {
    let log = scratch("frame").join("run.mcap");
    write(&log, &Plan { ticks: 50, ..Plan::default() });
    let frames = Frames::read(&log, |channel| channel != "TIMING", &mut |_| ()).unwrap();
    let tracking = frames.get("BASE_TRACKING").unwrap();
    assert_eq!(tracking.height(), 50);
    let column = |name: &str| tracking.column(name).unwrap().f64().unwrap().get(20).unwrap();
    assert!((column("rpy_des[1]") - column("rpy_est[1]") - 0.5 * RPY_ERROR[1]).abs() < 1e-15);
    let truth = frames.get("GROUND_TRUTH").unwrap();
    assert_eq!(truth.column("p_WF[3][2]").unwrap().f64().unwrap().get(0), Some(0.0));
    assert_eq!(truth.column("contact[0]").unwrap().i64().unwrap().get(0), Some(1));
    assert_eq!(frames.get("RUN_INFO").unwrap().column("robot").unwrap().str().unwrap().get(0), Some("hyq"));
    let units = frames.units("BASE_TRACKING");
    assert_eq!((units["height_des"].as_str(), units["w_WB_W_des"].as_str()), ("m", "rad/s"));
    match frames.get("TIMING") {
        Err(Error::NoSuchChannel { channel, found }) => assert!(channel == "TIMING" && found.contains("LEG_STATE")),
        other => panic!("expected NoSuchChannel, found {other:?}"),
    }
}

#[test]
fn joined_rows_have_equal_times_and_gaps_are_null() {
    let log = scratch("joined").join("run.lcmlog");
    write(&log, &Plan { ticks: 30, ..Plan::default() });
    let short = scratch("joined_gap").join("run.lcmlog");
    write(&short, &Plan { ticks: 30, gap: 10..12, ..Plan::default() });
    let frames = Frames::read(&log, |_| true, &mut |_| ()).unwrap();
    let joined = frames.joined(&["CONTROLLER_TICK", "GROUND_TRUTH", "EVENT"]);
    assert!(matches!(joined, Err(Error::NoSuchChannel { .. })), "this log has no EVENT");
    let joined = frames.joined(&["CONTROLLER_TICK", "GROUND_TRUTH"]).unwrap();
    let times = |name: &str| joined.column(name).unwrap().i64().unwrap().iter().collect::<Vec<_>>();
    assert_eq!(times("CONTROLLER_TICK.t_ns"), times("GROUND_TRUTH.t_ns"));
    // RUN_INFO has one message, at time 0: all other rows are null.
    let joined = frames.joined(&["GROUND_TRUTH", "RUN_INFO"]).unwrap();
    assert_eq!(joined.column("RUN_INFO.seed").unwrap().null_count(), 29);
    assert_eq!(Frames::read(&short, |_| true, &mut |_| ()).unwrap().get("GROUND_TRUTH").unwrap().height(), 28);
}

#[test]
fn parquet_reads_back_equal() {
    let dir = scratch("parquet");
    let log = dir.join("run.mcap");
    write(&log, &Plan { ticks: 100, ..Plan::default() });
    let mut frames = Frames::read(&log, |_| true, &mut |_| ()).unwrap();
    let files = frames.write_parquet(&dir.join("frames")).unwrap();
    assert_eq!(files.len(), 10);
    let file = std::fs::File::open(dir.join("frames/GROUND_TRUTH.parquet")).unwrap();
    assert!(ParquetReader::new(file).finish().unwrap().equals_missing(frames.get("GROUND_TRUTH").unwrap()));
}

#[test]
fn ticks_stand_side_by_side_with_their_units_in_the_file() {
    let dir = scratch("ticks");
    let log = dir.join("run.mcap");
    write(&log, &Plan { ticks: 60, truth_gap: 20..23, ..Plan::default() });
    let frames = Frames::read(&log, |_| true, &mut |_| ()).unwrap();
    let (ticks, units) = frames.ticks().unwrap();
    assert_eq!((ticks.height(), ticks.column("GROUND_TRUTH.p_WB[0]").unwrap().null_count()), (60, 3));
    let unit = |column: &str| units.get(column).map(String::as_str);
    assert_eq!(unit("CONTROLLER_INPUT.state.qd[7]"), Some("rad/s, m/s"));
    assert_eq!((unit("GROUND_TRUTH.p_WF[2][1]"), unit("BASE_TRACKING.log_t_ns")), (Some("m"), Some("ns")));
    assert_eq!((unit("CONTROLLER_INPUT.op.v_H[1]"), unit("CONTROLLER_INPUT.op.roll")), (Some("m/s"), Some("rad")));
    let out = dir.join("ticks.parquet");
    let types = replay::log::Types::default();
    analysis::export::export(&log, &out, ExportFormat::Ticks, types, |_| true, &mut |_| ()).unwrap();
    // A footer keeps its metadata as plain text: key, then value.
    let bytes = std::fs::read(&out).unwrap();
    let text = b"\"CONTROLLER_INPUT.state.qd[7]\":\"rad/s, m/s\"";
    assert!(bytes.windows(text.len()).any(|window| window == text));
}

/// A part of a log begins with the state before it, which contains the messages that hold: RUNNING and commands come only when they change.
#[test]
fn a_part_of_a_log_has_the_input_that_holds() {
    let dir = scratch("held");
    let log = dir.join("part.mcap");
    let held = |tick: i64, running: i64| {
        let state = RobotState { t_ns: tick * 1000, seq: 42, ..RobotState::zeros(1, 1, 0) };
        let op = OperatorCommand { seq: 7, ..OperatorCommand::default() };
        let input = TickInput { t_ns: tick * 1000, tick, running, t_op_ns: 5, state, op, ..TickInput::default() };
        encoded(&ComponentState { t_ns: input.t_ns, tick, input, ..ComponentState::default() })
    };
    let input = |tick: i64, running: Option<i64>| {
        let mut input = ControllerInput { t_ns: tick * 1000, tick, ..ControllerInput::default() };
        if let Some(running) = running {
            input.deliver("RUNNING", 0, &Running { running, ..Running::default() }).unwrap();
        }
        encoded(&input)
    };
    // Ticks 13 to 19 are lost.
    let events = [
        ("CONTROLLER_SNAPSHOT", 9, held(9, 1)),
        ("CONTROLLER_INPUT", 10, input(10, None)),
        ("CONTROLLER_INPUT", 11, input(11, Some(3))),
        ("CONTROLLER_INPUT", 12, input(12, None)),
        ("CONTROLLER_SNAPSHOT", 20, held(20, 5)),
        ("CONTROLLER_INPUT", 21, input(21, None)),
        // Late, after the input of a later tick.
        ("CONTROLLER_SNAPSHOT", 20, held(20, 8)),
        ("CONTROLLER_INPUT", 22, input(22, None)),
    ];
    let mut writer = replay::log::LogWriter::create(&log).unwrap();
    for (channel, tick, data) in &events {
        writer.write(channel, tick * 1000, data).unwrap();
    }
    writer.finish().unwrap();
    let frames = Frames::read(&log, |channel| channel == "CONTROLLER_INPUT", &mut |_| ()).unwrap();
    assert_eq!(frames.names().collect::<Vec<_>>(), ["CONTROLLER_INPUT"]);
    let frame = frames.get("CONTROLLER_INPUT").unwrap();
    let column = |name: &str| frame.column(name).unwrap().i64().unwrap().iter().map(Option::unwrap).collect::<Vec<_>>();
    assert_eq!(column("running"), [1, 3, 3, 5, 5]);
    assert_eq!([column("op.seq"), column("t_op_ns"), column("state.seq")], [[7; 5], [5; 5], [42; 5]].map(Vec::from));
    // The same in a report and in the time series of its figures.
    let field = Field::parse("CONTROLLER_INPUT.running").unwrap();
    let run = Run::read_with(&log, std::slice::from_ref(&field), &mut |_| ()).unwrap();
    assert_eq!(run.fields[&field.to_string()].values, [1.0, 3.0, 3.0, 5.0, 5.0]);
    let found: Vec<_> = run.ticks.iter().map(|tick| tick.consumed.map(|consumed| consumed.seq)).collect();
    assert_eq!(found, [Some(42); 5]);
}

fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).expect("the lengths are those of the arrays");
    bytes
}
