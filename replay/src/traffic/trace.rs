//! Values of selected fields over time.

use lcm_idl::{Leaf, Segment, Type};
use std::collections::VecDeque;

/// Largest number of points per trace: a minute at 1 kHz.
const POINTS: usize = 60_000;
/// Shortest time between two points, ns; messages in between are not decoded.
const FASTEST_NS: i64 = 500_000;

/// The values of a numeric field.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Channel.
    pub channel: String,
    /// Path, such as `state.q[3]`.
    pub path: String,
    steps: Vec<Step>,
    points: VecDeque<(i64, f64)>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Step {
    Field(String),
    Index(usize),
}

impl Trace {
    /// An empty trace; `None` for an invalid path.
    pub fn new(channel: &str, path: &str) -> Option<Self> {
        let step = |text: &str| match text.strip_suffix(']') {
            Some(index) => index.parse().ok().map(Step::Index),
            None => Some(Step::Field(text.to_owned())),
        };
        let steps: Vec<_> = path.split(['.', '[']).filter(|text| !text.is_empty()).map(step).collect::<Option<_>>()?;
        let is_some = !steps.is_empty();
        is_some.then(|| Trace { channel: channel.to_owned(), path: path.to_owned(), steps, points: VecDeque::new() })
    }

    /// Receive time, ns, and value; oldest first.
    pub fn points(&self) -> impl DoubleEndedIterator<Item = (i64, f64)> + ExactSizeIterator {
        self.points.iter().copied()
    }

    /// Removes all points.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// Whether a message at `t_ns` gives a new point.
    pub(super) fn is_due(&self, t_ns: i64) -> bool {
        // An earlier time means that the clock was set back.
        self.points.back().is_none_or(|(last, _)| !(0..FASTEST_NS).contains(&t_ns.saturating_sub(*last)))
    }

    fn add(&mut self, t_ns: i64, value: f64) {
        if self.points.len() == POINTS {
            self.points.pop_front();
        }
        self.points.push_back((t_ns, value));
    }

    fn is_at(&self, segments: &[Segment]) -> bool {
        let same = |(step, segment): (&Step, &Segment)| match (step, segment) {
            (Step::Field(name), Segment::Field(found)) => name == found,
            (Step::Index(index), Segment::Index(found)) => index == found,
            _ => false,
        };
        self.steps.len() == segments.len() && self.steps.iter().zip(segments).all(same)
    }
}

/// Adds a message of `channel` to the traces of its fields.
pub(super) fn trace(traces: &mut [Trace], channel: &str, ty: Type, data: &[u8], t_ns: i64) {
    let mut due: Vec<&mut Trace> = traces.iter_mut().filter(|t| t.channel == channel && t.is_due(t_ns)).collect();
    // If the message is malformed, the fields before the error are used; the message page shows the error.
    let _ = ty.walk_lenient(data, |path, leaf: Leaf| {
        let Some(value) = leaf.as_f64() else { return };
        due.iter_mut().filter(|trace| trace.is_at(path.segments())).for_each(|trace| trace.add(t_ns, value));
    });
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use lcmtypes::{Message, RobotState, channels};

    #[test]
    fn a_trace_contains_the_values_of_its_field() {
        let ty = lcmtypes::types().by_name(RobotState::TYPE).unwrap();
        let named = |path| Trace::new(channels::ROBOT_STATE, path).unwrap();
        let mut traces = [named("q[1]"), named("seq"), named("q[2]"), Trace::new("OTHER", "seq").unwrap()];
        for (t_ns, seq) in [(0, 5), (1_000_000, 6), (1_200_000, 7), (3_000_000, 8)] {
            let (q, qd, tau) = (vec![0.25, seq as f64 / 2.0], vec![0.0; 2], vec![0.0; 2]);
            let state = RobotState { seq, nj: 2, q, qd, tau, ..Default::default() };
            let mut bytes = Vec::new();
            state.encode(&mut bytes).unwrap();
            trace(&mut traces, channels::ROBOT_STATE, ty, &bytes, t_ns);
        }
        // The third is too close to the second.
        let points = |trace: &Trace| trace.points().collect::<Vec<_>>();
        assert_eq!(points(&traces[0]), [(0, 2.5), (1_000_000, 3.0), (3_000_000, 4.0)]);
        assert_eq!(points(&traces[1]), [(0, 5.0), (1_000_000, 6.0), (3_000_000, 8.0)]);
        assert_eq!((points(&traces[2]).len(), points(&traces[3]).len()), (0, 0));
    }

    #[test]
    fn an_invalid_path_is_rejected() {
        assert!(Trace::new("A", "q[x]").is_none() && Trace::new("A", "").is_none());
    }
}
