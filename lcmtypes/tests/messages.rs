//! The generated structs: encoding, lengths, strings, and the table of channels.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use lcmtypes::channels::{CHANNELS, Class, Stage};
use lcmtypes::{
    BaseTracking, ControllerInput, ControllerTick, DecodeError, EncodeError, GroundTruth, Message, OperatorCommand,
    RobotState, RunInfo, TextFile, TickInput,
};

fn state() -> RobotState {
    RobotState {
        t_ns: -2,
        seq: 1 << 40,
        sender_id: 5,
        nj: 2,
        q: vec![0.1, f64::MIN_POSITIVE],
        qd: vec![-0.0, f64::INFINITY],
        tau: vec![1e300, -3.5],
        n_imus: 1,
        q_WI_wxyz: vec![[1.0, 0.0, 0.0, 0.0]],
        w_WI_I: vec![[1.0, 2.0, 3.0]],
        a_I: vec![[0.0, 0.0, 9.81]],
        n_ft: 2,
        f_S: vec![[1.0; 3], [2.0; 3]],
        tau_S: vec![[3.0; 3], [4.0; 3]],
    }
}

fn bytes<M: Message>(message: &M) -> Vec<u8> {
    let mut out = Vec::new();
    message.encode(&mut out).unwrap();
    out
}

#[test]
fn a_message_is_fingerprint_and_fields_big_endian() {
    let bytes = bytes(&state());
    assert_eq!(bytes.len(), 8 + 3 * 8 + 4 + 3 * 2 * 8 + 4 + (4 + 3 + 3) * 8 + 4 + 2 * 2 * 3 * 8);
    assert_eq!(bytes[..8], RobotState::FINGERPRINT.to_be_bytes());
    assert_eq!(bytes[8..16], (-2i64).to_be_bytes());
    assert_eq!(bytes[32..36], [0, 0, 0, 2]);
    assert_eq!(bytes[36..44], 0.1f64.to_bits().to_be_bytes());
    assert_eq!(RobotState::decode(&bytes).unwrap(), state());
}

#[test]
fn nested_messages_and_strings_survive_encoding() {
    let op = OperatorCommand { seq: -1, mode: OperatorCommand::MODE_WALK, v_H: [0.5, -0.25], ..Default::default() };
    let input = TickInput {
        t_ns: 7,
        tick: 3,
        run_id: 4,
        running: 1,
        t_op_ns: 6,
        n_ignored: 0,
        n_late: 0,
        state: state(),
        op: op.clone(),
    };
    assert_eq!(TickInput::decode(&bytes(&input)).unwrap(), input);

    let mut input = ControllerInput { t_ns: 7, tick: 3, run_id: 4, ..Default::default() };
    input.deliver("OPERATOR_COMMAND", 5, &OperatorCommand::default()).unwrap();
    input.deliver("ROBOT_STATE", 6, &state()).unwrap();
    input.deliver("OPERATOR_COMMAND", 6, &op).unwrap();
    let encoded = bytes(&input);
    assert_eq!(ControllerInput::decode(&encoded).unwrap(), input);
    // A longer name and more bytes than before: memory is used again, what was there is not.
    let mut again = ControllerInput::default();
    again.deliver("OPERATOR_COMMAND_OF_ANOTHER", 9, &RunInfo::default()).unwrap();
    again.decode_into(&encoded).unwrap();
    assert_eq!(again, input);
    assert_eq!(input.newest::<OperatorCommand>("OPERATOR_COMMAND"), Some(op));
    assert_eq!(input.newest::<RobotState>("OPERATOR_COMMAND"), None, "another type");
    assert!(input.change("ROBOT_STATE", |state: &mut RobotState| state.seq = 77));
    assert_eq!(input.newest::<RobotState>("ROBOT_STATE").map(|state| state.seq), Some(77));
    assert_eq!(input.messages[1].size as usize, input.messages[1].data.len());

    let file = TextFile { name: "ä.lcm".into(), text: "a\0b\n".into() };
    let info =
        RunInfo { dirty: true, num_lcm_types: 2, lcm_types: vec![file, TextFile::default()], ..Default::default() };
    assert_eq!(RunInfo::decode(&bytes(&info)).unwrap(), info);

    let truth = GroundTruth {
        n_contacts: 1,
        p_WF: vec![[1.0; 3]],
        v_WF: vec![[2.0; 3]],
        f_F_W: vec![[3.0; 3]],
        tau_F_W: vec![[4.0; 3]],
        contact: vec![1],
        n_objects: 1,
        p_WO: vec![[5.0; 3]],
        q_WO_wxyz: vec![[1.0, 0.0, 0.0, 0.0]],
        v_WO: vec![[6.0; 3]],
        w_WO_W: vec![[7.0; 3]],
        ..Default::default()
    };
    assert_eq!(GroundTruth::decode(&bytes(&truth)).unwrap(), truth);
}

#[test]
fn constants_are_associated_constants() {
    assert_eq!((ControllerTick::MODE_IDLE, ControllerTick::MODE_WALK, ControllerTick::MODE_DAMPING), (0i8, 2i8, 3i8));
    assert_eq!((OperatorCommand::GAIT_CRAWL, ControllerTick::FAULT_NONE), (1i8, 0i32));
}

#[test]
fn encode_appends_and_does_not_allocate() {
    let mut out = Vec::with_capacity(4096);
    out.push(0xaa);
    let place = out.as_ptr();
    for _ in 0..10 {
        state().encode(&mut out).unwrap();
    }
    assert_eq!((out.as_ptr(), out[0]), (place, 0xaa));
    assert_eq!(RobotState::decode(&out[1..1 + (out.len() - 1) / 10]).unwrap(), state());
}

#[test]
fn encode_refuses_a_length_field_that_differs_from_the_array() {
    let mut out = vec![1, 2, 3];
    let wrong = RobotState { qd: vec![0.0; 3], ..state() };
    let error = wrong.encode(&mut out).unwrap_err();
    let text = error.to_string();
    assert!(["hoofprint.robot_state_t.qd", "3", "nj", "2"].iter().all(|fact| text.contains(fact)), "{text}");
    assert!(matches!(error, EncodeError::Length { expected: 2, found: 3, .. }));
    assert_eq!(out, [1, 2, 3], "the buffer is unchanged");
}

#[test]
fn decode_names_the_field() {
    let input = TickInput { state: state(), ..Default::default() };
    let bytes = bytes(&input);
    let error = |bytes: &[u8]| TickInput::decode(bytes).unwrap_err().to_string();
    // The second joint velocity is at byte 8 + 48 + 28 + 16 + 8 = 108.
    assert_eq!(
        error(&bytes[..80]),
        "hoofprint.tick_input_t, field state.nj, byte 80: 0 bytes remain, expected at least 4"
    );
    assert_eq!(
        error(&bytes[..110]),
        "hoofprint.tick_input_t, field state.qd, byte 100: 10 bytes remain, expected at least 16"
    );
    assert_eq!(
        error(&[&bytes[..], &[0]].concat()),
        format!("hoofprint.tick_input_t, byte {}: 1 bytes follow the last field, expected none", bytes.len())
    );
    let DecodeError { offset, .. } = BaseTracking::decode(&bytes).unwrap_err();
    assert_eq!(offset, 0);
}

#[test]
fn hostile_lengths_do_not_allocate() {
    let mut bytes = bytes(&state());
    bytes[32..36].copy_from_slice(&i32::MAX.to_be_bytes());
    let error = RobotState::decode(&bytes).unwrap_err().to_string();
    assert_eq!(error, "hoofprint.robot_state_t, field q, byte 36: 232 bytes remain, expected at least 17179869176");
    bytes[32..36].copy_from_slice(&(-1i32).to_be_bytes());
    let error = RobotState::decode(&bytes).unwrap_err().to_string();
    assert_eq!(error, "hoofprint.robot_state_t, field q, byte 36: nj is -1, expected a length of 0 or more");
}

#[test]
fn every_lcm_file_of_the_folder_is_a_source() {
    let mut files: Vec<String> = std::fs::read_dir(env!("CARGO_MANIFEST_DIR"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".lcm"))
        .collect();
    files.sort();
    let sources: Vec<&str> = lcmtypes::SOURCES.iter().map(|s| s.0).collect();
    assert_eq!(sources, files);
}

#[test]
fn the_channel_table_agrees_with_the_lcm_files() {
    for channel in CHANNELS {
        let ty = lcmtypes::types().by_name(channel.type_name).unwrap();
        assert_eq!(ty.fingerprint(), channel.fingerprint, "{}", channel.name);
        let comment = ty.def().comment.as_ref().unwrap();
        assert!(comment.contains(&format!("Channel {}", channel.name)), "{comment}");
        assert_eq!(lcmtypes::channels::find(channel.name), Some(channel));
        assert_eq!(&*ty.def().fields[0].name, "t_ns", "the first field is the time");
    }
    let fingerprints: std::collections::BTreeSet<u64> = CHANNELS.iter().map(|c| c.fingerprint).collect();
    let types: std::collections::BTreeSet<&str> = CHANNELS.iter().map(|c| c.type_name).collect();
    assert_eq!(fingerprints.len(), types.len(), "fingerprints are unique");
    let inputs: Vec<&str> = CHANNELS.iter().filter(|c| c.class == Class::ReplayInput).map(|c| c.name).collect();
    assert_eq!(inputs, ["PARAMETER_CHANGE", "CONTROLLER_INPUT"], "the inputs of a replay");
    assert!(CHANNELS.iter().all(|c| c.stage.is_none() || c.class != Class::Timing));
    assert_eq!(Stage::ALL.map(Stage::name), Stage::NAMES);
    assert_eq!(Stage::NAMES, ["input", "estimation", "gait", "tasks", "qp", "output"]);
}
