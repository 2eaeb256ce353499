//! Shapes for links without primitives, and URDF text written from a tree.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::Vector3;
use robot_model::*;

const HYQ: &str = include_str!("../../../robots/hyq/hyq.urdf");
const ARM: &str = include_str!("data/arm.urdf");

/// What is written is read as the same tree; angles are rounded, and visual shapes become collision shapes where there are no others.
#[test]
fn written_text_is_read_as_the_same_tree() {
    for text in [HYQ, ARM] {
        let tree = UrdfTree::parse(text, "a.urdf").unwrap();
        let again = UrdfTree::parse(&tree.to_urdf(&["two -- hyphens".to_owned()]), "a.urdf").unwrap();
        assert_eq!((again.links.len(), again.joints.len()), (tree.links.len(), tree.joints.len()));
        let near = |a: &Pose, b: &Pose| (a.p - b.p).norm() < 1e-12 && (a.R - b.R).norm() < 1e-12;
        for (a, b) in tree.links.iter().zip(&again.links) {
            assert_eq!((&a.name, a.parent_joint, a.inertial.mass), (&b.name, b.parent_joint, b.inertial.mass));
            assert!(a.inertial.I_C == b.inertial.I_C && near(&a.inertial.X_LC, &b.inertial.X_LC), "{}", a.name);
            if !a.collisions.is_empty() {
                assert_eq!(a.collisions.len(), b.collisions.len());
            }
            for (a, b) in a.collisions.iter().zip(&b.collisions) {
                assert!(a.kind == b.kind && near(&a.X_LS, &b.X_LS));
            }
        }
        for (a, b) in tree.joints.iter().zip(&again.joints) {
            assert_eq!((&a.name, a.kind, a.parent, a.child, a.limits), (&b.name, b.kind, b.parent, b.child, b.limits));
            assert!(near(&a.X_PC, &b.X_PC) && (a.axis - b.axis).norm() < 1e-12, "{}", a.name);
        }
    }
}

/// A trunk with a mesh, and legs without any shape: the trunk receives the box of its mesh, or one around the hips; a limb a cylinder from
/// joint to joint that ends above the foot. HyQ's own trunk is not changed.
#[test]
fn links_with_meshes_receive_shapes() {
    let feet = ["lf_foot", "rf_foot", "lh_foot", "rh_foot"].map(str::to_owned);
    let tree = UrdfTree::parse(HYQ, "hyq.urdf").unwrap();
    let (same, added) = with_shapes(&tree, &feet, 0.02, &|_| None);
    assert!(added.is_empty() && same == tree && untouchable(&tree, &feet).is_empty());

    let bare: String =
        HYQ.lines().filter(|line| !line.contains("<geometry><")).map(|line| format!("{line}\n")).collect();
    let bare = UrdfTree::parse(&bare, "bare.urdf").unwrap();
    assert_eq!(untouchable(&bare, &feet).len(), 1 + 8 + 4 - 4, "trunk, hips and thighs; shanks carry the feet");
    let (shaped, added) = with_shapes(&bare, &feet, 0.02, &|_| None);
    assert_eq!((added[0].link.as_str(), added[0].from_mesh), ("base_link", false));
    let shape =
        |tree: &UrdfTree, name: &str| tree.links.iter().find(|link| link.name == name).unwrap().collisions[0].clone();
    // HyQ's hips are at x = ±0.3735 m and y = ±0.207 m.
    let ShapeKind::Box { size } = shape(&shaped, "base_link").kind else { panic!("a box") };
    for (found, expected) in size.into_iter().zip([0.747, 0.414, 0.2241]) {
        assert!((found - expected).abs() < 1e-3, "{size:?}");
    }
    // The shank is 0.346 m long.
    let Shape { X_LS, kind: ShapeKind::Cylinder { radius, length } } = shape(&shaped, "lf_lowerleg") else {
        panic!("a cylinder")
    };
    assert!(
        radius == 0.02 && (length - 0.306).abs() < 2e-3 && (X_LS.p.norm() - length / 2.0).abs() < 1e-12,
        "{radius} {length}"
    );

    let mesh = "<geometry><mesh filename=\"trunk.stl\" scale=\"2 1 1\"/></geometry>";
    let meshed =
        UrdfTree::parse(&HYQ.replace("<geometry><box size=\"0.9 0.35 0.2\"/></geometry>", mesh), "mesh.urdf").unwrap();
    let bounds =
        |name: &str| (name == "trunk.stl").then_some([Vector3::new(-0.1, -0.2, 0.0), Vector3::new(0.3, 0.2, 0.5)]);
    let (shaped, added) = with_shapes(&meshed, &feet, 0.02, &bounds);
    assert_eq!(added, [AddedShape { link: "base_link".into(), from_mesh: true }]);
    let Shape { X_LS, kind: ShapeKind::Box { size } } = shape(&shaped, "base_link") else { panic!("a box") };
    assert!((Vector3::from(size) - Vector3::new(0.8, 0.4, 0.5)).norm() < 1e-12, "{size:?}");
    assert!((X_LS.p - Vector3::new(0.2, 0.0, 0.25)).norm() < 1e-12, "{}", X_LS.p);
}

/// A trunk with a thousand meshes: a bounded number of files is read, each once, and the box is that of the largest among them that is not far larger
/// than the robot, such as one in mm.
#[test]
fn few_of_many_meshes_are_read() {
    let mesh = |i: usize| format!("<collision><geometry><mesh filename=\"{}.stl\"/></geometry></collision>", i / 2);
    let many: String = (0..1000).map(mesh).collect();
    let trunk = "<collision>\n      <geometry><box size=\"0.9 0.35 0.2\"/></geometry>\n    </collision>";
    let text = HYQ.replace("<link name=\"base_link\">", &format!("<link name=\"base_link\">{many}"));
    let text = text.replace(trunk, "").replace("<geometry><box size=\"0.9 0.35 0.2\"/></geometry>", "<geometry/>");
    let tree = UrdfTree::parse(&text, "many.urdf").unwrap();
    let asked = std::cell::RefCell::new(Vec::new());
    let bounds = |name: &str| {
        asked.borrow_mut().push(name.to_owned());
        let size: f64 = name.trim_end_matches(".stl").parse().unwrap();
        Some([Vector3::zeros(), Vector3::new(1.0, 1.0, 1.0) * if size == 15.0 { 600.0 } else { 0.1 * size }])
    };
    let feet = ["lf_foot", "rf_foot", "lh_foot", "rh_foot"].map(str::to_owned);
    let (shaped, added) = with_shapes(&tree, &feet, 0.02, &bounds);
    assert_eq!(*asked.borrow(), (0..16).map(|i| format!("{i}.stl")).collect::<Vec<_>>());
    assert_eq!(added[0], AddedShape { link: "base_link".into(), from_mesh: true });
    let box_of = &shaped.links[0].collisions.last().unwrap().kind;
    let ShapeKind::Box { size } = box_of else { panic!("a box") };
    assert!(size.iter().all(|x| (x - 1.4).abs() < 1e-12), "{size:?}");
}
