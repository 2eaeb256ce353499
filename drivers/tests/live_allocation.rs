//! The real-time thread allocates nothing from its first tick on: with the quadruped that walks, over a real network, while another controller
//! is started and stopped and parameters change.
//!
//! The measurements are those of a golden log, sent again with the time of the clock; the operator's commands come with them.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::RestoreError;
use controller::params::apply_overrides;
use drivers::live::clock::{TickSchedule, now_ns, sleep_until};
use drivers::live::{Call, Caller, Ending, Handover, LcmRobot, RealtimeLoop, Speaker, calls};
use drivers::parameter_requests::{ParameterRequestHandler, Proposal};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, PARAMETER_CHANGE, ROBOT_STATE, RUN_INFO,
};
use lcmtypes::{ControllerInput, ControllerTick, Message, ParameterRequest, RunInfo};
use replay::log::LogReader;
use replay::record::byte_ring;
use replay::udpm::Url;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const TICKS: i64 = 2500;
/// Changes of parameters on the way.
const CHANGES: usize = 10;
const BEAT: TickSchedule = TickSchedule { period_ns: 1_000_000, phase_ns: 0 };

fn golden() -> (RunInfo, Vec<ControllerInput>) {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden/flat_trot.mcap");
    let (mut info, mut inputs) = (None, Vec::new());
    for event in LogReader::open(log).unwrap().events().map(Result::unwrap) {
        match &*event.channel {
            RUN_INFO => info = Some(RunInfo::decode(&event.data).unwrap()),
            CONTROLLER_INPUT => inputs.push(ControllerInput::decode(&event.data).unwrap()),
            _ => {}
        }
    }
    (info.unwrap(), inputs)
}

/// The driver's and the operator's side, until `over`. How many handovers came back, and what was refused of them.
fn send(
    inputs: Vec<ControllerInput>,
    url: &Url,
    (mut caller, mut changes): (Caller, Vec<Proposal>),
    over: &AtomicBool,
) -> Vec<Option<RestoreError>> {
    let mut speaker = Speaker::open(url).unwrap();
    let (mut bytes, mut seq, mut returned) = (Vec::new(), -1, Vec::new());
    for (k, mut input) in inputs.into_iter().enumerate() {
        if over.load(Ordering::Relaxed) {
            break;
        }
        sleep_until(BEAT.after(now_ns()));
        input.state.t_ns = now_ns();
        bytes.clear();
        input.state.encode(&mut bytes).unwrap();
        assert!(speaker.say(ROBOT_STATE, &bytes));
        if input.op.seq > seq {
            seq = input.op.seq;
            caller.call(Call::Operator { t_ns: now_ns(), command: input.op });
        }
        match k % 100 {
            30 => drop(caller.call(Call::Start(0))),
            60 => drop(caller.call(Call::Stop(0))),
            90 => {
                if let Some(Proposal { controller, change, parameters }) = changes.pop() {
                    caller.call(Call::Change(Box::new(Handover { controller, change, parameters, refused: None })));
                }
            }
            _ => {}
        }
        returned.extend(std::iter::from_fn(|| caller.returned()).map(|handover| handover.refused));
    }
    returned
}

#[test]
fn the_real_time_thread_allocates_nothing() {
    let (mut info, inputs) = golden();
    // A machine that stalls must not end the walk, nor must a robot that does not do as it is told.
    let lenient = ["safety.max_state_age=1000.0", "safety.max_tilt=3.0"];
    let lenient: Vec<(String, String)> = lenient
        .iter()
        .filter_map(|set| set.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    info.params = apply_overrides(&info.params, &lenient).unwrap();
    info.controller = "sequence(hold, quadruped)".to_owned();
    let desk = ParameterRequestHandler::new(&info);
    let wish = |k: usize| ParameterRequest {
        key: "trunk.kp".to_owned(),
        value: format!("[{0}.0, {0}.0, {0}.0]", 900 + k),
        ..ParameterRequest::default()
    };
    let changes: Vec<Proposal> = (0..CHANGES).map(|k| desk.answer(&wish(k)).unwrap()).collect();
    let port = u16::try_from(20_000 + std::process::id() % 40_000).unwrap();
    let url = Url { port, ..Url::default() };
    let hardware = Box::new(LcmRobot::open(&url).unwrap());
    let (ring_in, mut ring_out) = byte_ring(1 << 24);
    let (caller, called) = calls();
    let mut runner = RealtimeLoop::new(controller::load(&info).unwrap(), 2, hardware, called, ring_in, BEAT);

    let over = Arc::new(AtomicBool::new(false));
    let sender = std::thread::spawn({
        let over = over.clone();
        move || send(inputs, &url, (caller, changes), &over)
    });
    let carrier = std::thread::spawn(move || {
        let (mut modes, mut seen, mut parcel) = (Vec::new(), BTreeMap::<String, usize>::new(), Vec::new());
        while !ring_out.is_abandoned() {
            while ring_out.pop(&mut parcel) {
                let (channel, data) = parcel[1..].split_at(usize::from(parcel[0]));
                *seen.entry(String::from_utf8(channel.to_vec()).unwrap()).or_default() += 1;
                if channel == CONTROLLER_TICK.as_bytes() {
                    modes.push(ControllerTick::decode(data).unwrap().mode);
                }
            }
            std::thread::park_timeout(Duration::from_millis(1));
        }
        (modes, seen)
    });
    let mut ticked = None;
    let counted = allocation_counter::measure(|| ticked = Some(runner.run(TICKS, &Ending::default())));
    drop(runner);
    over.store(true, Ordering::Relaxed);
    let returned = sender.join().unwrap();
    let (modes, seen) = carrier.join().unwrap();
    let of = |mode: i8| modes.iter().filter(|found| **found == mode).count();
    assert_eq!(ticked.unwrap().ticks, TICKS);
    assert!(
        of(ControllerTick::MODE_STANCE) > 30 && of(ControllerTick::MODE_WALK) > 300,
        "{ticked:?}, {} in stance, {} walking",
        of(ControllerTick::MODE_STANCE),
        of(ControllerTick::MODE_WALK)
    );
    // What else was to happen, did: a second controller beside the first, its starts, snapshots, changes.
    let count = |channel: &str| seen.get(channel).copied().unwrap_or_default();
    assert!(count("hold/ROBOT_COMMAND") > 300 && count(CONTROLLER_SNAPSHOT) == 3, "{seen:?}");
    assert!(count(PARAMETER_CHANGE) > CHANGES / 2 && returned.len() > CHANGES / 2, "{seen:?}");
    assert!(returned.iter().all(Option::is_none), "{returned:?}");
    assert_eq!(counted.count_total, 0, "allocations in {TICKS} ticks");
}
