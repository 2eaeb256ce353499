//! Data frames of a synthetic log.

mod common;

use analysis::export::ExportFormat;
use analysis::{Error, Frames};
use common::{Plan, RPY_ERROR, scratch, write};
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
