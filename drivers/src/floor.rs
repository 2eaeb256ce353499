//! Moving floors: the ground under one contact drops or rises while the contact is in the air.
//!
//! Each contact with floor moves stands on a separate plane. This plane collides only with the chain of that contact, and the chain collides only
//! with this plane. A move takes effect in one step, while the foot is above the old and the new height, so that no contact sees a
//! moving floor.

use crate::DriverError;
use crate::checks::{BadKey, check_range, to_ns};
use crate::terrain::TerrainKind;
use robot_model::RobotDescription;
use serde::Deserialize;

/// Smallest height of the foot above the old and the new floor when the floor moves, m.
const CLEARANCE: f64 = 0.01;

/// A `[[floor]]` entry: the floor under one foot moves to another height.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorMove {
    /// Earliest time of the move, ns. The floor moves at the first instant from then on at which the foot is high enough.
    pub t_ns: i64,
    /// Name of the contact; the feet of a quadruped are LF RF LH RH.
    pub contact: String,
    /// Key that names the contact: `contact` or `leg`.
    pub key: &'static str,
    /// New height above the surrounding ground, m.
    pub height: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FloorEntry {
    t_s: f64,
    contact: Option<String>,
    leg: Option<String>,
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
        let (key, contact) = match (&self.contact, &self.leg) {
            (Some(contact), None) => ("contact", contact.clone()),
            (None, Some(leg)) => ("leg", leg.clone()),
            (found, _) => {
                let found = if found.is_some() { "given beside leg" } else { "missing" }.to_owned();
                return Err(BadKey { key: "contact", found, expected: "either contact or leg".to_owned() });
            }
        };
        Ok(FloorMove { t_ns: to_ns(self.t_s), contact, key, height: self.height_m })
    }
}

/// State of the floors of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Floors {
    moves: Vec<Move>,
    /// Height under each contact, m.
    height: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Move {
    t_ns: i64,
    contact: usize,
    height: f64,
    is_made: bool,
}

impl Floors {
    /// Binds the moves to the contacts of a robot.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a contact that the robot does not have.
    pub fn new(moves: &[FloorMove], robot: &RobotDescription) -> Result<Self, DriverError> {
        let known = || robot.contacts.iter().map(|contact| contact.name.clone());
        let bind = |(number, of): (usize, &FloorMove)| match known().position(|name| name == of.contact) {
            Some(contact) => Ok(Move { t_ns: of.t_ns, contact, height: of.height, is_made: false }),
            None => Err(DriverError::Unknown {
                wanted_by: format!("floor[{number}].{}", of.key),
                what: "contact",
                name: of.contact.clone(),
                known: known().collect(),
            }),
        };
        let moves = (1..).zip(moves).map(bind).collect::<Result<_, _>>()?;
        Ok(Floors { moves, height: vec![0.0; robot.contacts.len()] })
    }

    /// Whether a contact has a floor of its own.
    pub fn has(&self, contact: usize) -> bool {
        self.moves.iter().any(|of| of.contact == contact)
    }

    /// Returns all floors to their initial height.
    pub fn reset(&mut self) {
        self.moves.iter_mut().for_each(|of| of.is_made = false);
        self.height.fill(0.0);
    }

    /// The new height of a contact's floor, m, if it moves now.
    ///
    /// - `lowest`: height of the lowest point of the contact, m.
    pub fn update(&mut self, t_ns: i64, contact: usize, lowest: f64) -> Option<f64> {
        let due = |of: &&mut Move| !of.is_made && of.contact == contact && of.t_ns <= t_ns;
        let of = self.moves.iter_mut().find(due)?;
        let height = &mut self.height[contact];
        if lowest < height.max(of.height) + CLEARANCE {
            return None;
        }
        (of.is_made, *height) = (true, of.height);
        Some(of.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot_model::UrdfTree;

    #[test]
    fn a_floor_moves_once_and_only_while_the_foot_is_above_both_heights() {
        let (urdf, toml) = (include_str!("../../robots/hyq/hyq.urdf"), include_str!("../../robots/hyq/hyq.toml"));
        let robot = RobotDescription::from_toml(toml, "hyq.toml", &UrdfTree::parse(urdf, "hyq.urdf").unwrap()).unwrap();
        let to = |t_ns, contact: &str, height| FloorMove { t_ns, contact: contact.to_owned(), key: "contact", height };
        let mut floors = Floors::new(&[to(10, "RF", -0.05), to(20, "RF", 0.03)], &robot).unwrap();
        let error = Floors::new(&[to(10, "rf", -0.05)], &robot).unwrap_err();
        let DriverError::Unknown { wanted_by, what, name, known } = &error else { panic!("{error}") };
        assert_eq!((wanted_by.as_str(), *what, name.as_str()), ("floor[1].contact", "contact", "rf"));
        assert_eq!(known[3], "RH");
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
