//! A small controller with a filter and an integrator, so that its replay depends on its state.

use controller::digest::Digest;
use controller::handover::take_over;
use controller::params::{Params, parameters_digest};
use controller::{Component, Controller, Delivery, LoadError, Outbox, Probe, RestoreError};
use lcmtypes::channels::Stage;
use lcmtypes::{
    ComponentInfo, ComponentState, ContactEstimate, ControllerInput, ControllerTick, Message, QuadrupedState,
    RobotCommand, RobotState, RunInfo, TextFile, TickInput, Timing, WbcSolution, channels,
};
use replay::log::LogWriter;
use std::path::Path;

pub const PERIOD_NS: i64 = 1_000_000;
/// Ticks from one snapshot to the next.
pub const SNAPSHOT: i64 = 100;

const PARAMS: &str = r#"
[robot]
name = "toy"
urdf = "toy.urdf"
feet = ["a", "b", "c", "d"]
foot_radius = 0.02
imu_link = "base"
posture = {}
"#;

#[derive(Default)]
pub struct Toy {
    pub gain: f64,
    pub height: f64,
    pub integral: f64,
    /// Stage and tick from which on the controller computes a different value.
    pub mutant: Option<(Stage, i64)>,
    /// `restore` changes the state by one ulp.
    pub restores_badly: bool,
    /// `restore` does not restore the integral.
    pub forgets: bool,
    pub last: (i64, i64),
    pub digest_parameters: i64,
}

/// Builds the toy, as [`controller::load`] builds real controllers.
pub fn load(info: &RunInfo) -> Result<Component, LoadError> {
    Ok(component(toy(info)?))
}

pub fn component(toy: Toy) -> Component {
    Component::new(Box::new(toy)).with_snapshots(SNAPSHOT, SNAPSHOT - 1)
}

pub fn toy(info: &RunInfo) -> Result<Toy, LoadError> {
    let gain = Params::from_toml(info.params(), "toy")?.gait.trot.swing_frequency;
    Ok(Toy { gain, digest_parameters: parameters_digest(info.params()), ..Toy::default() })
}

fn digest(values: &[f64]) -> i64 {
    let mut digest = Digest::default();
    digest.f64s(values);
    digest.finish()
}

fn next_up(value: &mut f64) {
    *value = value.next_up();
}

impl Controller for Toy {
    fn name(&self) -> &'static str {
        "toy"
    }

    fn stages(&self) -> &[&'static str] {
        &Stage::NAMES
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, _: &mut dyn Probe) {
        let (t_ns, tick) = (input.t_ns, input.tick);
        let mutant = |stage| self.mutant.is_some_and(|(s, from)| s == stage && tick >= from);
        let mut q = input.state.q[0];
        if mutant(Stage::Input) {
            next_up(&mut q);
        }
        let digest_input = digest(&[q]);
        self.height += 0.125 * (q - self.height);
        if mutant(Stage::Estimation) {
            next_up(&mut self.height);
        }
        let mut gait = self.height.abs();
        if mutant(Stage::Gait) {
            next_up(&mut gait);
        }
        let mut task = self.gain * gait;
        if mutant(Stage::Tasks) {
            next_up(&mut task);
        }
        self.integral += 0.001 * task;
        let mut vd = 1.5 * self.integral - self.height;
        if mutant(Stage::Qp) {
            next_up(&mut vd);
        }
        let mut tau = 2.0 * vd + 1.0;
        if mutant(Stage::Output) {
            next_up(&mut tau);
        }
        let mut contact = ContactEstimate { t_ns, tick, height: self.height, ..Default::default() };
        (contact.n_contacts, contact.f_F_W) = (4, vec![[0.0; 3]; 4]);
        (contact.f_normal, contact.contact) = (vec![0.0; 4], vec![0; 4]);
        contact.f_F_W[2][1] = -self.height;
        out.put(channels::CONTACT_ESTIMATE, &contact).unwrap();
        let solution = WbcSolution { t_ns, tick, nv: 2, vd: vec![0.5, vd], ..Default::default() };
        out.put(channels::WBC_SOLUTION, &solution).unwrap();
        let command = RobotCommand { t_ns, tick, run_id: input.run_id, tau: vec![tau], ..RobotCommand::zeros(1) };
        out.put(channels::ROBOT_COMMAND, &command).unwrap();
        let digests = ControllerTick {
            t_ns,
            tick,
            run_id: input.run_id,
            n_stages: 6,
            digest: [digest_input]
                .into_iter()
                .chain([self.height, gait, task, vd, tau].map(|x| digest(&[x])))
                .collect(),
            digest_parameters: self.digest_parameters,
            ..Default::default()
        };
        out.put(channels::CONTROLLER_TICK, &digests).unwrap();
        self.last = (t_ns, tick);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state().encode(out).unwrap();
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = QuadrupedState::decode(bytes)?;
        if !state.height.is_finite() {
            return Err(RestoreError::NotFinite { field: "height" });
        }
        self.last = (state.t_ns, state.tick);
        self.height = state.height;
        if !self.forgets {
            self.integral = state.zeta;
        }
        if self.restores_badly {
            next_up(&mut self.height);
        }
        Ok(())
    }

    fn poison_workspace(&mut self) {}
}

impl Toy {
    fn state(&self) -> QuadrupedState {
        let (t_ns, tick) = self.last;
        QuadrupedState { t_ns, tick, height: self.height, zeta: self.integral, ..Default::default() }
    }
}

pub fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    message.encode(&mut bytes).unwrap();
    bytes
}

/// The events of a run of the toy: RUN_INFO, then in each tick the measurement, the input, the outputs and the timing.
pub fn events(ticks: i64) -> Vec<super::Message> {
    events_from(ticks, 0)
}

/// [`events`] of a controller whose clock shows `t0_ns` at tick 0.
pub fn events_from(ticks: i64, t0_ns: i64) -> Vec<super::Message> {
    events_of(0, ticks, t0_ns, None)
}

/// [`events_from`] of a run with this `run_id`.
pub fn events_of_run(run_id: i64, ticks: i64, t0_ns: i64) -> Vec<super::Message> {
    events_of(run_id, ticks, t0_ns, None)
}

/// [`events`] of a run whose parameter changes at a tick; without a PARAMETER_CHANGE.
pub fn events_with(ticks: i64, change: Option<(i64, &str, &str)>) -> Vec<super::Message> {
    events_of(0, ticks, 0, change)
}

fn events_of(run_id: i64, ticks: i64, t0_ns: i64, change: Option<(i64, &str, &str)>) -> Vec<super::Message> {
    let lcm_types: Vec<_> =
        lcmtypes::SOURCES.iter().map(|(n, t)| TextFile { name: n.to_string(), text: t.to_string() }).collect();
    let num_lcm_types = lcm_types.len() as i32;
    let mut component = ComponentInfo::new("toy", PARAMS);
    (component.n_stages, component.stages) = (6, Stage::NAMES.map(str::to_owned).to_vec());
    let info =
        RunInfo { t_ns: t0_ns, run_id, num_lcm_types, lcm_types, ..Default::default() }.with_component(component);
    let (mut toy, mut delivery) = (load(&info).unwrap(), Delivery::new(run_id));
    let mut events = vec![(channels::RUN_INFO.to_owned(), t0_ns, encoded(&info))];
    let (mut random, mut out) = (super::Random(5), Outbox::new());
    for tick in 0..ticks {
        let t_ns = t0_ns + tick * PERIOD_NS;
        if let Some((_, key, value)) = change.filter(|(at, ..)| *at == tick) {
            let set = [(key.to_owned(), value.to_owned())];
            let params = controller::params::apply_changes(info.params(), &set).unwrap();
            let mut next = load(&info.clone().with_params(params)).unwrap();
            take_over(&toy, &mut next, &mut Vec::new()).unwrap();
            toy = next;
        }
        let mut put = |channel: &str, bytes: Vec<u8>| events.push((channel.to_owned(), t_ns, bytes));
        let q = (random.next() >> 11) as f64 / (1_u64 << 53) as f64;
        let state = RobotState { t_ns, seq: tick, q: vec![q], ..RobotState::zeros(1, 0, 0) };
        put(channels::ROBOT_STATE, encoded(&state));
        delivery.begin(t_ns, tick);
        delivery.put(channels::ROBOT_STATE, t_ns, &state).unwrap();
        put(channels::CONTROLLER_INPUT, encoded(delivery.input()));
        out.clear();
        toy.step(delivery.input(), &mut out);
        out.iter().for_each(|(channel, bytes)| put(channel, bytes.to_vec()));
        put(channels::TIMING, encoded(&Timing { t_ns, tick, wall_ns: 17 * tick, ..Default::default() }));
    }
    events
}

/// Writes events to a log.
pub fn write(path: &Path, events: &[super::Message]) {
    let mut log = LogWriter::create(path).unwrap();
    for (channel, t_ns, data) in events {
        log.write(channel, *t_ns, data).unwrap();
    }
    log.finish().unwrap();
}

/// Changes the message of a channel and tick.
pub fn change<M: Message>(events: &mut [super::Message], channel: &str, tick: i64, change: impl FnOnce(&mut M)) {
    let is_it = |(c, t_ns, _): &&mut super::Message| c == channel && *t_ns == tick * PERIOD_NS;
    let (.., data) = events.iter_mut().find(is_it).unwrap();
    let mut message = M::decode(data).unwrap();
    change(&mut message);
    *data = encoded(&message);
}

/// Changes the measurement in the input of a tick.
pub fn change_input(events: &mut [super::Message], tick: i64, edit: impl FnOnce(&mut RobotState)) {
    change(events, channels::CONTROLLER_INPUT, tick, |input: &mut ControllerInput| {
        assert!(input.change(channels::ROBOT_STATE, edit));
    });
}

/// Changes the toy's state in the snapshot of a tick.
pub fn change_state(events: &mut [super::Message], tick: i64, edit: impl FnOnce(&mut QuadrupedState)) {
    change(events, channels::CONTROLLER_SNAPSHOT, tick, |state: &mut ComponentState| {
        let mut toy = QuadrupedState::decode(&state.controller.data).unwrap();
        edit(&mut toy);
        state.controller.data = encoded(&toy);
        state.controller.size = state.controller.data.len() as i32;
    });
}
