//! Alarm conditions on channels.

use super::Row;
use crate::Error;
use crate::record::Pattern;
use std::collections::{BTreeMap, BTreeSet};

/// One condition, such as `ROBOT_STATE rate<900`: a regular expression for the whole channel name, a quantity, `<` or `>`, a limit.
#[derive(Debug, Clone)]
pub struct Alarm {
    text: String,
    channels: Pattern,
    names: String,
    quantity: Quantity,
    is_above: bool,
    limit: f64,
}

/// Quantities of a condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Rate,
    Jitter,
    JitterRms,
    Gap,
    Age,
    Lost,
    Late,
    Bandwidth,
    Count,
    Senders,
}

/// Names of the quantities.
const QUANTITIES: [(&str, Quantity); 10] = [
    ("rate", Quantity::Rate),
    ("jitter", Quantity::Jitter),
    ("jitter_rms", Quantity::JitterRms),
    ("gap", Quantity::Gap),
    ("age", Quantity::Age),
    ("lost", Quantity::Lost),
    ("late", Quantity::Late),
    ("bandwidth", Quantity::Bandwidth),
    ("count", Quantity::Count),
    ("senders", Quantity::Senders),
];

impl Alarm {
    /// Parses a condition.
    ///
    /// # Errors
    /// [`Error::Alarm`] with the expected syntax; [`Error::Pattern`].
    pub fn new(text: &str) -> Result<Self, Error> {
        let error = |why: String| Error::Alarm { alarm: text.to_owned(), why };
        let Some((names, condition)) = text.trim().split_once(char::is_whitespace) else {
            return Err(error("expected a channel and a condition, such as ROBOT_STATE rate<900".to_owned()));
        };
        let at = condition.find(['<', '>']).ok_or_else(|| error("expected < or >".to_owned()))?;
        let (name, limit) = (condition[..at].trim(), condition[at + 1..].trim());
        let quantity = QUANTITIES.iter().find(|(known, _)| *known == name).map(|(_, quantity)| *quantity);
        let known = QUANTITIES.map(|(name, _)| name).join(", ");
        let quantity =
            quantity.ok_or_else(|| error(format!("{name:?} is not a quantity, expected one of: {known}")))?;
        let number = limit.parse().ok().filter(|limit: &f64| limit.is_finite());
        let limit = number.ok_or_else(|| error(format!("{limit:?} is not a finite number")))?;
        let (channels, is_above) = (Pattern::new(names)?, condition[at..].starts_with('>'));
        let (text, names) = (text.trim().to_owned(), names.to_owned());
        Ok(Alarm { text, channels, names, quantity, is_above, limit })
    }

    fn value(&self, row: &Row) -> Option<f64> {
        match self.quantity {
            Quantity::Rate => Some(row.rate_hz),
            Quantity::Jitter => row.jitter_us,
            Quantity::JitterRms => row.jitter_rms_us,
            Quantity::Gap => row.gap_us,
            Quantity::Age => Some(row.age_s),
            // If the number is unknown, use its upper bound.
            Quantity::Lost => row.lost.or(row.lost_at_most).map(|lost| lost as f64),
            Quantity::Late => Some(row.late as f64),
            Quantity::Bandwidth => Some(row.bytes_per_s),
            Quantity::Count => Some(row.count as f64),
            Quantity::Senders => Some(row.senders.len() as f64),
        }
    }

    fn is_raised(&self, value: f64) -> bool {
        if self.is_above { value > self.limit } else { value < self.limit }
    }

    /// Whether a channel without messages raises this alarm.
    fn is_raised_without_messages(&self) -> bool {
        match self.quantity {
            Quantity::Rate | Quantity::Count | Quantity::Senders | Quantity::Bandwidth => self.is_raised(0.0),
            Quantity::Age => self.is_above,
            Quantity::Jitter | Quantity::JitterRms | Quantity::Gap | Quantity::Lost | Quantity::Late => false,
        }
    }
}

/// A raised alarm.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Raised {
    /// The condition.
    pub alarm: String,
    /// Channel, or the condition's expression if no channel matches it.
    pub channel: String,
    /// Value in the unit of the condition; `None` if no channel matches.
    pub value: Option<f64>,
    /// Number of changes from not raised to raised.
    pub times: u64,
}

/// Alarm conditions and their states.
#[derive(Debug, Clone, Default)]
pub struct Alarms {
    alarms: Vec<Alarm>,
    states: BTreeMap<(usize, String), State>,
    /// Indices of conditions that matched a channel at some time.
    matched: BTreeSet<usize>,
}

#[derive(Debug, Clone, Copy, Default)]
struct State {
    is_raised: bool,
    times: u64,
}

impl Alarms {
    /// Conditions that are not raised.
    pub fn new(alarms: Vec<Alarm>) -> Self {
        Alarms { alarms, ..Alarms::default() }
    }

    /// Checks all conditions. Returns those that are raised now.
    pub fn check(&mut self, rows: &[Row]) -> Vec<Raised> {
        let mut raised = Vec::new();
        for (at, alarm) in self.alarms.iter().enumerate() {
            let matching = rows.iter().filter(|row| alarm.channels.matches(&row.name));
            let mut found: Vec<(&str, Option<f64>, bool)> = matching
                .filter_map(|row| alarm.value(row).map(|value| (&*row.name, Some(value), alarm.is_raised(value))))
                .collect();
            if rows.iter().any(|row| alarm.channels.matches(&row.name)) {
                self.matched.insert(at);
            } else {
                found.push((&alarm.names, None, alarm.is_raised_without_messages()));
            }
            for (channel, value, is_raised) in found {
                let state = self.states.entry((at, channel.to_owned())).or_default();
                state.times += u64::from(is_raised && !state.is_raised);
                state.is_raised = is_raised;
                if is_raised {
                    let (alarm, channel) = (alarm.text.clone(), channel.to_owned());
                    raised.push(Raised { alarm, channel, value, times: state.times });
                }
            }
        }
        raised
    }

    /// Conditions that have not matched a channel in any [`Alarms::check`], for example because of a misspelled name.
    pub fn unmatched(&self) -> impl Iterator<Item = &str> {
        let alarms = self.alarms.iter().enumerate();
        alarms.filter(|(at, _)| !self.matched.contains(at)).map(|(_, alarm)| &*alarm.text)
    }

    /// How often each condition was raised, over all channels.
    pub fn times(&self) -> impl Iterator<Item = (&str, u64)> {
        let times = |at| self.states.iter().filter(move |((of, _), _)| *of == at).map(|(_, state)| state.times).sum();
        self.alarms.iter().enumerate().map(move |(at, alarm)| (&*alarm.text, times(at)))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn row(name: &str, rate_hz: f64) -> Row {
        Row { name: name.to_owned(), rate_hz, lost: None, lost_at_most: Some(2), ..Row::default() }
    }

    fn alarms(texts: &[&str]) -> Alarms {
        Alarms::new(texts.iter().map(|text| Alarm::new(text).unwrap()).collect())
    }

    fn raised(alarms: &mut Alarms, rows: &[Row]) -> Vec<(String, Option<f64>, u64)> {
        alarms.check(rows).into_iter().map(|raised| (raised.channel, raised.value, raised.times)).collect()
    }

    #[test]
    fn conditions_that_match_no_channel_are_listed() {
        let mut alarms = alarms(&["A.* rate<900", "AA rate>10", "B rate<900"]);
        raised(&mut alarms, &[row("A1", 1000.0)]);
        assert_eq!(alarms.unmatched().collect::<Vec<_>>(), ["AA rate>10", "B rate<900"]);
        raised(&mut alarms, &[row("B", 1000.0)]);
        raised(&mut alarms, &[]);
        assert_eq!(alarms.unmatched().collect::<Vec<_>>(), ["AA rate>10"]);
    }

    #[test]
    fn an_alarm_is_counted_each_time_it_is_raised() {
        let mut alarms = alarms(&["A.* rate < 900"]);
        assert_eq!(raised(&mut alarms, &[row("A1", 1000.0), row("B", 1.0)]), []);
        assert_eq!(raised(&mut alarms, &[row("A1", 899.0)]), [("A1".to_owned(), Some(899.0), 1)]);
        assert_eq!(raised(&mut alarms, &[row("A1", 800.0)]), [("A1".to_owned(), Some(800.0), 1)]);
        assert_eq!(raised(&mut alarms, &[row("A1", 900.0)]), []);
        assert_eq!(raised(&mut alarms, &[row("A1", 1.0)])[0].2, 2);
        assert_eq!(alarms.times().collect::<Vec<_>>(), [("A.* rate < 900", 2)]);
    }

    #[test]
    fn a_channel_without_messages_raises_rate_age_and_senders_only() {
        let texts = ["GONE rate<900", "GONE age>1", "GONE rate>5", "GONE lost>0", "GONE gap>1", "GONE senders<1"];
        let mut alarms = alarms(&texts);
        let found: Vec<_> = alarms.check(&[row("A", 1.0)]).into_iter().map(|raised| raised.alarm).collect();
        assert_eq!(found, ["GONE rate<900", "GONE age>1", "GONE senders<1"]);
    }

    #[test]
    fn an_unknown_loss_uses_its_upper_bound() {
        assert_eq!(raised(&mut alarms(&["A lost>1"]), &[row("A", 1.0)]), [("A".to_owned(), Some(2.0), 1)]);
        assert_eq!(raised(&mut alarms(&["A lost>2"]), &[row("A", 1.0)]), []);
    }

    #[test]
    fn an_invalid_condition_is_rejected() {
        for (text, named) in [
            ("ROBOT_STATE", "ROBOT_STATE"),
            ("A rate", "<"),
            ("A speed<1", "\"speed\""),
            ("A rate<many", "\"many\""),
            ("A rate<NaN", "\"NaN\""),
        ] {
            let error = Alarm::new(text).unwrap_err();
            assert!(matches!(&error, Error::Alarm { alarm, why } if alarm == text && why.contains(named)), "{error}");
        }
        assert!(matches!(Alarm::new("A( rate<1").unwrap_err(), Error::Pattern { pattern, .. } if pattern == "A("));
    }
}
