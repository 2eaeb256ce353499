//! What an SRDF contains for the parameter file: groups, postures, passive joints and disabled collisions, as TOML.

use super::Guess;
use crate::model::srdf::{Srdf, SrdfGroup, VirtualKind};
use crate::model::{Base, JointInfo, Model, UrdfTree};
use crate::params::{quoted, toml_key};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// What the parameter file already has, and the robot that it describes.
pub(super) struct Known<'a> {
    pub(super) tree: &'a UrdfTree,
    pub(super) model: &'a Model,
    pub(super) base: Base,
    /// Names of groups.
    pub(super) groups: &'a [&'a str],
    /// Names of postures that the file has, computed.
    pub(super) postures: &'a [&'a str],
    /// Links with a contact.
    pub(super) contacts: &'a [String],
}

/// TOML tables, guesses and remarks.
#[derive(Default)]
pub(super) struct FromSrdf {
    /// `[[robot.group]]` of each group.
    pub(super) groups: String,
    /// `[robot.postures.NAME]` of each posture.
    pub(super) postures: String,
    /// Joints without a drive.
    pub(super) passive: BTreeSet<String>,
    /// `[robot.disabled_collisions]`.
    pub(super) collisions: String,
    pub(super) guesses: Vec<Guess>,
    pub(super) look_at: Vec<String>,
}

/// Positions of some joints, rad or m.
pub(super) type Positions = BTreeMap<String, f64>;

/// The states by name, in the order of the file. States of one name are one posture; of a joint that two of them have, the first position counts.
pub(super) fn postures(srdf: &Srdf) -> Vec<(&str, Positions)> {
    let mut postures: Vec<(&str, Positions)> = Vec::new();
    for state in &srdf.states {
        let at = postures.iter().position(|(name, _)| *name == state.name).unwrap_or(postures.len());
        if at == postures.len() {
            postures.push((&state.name, Positions::new()));
        }
        for (joint, q) in &state.joints {
            postures[at].1.entry(joint.clone()).or_insert(*q);
        }
    }
    postures
}

impl FromSrdf {
    /// Takes what the robot has: links and joints may have been removed or fixed since the SRDF was read.
    ///
    /// - `states`: the postures to write, of [`postures`].
    pub(super) fn new(srdf: &Srdf, states: &[(&str, Positions)], known: &Known) -> Self {
        let mut from = FromSrdf::default();
        from.look_at.extend(srdf.warnings.iter().map(|warning| format!("SRDF: {warning}")));
        let movable: BTreeSet<&str> = known.model.joints.iter().map(|joint| joint.name.as_str()).collect();
        let links: BTreeSet<&str> = known.tree.links.iter().map(|link| link.name.as_str()).collect();
        from.take_groups(srdf, known, &movable, &links);
        from.take_postures(states, known);
        from.take_collisions(srdf, &links);
        from.passive = srdf.passive_joints.iter().filter(|joint| movable.contains(joint.as_str())).cloned().collect();
        from.guess("passive joints", from.passive.iter().cloned().collect::<Vec<_>>().join(" "), "of the SRDF");
        let ends = srdf.end_effectors.iter().map(|end| &end.parent_link);
        let ends: Vec<&str> = ends.filter(|link| !known.contacts.contains(link)).map(String::as_str).collect();
        from.guess(
            "end effectors",
            ends.join(" "),
            "of the SRDF; one that touches something needs a [[robot.contact]]",
        );
        for joint in &srdf.virtual_joints {
            let is_fixed = joint.kind == VirtualKind::Fixed;
            if is_fixed != (known.base == Base::Fixed) {
                let [srdf, base] = if is_fixed { ["fixed", "floating"] } else { ["movable", "fixed"] };
                from.look_at
                    .push(format!("robot.base: it is {base}, the SRDF has the {srdf} virtual joint {}", joint.name));
            }
        }
        from
    }

    /// Adds a guess unless its value is empty.
    fn guess(&mut self, what: &'static str, value: String, because: &str) {
        if !value.is_empty() {
            self.guesses.push(Guess { what, value, because: because.to_owned() });
        }
    }

    fn take_groups(&mut self, srdf: &Srdf, known: &Known, movable: &BTreeSet<&str>, links: &BTreeSet<&str>) {
        let mut names = Vec::new();
        for SrdfGroup { name, joints, chain } in &srdf.groups {
            let joints: Vec<String> =
                joints.iter().filter(|joint| movable.contains(joint.as_str())).map(|joint| quoted(joint)).collect();
            if joints.is_empty() {
                self.look_at.push(format!("group {name} of the SRDF is left out: its joints are fixed"));
                continue;
            }
            if known.groups.contains(&name.as_str()) {
                self.look_at.push(format!("group {name} of the SRDF is left out: there is another group of this name"));
                continue;
            }
            let chain = chain.as_ref().filter(|ends| ends.iter().all(|link| links.contains(link.as_str())));
            let (kind, contents) = match chain {
                Some([root, tip]) => (kind(name), format!("root = {}\ntip = {}", quoted(root), quoted(tip))),
                None => ("chain", format!("joints = [{}]", joints.join(", "))),
            };
            let name_value = quoted(name);
            write!(self.groups, "\n[[robot.group]]\nname = {name_value}\nkind = \"{kind}\"\n{contents}\n")
                .expect("writing to a String never fails");
            names.push(name.as_str());
        }
        self.guess("groups", names.join(" "), "of the SRDF; leg and arm: chains with this word in their name");
    }

    fn take_postures(&mut self, states: &[(&str, Positions)], known: &Known) {
        let mut names = Vec::new();
        for (name, positions) in states {
            if known.postures.contains(name) {
                self.look_at.push(format!("posture {name} of the SRDF is left out: it is computed"));
                continue;
            }
            let positions = within_limits(name, positions, known.model, &mut self.look_at);
            if !positions.is_empty() {
                let lines: String =
                    positions.iter().map(|(joint, q)| format!("{} = {q:?}\n", toml_key(joint))).collect();
                self.postures += &format!("\n[robot.postures.{}]\n{lines}", toml_key(name));
                names.push(*name);
            }
        }
        self.guess("postures", names.join(" "), "states of the SRDF");
    }

    fn take_collisions(&mut self, srdf: &Srdf, links: &BTreeSet<&str>) {
        let mut others: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        let mut reasons: BTreeMap<&str, usize> = BTreeMap::new();
        let kept = |link: &String| links.contains(link.as_str());
        for pair in srdf.disabled_collisions.iter().filter(|pair| pair.links.iter().all(kept)) {
            let [first, second] = &pair.links;
            others.entry(first).or_default().push(quoted(second));
            let reason = if pair.reason.is_empty() { "without a reason" } else { &pair.reason };
            *reasons.entry(reason).or_default() += 1;
        }
        if others.is_empty() {
            return;
        }
        self.collisions =
            "\n# Each link with those with which it needs no check for collisions.\n[robot.disabled_collisions]\n"
                .to_owned();
        for (link, others) in others {
            writeln!(self.collisions, "{} = [{}]", toml_key(link), others.join(", "))
                .expect("writing to a String never fails");
        }
        let counts: Vec<String> = reasons.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        let pairs: usize = reasons.values().sum();
        self.guess("disabled collisions", format!("{pairs} pairs: {}", counts.join(", ")), "of the SRDF");
    }
}

/// The positions of the joints that the model has, each moved into the limits of its joint; remarks on what differs from the SRDF.
///
/// - `name`: name of the posture.
pub(super) fn within_limits(name: &str, positions: &Positions, model: &Model, look_at: &mut Vec<String>) -> Positions {
    let (mut kept, mut fixed) = (Positions::new(), Vec::new());
    for (joint, &q) in positions {
        let Some(JointInfo { lower, upper, .. }) = model.joints.iter().find(|other| other.name == *joint) else {
            fixed.push(joint.as_str());
            continue;
        };
        let within = q.max(*lower).min(*upper);
        if within != q {
            look_at.push(format!(
                "robot.postures.{name}.{joint}: {within}; the SRDF has {q}, outside of the limits {lower} to {upper}"
            ));
        }
        kept.insert(joint.clone(), within);
    }
    if !fixed.is_empty() {
        look_at.push(format!("robot.postures.{name}: without {}: fixed here", fixed.join(", ")));
    }
    kept
}

/// The kind of a group that is a chain, by its name.
fn kind(name: &str) -> &'static str {
    let name = name.to_lowercase();
    let has = |word: &str| name.contains(word);
    if has("leg") {
        "leg"
    } else if has("arm") {
        "arm"
    } else {
        "chain"
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Options, Proposal, propose, propose_any};
    use super::*;

    const UPPER: &str = include_str!("../../../robots/centauro_upper/centauro_upper.urdf");
    const HYQ: &str = include_str!("../../../robots/hyq/hyq.urdf");

    /// The file of the two arms or of HyQ with these elements of an SRDF, its table `[robot]`, and the remarks.
    fn with(elements: &str, is_quadruped: bool) -> (toml::Table, String) {
        let name = if is_quadruped { "hyq" } else { "centauro_upper" };
        let text = format!("<robot name=\"{name}\">{elements}</robot>");
        let srdf = Some((text.as_str(), "a.srdf"));
        let options =
            Options { urdf_file: "a.urdf", beside: false, srdf, name: Some("a"), fixed: &[], bounds: &|_| None };
        let proposal = if is_quadruped {
            propose(HYQ, "a.urdf", &options)
        } else {
            propose_any(UPPER, "a.urdf", Base::Fixed, &options)
        };
        let Proposal { toml, look_at, .. } = proposal.unwrap();
        (toml.parse::<toml::Table>().unwrap()["robot"].as_table().unwrap().clone(), look_at.join("\n"))
    }

    #[test]
    fn passive_joints_have_no_gains() {
        let (robot, _) = with("<passive_joint name=\"j_arm1_2\"/>", false);
        let joint = robot["joints"]["j_arm1_2"].as_table().unwrap();
        assert_eq!(joint["role"].as_str(), Some("passive"));
        assert_eq!((joint["stiffness"].as_float(), joint["damping"].as_float()), (Some(0.0), Some(0.0)));
        assert!(!robot["joints"]["j_arm1_1"].as_table().unwrap().contains_key("role"));
        let (robot, _) = with("<passive_joint name=\"lf_haa_joint\"/>", true);
        assert_eq!(robot["joints"]["lf_haa_joint"]["role"].as_str(), Some("passive"));
    }

    #[test]
    fn positions_outside_of_the_limits_are_set_to_them_and_reported() {
        let (robot, look_at) =
            with("<group_state name=\"out\"><joint name=\"j_arm1_1\" value=\"99\"/></group_state>", false);
        let tree = UrdfTree::parse(UPPER, "a.urdf").unwrap();
        let upper = tree.joints.iter().find(|joint| joint.name == "j_arm1_1").unwrap().limits.upper;
        assert_eq!(robot["postures"]["out"]["j_arm1_1"].as_float(), Some(upper));
        assert!(look_at.contains("robot.postures.out.j_arm1_1"), "{look_at}");
    }

    #[test]
    fn states_of_one_name_are_one_posture_and_nominal_is_the_posture_to_hold() {
        let state = |name: &str, joint: &str, q: f64| {
            format!("<group_state name=\"{name}\" group=\"\"><joint name=\"{joint}\" value=\"{q}\"/></group_state>")
        };
        let both = state("up", "j_arm1_1", 0.25) + &state("up", "j_arm2_1", 0.5) + &state("up", "j_arm1_1", 0.75);
        let (robot, _) = with(&(both + &state("nominal", "j_arm1_1", 0.125)), false);
        let up = robot["postures"]["up"].as_table().unwrap();
        assert_eq!((up.len(), up["j_arm1_1"].as_float(), up["j_arm2_1"].as_float()), (2, Some(0.25), Some(0.5)));
        let nominal = robot["postures"]["nominal"].as_table().unwrap();
        assert_eq!((nominal.len(), nominal["j_arm1_1"].as_float()), (15, Some(0.125)));
        // The standing posture of a quadruped is computed.
        let (robot, look_at) = with(&state("nominal", "lf_haa_joint", 0.125), true);
        assert!(!robot.contains_key("postures"), "{robot}");
        assert!(look_at.contains("posture nominal of the SRDF is left out"), "{look_at}");
    }

    #[test]
    fn names_with_quotes_stay_names() {
        let group = "<group name=\"a &quot;b&quot;] #\"><joint name=\"j_arm1_1\"/></group>\
                     <group_state name=\"x.y &quot;\"><joint name=\"j_arm1_1\" value=\"0\"/></group_state>";
        let (robot, _) = with(group, false);
        assert_eq!(robot["group"][0]["name"].as_str(), Some("a \"b\"] #"));
        assert!(robot["postures"].as_table().unwrap().contains_key("x.y \""), "{robot}");
    }

    #[test]
    fn groups_of_the_srdf_replace_guessed_ones_but_not_the_legs_of_a_quadruped() {
        let (guessed, _) = with("", false);
        assert_eq!(guessed["group"].as_array().unwrap().len(), 2);
        let (robot, _) = with("<group name=\"torso\"><joint name=\"torso_yaw\"/></group>", false);
        assert_eq!(robot["group"].as_array().unwrap().len(), 1);
        let legs = "<group name=\"LF\"><joint name=\"rh_haa_joint\"/></group><group name=\"hips\"><joint name=\"lf_haa_joint\"/></group>";
        let (robot, look_at) = with(legs, true);
        assert_eq!(robot["group"].as_array().unwrap().len(), 1);
        assert!(look_at.contains("group LF of the SRDF is left out"), "{look_at}");
    }

    #[test]
    fn pairs_are_written_by_link_and_a_virtual_joint_of_another_base_is_reported() {
        let elements = "<disable_collisions link1=\"torso_2\" link2=\"arm1_1\" reason=\"Adjacent\"/>\
                        <disable_collisions link1=\"arm2_1\" link2=\"torso_2\"/><disable_collisions link1=\"torso_2\" link2=\"arm1_2\"/>\
                        <virtual_joint name=\"world\" type=\"floating\" parent_frame=\"w\" child_link=\"torso_2\"/>";
        let (robot, look_at) = with(elements, false);
        let pairs = robot["disabled_collisions"].as_table().unwrap();
        let others = |link: &str| {
            pairs[link].as_array().unwrap().iter().map(|other| other.as_str().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!((others("torso_2"), others("arm2_1")), (vec!["arm1_1", "arm1_2"], vec!["torso_2"]));
        assert!(look_at.contains("virtual joint world"), "{look_at}");
    }
}
