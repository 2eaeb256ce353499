//! Checks the table `[robot]` against the URDF and makes the description of it.

use super::error::DescriptionError;
use super::file::{BaseKind, ContactTable, GroupTable, JointTable, RobotTable, SensorTable};
use super::{Contact, ContactGeometry, Group, GroupKind, JointDescription, JointRole, RobotDescription, Sensor};
use crate::bodies::{Base, JointId, Model};
use crate::drive::DriveLimits;
use crate::math::norm;
use crate::names::near_names;
use crate::tree::{JointKind, UrdfTree};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// Names of contacts and legs of a quadruped, in the order of `feet`.
const LEGS: [&str; 4] = ["LF", "RF", "LH", "RH"];
/// Largest length, torque, speed or gain, SI units.
const MAX_NUMBER: f64 = 1e9;

type Result<T> = std::result::Result<T, DescriptionError>;

pub(super) fn resolve(mut table: RobotTable, file: &str, tree: &UrdfTree) -> Result<RobotDescription> {
    let base = match table.base {
        BaseKind::Floating => Base::Floating,
        BaseKind::Fixed => Base::Fixed,
    };
    let parse = |reason: String| DescriptionError::Parse { file: file.to_owned(), reason };
    let model = Model::new(tree, base).map_err(|error| parse(error.to_string()))?;
    let check = Check { file, tree, model: &model };
    check.quadruped(&mut table)?;
    let imus = check.sensors("robot.imu", &table.imu)?;
    let force_torque = check.sensors("robot.force_torque", &table.force_torque)?;
    let contacts = check.contacts(&table.contact)?;
    let groups = check.groups(&table.group)?;
    for (name, posture) in &table.postures {
        if name.is_empty() {
            return Err(check.bad("robot.postures", "\"\"", "a name"));
        }
        check.posture(&format!("robot.postures.{name}"), posture)?;
    }
    let joints = check.joints(&table.joints, &table.drives)?;
    let disabled_collisions = check.disabled_collisions(&table.disabled_collisions)?;
    if let Some(frame) = &table.virtual_frame {
        check.link("robot.virtual_frame.link", &frame.link)?;
        if tree.links.iter().any(|link| link.name.starts_with(&frame.name)) || frame.name.is_empty() {
            return Err(check.bad("robot.virtual_frame.name", &frame.name, "a name with which no link begins"));
        }
    }
    let RobotTable { name, urdf, postures, virtual_frame, .. } = table;
    let file = file.to_owned();
    Ok(RobotDescription {
        name,
        file,
        urdf,
        base,
        imus,
        force_torque,
        contacts,
        groups,
        postures,
        joints,
        disabled_collisions,
        virtual_frame,
    })
}

struct Check<'a> {
    file: &'a str,
    tree: &'a UrdfTree,
    model: &'a Model,
}

impl Check<'_> {
    /// Writes the keys of a quadruped as those of any robot.
    fn quadruped(&self, table: &mut RobotTable) -> Result<()> {
        let Some(feet) = table.feet.take() else {
            let only = [
                ("robot.foot_radius", table.foot_radius.is_some()),
                ("robot.posture", !table.posture.is_empty()),
                ("robot.lying", !table.lying.is_empty()),
                ("robot.imu_link", table.imu_link.is_some()),
                ("robot.drives", !table.drives.is_empty()),
            ];
            return match only.into_iter().find(|(_, given)| *given) {
                Some((key, _)) => Err(self.bad(key, "a key of a quadruped", "robot.feet beside it")),
                None => Ok(()),
            };
        };
        if !table.contact.is_empty() {
            return Err(self.bad("robot.contact", "tables", "none beside robot.feet"));
        }
        let (Some(radius), Some(link)) = (table.foot_radius, table.imu_link.take()) else {
            return Err(self.bad("robot", "robot.feet alone", "foot_radius and imu_link beside robot.feet"));
        };
        table.imu.push(SensorTable { name: "imu".to_owned(), link });
        let further = std::mem::take(&mut table.group);
        for (name, link) in LEGS.into_iter().zip(feet) {
            let (name, tip) = (name.to_owned(), Some(link.clone()));
            let geometry = ContactGeometry::Point { radius };
            table.contact.push(ContactTable { name: name.clone(), link, geometry });
            table.group.push(GroupTable { name, kind: GroupKind::Leg, joints: None, root: None, tip });
        }
        table.group.extend(further);
        for (key, name, posture) in
            [("robot.posture", "nominal", &mut table.posture), ("robot.lying", "lying", &mut table.lying)]
        {
            self.posture(key, posture)?;
            if !posture.is_empty() {
                table.postures.insert(name.to_owned(), std::mem::take(posture));
            }
        }
        Ok(())
    }

    fn sensors(&self, key: &str, tables: &[SensorTable]) -> Result<Vec<Sensor>> {
        self.unique(key, tables.iter().map(|sensor| sensor.name.as_str()))?;
        let sensor = |table: &SensorTable| {
            self.link(&format!("{key}.{}.link", table.name), &table.link)?;
            Ok(Sensor { name: table.name.clone(), link: table.link.clone() })
        };
        tables.iter().map(sensor).collect()
    }

    fn contacts(&self, tables: &[ContactTable]) -> Result<Vec<Contact>> {
        self.unique("robot.contact", tables.iter().map(|contact| contact.name.as_str()))?;
        let contact = |(at, table): (usize, &ContactTable)| {
            let key = format!("robot.contact.{}", table.name);
            self.link(&format!("{key}.link"), &table.link)?;
            if let Some(other) = tables[..at].iter().find(|other| other.link == table.link) {
                let found = format!("{}, the link of the contact {}", table.link, other.name);
                return Err(self.bad(&format!("{key}.link"), &found, "a link without another contact"));
            }
            let geometry = self.geometry(&format!("{key}.geometry"), table.geometry)?;
            Ok(Contact { name: table.name.clone(), link: table.link.clone(), geometry })
        };
        tables.iter().enumerate().map(contact).collect()
    }

    fn geometry(&self, key: &str, mut geometry: ContactGeometry) -> Result<ContactGeometry> {
        match &mut geometry {
            ContactGeometry::Point { radius } => self.not_negative(&format!("{key}.point.radius"), *radius)?,
            ContactGeometry::Hand { radius } => self.not_negative(&format!("{key}.hand.radius"), *radius)?,
            ContactGeometry::Wheel { radius, axis } => {
                self.positive(&format!("{key}.wheel.radius"), *radius)?;
                let length = norm(&Vector3::from(*axis));
                if !(1e-6..=1e6).contains(&length) {
                    let expected = "a vector with a direction";
                    return Err(self.bad(&format!("{key}.wheel.axis"), &format!("{axis:?}"), expected));
                }
                axis.iter_mut().for_each(|x| *x /= length);
            }
            ContactGeometry::Sole { x, y } => {
                for (name, [low, high]) in [("x", *x), ("y", *y)] {
                    if !(low < high && low.abs().max(high.abs()) <= MAX_NUMBER) {
                        let expected = "[smallest, largest], finite, m";
                        return Err(self.bad(&format!("{key}.sole.{name}"), &format!("[{low}, {high}]"), expected));
                    }
                }
            }
        }
        Ok(geometry)
    }

    fn groups(&self, tables: &[GroupTable]) -> Result<Vec<Group>> {
        self.unique("robot.group", tables.iter().map(|group| group.name.as_str()))?;
        let group = |table: &GroupTable| {
            let key = format!("robot.group.{}", table.name);
            let joints = match table {
                GroupTable { joints: Some(joints), root: None, tip: None, .. } => {
                    let key = format!("{key}.joints");
                    self.unique(&key, joints.iter().map(String::as_str))?;
                    joints.iter().map(|joint| self.joint(&key, joint)).collect::<Result<Vec<_>>>()?
                }
                GroupTable { joints: None, root, tip: Some(tip), .. } => self.chain(&key, root.as_deref(), tip)?,
                _ => return Err(self.bad(&key, "other keys", "either joints, or tip and perhaps root")),
            };
            if joints.is_empty() {
                return Err(self.bad(&key, "no movable joint", "at least one"));
            }
            Ok(Group { name: table.name.clone(), kind: table.kind, joints, tip: table.tip.clone() })
        };
        tables.iter().map(group).collect()
    }

    /// The movable joints between two links, from the root outward. Without `root`, the root of the tree.
    fn chain(&self, key: &str, root: Option<&str>, tip: &str) -> Result<Vec<JointId>> {
        let root = root.map_or(Ok(0), |root| self.link(&format!("{key}.root"), root))?;
        let mut at = self.link(&format!("{key}.tip"), tip)?;
        let mut joints = Vec::new();
        while at != root {
            let Some(joint) = self.tree.links[at].parent_joint else {
                let expected = format!("a link below the root \"{}\"", self.tree.links[root].name);
                return Err(self.bad(&format!("{key}.tip"), tip, &expected));
            };
            let joint = &self.tree.joints[joint];
            if joint.kind != JointKind::Fixed {
                joints.push(self.joint(key, &joint.name)?);
            }
            at = joint.parent;
        }
        joints.reverse();
        Ok(joints)
    }

    fn posture(&self, key: &str, posture: &BTreeMap<String, f64>) -> Result<()> {
        for (joint, &q) in posture {
            let info = &self.model.joints[self.joint(key, joint)?.index()];
            if !(info.lower..=info.upper).contains(&q) || !q.is_finite() {
                let expected = format!("{} to {}", info.lower, info.upper);
                return Err(self.bad(&format!("{key}.{joint}"), &q.to_string(), &expected));
            }
        }
        Ok(())
    }

    fn joints(
        &self,
        tables: &BTreeMap<String, JointTable>,
        drives: &BTreeMap<String, DriveLimits>,
    ) -> Result<Vec<JointDescription>> {
        let mut joints: Vec<JointDescription> = Vec::with_capacity(self.model.nj());
        for joint in &self.model.joints {
            joints.push(JointDescription {
                name: joint.name.clone(),
                role: JointRole::Actuated,
                effort: None,
                velocity: None,
                stiffness: None,
                damping: None,
                drive: DriveLimits::default(),
            });
        }
        for (name, drive) in drives {
            joints[self.joint("robot.drives", name)?.index()].drive = *drive;
        }
        for (name, table) in tables {
            let key = format!("robot.joints.{name}");
            let joint = &mut joints[self.joint("robot.joints", name)?.index()];
            let JointTable { role, effort, velocity, stiffness, damping, power, rated_velocity, no_load_velocity } =
                table;
            joint.role = *role;
            for (quantity, value) in [("effort", effort), ("velocity", velocity)] {
                value.map_or(Ok(()), |value| self.positive(&format!("{key}.{quantity}"), value))?;
            }
            for (quantity, value) in [("stiffness", stiffness), ("damping", damping)] {
                value.map_or(Ok(()), |value| self.not_negative(&format!("{key}.{quantity}"), value))?;
            }
            (joint.effort, joint.velocity, joint.stiffness, joint.damping) = (*effort, *velocity, *stiffness, *damping);
            let drive = &mut joint.drive;
            for (limit, value) in [
                (&mut drive.power, power),
                (&mut drive.rated_velocity, rated_velocity),
                (&mut drive.no_load_velocity, no_load_velocity),
            ] {
                *limit = value.unwrap_or(*limit);
            }
        }
        for joint in &joints {
            let DriveLimits { power, rated_velocity: rated, no_load_velocity: no_load } = joint.drive;
            let table = if drives.contains_key(&joint.name) { "drives" } else { "joints" };
            let key = |quantity| format!("robot.{table}.{}.{quantity}", joint.name);
            for (quantity, value) in [("power", power), ("rated_velocity", rated), ("no_load_velocity", no_load)] {
                if value.is_nan() || value <= 0.0 {
                    return Err(self.bad(&key(quantity), &value.to_string(), "a number > 0"));
                }
            }
            if rated >= no_load && rated < f64::INFINITY {
                let expected = format!("less than no_load_velocity ({no_load})");
                return Err(self.bad(&key("rated_velocity"), &rated.to_string(), &expected));
            }
        }
        Ok(joints)
    }

    fn disabled_collisions(&self, tables: &BTreeMap<String, Vec<String>>) -> Result<BTreeSet<[String; 2]>> {
        let mut pairs = BTreeSet::new();
        for (link, others) in tables {
            self.link("robot.disabled_collisions", link)?;
            let key = format!("robot.disabled_collisions.{link}");
            for other in others {
                self.link(&key, other)?;
                if other == link {
                    return Err(self.bad(&key, other, "another link"));
                }
                let mut pair = [link.clone(), other.clone()];
                pair.sort_unstable();
                if !pairs.insert(pair) {
                    let (file, name) = (self.file.to_owned(), other.clone());
                    return Err(DescriptionError::Duplicate { file, key, name });
                }
            }
        }
        Ok(pairs)
    }

    fn link(&self, key: &str, name: &str) -> Result<usize> {
        let frame = self.model.frame(name).map(|frame| frame.index());
        frame.map_err(|_| self.unknown(key, "link", name, self.tree.links.iter().map(|link| link.name.as_str())))
    }

    fn joint(&self, key: &str, name: &str) -> Result<JointId> {
        let names = || self.model.joints.iter().map(|joint| joint.name.as_str());
        self.model.joint(name).map_err(|_| self.unknown(key, "movable joint", name, names()))
    }

    fn unique<'n>(&self, key: &str, names: impl Iterator<Item = &'n str>) -> Result<()> {
        let mut seen = BTreeSet::new();
        for name in names {
            if !seen.insert(name) {
                let (file, key) = (self.file.to_owned(), key.to_owned());
                return Err(DescriptionError::Duplicate { file, key, name: name.to_owned() });
            }
        }
        Ok(())
    }

    fn positive(&self, key: &str, value: f64) -> Result<()> {
        let fits = value > 0.0 && value <= MAX_NUMBER;
        if fits { Ok(()) } else { Err(self.bad(key, &value.to_string(), "a number > 0 and at most 1e9")) }
    }

    fn not_negative(&self, key: &str, value: f64) -> Result<()> {
        let fits = (0.0..=MAX_NUMBER).contains(&value);
        if fits { Ok(()) } else { Err(self.bad(key, &value.to_string(), "a number >= 0 and at most 1e9")) }
    }

    fn bad(&self, key: &str, found: &str, expected: &str) -> DescriptionError {
        let (file, key, found, expected) =
            (self.file.to_owned(), key.to_owned(), found.to_owned(), expected.to_owned());
        DescriptionError::BadValue { file, key, found, expected }
    }

    fn unknown<'n>(
        &self,
        key: &str,
        what: &'static str,
        name: &str,
        names: impl Iterator<Item = &'n str>,
    ) -> DescriptionError {
        let (file, key, near) = (self.file.to_owned(), key.to_owned(), near_names(name, names));
        DescriptionError::Unknown { file, key, what, name: name.to_owned(), near }
    }
}
