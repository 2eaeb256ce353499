//! Events to stop at: touchdowns, solver failures, missed deadlines, divergences, EVENT messages of the log and changes of mode.

use controller::dump::{Group, Value};
use controller::quadruped::leg::Leg;
use lcmtypes::{ControllerTick, LegState, Message, Timing, WbcSolution, channels, enum_names};
use replay::engine::{Cursor, Moment};

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// A leg changes from swing to stance
    Touchdown,
    /// A level of the stack of tasks has no solution
    QpFailure,
    /// The command was ready after its deadline
    MissedDeadline,
    /// The replay differs from the record
    Divergence,
    /// An EVENT message of the log, or a change of the controller's mode
    Event,
}

impl Kind {
    /// Name on the screen and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Touchdown => "touchdown",
            Kind::QpFailure => "QP failure",
            Kind::MissedDeadline => "missed deadline",
            Kind::Divergence => "divergence",
            Kind::Event => "EVENT",
        }
    }
}

/// An event of a tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind.
    pub kind: Kind,
    /// One line of text.
    pub text: String,
}

/// Values of the tick before, whose changes are events.
#[derive(Clone, Copy, Default, PartialEq)]
struct Before {
    legs: Option<[i8; 4]>,
    mode: Option<i8>,
}

impl Before {
    fn of(moment: &Moment) -> Self {
        Before {
            legs: decoded::<LegState>(moment, channels::LEG_STATE).map(|legs| legs.state),
            mode: decoded::<ControllerTick>(moment, channels::CONTROLLER_TICK).map(|tick| tick.mode),
        }
    }
}

/// The replayed message of a type.
fn decoded<M: Message>(moment: &Moment, channel: &str) -> Option<M> {
    M::decode(moment.replayed(channel)?).ok()
}

/// The events of a tick. Moves the cursor to the tick before and back.
pub fn at(cursor: &mut Cursor, moment: &Moment) -> anyhow::Result<Vec<Event>> {
    let before = match cursor.go_to(moment.tick.saturating_sub(1)) {
        Ok(before) => Before::of(&before),
        Err(replay::Error::NoSuchTick { .. } | replay::Error::StateUnknown { .. }) => Before::default(),
        Err(error) => return Err(error.into()),
    };
    cursor.go_to(moment.tick)?;
    Ok(found(before, moment))
}

/// Moves to the first tick after `tick` with an event of a kind (`None`: of any kind); searches at most `most` ticks.
pub fn next(cursor: &mut Cursor, tick: i64, kind: Option<Kind>, most: u64) -> Result<Option<Moment>, replay::Error> {
    let mut before = Before::default();
    cursor.search(tick, most.saturating_add(1), &mut |moment| {
        let events = found(before, moment);
        before = Before::of(moment);
        moment.tick > tick && events.iter().any(|event| kind.is_none_or(|kind| kind == event.kind))
    })
}

/// Moves back to the last tick before `tick` with an event. Searches the sections between recorded states, the last one first.
pub fn previous(cursor: &mut Cursor, tick: i64) -> Result<Option<Moment>, replay::Error> {
    let mut end = tick;
    while end > cursor.first_tick() {
        let begin = cursor.state_before(end - 1)?.map_or(cursor.first_tick(), |state| state + 1);
        let (mut before, mut last) = (Before::default(), None);
        cursor.search(begin, end.abs_diff(begin), &mut |moment| {
            if !found(before, moment).is_empty() {
                last = Some(moment.tick);
            }
            before = Before::of(moment);
            false
        })?;
        if let Some(tick) = last {
            return cursor.go_to(tick).map(Some);
        }
        end = begin;
    }
    Ok(None)
}

fn found(before: Before, moment: &Moment) -> Vec<Event> {
    let mut events = Vec::new();
    let mut add = |kind, text| events.push(Event { kind, text });
    if let Some(d) = &moment.divergence {
        add(Kind::Divergence, format!("differs in stage {}: {} {}", d.stage, d.channel, d.field));
    }
    let now = Before::of(moment);
    if let (Some(before), Some(now)) = (before.legs, now.legs) {
        for (leg, (before, now)) in Leg::ALL.iter().zip(before.into_iter().zip(now)) {
            if before != LegState::STATE_STANCE && now == LegState::STATE_STANCE {
                add(Kind::Touchdown, format!("{} touches down", leg.name()));
            }
        }
    }
    if let Some(wbc) = decoded::<WbcSolution>(moment, channels::WBC_SOLUTION)
        && [WbcSolution::STATUS_FAILED, WbcSolution::STATUS_INFEASIBLE].contains(&wbc.status)
    {
        add(Kind::QpFailure, format!("{} of {} levels have a solution", wbc.level.saturating_add(1), wbc.n_levels));
    }
    if before.mode.is_some() && before.mode != now.mode {
        let name = |mode: Option<i8>| mode.map_or("?", enum_names::mode);
        add(Kind::Event, format!("mode changes from {} to {}", name(before.mode), name(now.mode)));
    }
    for event in &moment.beside {
        if *event.channel == *channels::TIMING {
            if let Ok(timing) = Timing::decode(&event.data)
                && timing.deadline_ns > 0
                && timing.end_ns > timing.deadline_ns
            {
                let late = timing.end_ns.saturating_sub(timing.deadline_ns) / 1000;
                add(Kind::MissedDeadline, format!("command {late} µs after its deadline"));
            }
        } else if let Ok(message) = lcmtypes::Event::decode(&event.data) {
            add(Kind::Event, format!("{}: {}", message.source, message.text));
        }
    }
    events
}

/// The events for JSON.
pub fn to_value(events: &[Event]) -> Value {
    let one = |event: &Event| Group::new().with("kind", event.kind.name()).with("text", event.text.as_str());
    events.iter().map(one).collect::<Vec<_>>().into()
}
