//! The real-time thread allocates nothing from its first tick on: with a walking quadruped, over a real network, while another controller is
//! started and stopped and parameters change.
//!
//! Measurements and operator commands are those of a golden log, sent again with the present time.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../../tests/common/network.rs"]
mod network;

use controller::Unpacked;
use controller::params::apply_overrides;
use drivers::components::{Others, Runner, Slot};
use drivers::live::clock::{TickSchedule, now_ns, sleep_until};
use drivers::live::{
    Call, CallResult, CallSender, Ending, Handover, HandoverError, LcmRobot, LcmSender, RealtimeLoop, RealtimeParams,
    RequestId, Switch, call_ring, message_ring, start_worker,
};
use drivers::parameter_requests::{ParameterRequestHandler, Proposal};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, PARAMETER_CHANGE, ROBOT_STATE, RUN_INFO,
};
use lcmtypes::{ComponentInfo, ControllerInput, ControllerTick, Message, ParameterRequest, RunInfo, TickInput};
use replay::log::LogReader;
use replay::udpm::Url;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

const TICKS: i64 = 2500;
/// Parameter changes during the run.
const CHANGES: usize = 10;
const SCHEDULE: TickSchedule = TickSchedule { period_ns: 1_000_000, phase_ns: 0 };

fn golden() -> (RunInfo, Vec<TickInput>) {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden/flat_trot.mcap");
    let (mut info, mut inputs) = (None, Vec::<ControllerInput>::new());
    for event in LogReader::open(log).unwrap().events().map(Result::unwrap) {
        match &*event.channel {
            RUN_INFO => info = Some(RunInfo::decode(&event.data).unwrap()),
            CONTROLLER_INPUT => inputs.push(ControllerInput::decode(&event.data).unwrap()),
            _ => {}
        }
    }
    (info.unwrap(), Unpacked::all(&inputs))
}

/// Sends measurements, operator commands and calls until `over`. Returns the refusals of the handovers, and how many switches took effect.
fn send(
    inputs: Vec<TickInput>,
    url: &Url,
    (mut calls, mut changes): (CallSender, Vec<Proposal>),
    over: &AtomicBool,
) -> (Vec<Option<HandoverError>>, usize) {
    let mut sender = LcmSender::open(url).unwrap();
    let (mut bytes, mut seq, mut handovers, mut switched) = (Vec::new(), -1, Vec::new(), 0);
    for (k, mut input) in inputs.into_iter().enumerate() {
        if over.load(Ordering::Relaxed) {
            break;
        }
        sleep_until(SCHEDULE.after(now_ns()));
        input.state.t_ns = now_ns();
        bytes.clear();
        input.state.encode(&mut bytes).unwrap();
        assert!(sender.send(ROBOT_STATE, &bytes));
        if input.op.seq > seq {
            seq = input.op.seq;
            calls.send(Call::Operator { t_ns: now_ns(), command: input.op });
        }
        match k % 100 {
            30 | 60 => {
                let switch = Switch { id: RequestId::default(), controller: 0, start: k % 100 == 30 };
                calls.send(Call::Switch(switch));
            }
            90 => {
                if let Some(Proposal { controller, change, parameters }) = changes.pop() {
                    let id = RequestId::default();
                    calls.send(Call::Handover(Box::new(Handover {
                        id,
                        controller,
                        change,
                        parameters,
                        refused: None,
                    })));
                }
            }
            _ => {}
        }
        while let Some(result) = calls.result() {
            match result {
                CallResult::Handover(handover) => handovers.push(handover.refused),
                CallResult::Switched { changed, .. } => switched += usize::from(changed),
            }
        }
    }
    (handovers, switched)
}

/// Two planners beside the quadruped: one on the real-time thread and one on a thread of its own, each with 50 Hz, and each hears the other.
fn others(info: &RunInfo, params: &str) -> (Others, JoinHandle<Option<String>>) {
    let planner = |name: &str| ComponentInfo {
        name: name.to_owned(),
        period_ticks: 20,
        latency_ticks: 20,
        ..ComponentInfo::new("tour", params)
    };
    let (own, worker) = (planner("own"), planner("worker"));
    let build = |component: &ComponentInfo| controller::load(&info.clone().with_component(component.clone())).unwrap();
    let (end, thread) = start_worker(build(&worker), RealtimeParams::none(), Duration::ZERO).unwrap();
    let slot = |info: &ComponentInfo, receives: &[&str]| {
        Slot::new(info, 1, receives.iter().map(ToString::to_string).collect())
    };
    let slots = vec![
        slot(&info.components[0], &["own/JOINT_REFERENCE", "worker/JOINT_REFERENCE"]),
        slot(&own, &["worker/JOINT_REFERENCE"]),
        slot(&worker, &["own/JOINT_REFERENCE"]),
    ];
    let runners = vec![Runner::in_place(build(&own)), Runner::Worker(end)];
    (Others::new(slots, runners, message_ring(1 << 16).1), thread)
}

#[test]
fn the_real_time_thread_allocates_nothing() {
    let (mut info, inputs) = golden();
    // Neither a machine that stalls nor measurements that do not follow the commands must end the walk.
    let lenient = ["safety.max_state_age=0.2", "safety.max_tilt=1.2"];
    let lenient: Vec<(String, String)> = lenient
        .iter()
        .filter_map(|set| set.split_once('='))
        .map(|(key, value)| (key.to_owned(), value.to_owned()))
        .collect();
    let params = apply_overrides(info.params(), &lenient).unwrap();
    info = info.with_component(ComponentInfo::new("sequence(hold, quadruped)", &params));
    let handler = ParameterRequestHandler::new(&info);
    let request = |k: usize| ParameterRequest {
        key: "trunk.kp".to_owned(),
        value: format!("[{0}.0, {0}.0, {0}.0]", 900 + k),
        ..ParameterRequest::default()
    };
    let changes: Vec<Proposal> = (0..CHANGES).map(|k| handler.propose(&request(k)).ok().unwrap()).collect();
    let url = Url { port: network::port(0), ..Url::default() };
    let hardware = Box::new(LcmRobot::open(&url).unwrap());
    let (messages_in, mut messages_out) = message_ring(1 << 24);
    let (calls_in, calls_out) = call_ring();
    let controller = controller::load(&info).unwrap();
    let (others, worker) = others(&info, &params);
    let mut realtime =
        RealtimeLoop::new(controller, others, (info.run_id, 2), hardware, calls_out, messages_in, SCHEDULE);

    let over = Arc::new(AtomicBool::new(false));
    let sender = std::thread::spawn({
        let over = over.clone();
        move || send(inputs, &url, (calls_in, changes), &over)
    });
    let publisher = std::thread::spawn(move || {
        let (mut modes, mut seen) = (Vec::new(), BTreeMap::<String, usize>::new());
        while !messages_out.is_abandoned() {
            while let Some(message) = messages_out.pop() {
                *seen.entry(message.channel.to_owned()).or_default() += 1;
                if message.channel == CONTROLLER_TICK {
                    modes.push(ControllerTick::decode(message.data).unwrap().mode);
                }
            }
            std::thread::park_timeout(Duration::from_millis(1));
        }
        (modes, seen)
    });
    let mut report = None;
    let counted = allocation_counter::measure(|| report = Some(realtime.run(TICKS, &Ending::default())));
    drop(realtime);
    over.store(true, Ordering::Relaxed);
    let (handovers, switched) = sender.join().unwrap();
    let (modes, seen) = publisher.join().unwrap();
    let of = |mode: i8| modes.iter().filter(|found| **found == mode).count();
    assert_eq!(report.unwrap().ticks, TICKS);
    assert!(
        of(ControllerTick::MODE_STANCE) > 30 && of(ControllerTick::MODE_WALK) > 300,
        "{report:?}, {} in stance, {} walking",
        of(ControllerTick::MODE_STANCE),
        of(ControllerTick::MODE_WALK)
    );
    // The second controller ran, snapshots were taken, and parameters changed.
    let count = |channel: &str| seen.get(channel).copied().unwrap_or_default();
    assert!(count("hold/ROBOT_COMMAND") > 300 && count(CONTROLLER_SNAPSHOT) == 3, "{seen:?}");
    assert!(count(PARAMETER_CHANGE) > CHANGES / 2 && handovers.len() > CHANGES / 2, "{seen:?}");
    // Both planners computed, on either thread.
    assert_eq!(worker.join().unwrap(), None);
    assert!(count("own/JOINT_REFERENCE") > 100 && count("worker/JOINT_REFERENCE") > 100, "{seen:?}");
    assert!(switched > 10, "{switched} starts and stops");
    assert!(handovers.iter().all(Option::is_none), "{handovers:?}");
    assert_eq!(counted.count_total, 0, "allocations in {TICKS} ticks");
}
