//! Moving floors: the ground under one foot drops or rises while the foot is in the air.
//!
//! Each foot with floor moves stands on a separate plane. This plane collides only with the leg of that foot, and the leg collides only
//! with this plane. A move takes effect in one step, while the foot is above the old and the new height, so that no contact sees a
//! moving floor.

use crate::checks::{BadKey, check_range, to_ns};
use crate::terrain::TerrainKind;
use controller::quadruped::leg::Leg;
use serde::Deserialize;

/// Smallest height of the foot above the old and the new floor when the floor moves, m.
const CLEARANCE: f64 = 0.01;

/// Name of a leg in a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub(crate) enum LegName {
    LF,
    RF,
    LH,
    RH,
}

impl From<LegName> for Leg {
    fn from(name: LegName) -> Leg {
        match name {
            LegName::LF => Leg::LF,
            LegName::RF => Leg::RF,
            LegName::LH => Leg::LH,
            LegName::RH => Leg::RH,
        }
    }
}

/// A `[[floor]]` entry: the floor under one foot moves to another height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorMove {
    /// Earliest time of the move, ns. The floor moves at the first instant from then on at which the foot is high enough.
    pub t_ns: i64,
    /// Leg of the foot.
    pub leg: Leg,
    /// New height above the surrounding ground, m.
    pub height: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FloorEntry {
    t_s: f64,
    leg: LegName,
    height_m: f64,
}

impl FloorEntry {
    pub(crate) fn resolve(&self, ground: TerrainKind) -> Result<FloorMove, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        check_range("height_m", &[self.height_m], -1.0..=0.3)?;
        if ground != TerrainKind::Flat {
            let found = format!("given on terrain of kind {ground:?}").to_lowercase();
            return Err(BadKey { key: "height_m", found, expected: "terrain of kind flat".to_owned() });
        }
        Ok(FloorMove { t_ns: to_ns(self.t_s), leg: self.leg.into(), height: self.height_m })
    }
}

/// State of the floors of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Floors {
    moves: Vec<FloorMove>,
    /// Whether each move was made.
    made: Vec<bool>,
    height: [f64; 4],
}

impl Floors {
    pub fn new(moves: &[FloorMove]) -> Self {
        Floors { moves: moves.to_vec(), made: vec![false; moves.len()], height: [0.0; 4] }
    }

    /// Whether a foot has a floor of its own.
    pub fn has(&self, leg: usize) -> bool {
        self.moves.iter().any(|of| of.leg as usize == leg)
    }

    /// Returns all floors to their initial height.
    pub fn reset(&mut self) {
        *self = Floors::new(&self.moves);
    }

    /// The new height of a foot's floor, m, if it moves now.
    ///
    /// - `foot`: height of the lowest point of the foot, m.
    pub fn update(&mut self, t_ns: i64, leg: usize, foot: f64) -> Option<f64> {
        let due = |(i, of): &(usize, &FloorMove)| !self.made[*i] && of.leg as usize == leg && of.t_ns <= t_ns;
        let (i, of) = self.moves.iter().enumerate().find(due)?;
        if foot < self.height[leg].max(of.height) + CLEARANCE {
            return None;
        }
        self.made[i] = true;
        self.height[leg] = of.height;
        Some(of.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_moves_once_and_only_while_the_foot_is_above_both_heights() {
        let mut floors = Floors::new(&[
            FloorMove { t_ns: 10, leg: Leg::RF, height: -0.05 },
            FloorMove { t_ns: 20, leg: Leg::RF, height: 0.03 },
        ]);
        assert!(floors.has(1) && !floors.has(0));
        assert_eq!(floors.update(9, 1, 0.1), None, "too early");
        assert_eq!(floors.update(10, 0, 0.1), None, "another foot");
        assert_eq!(floors.update(11, 1, 0.009), None, "the foot is too low");
        assert_eq!(floors.update(12, 1, 0.01), Some(-0.05));
        assert_eq!(floors.update(13, 1, 0.1), None, "the move was made already");
        assert_eq!(floors.update(20, 1, 0.03), None, "the floor would hit the foot");
        assert_eq!(floors.update(21, 1, 0.05), Some(0.03));
        floors.reset();
        assert_eq!(floors.update(10, 1, 0.1), Some(-0.05));
    }
}
