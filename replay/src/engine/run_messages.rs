//! Which messages of a log belong to the run that is replayed, and what they are for.

use super::state_types::{first_difference, state_types};
use crate::log::Event;
use lcm_idl::ast::{Field, FieldType, Primitive};
use lcmtypes::RunInfo;
use lcmtypes::channels::{self, Channel, Class};
use std::sync::Arc;

/// What a replay does with the messages of a channel and type.
#[derive(Clone, Copy)]
pub(super) enum Role {
    /// RUN_INFO.
    RunInfo,
    /// CONTROLLER_INPUT: fed to the controller.
    Input,
    /// PARAMETER_CHANGE.
    Change,
    /// An output of the controller: compared.
    Output,
    /// Contains a tick but is not an output: TIMING, EVENT.
    Beside,
    /// On a channel outside the table, with a tick: an output if the controller has one on this channel, else a message of another program.
    Candidate,
    /// On a channel of the run, but of another type than this build's, or a snapshot that contains a state of another type: the fingerprints.
    OtherType { known: &'static Channel, found: Option<u64>, expected: u64 },
    /// On another channel of a component that is not the first one, with or without a tick: as [`Role::Candidate`], of the tick at its `t_ns`.
    AtTime,
    /// Not used.
    Other,
}

/// The channels and types of one run.
#[derive(Debug, Clone, Default)]
pub(crate) struct RunMessages {
    /// `None`: any run.
    run_id: Option<i64>,
    /// Controllers of a sequence: their names are prefixes of channels.
    members: Vec<String>,
    /// Prefix of the component's channels in the log, such as `arms/`; empty for the first component.
    prefix: String,
    /// For the first component: prefixes of the others, whose messages are hidden.
    hidden: Vec<String>,
    /// Parameters of the run at its start, as TOML.
    pub(super) params: Arc<str>,
    /// Types of the states in a snapshot of the controller; `None`: not compared.
    states: Option<Vec<u64>>,
}

impl RunMessages {
    /// Those of the first component of the run that RUN_INFO describes.
    pub fn of(info: &RunInfo) -> Self {
        Self::of_component(info, 0)
    }

    /// Those of one component of a run.
    ///
    /// - `run`: RUN_INFO of the log.
    pub fn of_component(run: &RunInfo, index: usize) -> Self {
        let info = &run.of_component(index);
        let (mut prefix, mut hidden) = (String::new(), Vec::new());
        if index > 0 {
            prefix = format!("{}/", info.component());
        } else {
            hidden = run.components.iter().skip(1).map(|component| format!("{}/", component.name)).collect();
        }
        let list = info.controller().split_once('(').and_then(|(_, rest)| rest.split_once(')')).map(|(list, _)| list);
        let members = list.into_iter().flat_map(|list| list.split(',')).map(|name| name.trim().to_owned()).collect();
        RunMessages { run_id: Some(info.run_id), members, prefix, hidden, params: info.params().into(), states: None }
    }

    /// With the types that the states in a snapshot must have: those of this one.
    pub fn with_snapshots_like(self, snapshot: Option<&[u8]>) -> Self {
        RunMessages { states: snapshot.and_then(state_types), ..self }
    }

    /// The role of a CONTROLLER_SNAPSHOT that contains a state of another type than the run's controller.
    pub(super) fn other_state(&self, plain: &str, data: &[u8]) -> Option<Role> {
        let known = (*plain == *channels::CONTROLLER_SNAPSHOT).then(|| channels::find(plain))??;
        let (found, expected) = first_difference(&state_types(data)?, self.states.as_ref()?)?;
        Some(Role::OtherType { known, found: Some(found), expected })
    }

    /// Whether the component is the first one of the run.
    pub fn is_of_first(&self) -> bool {
        self.prefix.is_empty()
    }

    /// Name in the log of a channel of the component.
    pub fn in_log(&self, channel: &str) -> String {
        format!("{}{channel}", self.prefix)
    }

    /// Name of a channel of the log as the component uses it, without its prefix; `None` for a channel of another component, or of the run if the
    /// component is not the first one. All components see RUN_INFO.
    pub fn plain<'c>(&self, channel: &'c str) -> Option<&'c str> {
        if self.prefix.is_empty() {
            return (!self.hidden.iter().any(|prefix| channel.starts_with(&**prefix))).then_some(channel);
        }
        match channel.strip_prefix(&*self.prefix) {
            None => (channel == channels::RUN_INFO).then_some(channel),
            plain => plain.filter(|plain| *plain != channels::RUN_INFO),
        }
    }

    /// Whether this is the run.
    pub fn is_of_run(&self, run_id: i64) -> bool {
        self.run_id.is_none_or(|ours| ours == run_id)
    }

    /// Whether a message says that it belongs to another run.
    pub(super) fn is_foreign(&self, event: &Event) -> bool {
        crate::log::run_id(&event.channel, &event.data).is_some_and(|run_id| !self.is_of_run(run_id))
    }

    /// Row of the table for a channel of the run, with or without the name of a member in front.
    fn known(&self, channel: &str) -> Option<&'static Channel> {
        channels::find(channel).or_else(|| {
            let (member, name) = channel.split_once('/')?;
            let known = channels::find(name).filter(|known| is_output(known))?;
            self.members.iter().any(|known| known == member).then_some(known)
        })
    }

    /// Tick of a message that belongs to one; `None` for any other.
    pub fn tick_of(&self, channel: &str, message: &[u8]) -> Option<i64> {
        let has_tick = match self.role(self.plain(channel)?, crate::log::fingerprint(message)) {
            Role::Input | Role::Change | Role::Output | Role::Beside | Role::Candidate => true,
            // An output of another type version has its tick at the same place.
            Role::OtherType { known, .. } => known.name != channels::RUN_INFO,
            Role::RunInfo | Role::AtTime | Role::Other => false,
        };
        // -1 is used by an EVENT without a tick.
        crate::log::sequence_number(message).filter(|tick| has_tick && *tick >= 0)
    }

    /// The role of a message on a channel, named as by [`RunMessages::plain`].
    pub(super) fn role(&self, channel: &str, fingerprint: Option<u64>) -> Role {
        let Some(known) = self.known(channel) else {
            return match fingerprint {
                Some(_) if !self.prefix.is_empty() => Role::AtTime,
                Some(fingerprint) if has_tick(fingerprint) => Role::Candidate,
                _ => Role::Other,
            };
        };
        let role = match (known.name, known.class) {
            (channels::RUN_INFO, _) => Role::RunInfo,
            (channels::PARAMETER_CHANGE, _) => Role::Change,
            (_, Class::ReplayInput) => Role::Input,
            (channels::TIMING | channels::EVENT, _) => Role::Beside,
            _ if is_output(known) => Role::Output,
            _ if !self.prefix.is_empty() => Role::AtTime,
            _ => return Role::Other,
        };
        let same = fingerprint == Some(known.fingerprint);
        match role {
            _ if same => role,
            Role::Beside | Role::AtTime => Role::Other,
            _ => Role::OtherType { known, found: fingerprint, expected: known.fingerprint },
        }
    }
}

/// Whether a tick computes the messages of a channel.
fn is_output(known: &Channel) -> bool {
    known.stage.is_some() && matches!(known.class, Class::Output | Class::Debug)
}

/// Whether a type starts with `int64_t t_ns; int64_t tick;`.
fn has_tick(fingerprint: u64) -> bool {
    let Some(ty) = lcmtypes::types().by_fingerprint(fingerprint) else { return false };
    let is = |field: &Field, name: &str| {
        *field.name == *name && field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    matches!(&ty.def().fields[..], [time, tick, ..] if is(time, "t_ns") && is(tick, "tick"))
}
