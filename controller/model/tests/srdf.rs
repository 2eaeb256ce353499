//! SRDFs: groups, states, pairs of links; errors name file, line and element, warnings name what is left out.
#![allow(clippy::unwrap_used, missing_docs)]

use robot_model::UrdfTree;
use robot_model::srdf::{Srdf, SrdfError, SrdfWarning, VirtualKind};
use test_support::replace_once;

/// trunk - hip - thigh - knee - shank - (fixed) - foot, and trunk - neck - head.
const URDF: &str = r#"<robot name="small">
    <link name="trunk"/><link name="thigh"/><link name="shank"/><link name="foot"/><link name="head"/>
    <joint name="hip" type="revolute"><parent link="trunk"/><child link="thigh"/><limit lower="-1" upper="1" effort="5" velocity="3"/></joint>
    <joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><limit lower="-1" upper="1" effort="5" velocity="3"/></joint>
    <joint name="ankle" type="fixed"><parent link="shank"/><child link="foot"/></joint>
    <joint name="neck" type="continuous"><parent link="trunk"/><child link="head"/></joint></robot>"#;

const SRDF: &str = r#"<robot name="small">
    <virtual_joint name="root_joint" type="floating" parent_frame="world" child_link="trunk"/>
    <group name="whole"><joint name="root_joint"/><group name="leg"/><group name="top"/></group>
    <group name="leg"><chain base_link="trunk" tip_link="foot"/></group>
    <group name="top"><link name="head"/></group>
    <group name="across"><chain base_link="head" tip_link="thigh"/></group>
    <group name="feet"><link name="foot"/></group>
    <group_state name="up" group="leg"><joint name="hip" value=" 0.5 "/><joint name="knee" value="-0.25"/></group_state>
    <group_state name="up" group="top"><joint name="neck" value="4"/></group_state>
    <end_effector name="toe" parent_link="foot" group="feet"/>
    <passive_joint name="neck"/><passive_joint name="root_joint"/>
    <disable_collisions link1="thigh" link2="shank" reason="Adjacent"/>
    <disable_collisions link1="shank" link2="thigh"/>
    <disable_collisions link1="head" link2="foot"/>
    <unknown/>
</robot>"#;

fn parse(text: &str) -> Result<Srdf, SrdfError> {
    Srdf::parse(text, "small.srdf", &UrdfTree::parse(URDF, "small.urdf").unwrap())
}

#[track_caller]
fn assert_rejected(from: &str, to: &str, expected: &str) {
    let message = parse(&replace_once(SRDF, from, to)).expect_err("the text is wrong").to_string();
    assert!(message.contains(expected), "found: {message}\nexpected: {expected}");
}

#[track_caller]
fn assert_warned(from: &str, to: &str, expected: &str) -> Srdf {
    let srdf = parse(&replace_once(SRDF, from, to)).unwrap();
    let warnings: Vec<String> = srdf.warnings.iter().map(ToString::to_string).collect();
    assert!(warnings.len() == 1 && warnings[0].contains(expected), "found: {warnings:?}\nexpected: {expected}");
    srdf
}

#[test]
fn groups_are_the_union_of_their_elements() {
    let srdf = parse(SRDF).unwrap();
    assert_eq!(srdf.warnings, []);
    let groups: Vec<_> = srdf.groups.iter().map(|group| (group.name.as_str(), group.joints.join(" "))).collect();
    let expected = [("whole", "hip knee neck"), ("leg", "hip knee"), ("top", "neck"), ("across", "hip neck")];
    assert_eq!(groups, expected.map(|(name, joints)| (name, joints.to_owned())));
    // The chain of `across` goes up and down: its first link is not above its last one.
    let chains: Vec<_> = srdf.groups.iter().map(|group| group.chain.as_ref().map(|ends| ends.join(" "))).collect();
    assert_eq!(chains, [None, Some("trunk foot".to_owned()), None, None]);
    // A group inside adds joints to those of the chain.
    let chain = "<chain base_link=\"trunk\" tip_link=\"foot\"/>";
    let srdf = parse(&replace_once(SRDF, chain, &format!("{chain}<group name=\"top\"/>"))).unwrap();
    assert_eq!((srdf.groups[1].joints.len(), &srdf.groups[1].chain), (3, &None));
}

#[test]
fn states_pairs_and_other_elements_are_read() {
    let srdf = parse(SRDF).unwrap();
    let states: Vec<_> = srdf.states.iter().map(|state| (state.name.as_str(), state.group.as_str())).collect();
    assert_eq!(states, [("up", "leg"), ("up", "top")]);
    assert_eq!(srdf.states[0].joints, [("hip".to_owned(), 0.5), ("knee".to_owned(), -0.25)].into());
    let pairs: Vec<_> = srdf.disabled_collisions.iter().map(|of| (of.links.join(" "), of.reason.as_str())).collect();
    assert_eq!(pairs, [("thigh shank".to_owned(), "Adjacent"), ("head foot".to_owned(), "")]);
    assert_eq!(srdf.passive_joints, ["neck"]);
    let [virtual_joint] = &srdf.virtual_joints[..] else { panic!("{:?}", srdf.virtual_joints) };
    assert_eq!((virtual_joint.kind, virtual_joint.child_link.as_str()), (VirtualKind::Floating, "trunk"));
    assert_eq!((srdf.end_effectors[0].parent_link.as_str(), srdf.end_effectors[0].group.as_str()), ("foot", "feet"));
}

#[test]
fn a_position_of_the_base_is_no_joint_of_the_state() {
    let base = "<joint name=\"free\" value=\"0 0 0.5 0 0 0 1\"/><joint name=\"hip\" value=\" 0.5 \"/>";
    let text = replace_once(SRDF, "<joint name=\"hip\" value=\" 0.5 \"/>", base);
    // A passive joint of this name is the base, too.
    let srdf = parse(&replace_once(&text, "<passive_joint name=\"neck\"/>", "<passive_joint name=\"free\"/>")).unwrap();
    assert_eq!((srdf.warnings.len(), srdf.states[0].joints.len(), srdf.passive_joints.len()), (0, 2, 0));
}

#[test]
fn text_that_is_no_srdf_is_an_error() {
    assert_rejected("</robot>", "", "small.srdf: not an SRDF: line 16: ");
    let urdf = parse("<sdf/>").unwrap_err().to_string();
    assert!(urdf.contains("line 1: the outermost element is <sdf>, expected <robot>"), "{urdf}");
    assert_rejected("<robot name=\"small\">", "<robot>", "<robot> has no attribute name");
}

#[test]
fn missing_and_malformed_attributes_are_errors() {
    assert_rejected(" tip_link=\"foot\"", "", "in group \"leg\": line 4: <chain> has no attribute tip_link");
    assert_rejected(
        "link1=\"head\"",
        "",
        "in <disable_collisions>: line 14: <disable_collisions> has no attribute link1",
    );
    assert_rejected(
        "type=\"floating\"",
        "type=\"free\"",
        "line 2: type is \"free\", expected fixed, planar or floating",
    );
    assert_rejected(
        "\"-0.25\"",
        "\"-0.25 x\"",
        "in group_state \"up\": line 8: value of <joint> is \"x\", expected a number",
    );
    assert_rejected("\"-0.25\"", "\"1 2\"", "line 8: value of joint \"knee\" has 2 numbers, expected 1");
    assert_rejected("\"-0.25\"", "\" \"", "line 8: value of joint \"knee\" is empty, expected a number");
    assert_rejected("\"-0.25\"", "\"nan\"", "value is NaN, expected a finite number");
    assert_rejected("\"knee\" value", "\"hip\" value", "line 8: joint \"hip\" occurs twice");
    let long = "n".repeat(201);
    assert_rejected("link2=\"shank\"", &format!("link2=\"{long}\""), "its link2 has 201 bytes");
}

#[test]
fn groups_that_contain_each_other_and_groups_of_one_name_are_errors() {
    let inner = "<link name=\"head\"/>";
    assert_rejected(inner, "<group name=\"top\"/>", "line 5: groups contain each other, expected no loop: top > top");
    let found = parse(&replace_once(SRDF, inner, "<group name=\"feet\"/><group name=\"whole\"/>")).unwrap_err();
    let SrdfError::GroupLoop { line, groups, .. } = &found else { panic!("{found}") };
    assert_eq!((*line, groups.join(" ")), (3, "whole top whole".to_owned()));
    assert_rejected("name=\"across\"", "name=\"leg\"", "line 6: two groups have the name \"leg\"");
}

#[test]
fn unknown_names_are_left_out_with_a_warning() {
    assert_warned("<robot name=\"small\">", "<robot name=\"tall\">", "robot \"tall\", the URDF of robot \"small\"");
    let srdf = assert_warned("tip_link=\"foot\"", "tip_link=\"foo\"", "line 4: unknown link: \"foo\"; ");
    assert!(srdf.groups.iter().all(|group| group.name != "leg"));
    let srdf = assert_warned("<group name=\"top\"/>", "<group name=\"tops\"/>", "line 3: unknown group: \"tops\"; ");
    assert_eq!(srdf.groups[0].joints, ["hip", "knee"]);
    let srdf = assert_warned("\"knee\" value", "\"ankle\" value", "line 8: unknown movable joint: \"ankle\"; ");
    assert_eq!(srdf.states[0].joints.len(), 1);
    let srdf = assert_warned("passive_joint name=\"neck\"", "passive_joint name=\"nek\"", "near: neck");
    assert!(srdf.passive_joints.is_empty());
    let srdf = assert_warned("parent_link=\"foot\"", "parent_link=\"toe\"", "line 10: unknown link: \"toe\"");
    assert!(srdf.end_effectors.is_empty());
    assert_warned("group=\"top\"", "group=\"leg2\"", "line 9: unknown group: \"leg2\"; ");
    assert_warned("link1=\"head\"", "link1=\"foot\"", "line 14: disabled collision of link \"foot\" with itself");
    assert_warned("<unknown/>", "<enable_collisions/><enable_collisions/>", "line 15: <enable_collisions> is not read");
}

#[test]
fn names_of_one_kind_give_one_warning_that_lists_the_first_eight() {
    let pairs: String =
        (0..20).map(|i| format!("<disable_collisions link1=\"trunk\" link2=\"l{}\"/>", i % 10)).collect();
    let srdf = assert_warned("<unknown/>", &pairs, "\"l0\", \"l1\", ");
    let [SrdfWarning::Unknown { what: "link", line: 15, names, more: 2, .. }] = &srdf.warnings[..] else {
        panic!("{:?}", srdf.warnings);
    };
    assert_eq!(names.len(), 8);
}

#[test]
fn a_chain_with_joints_that_the_group_does_not_list_is_reported() {
    let chain = "<chain base_link=\"trunk\" tip_link=\"foot\"/>";
    let listed = |joints: &str| format!("{joints}{chain}");
    let srdf =
        assert_warned(chain, &listed("<joint name=\"hip\"/>"), "group \"leg\" lists joints, and its chain to \"foot\"");
    assert_eq!(srdf.groups[1].joints, ["hip", "knee"]);
    let both = parse(&replace_once(SRDF, chain, &listed("<joint name=\"knee\"/><link name=\"thigh\"/>"))).unwrap();
    assert_eq!((both.warnings.len(), both.groups[1].chain.is_some()), (0, true));
    let more =
        parse(&replace_once(SRDF, chain, &listed("<joint name=\"hip\"/><joint name=\"knee\"/><joint name=\"neck\"/>")));
    assert_eq!(more.unwrap().groups[1].chain, None);
}

#[test]
fn number_of_groups_and_of_their_elements_is_limited() {
    let groups =
        |n: usize| (0..n).map(|i| format!("<group name=\"g{i}\"><link name=\"head\"/></group>")).collect::<String>();
    assert!(parse(&replace_once(SRDF, "<unknown/>", &groups(195))).is_ok());
    assert_rejected("<unknown/>", &groups(196), "line 15: more than 200 groups");
    let links = |n: usize| format!("<group name=\"g\">{}</group>", "<link name=\"head\"/>".repeat(n));
    assert!(parse(&replace_once(SRDF, "<unknown/>", &links(9_993))).is_ok());
    assert_rejected("<unknown/>", &links(9_994), "more than 10000 elements inside groups");
}
