//! The executor without a network: what a controller may do to it, and what others may ask of it.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::sequence::Sequence;
use controller::{Controller, Outbox, Probe, RestoreError};
use drivers::Scenario;
use drivers::command_mux::{CommandMux, default_sources};
use drivers::live::clock::{TickSchedule, now_ns};
use drivers::live::{Dummy, Executor, Faulty, Hardware, Plan, RealtimeParams, Summary};
use lcmtypes::bus::{Bus, MemoryBus, Received};
use lcmtypes::channels::{
    CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, CONTROLLER_TICK, EVENT, EXECUTOR_COMMAND, ROBOT_COMMAND, RUN_INFO,
};
use lcmtypes::{
    ControllerInput, ControllerTick, Event, ExecutorCommand, Message, RobotCommand, RunInfo, SequenceState,
};
use std::time::Duration;

const BEAT: TickSchedule = TickSchedule { period_ns: 1_000_000, phase_ns: 0 };

/// What a controller of these tests does in a tick.
type Deed = fn(&ControllerInput);

/// Counts its ticks since it was started; that is its state, and its command.
struct Counter {
    name: &'static str,
    ticks: i64,
    deed: Deed,
}

impl Controller for Counter {
    fn name(&self) -> &'static str {
        self.name
    }

    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, _: &mut dyn Probe) {
        self.ticks += 1;
        (self.deed)(input);
        let ControllerInput { t_ns, tick, .. } = *input;
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

fn sequence(controllers: &[(&'static str, Deed)]) -> Sequence {
    let of = |&(name, deed): &(&'static str, Deed)| Box::new(Counter { name, ticks: 0, deed }) as Box<dyn Controller>;
    let [tau, q_des, qd_des, kp, kd] = [(); 5].map(|()| vec![0.0]);
    let damping =
        RobotCommand { mode: RobotCommand::MODE_DAMPING, nj: 1, tau, q_des, qd_des, kp, kd, ..RobotCommand::default() };
    Sequence::new(controllers.iter().map(of).collect(), damping).unwrap()
}

/// An executor whose first controller starts at once; everything it says is on the bus.
fn start(controllers: &[(&'static str, Deed)], ticks: i64) -> (Executor, MemoryBus) {
    start_with(controllers, ticks, Box::new(Dummy::new(vec![0.0])))
}

fn start_with(controllers: &[(&'static str, Deed)], ticks: i64, hardware: Box<dyn Hardware>) -> (Executor, MemoryBus) {
    let mut bus = MemoryBus::new();
    bus.subscribe(".*").unwrap();
    let plan = Plan {
        controller: Box::new(sequence(controllers)),
        controllers: controllers.iter().enumerate().map(|(k, (name, _))| ((*name).to_owned(), k == 0)).collect(),
        hardware,
        bus: Box::new(bus.connect()),
        operators: CommandMux::new(default_sources()).unwrap(),
        info: RunInfo { robot: "dummy".to_owned(), ..RunInfo::default() },
        beat: BEAT,
        ticks: Some(ticks),
        realtime: RealtimeParams::none(),
    };
    (Executor::start(plan).unwrap(), bus)
}

/// A run to its end.
fn run(controllers: &[(&'static str, Deed)], ticks: i64) -> (Summary, Vec<Received>) {
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

/// Steps a fresh controller with the inputs of a run; it must put out what the run did.
#[track_caller]
fn replays(controllers: &[(&'static str, Deed)], messages: &[Received]) {
    let (mut fresh, mut out) = (sequence(controllers), Outbox::new());
    for input in of::<ControllerInput>(messages, CONTROLLER_INPUT) {
        fresh.step(&input, &mut out);
        for (channel, bytes) in out.iter() {
            let found = messages.iter().any(|m| m.channel == channel && m.data == bytes);
            assert!(found, "tick {}: {channel} is another one in the run", input.tick);
        }
    }
}

#[test]
fn a_panic_ends_in_damped_joints_and_a_log_that_replays() {
    let controllers: &[(&'static str, Deed)] =
        &[("rash", |input| assert!(input.tick != 30 || input.running == 0, "a hole in the road"))];
    // Until the next snapshot, and what it holds of the tick that was given up.
    let (summary, messages) = run(controllers, 1010);
    assert_eq!((summary.ticked.ticks, summary.ticked.panics), (1010, 1));
    let commands: Vec<RobotCommand> = of(&messages, ROBOT_COMMAND);
    let modes: Vec<i8> = commands.iter().map(|command| command.mode).collect();
    assert_eq!(modes[..30], [RobotCommand::MODE_TORQUE; 30]);
    assert!(modes[30..].iter().all(|mode| *mode == RobotCommand::MODE_DAMPING));
    assert_eq!(of::<SequenceState>(&messages, CONTROLLER_SNAPSHOT).len(), 2);
    let ticks: Vec<ControllerTick> = of(&messages, CONTROLLER_TICK);
    assert_eq!((ticks[29].fault, ticks[30].fault), (ControllerTick::FAULT_NONE, ControllerTick::FAULT_CONTROLLER));
    let events: Vec<Event> = of(&messages, EVENT);
    let told = events.iter().find(|event| event.text.contains("panicked")).unwrap();
    assert_eq!((told.tick, told.level), (30, Event::LEVEL_ERROR));
    assert_eq!(
        told.text,
        "a controller panicked and all are stopped: a hole in the road; it happens again in a replay of this tick with running = 1"
    );
    replays(controllers, &messages);
}

#[test]
fn controllers_that_take_longer_than_a_period_are_stopped_at_the_fourth_time() {
    let slow: Deed = |input| {
        let until = now_ns() + if input.tick < 10 { 0 } else { 1_100_000 };
        while now_ns() < until {
            std::hint::spin_loop();
        }
    };
    let (summary, messages) = run(&[("slow", slow)], 40);
    // A machine that stalls may stop it sooner, never later.
    let stopped =
        of::<ControllerInput>(&messages, CONTROLLER_INPUT).iter().position(|input| input.running == 0).unwrap();
    assert!(stopped <= 14, "stopped in tick {stopped}");
    assert!(summary.ticked.late >= 4 && summary.ticked.skipped >= 4);
    let texts: Vec<String> = of::<Event>(&messages, EVENT).into_iter().map(|event| event.text).collect();
    let told = "all controllers are stopped: 4 ticks in a row took longer than a period";
    assert!(texts.iter().any(|text| text == told), "{texts:?}");
    assert!(texts.iter().any(|text| text.contains("late") && text.contains("left out")), "{texts:?}");
    replays(&[("slow", |_| ())], &messages);
}

/// Asks for something, and waits for the executor's answer.
fn ask(bus: &mut MemoryBus, heard: &mut Vec<Received>, action: i8, controller: &str) -> Event {
    let wish = ExecutorCommand { t_ns: now_ns(), action, controller: controller.to_owned() };
    let mut bytes = Vec::new();
    wish.encode(&mut bytes).unwrap();
    bus.publish(EXECUTOR_COMMAND, &bytes).unwrap();
    loop {
        let new = bus.handle(Duration::from_secs(60)).unwrap();
        assert!(!new.is_empty(), "nobody answers");
        let answer = of::<Event>(&new, EVENT)
            .into_iter()
            .find(|event| event.source == "executor" && event.text.contains(controller));
        heard.extend(new);
        if let Some(answer) = answer {
            return answer;
        }
    }
}

#[test]
fn controllers_start_and_stop_on_request() {
    let controllers: &[(&'static str, Deed)] = &[("first", |_| ()), ("second", |_| ())];
    let (executor, mut bus) = start(controllers, i64::MAX);
    let (start, stop) = (ExecutorCommand::ACTION_START, ExecutorCommand::ACTION_STOP);
    let mut heard = Vec::new();
    let mut say = |action, name: &str| ask(&mut bus, &mut heard, action, name);
    // The first has started with the run; that event may come before the answer.
    assert!(["controller first starts", "controller first is running already"].contains(&&*say(start, "first").text));
    let on = say(start, "second");
    assert_eq!(on.text, "controller second starts");
    let off = say(stop, "second");
    assert_eq!(off.text, "controller second stops");
    assert_eq!(say(stop, "third").text, "no controller \"third\" to start or stop: there are first, second");
    let again = say(start, "second");
    assert_eq!(again.text, "controller second starts");
    executor.finish();
    heard.extend(bus.handle(Duration::ZERO).unwrap());

    let inputs: Vec<ControllerInput> = of(&heard, CONTROLLER_INPUT);
    let mut ticks = inputs.iter().map(|input| input.tick);
    assert!(ticks.by_ref().eq(0..i64::try_from(inputs.len()).unwrap()), "a tick is missing");
    for input in &inputs {
        let second = (on.tick..off.tick).contains(&input.tick) || input.tick >= again.tick;
        assert_eq!(input.running, if second { 3 } else { 1 }, "tick {}", input.tick);
    }
    // The last that runs has the robot, and begins anew with each start.
    let torque =
        |tick: i64| of::<RobotCommand>(&heard, ROBOT_COMMAND).into_iter().find(|c| c.tick == tick).unwrap().tau[0];
    assert_eq!(
        [on.tick - 1, on.tick, off.tick, again.tick].map(torque),
        [on.tick, 1, off.tick + 1, 1].map(|n| n as f64)
    );
    replays(controllers, &heard);
}

/// What passes between controller and robot fails as the lines of a scenario say, at their times, and the run goes on.
#[test]
fn hardware_fails_as_a_scenario_says() {
    let text = "name = \"t\"\nduration_s = 1.0\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\n\
        [[fault]]\nt_s = 0.1\nduration_s = 0.2\nkind = \"drop_state\"\n\
        [[fault]]\nt_s = 0.4\nduration_s = 0.2\nkind = \"nan_sensor\"\njoint = \"knee\"\n\
        [[fault]]\nt_s = 0.7\nduration_s = 0.2\nkind = \"clock_jump\"\njump_s = 5.0\n\
        [[fault]]\nt_s = 1.0\nduration_s = 0.2\nkind = \"late_process\"\n";
    let faults = Scenario::parse(text, "t.toml").unwrap().faults;
    let hardware = Faulty::new(Box::new(Dummy::new(vec![0.5])), &faults, &["knee".to_owned()]).unwrap();
    let controllers: &[(&'static str, Deed)] = &[("only", |_| ())];
    let (executor, mut bus) = start_with(controllers, i64::MAX, Box::new(hardware));
    let (mut heard, mut inputs) = (Vec::new(), Vec::<ControllerInput>::new());
    while inputs.last().is_none_or(|last| last.t_ns - inputs[0].t_ns < 1_300_000_000) {
        let new = bus.handle(Duration::from_millis(20)).unwrap();
        inputs.extend(of::<ControllerInput>(&new, CONTROLLER_INPUT));
        heard.extend(new);
    }
    executor.finish();
    // The rest, or the last tick might be there in part.
    heard.extend(bus.handle(Duration::ZERO).unwrap());
    // A tick's wake-up is before its measurement, by much where the machine stalls: only what is well inside a window is certain.
    for pair in inputs.windows(2) {
        let (before, now) = (&pair[0], &pair[1]);
        let (t_ms, knee) = ((now.t_ns - inputs[0].t_ns) / 1_000_000, now.state.q[0]);
        let new = now.state.seq - before.state.seq;
        let ahead_s = (now.state.t_ns - now.t_ns) / 1_000_000_000;
        match t_ms {
            110..200 => assert_eq!(new, 0, "a measurement in spite of drop_state at {t_ms} ms"),
            410..500 => assert!(knee.is_nan(), "a number from a broken sensor at {t_ms} ms"),
            710..800 => assert_eq!(ahead_s, 5, "the clock has not jumped at {t_ms} ms"),
            1010..1200 => panic!("a tick of a process that stands still at {t_ms} ms"),
            10..50 | 310..350 | 610..650 | 910..950 => assert_eq!((new, knee, ahead_s), (1, 0.5, 0), "{t_ms} ms"),
            _ => {}
        }
    }
    replays(controllers, &heard);
}

#[test]
fn run_info_comes_first_and_carries_the_time_of_the_first_tick() {
    let (_, messages) = run(&[("only", |_| ())], 30);
    assert_eq!(messages[0].channel, RUN_INFO);
    let info = RunInfo::decode(&messages[0].data).unwrap();
    let first: ControllerInput = of(&messages, CONTROLLER_INPUT).remove(0);
    assert_eq!(
        (info.t_ns, &*info.robot, &*info.realtime),
        (first.t_ns, "dummy", "live, every 1000 us, no timer slack")
    );
}
