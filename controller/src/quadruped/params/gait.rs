//! Parameters of the gaits.

use crate::params::ParamsError;
use crate::params::exact::array;
use crate::params::range::{Bound, Range, range};
use crate::quadruped::leg::Leg;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Range of a duty factor.
pub const DUTY: Range = Range { contains: |x| (0.5..1.0).contains(&x), expected: "at least 0.5 and below 1" };
/// Range of a phase.
const PHASE: Range = Range { contains: |x| (0.0..1.0).contains(&x), expected: "at least 0 and below 1" };
/// Range of the phase of a leg of a further gait.
const PHASE_OR_NEVER: Range =
    Range { contains: |x| x == NEVER || (0.0..1.0).contains(&x), expected: "at least 0 and below 1, or -1 (no step)" };
/// Phase of a leg that never lifts off.
pub const NEVER: f64 = -1.0;
/// Range of a swing frequency, Hz.
pub const SWING_FREQUENCY: Range = range!(0.5, 10);

const SWAY: Range = range!(0, 0.5);
const RESIDUAL_LOAD: Range = range!(0, 0.2);
const RAMP: Range = range!(0, 0.5);
const VELOCITY_GAIN: Range = range!(0.1, 3);
/// Legs that may swing at the same time: two legs stand at every moment.
pub const MOST_SWINGING: usize = 2;
/// Largest number of further gaits: the numbers in messages have 8 bits.
const MOST_FURTHER: usize = 100;
/// Longest name of a further gait, characters.
const LONGEST_NAME: usize = 24;
/// Difference of two phases up to which they count as equal: decimal fractions such as 1 - 0.55 are not exact.
const SAME_PHASE: f64 = 1e-9;

/// A gait of the parameters, by its number in `operator_command_t` and in a snapshot: trot, crawl, then the further gaits in the order of their
/// names. [`GaitParams::gait`] makes one that the parameters contain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gait(u8);

impl Gait {
    /// Diagonal pairs.
    pub const TROT: Gait = Gait(0);
    /// One leg at a time.
    pub const CRAWL: Gait = Gait(1);

    /// The gait with this number, from 0.
    pub(in crate::quadruped) const fn numbered(number: u8) -> Self {
        Gait(number)
    }

    /// Number in messages.
    pub fn number(self) -> i8 {
        self.0.cast_signed()
    }
}

/// The `[gait]` table: timing of the gaits. Source: Raiola, Fig. 4 and Table 2, except for the crawl. With the printed duty factor of 0.80 and
/// 2 Hz the weight has to move from one support triangle to the next in 0.125 s, and the robot falls where the feet do not land as planned; with
/// the defaults here it has 0.36 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "BTreeMap<String, GaitTiming>")]
pub struct GaitParams {
    /// Trot: diagonal pairs.
    pub trot: GaitTiming,
    /// Crawl: one leg at a time, LF RH RF LH.
    pub crawl: GaitTiming,
    /// Further gaits by name: `[gait.NAME]`.
    #[serde(flatten)]
    pub further: BTreeMap<String, GaitTiming>,
}

impl From<BTreeMap<String, GaitTiming>> for GaitParams {
    fn from(mut gaits: BTreeMap<String, GaitTiming>) -> Self {
        let GaitParams { trot, crawl, .. } = GaitParams::default();
        let (trot, crawl) = (gaits.remove("trot").unwrap_or(trot), gaits.remove("crawl").unwrap_or(crawl));
        GaitParams { trot, crawl, further: gaits }
    }
}

/// Timing of one gait. Swing time `T_sw = 1/f_sw`, stride `T = T_sw/(1 - δ)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaitTiming {
    /// Duty factor `δ = T_st/T`.
    pub duty: f64,
    /// Swing frequency `f_sw = 1/T_sw`, Hz.
    pub swing_frequency: f64,
    /// Phase of the stride at which each leg lifts off, LF RF LH RH; in a further gait -1 for a leg that never lifts off.
    #[serde(deserialize_with = "array")]
    pub lift_off_phase: [f64; 4],
    /// How far the zero-moment point moves from the centre towards the foot opposite to the swinging one, as a fraction of half their distance.
    #[serde(default)]
    pub sway: f64,
    /// Smallest vertical force of the foot opposite to one that swings or unloads, as a fraction of the weight.
    #[serde(default)]
    pub residual_load: f64,
    /// Length of the ramps on which a leg is loaded and unloaded, as a fraction of the time in which all four legs stand; 0 = no ramp.
    #[serde(default = "half")]
    pub ramp: f64,
    /// Factor on the commanded velocity, for a gait in which the robot walks slower than commanded.
    #[serde(default = "one")]
    pub velocity_gain: f64,
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

impl Default for GaitParams {
    fn default() -> Self {
        GaitParams {
            trot: GaitTiming {
                duty: 0.55,
                swing_frequency: 2.0,
                lift_off_phase: [0.0, 0.5, 0.5, 0.0],
                sway: 0.0,
                residual_load: 0.0,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
            crawl: GaitTiming {
                duty: 0.88,
                swing_frequency: 3.0,
                lift_off_phase: [0.0, 0.5, 0.75, 0.25],
                sway: 0.25,
                residual_load: 0.05,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
            further: BTreeMap::new(),
        }
    }
}

impl GaitParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("gait.trot.duty", DUTY, ""),
        Bound::new("gait.trot.swing_frequency", SWING_FREQUENCY, "Hz"),
        Bound::new("gait.trot.lift_off_phase", PHASE, "strides"),
        Bound::new("gait.trot.sway", SWAY, ""),
        Bound::new("gait.trot.residual_load", RESIDUAL_LOAD, "weights"),
        Bound::new("gait.trot.ramp", RAMP, ""),
        Bound::new("gait.trot.velocity_gain", VELOCITY_GAIN, ""),
        Bound::new("gait.crawl.duty", DUTY, ""),
        Bound::new("gait.crawl.swing_frequency", SWING_FREQUENCY, "Hz"),
        Bound::new("gait.crawl.lift_off_phase", PHASE, "strides"),
        Bound::new("gait.crawl.sway", SWAY, ""),
        Bound::new("gait.crawl.residual_load", RESIDUAL_LOAD, "weights"),
        Bound::new("gait.crawl.ramp", RAMP, ""),
        Bound::new("gait.crawl.velocity_gain", VELOCITY_GAIN, ""),
    ];

    /// The gait with a number of `operator_command_t` or of a snapshot; `None` if the parameters have no such gait.
    pub fn gait(&self, number: i8) -> Option<Gait> {
        u8::try_from(number).ok().filter(|_| number <= self.last()).map(Gait::numbered)
    }

    /// The largest number of a gait.
    pub fn last(&self) -> i8 {
        i8::try_from(self.further.len()).map_or(i8::MAX, |further| further.saturating_add(1))
    }

    /// Timing of a gait. A gait that these parameters do not have counts as trot.
    pub fn timing(&self, gait: Gait) -> &GaitTiming {
        match gait {
            Gait::TROT => &self.trot,
            Gait::CRAWL => &self.crawl,
            Gait(number) => self.further.values().nth(usize::from(number) - 2).unwrap_or(&self.trot),
        }
    }

    /// Names of all gaits, in the order of their numbers.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        ["trot", "crawl"].into_iter().chain(self.further.keys().map(String::as_str))
    }

    /// Name of a gait.
    pub fn name(&self, gait: Gait) -> &str {
        self.names().nth(usize::from(gait.0)).unwrap_or("?")
    }

    /// The gait with this name.
    pub fn named(&self, name: &str) -> Option<Gait> {
        let number = self.names().position(|known| known == name)?;
        u8::try_from(number).ok().map(Gait::numbered)
    }

    /// Checks names and numbers of the further gaits, and of every gait that a leg steps and that two legs stand at every moment.
    ///
    /// # Errors
    /// [`ParamsError::Gait`]
    pub fn check(&self) -> Result<(), ParamsError> {
        let error = |gait: &str, key, found: String, expected: String| {
            Err(ParamsError::Gait { gait: gait.to_owned(), key, found, expected })
        };
        let number = self.further.len();
        if number > MOST_FURTHER {
            return error("", "number of further gaits", number.to_string(), format!("at most {MOST_FURTHER}"));
        }
        for (name, timing) in &self.further {
            let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            if !(1..=LONGEST_NAME).contains(&name.len()) || !name.chars().all(is_plain) {
                let expected = format!("1 to {LONGEST_NAME} characters of a-z, 0-9 and _");
                return error(name, "name", format!("{name:?}"), expected);
            }
            let GaitTiming { duty, swing_frequency, lift_off_phase, sway, residual_load, ramp, velocity_gain } = timing;
            let one = std::slice::from_ref::<f64>;
            let numbers: [(&str, Range, &[f64]); 7] = [
                ("duty", DUTY, one(duty)),
                ("swing_frequency", SWING_FREQUENCY, one(swing_frequency)),
                ("lift_off_phase", PHASE_OR_NEVER, lift_off_phase),
                ("sway", SWAY, one(sway)),
                ("residual_load", RESIDUAL_LOAD, one(residual_load)),
                ("ramp", RAMP, one(ramp)),
                ("velocity_gain", VELOCITY_GAIN, one(velocity_gain)),
            ];
            for (key, range, values) in numbers {
                if let Some(found) = values.iter().find(|x| !(range.contains)(**x)) {
                    return error(name, key, found.to_string(), range.expected.to_owned());
                }
            }
        }
        for (name, timing) in self.names().zip([&self.trot, &self.crawl].into_iter().chain(self.further.values())) {
            let phases = format!("{:?}", timing.lift_off_phase);
            let (phase, swinging) = timing.most_swinging(timing.duty);
            if swinging == 0 {
                return error(name, "lift_off_phase", phases, "a leg that steps".to_owned());
            }
            if swinging > MOST_SWINGING {
                let found = format!("{phases} with duty {}: {swinging} legs swing at phase {phase}", timing.duty);
                return error(name, "lift_off_phase", found, "two legs that stand at every moment".to_owned());
            }
        }
        Ok(())
    }
}

impl GaitTiming {
    /// Whether a leg lifts off at all.
    pub fn steps(&self, leg: Leg) -> bool {
        self.lift_off_phase[leg as usize] != NEVER
    }

    /// Whether every leg lifts off.
    pub fn all_step(&self) -> bool {
        Leg::ALL.into_iter().all(|leg| self.steps(leg))
    }

    /// A phase at which most legs swing with a duty factor, and their number.
    pub fn most_swinging(&self, duty: f64) -> (f64, usize) {
        let stepping = || self.lift_off_phase.into_iter().filter(|phase| *phase != NEVER);
        let swinging = |at: f64| stepping().filter(|phase| wrapped(at - phase) < 1.0 - duty - SAME_PHASE).count();
        stepping().map(|at| (at, swinging(at))).fold((0.0, 0), |most, next| if next.1 > most.1 { next } else { most })
    }

    /// The part of the stride in which exactly these two legs stand.
    pub fn part_on(&self, pair: [Leg; 2]) -> f64 {
        let swing = 1.0 - self.duty;
        let stepping = self.lift_off_phase.into_iter().filter(|phase| *phase != NEVER);
        let mut changes: Vec<f64> = stepping.flat_map(|phase| [phase, wrapped(phase + swing)]).collect();
        changes.sort_by(f64::total_cmp);
        let ends = changes.iter().skip(1).copied().chain(changes.first().map(|first| first + 1.0));
        let swings = |leg: Leg, at: f64| self.steps(leg) && wrapped(at - self.lift_off_phase[leg as usize]) < swing;
        let is_on = |at: f64| Leg::ALL.into_iter().all(|leg| swings(leg, at) != pair.contains(&leg));
        changes.iter().zip(ends).filter(|(from, to)| is_on(0.5 * (*from + to))).map(|(from, to)| to - from).sum()
    }
}

/// A phase modulo 1, in `[0, 1)`; differences up to [`SAME_PHASE`] below 1 count as 0.
fn wrapped(phase: f64) -> f64 {
    let part = phase - phase.floor();
    if part > 1.0 - SAME_PHASE { 0.0 } else { part }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(duty: f64, lift_off_phase: [f64; 4]) -> GaitTiming {
        GaitTiming { duty, lift_off_phase, ..GaitParams::default().trot }
    }

    /// The key of the error that a gait `x` causes; empty if it is accepted.
    fn refused(timing: GaitTiming) -> &'static str {
        let mut params = GaitParams::default();
        params.further.insert("x".to_owned(), timing);
        match params.check() {
            Ok(()) => "",
            Err(ParamsError::Gait { gait, key, .. }) if gait == "x" => key,
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn two_legs_stand_at_every_moment_and_a_leg_steps() {
        for (duty, phases) in [
            (0.5, [0.0, 0.5, 0.5, 0.0]),
            (0.55, [0.0, 0.5, 0.0, 0.5]),
            (0.5, [0.0, 0.25, 0.5, 0.75]),
            (0.5, [0.0, 0.0, NEVER, NEVER]),
            (0.7, [0.9, 0.1, 0.4, 0.6]),
            // 1 - 0.9 is less than 0.1 by rounding, 1 - 0.7 more than 0.3.
            (0.9, [0.0, 0.1, 0.2, 0.3]),
            (0.7, [0.0, 0.0, 0.3, 0.3]),
        ] {
            assert_eq!(refused(timing(duty, phases)), "", "{duty} {phases:?}");
        }
        for (duty, phases) in [
            (0.55, [0.0; 4]),
            (0.55, [0.0, 0.1, 0.2, 0.5]),
            (0.6, [0.9, 0.1, 0.2, 0.5]),
            (0.55, [NEVER; 4]),
            (0.55, [0.0, 0.0, 0.0, NEVER]),
            (0.55, [1.0, 0.5, 0.5, 0.0]),
            (0.55, [-0.5, 0.5, 0.5, 0.0]),
            (0.55, [f64::NAN, 0.5, 0.5, 0.0]),
        ] {
            assert_eq!(refused(timing(duty, phases)), "lift_off_phase", "{duty} {phases:?}");
        }
        let good = timing(0.55, [0.0, 0.5, 0.5, 0.0]);
        for (changed, key) in [
            (GaitTiming { duty: 0.4, ..good.clone() }, "duty"),
            (GaitTiming { duty: 1.0, ..good.clone() }, "duty"),
            (GaitTiming { swing_frequency: 0.0, ..good.clone() }, "swing_frequency"),
            (GaitTiming { sway: 0.6, ..good.clone() }, "sway"),
            (GaitTiming { residual_load: -0.1, ..good.clone() }, "residual_load"),
            (GaitTiming { ramp: f64::INFINITY, ..good.clone() }, "ramp"),
            (GaitTiming { velocity_gain: 0.0, ..good.clone() }, "velocity_gain"),
        ] {
            assert_eq!(refused(changed), key);
        }
        let mut trot = GaitParams::default();
        trot.trot.lift_off_phase = [0.0; 4];
        assert!(matches!(trot.check(), Err(ParamsError::Gait { gait, .. }) if gait == "trot"));
    }

    #[test]
    fn names_are_plain_and_numbers_follow_their_order() {
        let mut params = GaitParams::default();
        for name in ["pace", "bound"] {
            params.further.insert(name.to_owned(), timing(0.6, [0.0, 0.5, 0.0, 0.5]));
        }
        params.check().unwrap();
        assert_eq!(params.names().collect::<Vec<_>>(), ["trot", "crawl", "bound", "pace"]);
        for (number, name) in (0..).zip(["trot", "crawl", "bound", "pace"]) {
            let gait = params.gait(number).unwrap();
            assert_eq!((params.name(gait), params.named(name), gait.number()), (name, Some(gait), number));
        }
        assert_eq!([-1, 4, 127].map(|number| params.gait(number)), [None; 3]);
        assert_eq!(params.timing(Gait::numbered(3)).duty, 0.6);
        for name in ["", "Pace", "a b", "\u{1b}[2J", "a.b", "abcdefghijklmnopqrstuvwxy"] {
            let mut params = GaitParams::default();
            params.further.insert(name.to_owned(), timing(0.6, [0.0, 0.5, 0.0, 0.5]));
            assert!(matches!(params.check(), Err(ParamsError::Gait { key: "name", .. })), "{name:?}");
        }
        let further = (0..200).map(|i| (format!("g{i}"), timing(0.6, [0.0, 0.5, 0.0, 0.5]))).collect();
        let many = GaitParams { further, ..GaitParams::default() };
        assert!(matches!(many.check(), Err(ParamsError::Gait { key: "number of further gaits", .. })));
    }

    #[test]
    fn the_part_of_the_stride_on_two_legs() {
        let of = |duty, phases, pair| timing(duty, phases).part_on(pair);
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}, {expected}");
        // A pace swings one side for 0.45 of the stride, and the other side stands.
        let pace = [0.0, 0.5, 0.0, 0.5];
        near(of(0.55, pace, [Leg::RF, Leg::RH]), 0.45);
        near(of(0.55, pace, [Leg::LF, Leg::LH]), 0.45);
        near(of(0.55, pace, [Leg::LF, Leg::RF]), 0.0);
        near(of(0.55, [0.0, 0.5, 0.5, 0.0], [Leg::RF, Leg::LH]), 0.45);
        // The swings [0.9, 1.2) of LF and [0.1, 0.4) of LH overlap from 0.1 to 0.2.
        near(of(0.7, [0.9, 0.6, 0.1, 0.6], [Leg::RF, Leg::RH]), 0.1);
        near(of(0.7, [0.9, NEVER, 0.1, NEVER], [Leg::RF, Leg::RH]), 0.1);
        near(of(0.7, [0.0, NEVER, NEVER, NEVER], [Leg::RF, Leg::RH]), 0.0);
    }
}
