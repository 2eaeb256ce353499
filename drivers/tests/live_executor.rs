//! The executor on a bus in memory: controllers that panic or overrun, requests and their replies, injected faults.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::handover::Parameters;
use controller::quadruped::params::GaitParams;
use controller::sequence::Sequence;
use controller::{Component, Controller, Outbox, Probe, RestoreError, Unpacked};
use drivers::Scenario;
use drivers::command_mux::{CommandMux, default_sources};
use drivers::components::{Others, slots};
use drivers::live::clock::{TickSchedule, now_ns};
use drivers::live::{
    Call, CallResult, Dummy, Ending, Executor, Faulty, Handover, HandoverError, Hardware, Plan, RealtimeLoop,
    RealtimeParams, RequestId, Summary, call_ring, message_ring,
};
use lcmtypes::bus::{Bus, MemoryBus, Received};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EVENT, EXECUTOR_COMMAND, OPERATOR_COMMAND,
    PARAMETER_CHANGE, PARAMETER_REQUEST, REQUEST_REPLY, ROBOT_COMMAND, RUN_INFO,
};
use lcmtypes::{
    ComponentState, ControllerInput, ControllerTick, Event, ExecutorCommand, Message, OperatorCommand, ParameterChange,
    ParameterRequest, RequestReply, RobotCommand, RunInfo, TickInput,
};
use std::time::{Duration, Instant};

const SCHEDULE: TickSchedule = TickSchedule { period_ns: 1_000_000, phase_ns: 0 };

/// Work of a test controller in a tick.
type Work = fn(&TickInput);

/// Counts its ticks since it was started; the count is its state and its command.
struct Counter {
    name: &'static str,
    ticks: i64,
    work: Work,
}

impl Controller for Counter {
    fn name(&self) -> &'static str {
        self.name
    }

    fn stages(&self) -> &[&'static str] {
        &["output"]
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, _: &mut dyn Probe) {
        self.ticks += 1;
        (self.work)(input);
        let TickInput { t_ns, tick, .. } = *input;
        let command = RobotCommand { t_ns, tick, mode: RobotCommand::MODE_TORQUE, nj: 1, ..RobotCommand::default() };
        let torque = f64::from(i32::try_from(self.ticks).unwrap());
        let [q_des, qd_des, kp, kd] = [(); 4].map(|()| vec![0.0]);
        out.clear();
        out.put(ROBOT_COMMAND, &RobotCommand { tau: vec![torque], q_des, qd_des, kp, kd, ..command }).unwrap();
        out.put(CONTROLLER_TICK, &ControllerTick { t_ns, tick, ..ControllerTick::default() }).unwrap();
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.ticks.to_be_bytes());
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        self.ticks = i64::from_be_bytes(*bytes.first_chunk().unwrap());
        Ok(())
    }

    fn poison_workspace(&mut self) {}
}

fn sequence(controllers: &[(&'static str, Work)]) -> Sequence {
    let of = |&(name, work): &(&'static str, Work)| Box::new(Counter { name, ticks: 0, work }) as Box<dyn Controller>;
    let [tau, q_des, qd_des, kp, kd] = [(); 5].map(|()| vec![0.0]);
    let damping =
        RobotCommand { mode: RobotCommand::MODE_DAMPING, nj: 1, tau, q_des, qd_des, kp, kd, ..RobotCommand::default() };
    Sequence::new(controllers.iter().map(of).collect(), damping, 0).unwrap()
}

/// An executor whose first controller runs from the first tick on, and a bus that receives all its messages.
fn start(controllers: &[(&'static str, Work)], ticks: i64) -> (Executor, MemoryBus) {
    start_with(controllers, ticks, Box::new(Dummy::new(vec![0.0])))
}

fn start_with(controllers: &[(&'static str, Work)], ticks: i64, hardware: Box<dyn Hardware>) -> (Executor, MemoryBus) {
    let mut bus = MemoryBus::new();
    bus.subscribe(".*").unwrap();
    let plan = Plan {
        component: Component::new(Box::new(sequence(controllers))),
        others: Vec::new(),
        receives: Vec::new(),
        controllers: controllers.iter().enumerate().map(|(k, (name, _))| ((*name).to_owned(), k == 0)).collect(),
        hardware,
        bus: Box::new(bus.connect()),
        operators: CommandMux::new(default_sources()).unwrap(),
        info: RunInfo { robot: "dummy".to_owned(), ..RunInfo::default() },
        schedule: SCHEDULE,
        ticks: Some(ticks),
        realtime: RealtimeParams::none(),
    };
    (Executor::start(plan).unwrap(), bus)
}

/// A complete run.
fn run(controllers: &[(&'static str, Work)], ticks: i64) -> (Summary, Vec<Received>) {
    let (executor, mut bus) = start(controllers, ticks);
    while !executor.is_finished() {
        std::thread::yield_now();
    }
    let summary = executor.finish();
    (summary, bus.handle(Duration::ZERO).unwrap())
}

fn of<M: Message>(messages: &[Received], channel: &str) -> Vec<M> {
    messages.iter().filter(|m| m.channel == channel).map(|m| M::decode(&m.data).unwrap()).collect()
}

/// What the controllers read in each tick.
fn inputs_of(messages: &[Received]) -> Vec<TickInput> {
    Unpacked::all(&of::<ControllerInput>(messages, CONTROLLER_INPUT))
}

/// Steps a new controller with the inputs of a run; its outputs must be those of the run.
#[track_caller]
fn replays(controllers: &[(&'static str, Work)], messages: &[Received]) {
    let (mut fresh, mut out) = (Component::new(Box::new(sequence(controllers))), Outbox::new());
    for input in of::<ControllerInput>(messages, CONTROLLER_INPUT) {
        fresh.step(&input, &mut out);
        for (channel, bytes) in out.iter() {
            let found = messages.iter().any(|m| m.channel == channel && m.data == bytes);
            assert!(found, "tick {}: {channel} differs from the run", input.tick);
        }
    }
}

#[test]
fn after_a_panic_the_joints_are_damped_and_the_log_replays() {
    let controllers: &[(&'static str, Work)] =
        &[("failing", |input| assert!(input.tick != 30 || input.running == 0, "test panic"))];
    // Until after the second snapshot, so that its state is replayed too.
    let (summary, messages) = run(controllers, 1010);
    assert_eq!((summary.realtime.ticks, summary.realtime.panics), (1010, 1));
    let commands: Vec<RobotCommand> = of(&messages, ROBOT_COMMAND);
    let modes: Vec<i8> = commands.iter().map(|command| command.mode).collect();
    assert_eq!(modes[..30], [RobotCommand::MODE_TORQUE; 30]);
    assert!(modes[30..].iter().all(|mode| *mode == RobotCommand::MODE_DAMPING));
    assert_eq!(of::<ComponentState>(&messages, CONTROLLER_SNAPSHOT).len(), 2);
    let ticks: Vec<ControllerTick> = of(&messages, CONTROLLER_TICK);
    assert_eq!((ticks[29].fault, ticks[30].fault), (ControllerTick::FAULT_NONE, ControllerTick::FAULT_CONTROLLER));
    let events: Vec<Event> = of(&messages, EVENT);
    let error = events.iter().find(|event| event.level == Event::LEVEL_ERROR).unwrap();
    assert_eq!((error.tick, &*error.source), (30, "executor"));
    assert!(error.text.contains("test panic") && error.text.contains("running = 1"), "{}", error.text);
    replays(controllers, &messages);
}

#[test]
fn controllers_are_stopped_after_four_consecutive_overruns() {
    let slow: Work = |input| {
        let until = now_ns() + if input.tick < 10 { 0 } else { 1_100_000 };
        while now_ns() < until {
            std::hint::spin_loop();
        }
    };
    let (summary, messages) = run(&[("slow", slow)], 40);
    // Sooner on a machine that stalls, never later.
    let stopped = inputs_of(&messages).iter().position(|input| input.running == 0).unwrap();
    assert!(stopped <= 14, "stopped in tick {stopped}");
    assert!(summary.realtime.late >= 4 && summary.realtime.skipped >= 4);
    let levels: Vec<i8> = of::<Event>(&messages, EVENT)
        .into_iter()
        .filter(|event| event.source == "executor")
        .map(|event| event.level)
        .collect();
    assert!(levels.contains(&Event::LEVEL_ERROR), "the stop");
    assert!(levels.contains(&Event::LEVEL_WARNING), "late and skipped ticks");
    replays(&[("slow", |_| ())], &messages);
}

/// Longest wait for a reply; a passing test gets it within milliseconds.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Publishes a message.
fn put(bus: &mut MemoryBus, channel: &str, message: &impl Message) {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).unwrap();
    bus.publish(channel, &bytes).unwrap();
}

/// Receives until a request is answered.
#[track_caller]
fn reply_to(bus: &mut MemoryBus, received: &mut Vec<Received>, sender_id: i64, request_id: i64) -> RequestReply {
    let end = Instant::now() + TIMEOUT;
    loop {
        // The messages of the ticks arrive in any case.
        assert!(Instant::now() < end, "no reply to request {request_id} of sender {sender_id}");
        let new = bus.handle(TIMEOUT).unwrap();
        let replies = of::<RequestReply>(&new, REQUEST_REPLY);
        received.extend(new);
        if let Some(reply) = replies.into_iter().find(|r| (r.sender_id, r.request_id) == (sender_id, request_id)) {
            return reply;
        }
    }
}

fn switch(request_id: i64, action: i8, controller: &str) -> ExecutorCommand {
    ExecutorCommand { t_ns: now_ns(), sender_id: 1, request_id, action, controller: controller.to_owned() }
}

#[test]
fn controllers_start_and_stop_on_request() {
    let controllers: &[(&'static str, Work)] = &[("first", |_| ()), ("second", |_| ())];
    let (executor, mut bus) = start(controllers, i64::MAX);
    let (start, stop) = (ExecutorCommand::ACTION_START, ExecutorCommand::ACTION_STOP);
    let mut received = Vec::new();
    let mut request_id = 0;
    let mut request = |action, name: &str| {
        request_id += 1;
        put(&mut bus, EXECUTOR_COMMAND, &switch(request_id, action, name));
        reply_to(&mut bus, &mut received, 1, request_id)
    };
    let running = request(start, "first");
    assert_eq!((running.code, running.tick), (RequestReply::CODE_WRONG_STATE, -1));
    let on = request(start, "second");
    let off = request(stop, "second");
    let unknown = request(stop, "third");
    assert_eq!((unknown.code, unknown.tick), (RequestReply::CODE_UNKNOWN_NAME, -1));
    assert!(unknown.reason.contains("third") && unknown.reason.contains("second"), "{}", unknown.reason);
    assert_eq!(request(7, "second").code, RequestReply::CODE_OUT_OF_RANGE);
    let again = request(start, "second");
    assert_eq!([on.code, off.code, again.code], [RequestReply::CODE_DONE; 3]);
    executor.finish();
    received.extend(bus.handle(Duration::ZERO).unwrap());

    let inputs = inputs_of(&received);
    let mut ticks = inputs.iter().map(|input| input.tick);
    assert!(ticks.by_ref().eq(0..i64::try_from(inputs.len()).unwrap()), "a tick is missing");
    for input in &inputs {
        let second = (on.tick..off.tick).contains(&input.tick) || input.tick >= again.tick;
        assert_eq!(input.running, if second { 3 } else { 1 }, "tick {}", input.tick);
    }
    // The last running controller commands the robot, and a start resets it.
    let torque =
        |tick: i64| of::<RobotCommand>(&received, ROBOT_COMMAND).into_iter().find(|c| c.tick == tick).unwrap().tau[0];
    assert_eq!(
        [on.tick - 1, on.tick, off.tick, again.tick].map(torque),
        [on.tick, 1, off.tick + 1, 1].map(|n| n as f64)
    );
    replays(controllers, &received);
}

#[test]
fn messages_that_cannot_be_decoded_are_counted_and_reported() {
    let (executor, mut bus) = start(&[("first", |_| ())], i64::MAX);
    for channel in [OPERATOR_COMMAND, PARAMETER_REQUEST, EXECUTOR_COMMAND] {
        bus.publish(channel, b"garbage").unwrap();
    }
    let is_report = |event: &Event| event.level == Event::LEVEL_WARNING && event.text.contains(" cannot be decoded");
    let end = Instant::now() + TIMEOUT;
    while !of::<Event>(&bus.handle(TIMEOUT).unwrap(), EVENT).iter().any(is_report) {
        assert!(Instant::now() < end, "no report");
    }
    assert_eq!(executor.finish().publisher.unreadable, 3);
}

#[test]
fn a_repeated_request_is_carried_out_once_and_gets_the_same_reply() {
    let controllers: &[(&'static str, Work)] = &[("first", |_| ()), ("second", |_| ())];
    let (executor, mut bus) = start(controllers, i64::MAX);
    let mut received = Vec::new();
    let start = switch(7, ExecutorCommand::ACTION_START, "second");
    put(&mut bus, EXECUTOR_COMMAND, &start);
    let reply = reply_to(&mut bus, &mut received, 1, 7);
    put(&mut bus, EXECUTOR_COMMAND, &switch(8, ExecutorCommand::ACTION_STOP, "second"));
    reply_to(&mut bus, &mut received, 1, 8);
    // Carried out again, it would start the controller again.
    put(&mut bus, EXECUTOR_COMMAND, &start);
    assert_eq!(reply_to(&mut bus, &mut received, 1, 7), reply);
    // Another sender with the same request_id is another request.
    put(&mut bus, EXECUTOR_COMMAND, &ExecutorCommand { sender_id: 2, ..start });
    let other = reply_to(&mut bus, &mut received, 2, 7);
    assert!(other.code == RequestReply::CODE_DONE && other.tick > reply.tick, "{other:?}");
    executor.finish();
    received.extend(bus.handle(Duration::ZERO).unwrap());
    let running: Vec<i64> = inputs_of(&received).iter().map(|i| i.running).collect();
    let mut changes = running.clone();
    changes.dedup();
    // The first tick may have consumed the first request already.
    let changes: Vec<i64> = changes.into_iter().skip_while(|running| *running == 1).collect();
    assert_eq!(changes, [3, 1, 3]);
}

#[test]
fn parameter_requests_that_cannot_be_carried_out_are_answered_by_code() {
    let (executor, mut bus) = start(&[("only", |_| ())], i64::MAX);
    let mut received = Vec::new();
    // The run has no parameters that could be read, so every value is refused; [robot] and oversized values before that.
    for (seq, key, value, code) in [
        (1, "robot.name", "1".to_owned(), RequestReply::CODE_REJECTED),
        (2, "trunk.kp", "9".repeat(5000), RequestReply::CODE_OUT_OF_RANGE),
    ] {
        let request = ParameterRequest { sender_id: 5, seq, key: key.to_owned(), value, ..ParameterRequest::default() };
        put(&mut bus, PARAMETER_REQUEST, &request);
        let reply = reply_to(&mut bus, &mut received, 5, seq);
        assert_eq!((reply.code, reply.tick), (code, -1), "{}", reply.reason);
        assert!(reply.reason.contains(key), "{}", reply.reason);
    }
    executor.finish();
}

#[test]
fn an_operators_mode_request_is_answered() {
    let (executor, mut bus) = start(&[("only", |_| ())], i64::MAX);
    let mut received = Vec::new();
    let (teleop, planner) = (11, 12);
    let t_ns = now_ns();
    let stand = OperatorCommand { t_ns, t_mode_ns: t_ns, sender_id: teleop, seq: 3, ..OperatorCommand::default() };
    put(&mut bus, "OPERATOR_TELEOP", &stand);
    let followed = reply_to(&mut bus, &mut received, teleop, 3);
    assert_eq!(followed.code, RequestReply::CODE_DONE);
    put(&mut bus, "OPERATOR_TELEOP", &OperatorCommand { seq: 4, ..stand.clone() });
    let walk = OperatorCommand { mode: OperatorCommand::MODE_WALK, sender_id: planner, ..stand };
    put(&mut bus, OPERATOR_COMMAND, &walk);
    let other = reply_to(&mut bus, &mut received, planner, 3);
    executor.finish();
    received.extend(bus.handle(Duration::ZERO).unwrap());
    // If the machine stalled for longer than the time-out of OPERATOR_TELEOP, the other operator was active by then.
    let inputs = inputs_of(&received);
    let consumed = inputs.iter().any(|input| input.op.mode == OperatorCommand::MODE_WALK && input.op.seq == 3);
    assert_eq!(other.code, if consumed { RequestReply::CODE_DONE } else { RequestReply::CODE_REJECTED });
    let input = inputs.iter().find(|input| input.tick == followed.tick).unwrap();
    assert_eq!((input.op.seq, input.t_ns), (3, followed.t_ns));
}

/// Faults are injected in the windows of the scenario, and the run continues.
#[test]
fn faults_of_a_scenario_are_injected_into_the_hardware() {
    let text = "name = \"t\"\nduration_s = 1.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\n\
        [[fault]]\nt_s = 0.1\nduration_s = 0.2\nkind = \"drop_state\"\n\
        [[fault]]\nt_s = 0.4\nduration_s = 0.2\nkind = \"nan_sensor\"\njoint = \"knee\"\n\
        [[fault]]\nt_s = 0.7\nduration_s = 0.2\nkind = \"clock_jump\"\njump_s = 5.0\n\
        [[fault]]\nt_s = 1.0\nduration_s = 0.2\nkind = \"late_process\"\n";
    let faults = Scenario::parse(text, "t.toml", &GaitParams::default()).unwrap().faults;
    let hardware = Faulty::new(Box::new(Dummy::new(vec![0.5])), &faults, &["knee".to_owned()]).unwrap();
    let controllers: &[(&'static str, Work)] = &[("only", |_| ())];
    let (executor, mut bus) = start_with(controllers, i64::MAX, Box::new(hardware));
    let (mut received, mut inputs) = (Vec::new(), Vec::<ControllerInput>::new());
    while inputs.last().is_none_or(|last| last.t_ns - inputs[0].t_ns < 1_300_000_000) {
        let new = bus.handle(Duration::from_millis(20)).unwrap();
        inputs.extend(of::<ControllerInput>(&new, CONTROLLER_INPUT));
        received.extend(new);
    }
    executor.finish();
    // The rest: the last tick may be incomplete.
    received.extend(bus.handle(Duration::ZERO).unwrap());
    let inputs = Unpacked::all(&inputs);
    // A tick wakes before it measures, long before if the machine stalls: only ticks well inside a window are checked.
    for pair in inputs.windows(2) {
        let (before, now) = (&pair[0], &pair[1]);
        let (t_ms, knee) = ((now.t_ns - inputs[0].t_ns) / 1_000_000, now.state.q[0]);
        let new = now.state.seq - before.state.seq;
        let ahead_s = (now.state.t_ns - now.t_ns) / 1_000_000_000;
        match t_ms {
            110..200 => assert_eq!(new, 0, "measurement during drop_state at {t_ms} ms"),
            410..500 => assert!(knee.is_nan(), "finite value during nan_sensor at {t_ms} ms"),
            710..800 => assert_eq!(ahead_s, 5, "no clock jump at {t_ms} ms"),
            1010..1200 => panic!("tick during late_process at {t_ms} ms"),
            10..50 | 310..350 | 610..650 | 910..950 => assert_eq!((new, knee, ahead_s), (1, 0.5, 0), "{t_ms} ms"),
            _ => {}
        }
    }
    replays(controllers, &received);
}

#[test]
fn run_info_is_the_first_message_and_has_the_time_of_the_first_tick() {
    let (_, messages) = run(&[("only", |_| ())], 30);
    assert_eq!(messages[0].channel, RUN_INFO);
    let info = RunInfo::decode(&messages[0].data).unwrap();
    let first: ControllerInput = of(&messages, CONTROLLER_INPUT).remove(0);
    assert_eq!(
        (info.t_ns, &*info.robot, &*info.realtime),
        (first.t_ns, "dummy", "live, every 1000 us, no timer slack")
    );
}

/// Its state cannot be restored.
struct Fragile;

impl Controller for Fragile {
    fn name(&self) -> &'static str {
        "fragile"
    }

    fn stages(&self) -> &[&'static str] {
        &[]
    }

    fn step_probed(&mut self, _: &TickInput, _: &mut Outbox, _: &mut dyn Probe) {}

    fn snapshot(&self, _: &mut Vec<u8>) {}

    fn restore(&mut self, _: &[u8]) -> Result<(), RestoreError> {
        panic!("test panic")
    }

    fn poison_workspace(&mut self) {}
}

#[test]
fn a_panic_in_a_handover_damps_the_joints() {
    let controllers: &[(&'static str, Work)] = &[("only", |_| ())];
    let (messages_in, mut messages_out) = message_ring(1 << 20);
    let (mut calls, calls_out) = call_ring();
    let dummy = Box::new(Dummy::new(vec![0.0]));
    let mut realtime = RealtimeLoop::new(
        Component::new(Box::new(sequence(controllers))),
        Others::new(slots(&RunInfo { run_id: 3, ..RunInfo::default() }, &[], &[]), Vec::new(), message_ring(1).1),
        (3, 1),
        dummy,
        calls_out,
        messages_in,
        SCHEDULE,
    );
    let (change, info) = (ParameterChange::default(), RunInfo::default());
    let parameters = Parameters::new(&info);
    let (id, controller) = (RequestId::default(), Component::new(Box::new(Fragile)));
    let handover = Handover { id, controller, change, parameters, refused: None };
    assert!(calls.send(Call::Handover(Box::new(handover))));
    let report = realtime.run(30, &Ending::default());
    assert_eq!((report.ticks, report.panics), (30, 1));
    let Some(CallResult::Handover(returned)) = calls.result() else { panic!("no result") };
    assert!(matches!(returned.refused, Some(HandoverError::Panicked)));
    drop(realtime);
    let (mut commands, mut changes) = (Vec::new(), 0);
    while let Some(message) = messages_out.pop() {
        match message.channel {
            ROBOT_COMMAND => commands.push(RobotCommand::decode(message.data).unwrap()),
            PARAMETER_CHANGE => changes += 1,
            _ => {}
        }
    }
    assert_eq!((commands.len(), changes), (30, 0));
    assert!(commands.iter().all(|command| command.mode == RobotCommand::MODE_DAMPING && command.run_id == 3));
}

/// A flood of operator commands leaves room for the messages of other programs that the first component listens to.
#[test]
fn messages_of_other_programs_have_room_beside_operator_commands() {
    const CHANNELS: usize = 20;
    let (messages_in, mut messages_out) = message_ring(1 << 22);
    let (mut received_in, received_out) = message_ring(1 << 16);
    let (mut calls, calls_out) = call_ring();
    let receives: Vec<String> = (0..CHANNELS).map(|k| format!("script/C{k}")).collect();
    for channel in &receives {
        assert!(received_in.push(0, channel, &[1, 2, 3]));
    }
    let mut sent = 0;
    while sent < 60 && calls.send(Call::Operator { t_ns: 1, command: OperatorCommand::default() }) {
        sent += 1;
    }
    let info = RunInfo { run_id: 3, ..RunInfo::default() };
    let mut realtime = RealtimeLoop::new(
        Component::new(Box::new(sequence(&[("only", |_| ())]))),
        Others::new(slots(&info, &[], &receives), Vec::new(), received_out),
        (3, 1),
        Box::new(Dummy::new(vec![0.0])),
        calls_out,
        messages_in,
        SCHEDULE,
    );
    realtime.run(30, &Ending::default());
    drop(realtime);
    let mut inputs = Vec::new();
    while let Some(message) = messages_out.pop() {
        if message.channel == CONTROLLER_INPUT {
            inputs.push(ControllerInput::decode(message.data).unwrap());
        }
    }
    let count = |input: &ControllerInput, is_counted: fn(&str) -> bool| {
        input.messages.iter().filter(|message| is_counted(&message.channel)).count()
    };
    assert_eq!(count(&inputs[0], |channel| channel.starts_with("script/")), CHANNELS);
    let operator: usize = inputs.iter().map(|input| count(input, |channel| channel == OPERATOR_COMMAND)).sum();
    assert!(sent > 45 && operator >= sent, "{operator} of {sent} operator commands");
}
