//! The real-time thread allocates nothing from its first tick on: with the quadruped that walks, over a real network.
//!
//! The measurements are those of a golden log, sent again with the time of the clock; the operator's commands come with them.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::params::apply_overrides;
use drivers::live::clock::{Beat, now_ns, sleep_until};
use drivers::live::{Call, Ending, LcmRobot, Runner, Speaker};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, ROBOT_STATE, RUN_INFO};
use lcmtypes::{ControllerInput, ControllerTick, Message, RunInfo};
use replay::log::LogReader;
use replay::record::byte_ring;
use replay::udpm::Url;
use rtrb::{Producer, RingBuffer};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const TICKS: i64 = 2500;
const BEAT: Beat = Beat { period_ns: 1_000_000, phase_ns: 0 };

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

/// The driver's and the operator's side, until `over`.
fn send(inputs: Vec<ControllerInput>, url: &Url, mut calls: Producer<Call>, over: &AtomicBool) {
    let mut speaker = Speaker::open(url).unwrap();
    let (mut bytes, mut seq) = (Vec::new(), -1);
    for mut input in inputs {
        if over.load(Ordering::Relaxed) {
            return;
        }
        sleep_until(BEAT.after(now_ns()));
        input.state.t_ns = now_ns();
        bytes.clear();
        input.state.encode(&mut bytes).unwrap();
        assert!(speaker.say(ROBOT_STATE, &bytes));
        if input.op.seq > seq {
            seq = input.op.seq;
            drop(calls.push(Call::Operator { t_ns: now_ns(), command: input.op }));
        }
    }
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
    let port = u16::try_from(20_000 + std::process::id() % 40_000).unwrap();
    let url = Url { port, ..Url::default() };
    let hardware = Box::new(LcmRobot::open(&url).unwrap());
    let (ring_in, mut ring_out) = byte_ring(1 << 24);
    let (mut calls_in, calls_out) = RingBuffer::new(256);
    let mut runner = Runner::new(controller::load(&info).unwrap(), 2, hardware, calls_out, ring_in, BEAT);

    let over = Arc::new(AtomicBool::new(false));
    let sender = std::thread::spawn({
        let over = over.clone();
        move || send(inputs, &url, std::mem::replace(&mut calls_in, RingBuffer::new(1).0), &over)
    });
    let carrier = std::thread::spawn(move || {
        let (mut modes, mut parcel) = (Vec::new(), Vec::new());
        while !ring_out.is_abandoned() {
            while ring_out.pop(&mut parcel) {
                let (channel, data) = parcel[1..].split_at(usize::from(parcel[0]));
                if channel == CONTROLLER_TICK.as_bytes() {
                    modes.push(ControllerTick::decode(data).unwrap().mode);
                }
            }
            std::thread::park_timeout(Duration::from_millis(1));
        }
        modes
    });
    let mut ticked = None;
    let counted = allocation_counter::measure(|| ticked = Some(runner.run(TICKS, &Ending::default())));
    drop(runner);
    over.store(true, Ordering::Relaxed);
    sender.join().unwrap();
    let modes = carrier.join().unwrap();
    let of = |mode: i8| modes.iter().filter(|found| **found == mode).count();
    assert_eq!(ticked.unwrap().ticks, TICKS);
    assert!(
        of(ControllerTick::MODE_STANCE) > 30 && of(ControllerTick::MODE_WALK) > 300,
        "{ticked:?}, {} in stance, {} walking",
        of(ControllerTick::MODE_STANCE),
        of(ControllerTick::MODE_WALK)
    );
    assert_eq!(counted.count_total, 0, "allocations in {TICKS} ticks");
}
