//! From delivered messages to what a controller reads.

use lcmtypes::{
    ComponentState, ControllerInput, Delivered, Message, OperatorCommand, RobotState, Running, TickInput, channels,
};

/// Joints and sensors for which memory is allocated in advance. A robot with more of them causes allocations in its first ticks.
const JOINTS: usize = 64;
const SENSORS: usize = 16;

/// A measurement without joints and sensors, with memory allocated for them.
pub fn empty_state() -> RobotState {
    let numbers = || Vec::with_capacity(JOINTS);
    let vectors = || Vec::with_capacity(SENSORS);
    RobotState {
        q: numbers(),
        qd: numbers(),
        tau: numbers(),
        q_WI_wxyz: Vec::with_capacity(SENSORS),
        w_WI_I: vectors(),
        a_I: vectors(),
        f_S: vectors(),
        tau_S: vectors(),
        ..RobotState::default()
    }
}

/// Copies an input into the memory of another one: the derived `clone_from` would allocate.
pub(super) fn copy(from: &TickInput, to: &mut TickInput) {
    let TickInput { t_ns, tick, run_id, running, t_op_ns, n_ignored, n_late, state, op } = to;
    (*t_ns, *tick, *run_id) = (from.t_ns, from.tick, from.run_id);
    (*running, *t_op_ns) = (from.running, from.t_op_ns);
    (*n_ignored, *n_late) = (from.n_ignored, from.n_late);
    // An operator command has no lists.
    op.clone_from(&from.op);
    let RobotState { t_ns, seq, sender_id, nj, q, qd, tau, n_imus, q_WI_wxyz, w_WI_I, a_I, n_ft, f_S, tau_S } = state;
    let from = &from.state;
    (*t_ns, *seq, *sender_id) = (from.t_ns, from.seq, from.sender_id);
    (*nj, *n_imus, *n_ft) = (from.nj, from.n_imus, from.n_ft);
    for (to, from) in [(q, &from.q), (qd, &from.qd), (tau, &from.tau)] {
        to.clone_from(from);
    }
    q_WI_wxyz.clone_from(&from.q_WI_wxyz);
    for (to, from) in [(w_WI_I, &from.w_WI_I), (a_I, &from.a_I), (f_S, &from.f_S), (tau_S, &from.tau_S)] {
        to.clone_from(from);
    }
}

/// What a component has consumed up to a tick. Readers of logs use it too.
#[derive(Clone, Debug)]
pub struct Unpacked {
    pub(super) input: TickInput,
    /// Decoded first, so that a message that cannot be decoded changes nothing.
    state: RobotState,
    op: OperatorCommand,
}

impl Default for Unpacked {
    fn default() -> Self {
        let op = OperatorCommand { seq: -1, ..OperatorCommand::default() };
        Unpacked {
            input: TickInput { tick: -1, op: op.clone(), state: empty_state(), ..TickInput::default() },
            state: empty_state(),
            op,
        }
    }
}

impl Unpacked {
    /// What a controller reads after the last [`Unpacked::update`].
    pub fn input(&self) -> &TickInput {
        &self.input
    }

    /// What a controller reads in each of consecutive ticks.
    pub fn all<'i>(inputs: impl IntoIterator<Item = &'i ControllerInput>) -> Vec<TickInput> {
        let mut unpacked = Unpacked::default();
        inputs.into_iter().map(|input| unpacked.update(input).clone()).collect()
    }

    /// Takes the input that holds after a tick from a CONTROLLER_SNAPSHOT. A reader of a log calls it for every one: the messages before a part of a run,
    /// before the start of a recording or in a gap are known from there. A snapshot that does not decode, is of an earlier tick than the last
    /// [`Unpacked::update`], or is of another run, changes nothing.
    pub fn restore(&mut self, snapshot: &[u8]) {
        let Ok(ComponentState { input, .. }) = ComponentState::decode(snapshot) else { return };
        let now = &self.input;
        if now.tick < 0 || now.run_id == input.run_id && now.tick <= input.tick {
            self.input = input;
        }
    }

    /// Takes the messages of a tick. Messages on channels outside the table of [`crate::runtime`] are ignored.
    pub fn update(&mut self, input: &ControllerInput) -> &TickInput {
        self.update_with(input, |_, _| false)
    }

    /// Takes the messages of a tick. `other` receives the messages on channels outside the table of [`crate::runtime`] after the others, and returns
    /// whether it used them. Does not allocate if the messages have the sizes of earlier ones.
    pub fn update_with(
        &mut self,
        input: &ControllerInput,
        mut other: impl FnMut(&TickInput, &Delivered) -> bool,
    ) -> &TickInput {
        let now = &mut self.input;
        (now.t_ns, now.tick, now.run_id) = (input.t_ns, input.tick, input.run_id);
        (now.n_ignored, now.n_late) = (0, i32::try_from(input.late.len()).unwrap_or(i32::MAX));
        let mut n_ignored = 0;
        for message in &input.messages {
            let is_used = match &*message.channel {
                channels::ROBOT_STATE => {
                    let decoded = self.state.decode_into(&message.data).is_ok();
                    if decoded {
                        std::mem::swap(&mut now.state, &mut self.state);
                    }
                    decoded
                }
                channels::OPERATOR_COMMAND => {
                    let decoded = self.op.decode_into(&message.data).is_ok();
                    if decoded {
                        std::mem::swap(&mut now.op, &mut self.op);
                        now.t_op_ns = message.t_arrival_ns;
                    }
                    decoded
                }
                channels::RUNNING => match Running::decode(&message.data) {
                    Ok(running) => {
                        now.running = running.running;
                        true
                    }
                    Err(_) => false,
                },
                _ => true,
            };
            n_ignored += i32::from(!is_used);
        }
        let known = [channels::ROBOT_STATE, channels::OPERATOR_COMMAND, channels::RUNNING];
        for message in input.messages.iter().filter(|message| !known.contains(&&*message.channel)) {
            n_ignored += i32::from(!other(now, message));
        }
        now.n_ignored = n_ignored;
        now
    }
}
