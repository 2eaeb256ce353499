//! The ends of the chains of a robot, and soles at those that are feet.

use super::Options;
use crate::model::{
    BaseState, Inertial, Joint, JointKind, Kinematics, Limits, Link, LinkGroups, Model, Pose, Shape, ShapeKind,
    UrdfTree, bounds_of,
};
use nalgebra::{Matrix3, Vector3};

/// Largest height above the lowest point at which the end of a chain is a foot, m.
const FOOT_HEIGHT: f64 = 0.03;
/// Smallest length and width of a sole, m.
const LEAST_SOLE: f64 = 0.02;

/// The bodies without a movable child: the name of the first link, and the body.
pub(super) fn chains(tree: &UrdfTree) -> Vec<(String, usize)> {
    let groups = LinkGroups::new(tree, |_| Matrix3::identity());
    let mut is_end = vec![true; groups.first_links.len()];
    for joint in tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed) {
        is_end[groups.body_of_link[joint.parent]] = false;
    }
    let ends = (1..is_end.len()).filter(|&body| is_end[body]);
    ends.map(|body| (tree.links[groups.first_links[body]].name.clone(), body)).collect()
}

/// Adds a link at the bottom of each foot: the ends of chains at the lowest point of the robot. Returns the links with the range of their soles in x and y, m.
pub(super) fn add_soles(
    tree: &mut UrdfTree,
    model: &Model,
    q: &[f64],
    options: &Options,
) -> Vec<(String, [[f64; 2]; 2])> {
    let groups = LinkGroups::new(tree, |_| Matrix3::identity());
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
    let mut feet = Vec::new();
    for (name, body) in chains(tree) {
        let Ok(frame) = model.frame(&name) else { continue };
        let R_WB = kin.R_WF(model, frame);
        let p_WB = kin.p_WF(model, frame);
        let mut points = Vec::new();
        for (index, link) in tree.links.iter().enumerate().filter(|(index, _)| groups.body_of_link[*index] == body) {
            let shapes = if link.collisions.is_empty() { &link.visuals } else { &link.collisions };
            for shape in shapes {
                let X_BS = groups.X_BL[index].then(&shape.X_LS);
                points.extend(corners(shape, options).into_iter().map(|p| R_WB * (X_BS.p + X_BS.R * p)));
            }
        }
        let Some([low, high]) = bounds_of(points) else { continue };
        feet.push((groups.first_links[body], name, R_WB, p_WB.z + low.z, low, high));
    }
    let lowest = feet.iter().map(|foot| foot.3).fold(f64::INFINITY, f64::min);
    let mut soles = Vec::new();
    for (parent, name, R_WB, height, low, high) in feet {
        let is_flat = high.x - low.x > LEAST_SOLE && high.y - low.y > LEAST_SOLE;
        if height > lowest + FOOT_HEIGHT || !is_flat || turns_freely(tree, parent) {
            continue;
        }
        // The link has the axes of W in the posture, below the origin of the foot.
        let name = new_name(tree, &format!("{name}_bottom"));
        let X_PC = Pose { p: R_WB.transpose() * Vector3::new(0.0, 0.0, low.z), R: R_WB.transpose() };
        add_link(tree, parent, &name, X_PC);
        let round = |x: f64| (x * 1e4).round() / 1e4;
        soles.push((name, [[round(low.x), round(high.x)], [round(low.y), round(high.y)]]));
    }
    soles
}

/// Whether the joint of a link has no limits, as that of a wheel.
pub(super) fn turns_freely(tree: &UrdfTree, link: usize) -> bool {
    let limits = tree.links[link].parent_joint.map(|joint| &tree.joints[joint].limits);
    limits.is_some_and(|limits| limits.lower == f64::NEG_INFINITY && limits.upper == f64::INFINITY)
}

/// An unused name for a link: `wanted`, or `wanted` and a number. The name followed by `_joint` is unused among the joints, too.
fn new_name(tree: &UrdfTree, wanted: &str) -> String {
    let is_new = |name: &String| {
        let joint = format!("{name}_joint");
        tree.links.iter().all(|link| link.name != *name) && tree.joints.iter().all(|other| other.name != joint)
    };
    let numbered = (2..).map(|number| format!("{wanted}_{number}"));
    std::iter::once(wanted.to_owned()).chain(numbered).find(is_new).expect("there are endless numbers")
}

fn add_link(tree: &mut UrdfTree, parent: usize, name: &str, X_PC: Pose) {
    tree.joints.push(Joint {
        name: format!("{name}_joint"),
        kind: JointKind::Fixed,
        parent,
        child: tree.links.len(),
        X_PC,
        axis: Vector3::z(),
        limits: Limits::NONE,
        damping: 0.0,
        friction: 0.0,
    });
    tree.links.push(Link {
        name: name.to_owned(),
        parent_joint: Some(tree.joints.len() - 1),
        inertial: Inertial { X_LC: Pose::identity(), mass: 0.0, I_C: Matrix3::zeros() },
        visuals: Vec::new(),
        collisions: Vec::new(),
    });
}

/// Corners of the box around a shape, in its axes, m; none for a mesh that cannot be read.
fn corners(shape: &Shape, options: &Options) -> Vec<Vector3<f64>> {
    let around = |half: Vector3<f64>| [-half, half];
    let [low, high] = match &shape.kind {
        ShapeKind::Box { size } => around(Vector3::from(*size) / 2.0),
        ShapeKind::Cylinder { radius, length } => around(Vector3::new(*radius, *radius, length / 2.0)),
        ShapeKind::Capsule { radius, length } => around(Vector3::new(*radius, *radius, length / 2.0 + radius)),
        ShapeKind::Sphere { radius } => around(Vector3::new(*radius, *radius, *radius)),
        ShapeKind::Mesh { filename, scale } => {
            let Some(bounds) = (options.bounds)(filename) else { return Vec::new() };
            bounds.map(|corner| corner.component_mul(&Vector3::from(*scale)))
        }
    };
    let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
    (0..8).map(|i| Vector3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect()
}
