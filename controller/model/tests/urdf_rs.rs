//! The project's URDF reader and the crate urdf-rs read the same numbers from the robots of the project.

#![allow(clippy::unwrap_used, missing_docs, non_snake_case)]

use nalgebra::Matrix3;
use robot_model::{JointKind, Pose, UrdfTree};

#[test]
fn urdf_rs_reads_the_same_numbers() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots");
    for name in ["hyq", "anymal_b"] {
        let text = std::fs::read_to_string(format!("{folder}/{name}/{name}.urdf")).unwrap();
        let tree = UrdfTree::parse(&text, name).unwrap();
        let other = urdf_rs::read_from_string(&text).unwrap();
        assert_eq!(
            (&tree.name, tree.links.len(), tree.joints.len()),
            (&other.name, other.links.len(), other.joints.len())
        );
        for expected in &other.links {
            let link = tree.links.iter().find(|link| link.name == expected.name).unwrap();
            let i = &expected.inertial.inertia;
            let I_C = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
            assert_eq!((link.inertial.mass, link.inertial.I_C), (expected.inertial.mass.value, I_C), "{}", link.name);
            assert_eq!(link.inertial.X_LC, pose(&expected.inertial.origin), "{}", link.name);
            let shapes = (link.visuals.len(), link.collisions.len());
            assert_eq!(shapes, (expected.visual.len(), expected.collision.len()), "{}", link.name);
            for (shape, expected) in link.collisions.iter().zip(&expected.collision) {
                assert_eq!(shape.X_LS, pose(&expected.origin), "{}", link.name);
            }
        }
        for (joint, expected) in tree.joints.iter().zip(&other.joints) {
            assert_eq!((&joint.name, joint.X_PC), (&expected.name, pose(&expected.origin)));
            assert_eq!(tree.links[joint.parent].name, expected.parent.link, "{}", joint.name);
            assert_eq!(tree.links[joint.child].name, expected.child.link, "{}", joint.name);
            let is_fixed = matches!(expected.joint_type, urdf_rs::JointType::Fixed);
            assert_eq!(joint.kind == JointKind::Fixed, is_fixed, "{}", joint.name);
            if is_fixed {
                continue;
            }
            let (limits, limit) = (joint.limits, &expected.limit);
            assert_eq!(joint.axis.as_slice(), &*expected.axis.xyz, "{}", joint.name);
            assert_eq!((limits.lower, limits.upper), (limit.lower, limit.upper), "{}", joint.name);
            assert_eq!((limits.effort, limits.velocity), (limit.effort, limit.velocity), "{}", joint.name);
            let dynamics = expected.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
            assert_eq!((joint.damping, joint.friction), dynamics, "{}", joint.name);
        }
    }
}

fn pose(origin: &urdf_rs::Pose) -> Pose {
    Pose::from_xyz_rpy(*origin.xyz, *origin.rpy)
}
