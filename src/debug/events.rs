//! What is worth stopping at: touchdowns, failures of the solver, missed deadlines, divergences, and what the log itself calls an event.

use controller::dump::Quantity;
use lcmtypes::{
    ControllerTick, LegState, Message, Timing, WbcSolution, channels,
    enum_names::{self, LEGS},
};
use replay::engine::{Cursor, Moment};

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// A swinging leg stands again
    Touchdown,
    /// The solver found no solution for a level of the stack
    QpFailure,
    /// A command was ready too late
    MissedDeadline,
    /// The replay differs from the record
    Divergence,
    /// An EVENT of the log, or a change of the controller's mode
    Event,
}

impl Kind {
    /// Name for a person.
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

/// Something that happened in a tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What it is.
    pub kind: Kind,
    /// In words.
    pub text: String,
}

/// What an event is a change of.
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

fn decoded<M: Message>(moment: &Moment, channel: &str) -> Option<M> {
    M::decode(moment.replayed(channel)?).ok()
}

/// The events of a tick. Goes back to the tick before it, and returns.
pub fn at(cursor: &mut Cursor, moment: &Moment) -> anyhow::Result<Vec<Event>> {
    let before = match cursor.go_to(moment.tick - 1) {
        Ok(before) => Before::of(&before),
        Err(replay::Error::NoSuchTick { .. } | replay::Error::StateUnknown { .. }) => Before::default(),
        Err(error) => return Err(error.into()),
    };
    cursor.go_to(moment.tick)?;
    Ok(found(before, moment))
}

/// Goes on to the next event behind `tick`, of one kind or any, at most `most` ticks.
pub fn next(cursor: &mut Cursor, tick: i64, kind: Option<Kind>, most: u64) -> Result<Option<Moment>, replay::Error> {
    let mut before = Before::default();
    cursor.search(tick, most.saturating_add(1), &mut |moment| {
        let events = found(before, moment);
        before = Before::of(moment);
        moment.tick > tick && events.iter().any(|event| kind.is_none_or(|kind| kind == event.kind))
    })
}

/// Goes back to the last event before `tick`, page by page from recorded state to recorded state.
pub fn previous(cursor: &mut Cursor, tick: i64) -> Result<Option<Moment>, replay::Error> {
    let mut end = tick;
    while end > cursor.first_tick() {
        let begin = cursor.snapshots().iter().rev().find(|s| **s + 1 < end).map_or(cursor.first_tick(), |s| s + 1);
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
        for (leg, (before, now)) in LEGS.iter().zip(before.into_iter().zip(now)) {
            if before != LegState::STATE_STANCE && now == LegState::STATE_STANCE {
                add(Kind::Touchdown, format!("{leg} touches down"));
            }
        }
    }
    if let Some(wbc) = decoded::<WbcSolution>(moment, channels::WBC_SOLUTION)
        && [WbcSolution::STATUS_FAILED, WbcSolution::STATUS_INFEASIBLE].contains(&wbc.status)
    {
        add(Kind::QpFailure, format!("no solution: last level solved {}, of {}", wbc.level, wbc.n_levels));
    }
    if before.mode.is_some() && before.mode != now.mode {
        let name = |mode: Option<i8>| mode.map_or("?", enum_names::mode);
        add(Kind::Event, format!("mode {} becomes {}", name(before.mode), name(now.mode)));
    }
    for event in &moment.beside {
        if *event.channel == *channels::TIMING {
            if let Ok(timing) = Timing::decode(&event.data)
                && timing.deadline_ns > 0
                && timing.end_ns > timing.deadline_ns
            {
                let late = (timing.end_ns - timing.deadline_ns) / 1000;
                add(Kind::MissedDeadline, format!("command {late} µs too late"));
            }
        } else if let Ok(said) = lcmtypes::Event::decode(&event.data) {
            add(Kind::Event, format!("{}: {}", said.source, said.text));
        }
    }
    events
}

/// The events for JSON.
pub fn quantity(events: &[Event]) -> Quantity {
    let one = |event: &Event| Quantity::group().with("kind", event.kind.name()).with("text", event.text.as_str());
    Quantity::List(events.iter().map(one).collect())
}
