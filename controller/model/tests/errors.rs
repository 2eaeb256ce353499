//! Errors of a robot description name file and element, and give the value found and the range expected.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use robot_model::*;
use test_support::replace_once;

const HYQ: &str = include_str!("../../../robots/hyq/hyq.urdf");

const ROBOT: &str = r#"<robot name="two">
        <link name="stand"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <link name="bar"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="hinge" type="revolute">
            <parent link="stand"/><child link="bar"/><axis xyz="0 0 1"/>
            <limit lower="-1" upper="1" effort="5" velocity="3"/>
        </joint></robot>"#;

/// A robot of two links and one joint, after replacing a part of its text.
fn two_links(from: &str, to: &str) -> Result<Model, ModelError> {
    Model::new(&UrdfTree::parse(&replace_once(ROBOT, from, to), "two.urdf")?, Base::Fixed)
}

#[track_caller]
fn assert_rejected(from: &str, to: &str, expected: &str) {
    let message = two_links(from, to).expect_err("the text is wrong").to_string();
    assert!(message.contains(expected), "found: {message}\nexpected: {expected}");
}

#[test]
fn the_unchanged_text_is_valid() {
    let model = two_links("two", "two").unwrap();
    assert_eq!((model.nj(), model.nv(), model.total_mass()), (1, 1, 3.0));
    assert!(model.warnings.is_empty());
}

#[test]
fn syntax_errors_name_file_and_element() {
    assert_rejected("</robot>", "", "two.urdf: not a URDF: ");
    assert_rejected(r#"<mass value="1"/>"#, r#"<mass value="heavy"/>"#, "two.urdf: in link \"bar\": ");
    assert_rejected(r#"<parent link="stand"/>"#, "", "two.urdf: in joint \"hinge\": ");
    assert_rejected(r#"type="revolute""#, r#"type="hinge""#, "two.urdf: in joint \"hinge\": ");
}

#[test]
fn missing_and_repeated_names_are_errors() {
    assert_rejected(
        r#"<parent link="stand"/>"#,
        r#"<parent link="stnd"/>"#,
        "two.urdf: line 4: joint \"hinge\": its parent link \"stnd\" does not exist; near: stand",
    );
    assert_rejected(r#"<link name="bar">"#, r#"<link name="stand">"#, "two links have the name \"stand\"");
    assert_rejected(
        "</robot>",
        r#"<link name="c"/><joint name="hinge" type="fixed"><parent link="bar"/><child link="c"/></joint></robot>"#,
        "two joints have the name \"hinge\"",
    );
}

#[test]
fn links_that_do_not_form_one_tree_are_errors() {
    assert_rejected(
        "</robot>",
        r#"<link name="lone"/></robot>"#,
        "links [\"stand\", \"lone\"] have no parent joint, expected one root",
    );
    assert_rejected(
        "</robot>",
        r#"<joint name="back" type="fixed"><parent link="bar"/><child link="stand"/></joint></robot>"#,
        "links [\"stand\", \"bar\"] form a loop",
    );
    assert_rejected(
        "</robot>",
        r#"<link name="c"/><link name="d"/>
        <joint name="cd" type="fixed"><parent link="c"/><child link="d"/></joint>
        <joint name="dc" type="fixed"><parent link="d"/><child link="c"/></joint></robot>"#,
        "links [\"c\", \"d\"] form a loop",
    );
    assert_rejected(
        "</robot>",
        r#"<joint name="again" type="fixed"><parent link="stand"/><child link="bar"/></joint></robot>"#,
        "link \"bar\" is the child of joints \"hinge\" and \"again\"",
    );
    let error = UrdfTree::parse("<robot name=\"none\"/>", "none.urdf").unwrap_err();
    assert_eq!(error.to_string(), "none.urdf: no link found, expected at least one");
}

#[test]
fn unsupported_joint_types_are_errors() {
    for kind in ["planar", "spherical"] {
        let ModelError::UnsupportedJoint { file, line, joint, found } = two_links("revolute", kind).unwrap_err() else {
            panic!("{kind}")
        };
        assert_eq!((file.as_str(), line, joint.as_str(), found.as_str()), ("two.urdf", 4, "hinge", kind));
    }
}

/// A floating joint at the root is the floating base; anywhere else it has no meaning.
#[test]
fn a_floating_joint_at_the_root_makes_its_child_the_root() {
    let model = two_links("revolute", "floating").unwrap();
    assert_eq!((model.nj(), model.total_mass()), (0, 1.0));
    assert_eq!(model.frames().map(|(_, name)| name).collect::<Vec<_>>(), ["bar"]);
    let ignored = ModelWarning::WorldIgnored { link: "stand".into(), joint: "hinge".into(), links: 1, mass: 2.0 };
    assert_eq!(model.warnings, [ignored]);

    // What is fixed to the world is part of it, above and beside the floating joint.
    let fixed = |name: &str, parent: &str, child: &str| {
        format!("<joint name=\"{name}\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>")
    };
    let map = format!(
        "<link name=\"map\"/>{}<link name=\"lamp\"/>{}",
        fixed("a", "map", "stand"),
        fixed("b", "stand", "lamp")
    );
    let text = ROBOT.replace("revolute", "floating").replace("</robot>", &format!("{map}</robot>"));
    let model = Model::new(&UrdfTree::parse(&text, "two.urdf").unwrap(), Base::Floating).unwrap();
    assert_eq!((model.nv(), model.total_mass()), (6, 1.0));
    let ignored = ModelWarning::WorldIgnored { link: "stand".into(), joint: "hinge".into(), links: 3, mass: 2.0 };
    assert_eq!(model.warnings, [ignored]);

    // Below a joint that moves, beside one, and below another floating joint.
    let free = |parent: &str| {
        format!(
            "<link name=\"c\"/>\n<joint name=\"free\" type=\"floating\"><parent link=\"{parent}\"/><child link=\"c\"/></joint></robot>"
        )
    };
    for (parent, hinge) in [("bar", "revolute"), ("stand", "revolute"), ("bar", "floating"), ("stand", "floating")] {
        let text = ROBOT.replace("revolute", hinge).replace("</robot>", &free(parent));
        let error = UrdfTree::parse(&text, "two.urdf").unwrap_err();
        let ModelError::FloatingInside { line: 8, joint, other, .. } = &error else { panic!("{error}") };
        assert_eq!((joint.as_str(), other.as_str()), ("free", "hinge"), "{parent} {hinge}");
    }
}

/// A byte order mark, other line ends, a declaration of a document type and comments do not change a robot.
#[test]
fn the_form_of_the_text_does_not_matter() {
    let plain = UrdfTree::parse(ROBOT, "two.urdf").unwrap();
    for text in [
        format!("\u{feff}{ROBOT}"),
        format!("\u{feff}<?xml version=\"1.0\"?>\r\n{}", ROBOT.replace('\n', "\r\n")),
        ROBOT.replace('\n', "\r\n"),
        format!("<!DOCTYPE robot>\n<!-- a -- b -->\n{ROBOT}"),
        ROBOT.replace("\"0 0 1\"", "\" 0\t0\n 1 \"").replace("value=\"2\"", "value=\" +2. \""),
        ROBOT.replace("</robot>", "<transmission name=\"hinge\"><joint name=\"hinge\"/></transmission></robot>"),
        ROBOT.replace("name=\"two\"", "name=\"two\" xmlns:xacro=\"http://x\""),
    ] {
        assert_eq!(UrdfTree::parse(&text, "two.urdf").unwrap(), plain, "{text}");
    }
}

/// Roll of a right angle as a quaternion, which URDF has since version 1.1. Other readers ignore it in earlier versions.
#[test]
fn an_orientation_may_be_a_quaternion() {
    let with = |origin: &str| {
        let robot = ROBOT.replace("<axis", &format!("<origin {origin}/><axis"));
        robot.replace("name=\"two\"", "name=\"two\" version=\"1.1\"")
    };
    let X = |origin: &str| UrdfTree::parse(&with(origin), "two.urdf").unwrap().joints[0].X_PC;
    let expected = nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    let found = X("xyz=\"1 2 3\" quat_xyzw=\"0.70710678 0 0 0.70710678\"");
    assert!((found.R - expected).norm() < 1e-15 && found.p == nalgebra::Vector3::new(1.0, 2.0, 3.0), "{found:?}");
    let error = UrdfTree::parse(&with("quat_xyzw=\"0 0 0 0\""), "two.urdf").unwrap_err();
    assert!(matches!(&error, ModelError::BadNumber { line: 5, quantity: "quat_xyzw", .. }), "{error}");
    let old = with("quat_xyzw=\"0 0 0 1\"").replace(" version=\"1.1\"", "");
    let error = UrdfTree::parse(&old, "two.urdf").unwrap_err();
    assert!(matches!(&error, ModelError::BadElement { line: 5, .. }), "{error}");
}

/// What does not concern the model is no reason to refuse a robot.
#[test]
fn elements_that_other_readers_accept_are_accepted() {
    let visual = |inside: &str| format!("<link name=\"bar\"><visual>{inside}</visual>");
    let with_material = |material: &str| visual(&format!("<geometry><box size=\"1 1 1\"/></geometry>{material}"));
    for to in [
        with_material("<material name=\"m\"><texture/></material>"),
        with_material("<material><color rgba=\"1 1 1\"/></material><material name=\"second\"/>"),
        "<drake:filter name=\"g\"/><link name=\"bar\" drake:x=\"1\">".to_owned(),
        "<gazebo><joint name=\"hinge\"/></gazebo><link name=\"bar\">".to_owned(),
    ] {
        let model = two_links("<link name=\"bar\">", &to).unwrap();
        assert_eq!((model.total_mass(), model.warnings.len()), (3.0, 0), "{to}");
    }
    let twice = two_links(
        "</inertial></link>\n        <joint",
        "</inertial><inertial><mass value=\"7\"/></inertial></link><joint",
    );
    assert_eq!(twice.unwrap().total_mass(), 3.0, "the first of two elements counts");
    for (inside, geometry) in [
        ("", false),
        ("<geometry/>", false),
        ("<geometry><cone/></geometry>", true),
        ("<geometry><box size=\"1 x 1\"/></geometry>", true),
        ("<geometry><box size=\"1 0 1\"/></geometry>", true),
        ("<geometry><sphere radius=\"0\"/></geometry>", true),
        ("<geometry><cylinder radius=\"1\"/></geometry>", true),
        ("<geometry><mesh/></geometry>", true),
    ] {
        for what in ["visual", "collision"] {
            let text = format!("<link name=\"bar\"><{what}>\n{inside}</{what}>");
            let model = two_links("<link name=\"bar\">", &text).unwrap();
            let [ModelWarning::ShapesIgnored { what: found, link, line, more: 0, .. }] = model.warnings.as_slice()
            else {
                panic!("{inside}: {:?}", model.warnings)
            };
            let at = 3 + usize::from(geometry || inside == "<geometry/>");
            assert_eq!((*found, link.as_str(), *line, model.total_mass()), (what, "bar", at, 3.0), "{inside}");
        }
    }
    let many = format!("<link name=\"bar\">{}", "<collision/>".repeat(1000));
    let warnings = two_links("<link name=\"bar\">", &many).unwrap().warnings;
    assert!(matches!(warnings.as_slice(), [ModelWarning::ShapesIgnored { what: "collision", line: 3, more: 999, .. }]));
    let two =
        "<link name=\"bar\"><collision><geometry><sphere radius=\"2\"/><box size=\"0 0 0\"/></geometry></collision>";
    assert!(two_links("<link name=\"bar\">", two).unwrap().warnings.is_empty());
}

#[test]
fn an_error_names_the_line_the_element_and_the_number() {
    for (from, to, line, parts) in [
        ("<mass value=\"1\"/>", "<mass value=\"1.5kg\"/>", 3, ["value of <mass>", "1.5kg"]),
        ("xyz=\"0 0 1\"", "xyz=\"0 0\"", 5, ["xyz of <axis>", "2 numbers"]),
        ("xyz=\"0 0 1\"", "xyz=\"0 0 1 1\"", 5, ["xyz of <axis>", "4 numbers"]),
        (" effort=\"5\"", "", 6, ["<limit>", "effort"]),
    ] {
        let error = two_links(from, to).unwrap_err();
        let ModelError::BadElement { file, line: found, reason, .. } = &error else { panic!("{error}") };
        assert_eq!((file.as_str(), *found), ("two.urdf", line), "{error}");
        assert!(parts.iter().all(|part| reason.contains(part)), "{error}");
    }
}

/// Text that exceeds a limit is refused with its line; what is within the limits is read in a time that grows with its length.
#[test]
fn hostile_text_costs_bounded_time() {
    let refused = |text: &str| match UrdfTree::parse(text, "huge.urdf").unwrap_err() {
        ModelError::NotUrdf { line, .. } => line,
        error => panic!("{error}"),
    };
    let deep = format!("<robot name=\"deep\">\n{}{}</robot>", "<x>\n".repeat(50_000), "</x>".repeat(50_000));
    assert_eq!(refused(&deep), 65);
    let chain = |links: usize, kind: &str| {
        let link = |i: usize| format!("<link name=\"link{i}\"/>\n");
        let limit = "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
        let joint = |i: usize| {
            let ends = format!("<parent link=\"link{i}\"/><child link=\"link{}\"/>", i + 1);
            format!("<joint name=\"joint{i}\" type=\"{kind}\">{ends}{limit}</joint>\n")
        };
        let parts: String = (0..links).map(link).chain((0..links - 1).map(joint)).collect();
        format!("<robot name=\"chain\">\n{parts}</robot>")
    };
    let tree = UrdfTree::parse(&chain(10_000, "fixed"), "chain.urdf").unwrap();
    assert_eq!((tree.links.len(), Model::new(&tree, Base::Fixed).unwrap().nj()), (10_000, 0));
    assert_eq!(refused(&chain(10_001, "fixed")), 10_002);
    let tree = UrdfTree::parse(&chain(10_000, "revolute"), "chain.urdf").unwrap();
    let model = Model::new(&tree, Base::Fixed).unwrap();
    assert_eq!(model.nj(), 9_999);
    let error = check_runnable(&model, &vec![0.0; model.nj()]).unwrap_err();
    assert!(matches!(error, ModelError::TooManyJoints { found: 9_999, limit: 500, .. }), "{error}");
    let name = format!("<robot name=\"r\"><link name=\"{}\"/></robot>", "n".repeat(201));
    assert!(matches!(UrdfTree::parse(&name, "name.urdf"), Err(ModelError::BadElement { line: 1, .. })));
}

#[test]
fn numbers_out_of_range_are_errors() {
    for (from, to, line, element, quantity) in [
        ("mass value=\"1\"", "mass value=\"-1\"", 3, "link \"bar\"", "mass"),
        ("mass value=\"1\"", "mass value=\"inf\"", 3, "link \"bar\"", "mass"),
        ("mass value=\"1\"", "mass value=\"1e300\"", 3, "link \"bar\"", "mass"),
        ("value=\"2\"/><inertia ixx=\"1\"", "value=\"2\"/><inertia ixx=\"NaN\"", 2, "link \"stand\"", "inertia"),
        ("0 0 1", "0 0 0", 5, "joint \"hinge\"", "axis"),
        ("lower=\"-1\"", "lower=\"NaN\"", 6, "joint \"hinge\"", "position range"),
        ("effort=\"5\"", "effort=\"-5\"", 6, "joint \"hinge\"", "effort limit"),
        ("velocity=\"3\"", "velocity=\"NaN\"", 6, "joint \"hinge\"", "velocity limit"),
    ] {
        let error = two_links(from, to).unwrap_err();
        let ModelError::BadNumber { file, line: l, element: e, quantity: q, .. } = &error else { panic!("{error}") };
        assert_eq!((file.as_str(), *l, e.as_str(), *q), ("two.urdf", line, element, quantity), "{to}");
    }
    let error = two_links("<limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"3\"/>", "").unwrap_err();
    assert!(matches!(&error, ModelError::MissingLimits { line: 4, joint, .. } if joint == "hinge"), "{error}");
}

#[test]
fn unusual_but_usable_numbers_give_warnings() {
    let warnings = |from, to| two_links(from, to).unwrap().warnings;
    let bar = "<mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"";
    let flat = "<mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"2.5\"";
    let moments = [1.0, 1.0, 2.5];
    assert_eq!(warnings(bar, flat), [ModelWarning::ImplausibleInertia { link: "bar".into(), moments }]);
    let empty = "<mass value=\"0\"/><inertia ixx=\"0\" iyy=\"0\" izz=\"0\"";
    let massless = ModelWarning::MasslessBody { link: "bar".into(), joint: "hinge".into() };
    assert_eq!(warnings(bar, empty), [massless]);
    let zero = ModelWarning::ZeroLimit { joint: "hinge".into(), quantity: "effort" };
    assert_eq!(warnings("effort=\"5\"", "effort=\"0\""), [zero]);
    let locked =
        two_links(r#"lower="-1" upper="1" effort="5" velocity="3""#, r#"lower="0" upper="0" effort="0" velocity="0""#);
    assert_eq!(locked.unwrap().warnings.len(), 2, "a limit of zeros is accepted, a missing one is an error");
    // Pinocchio keeps the mass of an <inertial> without <inertia>.
    for (from, to, lacks, mass) in [
        ("<mass value=\"1\"/>", "", "mass", 2.0),
        ("<mass value=\"1\"/>", "<mass/>", "mass", 2.0),
        ("<mass value=\"1\"/><inertia ixx=\"1\"", "<mass value=\"1\"/><inertia", "inertia", 3.0),
        ("<mass value=\"1\"/><inertia", "<mass value=\"1\"/><no", "inertia", 3.0),
    ] {
        let model = two_links(from, to).unwrap();
        let expected = ModelWarning::IncompleteInertial { link: "bar".into(), line: 3, lacks, more: 0 };
        assert_eq!((model.total_mass(), &model.warnings[0]), (mass, &expected), "{to}");
    }
    let reversed = ModelWarning::RangeReversed { joint: "hinge".into(), line: 4, lower: 1.5, upper: 1.0 };
    let model = two_links("lower=\"-1\"", "lower=\"1.5\"").unwrap();
    assert_eq!((model.joints[0].lower, model.joints[0].upper, model.warnings), (1.0, 1.5, vec![reversed]));
    let long = ModelWarning::AxisNormalized { joint: "hinge".into(), line: 5, length: 2.0, more: 0 };
    assert_eq!(warnings("0 0 1", "0 0 2"), [long]);
    assert_eq!(warnings("0 0 1", "0.57735 0.57735 0.57735"), [], "rounded in the file");
    let tree = UrdfTree::parse(&replace_once(ROBOT, "<axis xyz=\"0 0 1\"/>", ""), "two.urdf").unwrap();
    assert_eq!(tree.joints[0].axis, nalgebra::Vector3::x(), "the default of URDF");
    let mimic = "<limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"3\"/><mimic joint=\"other\"/>";
    let ignored = ModelWarning::MimicIgnored { joint: "hinge".into(), leader: "other".into() };
    assert_eq!(warnings("<limit lower=\"-1\" upper=\"1\" effort=\"5\" velocity=\"3\"/>", mimic), [ignored]);
}

#[test]
fn a_floating_base_needs_mass() {
    let tree = UrdfTree::parse("<robot name=\"air\"><link name=\"a\"/></robot>", "air.urdf").unwrap();
    assert!(Model::new(&tree, Base::Fixed).is_ok());
    let error = Model::new(&tree, Base::Floating).unwrap_err();
    assert!(matches!(&error, ModelError::BadMass { file, found: 0.0, .. } if file == "air.urdf"), "{error}");
}

#[test]
fn an_unknown_name_lists_similar_ones() {
    let model = Model::new(&UrdfTree::parse(HYQ, "hyq.urdf").unwrap(), Base::Floating).unwrap();
    let error = model.frame("lf_foott").unwrap_err().to_string();
    assert!(error.starts_with("robot \"hyq\" has no link \"lf_foott\"; near: lf_foot, "), "{error}");
    let error = model.joint("lf_haa").unwrap_err().to_string();
    assert_eq!(error, "robot \"hyq\" has no joint \"lf_haa\"; near: lf_haa_joint");
    assert_eq!(model.joint("rf_haa_joint").unwrap().index(), 3);
    assert_eq!(model.v_index(model.joint("rf_haa_joint").unwrap()), 9);
}

#[test]
fn links_are_ordered_parents_first_and_joints_as_in_the_file() {
    let tree = UrdfTree::parse(include_str!("data/arm.urdf"), "arm.urdf").unwrap();
    for (i, link) in tree.links.iter().enumerate() {
        match link.parent_joint {
            None => assert_eq!(i, 0),
            Some(j) => {
                assert!(tree.joints[j].parent < i, "{}", link.name);
                assert_eq!(tree.joints[j].child, i);
            }
        }
    }
    assert_eq!(tree.joints[0].name, "wrist_roll");
    // Depth first: a subtree is contiguous, children in file order.
    let names: Vec<&str> = tree.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(
        names,
        ["pedestal", "turret", "upper_arm", "rail", "slider", "forearm", "wrist", "spinner", "tool", "counterweight"]
    );
}

/// The reader does not panic: text cut at every byte, and text with changed bytes.
#[test]
fn damaged_text_is_an_error_or_a_robot_but_never_a_panic() {
    let text = two_links_text();
    for end in 0..text.len() {
        assert!(UrdfTree::parse(&text[..end], "cut.urdf").is_err(), "cut at {end}");
    }
    let mut seed = 7_u64;
    for _ in 0..3000 {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut bytes = text.clone().into_bytes();
        let place = (seed >> 33) as usize % bytes.len();
        bytes[place] = b"<>/\"'&=! -.0eNa\n"[(seed >> 20) as usize % 16];
        let changed = String::from_utf8(bytes).unwrap();
        if let Ok(tree) = UrdfTree::parse(&changed, "changed.urdf") {
            let _ = Model::new(&tree, Base::Floating);
        }
    }
}

/// A URDF with every kind of element that the reader knows.
fn two_links_text() -> String {
    r#"<?xml version="1.0"?><!-- c --><robot name="r"><link name="a"><inertial><origin xyz="1 2 3" rpy="0 0.1 0"/><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry><box size="1 2 3"/></geometry></visual>
<collision><origin rpy="1 0 0"/><geometry><mesh filename="a.stl"/></geometry></collision></link><link name="b"/>
<joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><dynamics damping="1"/>
<limit lower="-1" upper="1" effort="5" velocity="3"/></joint></robot>"#
        .to_owned()
}
