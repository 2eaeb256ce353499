//! Parameters and URDF of a robot that do not fit each other, though a controller can be built: usually a mistake in a file.

use super::leg::Leg;
use super::robot::Robot;
use crate::error::LoadError;
use crate::model::{ShapeKind, UrdfTree, untouchable};
use crate::params::{Params, RobotConfig};
use crate::stack::Formula;
use std::fmt;

/// Largest plausible radius of a foot, as a fraction of the height of the base above the centres of the feet.
const LARGEST_FOOT: f64 = 0.25;
/// Largest difference of the radius in the parameters from that in the URDF, as a fraction.
const RADIUS_TOLERANCE: f64 = 0.2;
/// Largest plausible distance of a foot's sphere from the origin of its link, m.
const LARGEST_OFFSET: f64 = 1e-3;
/// Tasks that keep the standing feet on the ground.
const STANCE: [&str; 2] = ["contact", "relative_feet"];
/// Part of the stride on the legs of one side or end up to which it is not reported.
const SHORTEST_ONE_SIDED: f64 = 1e-6;

/// A property that is probably a mistake.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Implausible {
    /// `robot.foot_radius` differs from the URDF.
    FootRadius {
        /// The value, m.
        found: f64,
        /// A foot whose sphere in the URDF has another radius.
        link: String,
        /// That radius, m.
        urdf: f64,
    },
    /// `robot.foot_radius` is large for the robot.
    LargeFootRadius {
        /// The value, m.
        found: f64,
        /// Largest plausible value, m.
        limit: f64,
    },
    /// The centre of a foot's sphere in the URDF is not at the origin of its link, where controller and simulator put it.
    FootOffset {
        /// The foot link.
        link: String,
        /// Distance, m.
        distance: f64,
    },
    /// A foot is on the wrong side of another one.
    FeetOrder {
        /// A foot, by its leg in `robot.feet`, and its link.
        first: (Leg, String),
        /// Where it should be: `in front of` or `left of`.
        expected: &'static str,
        /// The other foot.
        second: (Leg, String),
    },
    /// The robot has another name in the URDF.
    Name {
        /// `robot.name`.
        found: String,
        /// Name in the URDF.
        urdf: String,
    },
    /// A gait stands on the two legs of one side or end only.
    OneSided {
        /// The gait.
        gait: String,
        /// The two legs.
        legs: [Leg; 2],
        /// Part of the stride.
        part: f64,
    },
    /// No task of the stack keeps the standing feet on the ground.
    NoStanceTask {
        /// The formula.
        formula: String,
    },
    /// Links that cannot touch anything: they have only meshes or no shape.
    TouchNothing {
        /// The links.
        links: Vec<String>,
    },
}

impl fmt::Display for Implausible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FootRadius { found, link, urdf } => {
                write!(f, "robot.foot_radius is {found} m, the sphere of foot {link} in the URDF has {urdf} m")
            }
            Self::LargeFootRadius { found, limit } => {
                write!(f, "robot.foot_radius is {found} m, expected at most {limit:.3} m for the height of this robot")
            }
            Self::FootOffset { link, distance } => write!(
                f,
                "foot {link}: its sphere in the URDF is {distance:.4} m from the origin of the link; controller and simulator put it at the origin"
            ),
            Self::FeetOrder { first: (leg, link), expected, second: (other, other_link) } => write!(
                f,
                "robot.feet: foot {} ({link}) is not {expected} foot {} ({other_link}), expected the order LF RF LH RH",
                leg.name(),
                other.name()
            ),
            Self::Name { found, urdf } => write!(f, "robot.name is \"{found}\", the URDF is of \"{urdf}\""),
            Self::OneSided { gait, legs: [a, b], part } => write!(
                f,
                "gait {gait}: only {} and {} stand for {:.0} % of the stride; the robot tips to the other side meanwhile",
                a.name(),
                b.name(),
                100.0 * part
            ),
            Self::NoStanceTask { formula } => write!(
                f,
                "stack.formula \"{formula}\" names neither contact nor relative_feet: no task keeps the standing feet on the ground, and the robot falls"
            ),
            Self::TouchNothing { links } => write!(
                f,
                "links without a primitive shape: {}; in a simulation, links with a mesh receive a shape from joint to joint (all links, if the trunk has \
                 no primitive shape)",
                links.join(", ")
            ),
        }
    }
}

/// Checks the files of a robot.
///
/// # Errors
/// No controller can be built: see [`Robot::new`].
pub fn implausible(urdf: &str, params: &str) -> Result<Vec<Implausible>, LoadError> {
    let Params { robot: config, gait: gaits, stack, .. } = Params::from_toml(params, "parameters")?;
    let robot = Robot::new(urdf, &config)?;
    let tree = UrdfTree::parse(urdf, &config.urdf)?;
    let RobotConfig { name, feet, foot_radius, .. } = &config;
    let mut found = Vec::new();
    // A name of a file may differ from the URDF in case and in characters other than letters and digits.
    let plain = |name: &str| name.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "_");
    if plain(name) != plain(&tree.name) {
        found.push(Implausible::Name { found: name.clone(), urdf: tree.name.clone() });
    }
    let mut other_radius = None;
    for link in tree.links.iter().filter(|link| feet.contains(&link.name)) {
        let sphere = link.collisions.iter().chain(&link.visuals).find_map(|shape| match shape.kind {
            ShapeKind::Sphere { radius } => Some((radius, shape.X_LS.p.norm())),
            _ => None,
        });
        let Some((radius, distance)) = sphere else { continue };
        if (foot_radius - radius).abs() > RADIUS_TOLERANCE * radius && other_radius.is_none() {
            other_radius = Some(Implausible::FootRadius { found: *foot_radius, link: link.name.clone(), urdf: radius });
        }
        if distance > LARGEST_OFFSET {
            found.push(Implausible::FootOffset { link: link.name.clone(), distance });
        }
    }
    let limit = LARGEST_FOOT * (robot.nominal_height - foot_radius).abs();
    let is_large = *foot_radius > limit;
    found.extend(other_radius.or(is_large.then_some(Implausible::LargeFootRadius { found: *foot_radius, limit })));
    if !Formula::parse(&stack.formula)?.terms().any(|(_, term)| STANCE.contains(&term.task.as_str())) {
        found.push(Implausible::NoStanceTask { formula: stack.formula });
    }
    for number in 0..=gaits.last() {
        let Some(gait) = gaits.gait(number) else { continue };
        for legs in [[Leg::LF, Leg::LH], [Leg::RF, Leg::RH], [Leg::LF, Leg::RF], [Leg::LH, Leg::RH]] {
            let part = gaits.timing(gait).part_on(legs);
            if part > SHORTEST_ONE_SIDED {
                found.push(Implausible::OneSided { gait: gaits.name(gait).to_owned(), legs, part });
            }
        }
    }
    let place = |leg: Leg| robot.legs[leg].p_nominal_H;
    for (first, second, axis, expected) in [
        (Leg::LF, Leg::LH, 0, "in front of"),
        (Leg::RF, Leg::RH, 0, "in front of"),
        (Leg::LF, Leg::RF, 1, "left of"),
        (Leg::LH, Leg::RH, 1, "left of"),
    ] {
        if place(first)[axis] <= place(second)[axis] {
            let named = |leg: Leg| (leg, feet[leg as usize].clone());
            found.push(Implausible::FeetOrder { first: named(first), expected, second: named(second) });
        }
    }
    let links = untouchable(&tree, feet);
    if !links.is_empty() {
        found.push(Implausible::TouchNothing { links });
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HYQ: [&str; 2] = [include_str!("../../../robots/hyq/hyq.urdf"), include_str!("../../../robots/hyq/hyq.toml")];

    fn changed(urdf: (&str, &str), params: (&str, &str)) -> Vec<Implausible> {
        assert!(HYQ[0].contains(urdf.0) && HYQ[1].contains(params.0));
        implausible(&HYQ[0].replace(urdf.0, urdf.1), &HYQ[1].replace(params.0, params.1)).unwrap()
    }

    #[test]
    fn mistakes_in_the_files_are_found() {
        let same = ("robot", "robot");
        assert_eq!(changed(same, same), []);
        let radius = changed(same, ("foot_radius = 0.02175", "foot_radius = 0.5"));
        assert_eq!(radius, [Implausible::FootRadius { found: 0.5, link: "lf_foot".into(), urdf: 0.02175 }]);
        let small = changed(same, ("foot_radius = 0.02175", "foot_radius = 0.005"));
        assert_eq!(small, [Implausible::FootRadius { found: 0.005, link: "lf_foot".into(), urdf: 0.02175 }]);
        let large = ("sphere radius=\"0.02175\"", "sphere radius=\"0.5\"");
        let large = changed(large, ("foot_radius = 0.02175", "foot_radius = 0.5"));
        assert!(matches!(large[..], [Implausible::LargeFootRadius { found: 0.5, limit }] if limit < 0.2), "{large:?}");
        let name = changed(same, ("name = \"hyq\"", "name = \"anymal_b\""));
        assert_eq!(name, [Implausible::Name { found: "anymal_b".into(), urdf: "hyq".into() }]);
        let order = changed(same, ("\"lf_foot\", \"rf_foot\"", "\"rf_foot\", \"lf_foot\""));
        let feet = ((Leg::LF, "rf_foot".to_owned()), (Leg::RF, "lf_foot".to_owned()));
        assert_eq!(order, [Implausible::FeetOrder { first: feet.0, expected: "left of", second: feet.1 }]);
        let hind = changed(
            same,
            (
                "\"lf_foot\", \"rf_foot\", \"lh_foot\", \"rh_foot\"",
                "\"lh_foot\", \"rh_foot\", \"lf_foot\", \"rf_foot\"",
            ),
        );
        assert_eq!(hind.len(), 2, "{hind:?}");
        let formula = |tasks: &str| {
            let formula = format!("{tasks} << base_dynamics << friction << joint_acceleration << force_bounds");
            let found = changed(same, ("[safety]", &format!("[stack]\nformula = \"{formula}\"\n\n[safety]")));
            (formula, found)
        };
        let (without, found) = formula("trunk + posture");
        assert_eq!(found, [Implausible::NoStanceTask { formula: without }]);
        assert_eq!(formula("relative_feet + posture").1, []);
        let mesh = "<geometry><mesh filename=\"trunk.stl\"/></geometry>";
        let links = changed(("<geometry><box size=\"0.9 0.35 0.2\"/></geometry>", mesh), same);
        assert_eq!(links, [Implausible::TouchNothing { links: vec!["base_link".into()] }]);
    }
}
