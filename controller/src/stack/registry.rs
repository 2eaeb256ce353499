//! Tables of the tasks and constraints that a formula can name.

use super::{Formula, PhysicalLevel, StackError, Variables};
use crate::model::near_names;

/// A line of a table.
pub struct Entry<N> {
    /// Name in a formula.
    pub name: &'static str,
    /// Physical level of its rows.
    pub level: PhysicalLevel,
    /// Constructor.
    pub new: N,
}

/// The tasks and constraints of a controller. `T` and `C` are the types of their constructors.
pub struct Registry<T: 'static, C: 'static> {
    /// Tasks.
    pub tasks: &'static [Entry<T>],
    /// Constraints. Their rows are in this order, whatever the order in a formula.
    pub constraints: &'static [Entry<C>],
    /// Constraints without which a solution is physically meaningless.
    pub needed: &'static [&'static str],
}

impl<T, C> Registry<T, C> {
    /// The constraints of a formula, in the order of the table.
    pub fn constraints_of<'a>(&'a self, formula: &'a Formula) -> impl Iterator<Item = &'a Entry<C>> {
        self.constraints.iter().filter(|entry| formula.has(entry.name))
    }

    /// Checks the names in a formula and their levels.
    ///
    /// - `further`: names of tasks that are not in the table.
    ///
    /// # Errors
    /// An unknown task or constraint; one whose level the variables do not have; a needed constraint that is missing.
    pub fn check(&self, formula: &Formula, further: &[&str], variables: &Variables) -> Result<(), StackError> {
        for (_, term) in formula.terms().filter(|(_, term)| !further.contains(&term.task.as_str())) {
            let entry = self.tasks.iter().find(|entry| entry.name == term.task).ok_or_else(|| {
                let names = self.tasks.iter().map(|entry| entry.name).chain(further.iter().copied());
                let (known, near) = known_and_near(&term.task, names);
                StackError::UnknownTask { column: term.column, task: term.task.as_str().into(), known, near }
            })?;
            check_level(&term.task, term.column, entry.level, variables)?;
        }
        for constraint in &formula.constraints {
            let entry = self.constraints.iter().find(|entry| entry.name == constraint.name).ok_or_else(|| {
                let (known, near) = known_and_near(&constraint.name, self.constraints.iter().map(|entry| entry.name));
                let (column, constraint) = (constraint.column, constraint.name.as_str().into());
                StackError::UnknownConstraint { column, constraint, known, near }
            })?;
            check_level(&constraint.name, constraint.column, entry.level, variables)?;
        }
        match self.needed.iter().find(|needed| !formula.has(needed)) {
            Some(constraint) => Err(StackError::ConstraintMissing { constraint }),
            None => Ok(()),
        }
    }
}

fn check_level(name: &str, column: usize, level: PhysicalLevel, variables: &Variables) -> Result<(), StackError> {
    if variables.expresses(level) {
        return Ok(());
    }
    Err(StackError::Level { column, name: name.to_owned(), level: level.name() })
}

/// The known names as a list, and those similar to `wanted`.
fn known_and_near<'a>(wanted: &str, names: impl Iterator<Item = &'a str> + Clone) -> (Box<str>, Box<[String]>) {
    (names.clone().collect::<Vec<_>>().join(", ").into(), near_names(wanted, names).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn entry(name: &'static str, level: PhysicalLevel) -> Entry<()> {
        Entry { name, level, new: () }
    }

    const TABLE: Registry<(), ()> = Registry {
        tasks: &[
            entry("posture", PhysicalLevel::Acceleration),
            entry("rolling", PhysicalLevel::Velocity),
            entry("cone", PhysicalLevel::Force),
        ],
        constraints: &[entry("dynamics", PhysicalLevel::Acceleration), entry("friction", PhysicalLevel::Force)],
        needed: &["dynamics"],
    };

    fn check(text: &str, variables: &Variables) -> Result<(), StackError> {
        TABLE.check(&Formula::parse(text).unwrap(), &["own"], variables)
    }

    #[test]
    fn unknown_names_wrong_levels_and_missing_constraints_are_found() {
        let whole = Variables::new(18, [3; 4], true);
        assert_eq!(check("posture + cone / own << friction << dynamics", &whole), Ok(()));
        let unknown = check("posture / postre << dynamics", &whole);
        let StackError::UnknownTask { column, task, known, near } = unknown.unwrap_err() else { panic!() };
        assert_eq!((column, &*task, &*known), (11, "postre", "posture, rolling, cone, own"));
        assert_eq!(*near, ["posture"]);
        let unknown = check("posture << dynamics << frction", &whole);
        let StackError::UnknownConstraint { column, near, .. } = unknown.unwrap_err() else { panic!() };
        assert_eq!((column, &*near), (24, &["friction".to_owned()][..]));
        assert_eq!(check("posture << friction", &whole), Err(StackError::ConstraintMissing { constraint: "dynamics" }));
        let wrong = |column, name: &str, level| Err(StackError::Level { column, name: name.to_owned(), level });
        assert_eq!(check("posture + rolling << dynamics", &whole), wrong(11, "rolling", "velocity"));
        // A program of accelerations alone has no forces, a program of velocities neither forces nor accelerations.
        let motion = Variables::new(18, [], false);
        assert_eq!(check("posture << dynamics << friction", &motion), wrong(24, "friction", "force"));
        let velocities = Variables::velocities(18);
        assert_eq!(check("rolling + posture << dynamics", &velocities), wrong(11, "posture", "acceleration"));
    }
}
