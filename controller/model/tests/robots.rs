//! The robots in `robots/` agree with their sources: order of joints, limits, positions of the feet.
#![allow(clippy::unwrap_used, missing_docs)]

use robot_model::*;

#[test]
fn hyq_has_the_feet_and_joints_of_its_source() {
    let urdf = include_str!("../../../robots/hyq/hyq.urdf");
    let (model, feet) = feet_of(urdf, "foot", [-0.2, 0.75, -1.5], [1.0; 4]);
    check_feet(&feet, [0.371, 0.324, -0.5775]);
    assert_eq!(names(&model)[..4], ["lf_haa_joint", "lf_hfe_joint", "lf_kfe_joint", "rf_haa_joint"]);
    assert!(model.joints.iter().all(|j| (j.effort, j.velocity, j.damping) == (150.0, 12.0, 0.1)));
}

#[test]
fn anymal_b_has_the_feet_and_joints_of_its_source() {
    let urdf = include_str!("../../../robots/anymal_b/anymal_b.urdf");
    let (model, feet) = feet_of(urdf, "FOOT", [-0.1, 0.7, -1.0], [1.0, -1.0, 1.0, -1.0]);
    check_feet(&feet, [0.370, 0.199, -0.479]);
    assert_eq!(names(&model)[..4], ["LF_HAA", "LF_HFE", "LF_KFE", "RF_HAA"]);
    assert!(model.joints.iter().all(|j| (j.effort, j.velocity, j.damping) == (80.0, 15.0, 0.0)));
}

fn names(model: &Model) -> Vec<&str> {
    model.joints.iter().map(|joint| joint.name.as_str()).collect()
}

/// Positions of the feet in B, legs LF RF LH RH; hind legs are bent the other way; `haa_sign` mirrors the first joint of a leg.
fn feet_of(urdf: &str, ending: &str, [haa, hfe, kfe]: [f64; 3], haa_sign: [f64; 4]) -> (Model, Vec<[f64; 3]>) {
    let model = Model::new(&UrdfTree::parse(urdf, "urdf").unwrap(), Base::Floating).unwrap();
    let bend = [1.0, 1.0, -1.0, -1.0];
    let q: Vec<f64> = (0..4).flat_map(|i| [haa_sign[i] * haa, bend[i] * hfe, bend[i] * kfe]).collect();
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState::identity(), &q, &[0.0; 12]);
    let feet = model.frames().filter(|(_, name)| name.ends_with(ending));
    let feet = feet.map(|(frame, _)| kin.p_WF(&model, frame).into()).collect();
    (model, feet)
}

/// The source gives the positions of the feet with a resolution of 1 mm.
#[track_caller]
fn check_feet(feet: &[[f64; 3]], [x, y, z]: [f64; 3]) {
    let expected = [[x, y, z], [x, -y, z], [-x, y, z], [-x, -y, z]];
    assert_eq!(feet.len(), 4);
    for (foot, expected) in feet.iter().zip(expected) {
        for k in 0..3 {
            assert!((foot[k] - expected[k]).abs() < 1e-3, "found {foot:?}, expected {expected:?}");
        }
    }
}
