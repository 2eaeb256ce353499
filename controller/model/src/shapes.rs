//! Collision shapes for links that have only meshes or no shape. Sizes come from the bounding box of a mesh if the caller can read it, otherwise from
//! the positions of the joints.

use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;

use super::link_groups::LinkGroups;
use super::pose::Pose;
use super::tree::{JointKind, Link, Shape, ShapeKind, UrdfTree};

/// Corners of a bounding box: the smallest and the largest coordinates, m.
pub type Bounds = [Vector3<f64>; 2];

/// Radius of a limb, as a fraction of its length.
const SLENDER: f64 = 0.1;
/// Height and least width of a trunk, as fractions of its length.
const TRUNK: f64 = 0.3;
/// Largest number of mesh files that are read for a trunk: a URDF may name thousands.
const MAX_MESHES: usize = 16;
/// Largest dimension of a trunk's mesh, as a multiple of the distance of the hips.
const LARGEST_MESH: f64 = 5.0;
/// Length below which a limb gets no shape, m.
const LEAST_LENGTH: f64 = 0.03;

/// A link that received a shape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AddedShape {
    /// Name of the link.
    pub link: String,
    /// Whether the size is that of its mesh; otherwise it comes from the joints.
    pub from_mesh: bool,
}

/// For each body that cannot touch anything, the name of its first link: no link of the body has a primitive shape, and none is in `feet`.
pub fn untouchable(tree: &UrdfTree, feet: &[String]) -> Vec<String> {
    let groups = LinkGroups::new(tree, |_| Matrix3::identity());
    let touches = touches(tree, &groups, feet);
    let first = |(body, touches): (usize, &bool)| (!touches).then(|| tree.links[groups.first_links[body]].name.clone());
    touches.iter().enumerate().filter_map(first).collect()
}

/// For each body, whether it has a shape that can touch the ground.
fn touches(tree: &UrdfTree, groups: &LinkGroups, feet: &[String]) -> Vec<bool> {
    let feet: BTreeSet<&str> = feet.iter().map(String::as_str).collect();
    let mut touches = vec![false; groups.first_links.len()];
    for (link, &body) in tree.links.iter().zip(&groups.body_of_link) {
        touches[body] |= feet.contains(link.name.as_str()) || largest(link).is_some();
    }
    touches
}

/// Largest dimension of the primitive shapes of a link, m; `None` if it has none.
fn largest(link: &Link) -> Option<f64> {
    let size = |shape: &Shape| match shape.kind {
        ShapeKind::Box { size: [x, y, z] } => Some(x.max(y).max(z)),
        ShapeKind::Cylinder { radius, length } | ShapeKind::Capsule { radius, length } => {
            Some(length.max(2.0 * radius))
        }
        ShapeKind::Sphere { radius } => Some(2.0 * radius),
        ShapeKind::Mesh { .. } => None,
    };
    link.collisions.iter().chain(&link.visuals).filter_map(size).max_by(f64::total_cmp)
}

/// Largest distance along an axis between the movable joints on the trunk, m.
fn hips(tree: &UrdfTree, groups: &LinkGroups) -> f64 {
    let on_trunk = tree.joints.iter().filter(|j| j.kind != JointKind::Fixed && groups.body_of_link[j.parent] == 0);
    let places = on_trunk.map(|joint| groups.X_BL[joint.parent].then(&joint.X_PC).p);
    bounds_of(places).map_or(0.0, |[low, high]| (high - low).max())
}

/// The bounding box of points; `None` for no point.
pub fn bounds_of(points: impl IntoIterator<Item = Vector3<f64>>) -> Option<Bounds> {
    points.into_iter().fold(None, |bounds, p| match bounds {
        None => Some([p, p]),
        Some([low, high]) => Some([low.inf(&p), high.sup(&p)]),
    })
}

/// The tree with a shape for each body that has only meshes, and for each body of a robot whose trunk has no shape at all or only small ones,
/// such as that of a sensor; and the links that received one. Other links are unchanged.
///
/// - `feet`: links that the simulator gives a sphere.
/// - `bounds`: bounding box of a mesh file, in its own frame and units; `None` if it cannot be read.
pub fn with_shapes(
    tree: &UrdfTree,
    feet: &[String],
    foot_radius: f64,
    bounds: &dyn Fn(&str) -> Option<Bounds>,
) -> (UrdfTree, Vec<AddedShape>) {
    let groups = LinkGroups::new(tree, |_| Matrix3::identity());
    let bodies = groups.first_links.len();
    let between_hips = hips(tree, &groups);
    let mut has_shape = vec![false; bodies];
    let mut has_mesh = vec![false; bodies];
    // Points of each body at which something is attached: origins of movable joints and of feet, in the body.
    let mut ends: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); bodies];
    let mut carries_foot = vec![false; bodies];
    for (i, link) in tree.links.iter().enumerate() {
        let body = groups.body_of_link[i];
        let is_large = |size: f64| body > 0 || size >= TRUNK * between_hips;
        has_shape[body] |= largest(link).is_some_and(is_large) && !feet.contains(&link.name);
        has_mesh[body] |= link.collisions.iter().chain(&link.visuals).any(|shape| is_mesh(&shape.kind));
        if feet.contains(&link.name) {
            ends[body].push(groups.X_BL[i].p);
            carries_foot[body] = true;
        }
    }
    for joint in tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed) {
        ends[groups.body_of_link[joint.parent]].push(groups.X_BL[joint.parent].then(&joint.X_PC).p);
    }
    let (mut shaped, mut added) = (tree.clone(), Vec::new());
    for body in 0..bodies {
        if has_shape[body] || (!has_mesh[body] && has_shape[0]) {
            continue;
        }
        let first = groups.first_links[body];
        // Only a trunk receives the box of its mesh: the corners of such a box around a limb would touch the ground before the foot.
        let mesh = if body == 0 { of_trunk_mesh(tree, &groups, between_hips, bounds) } else { None };
        let from_mesh = mesh.is_some();
        let shape = mesh
            .or_else(|| if body == 0 { trunk(&ends[0]) } else { limb(&ends[body], carries_foot[body], foot_radius) });
        if let Some(shape) = shape {
            let link = &mut shaped.links[first];
            link.collisions.push(shape);
            added.push(AddedShape { link: link.name.clone(), from_mesh });
        }
    }
    (shaped, added)
}

fn is_mesh(kind: &ShapeKind) -> bool {
    matches!(kind, ShapeKind::Mesh { .. })
}

/// The box around the largest mesh of the trunk that can be read, in the frame of the root link. Only the first [`MAX_MESHES`] files are read, each
/// once. A mesh much larger than the distance of the hips is left out: it is often in mm, without a scale.
fn of_trunk_mesh(
    tree: &UrdfTree,
    groups: &LinkGroups,
    between_hips: f64,
    bounds: &dyn Fn(&str) -> Option<Bounds>,
) -> Option<Shape> {
    let mut best: Option<(f64, Shape)> = None;
    let mut known: Vec<(&str, Option<Bounds>)> = Vec::new();
    for (i, link) in tree.links.iter().enumerate().filter(|(i, _)| groups.body_of_link[*i] == 0) {
        let shapes =
            if link.collisions.iter().any(|shape| is_mesh(&shape.kind)) { &link.collisions } else { &link.visuals };
        for Shape { X_LS, kind } in shapes {
            let ShapeKind::Mesh { filename, scale } = kind else { continue };
            let box_of_file = match known.iter().find(|(name, _)| name == filename) {
                Some((_, known)) => *known,
                None if known.len() == MAX_MESHES => continue,
                None => {
                    known.push((filename, bounds(filename)));
                    known[known.len() - 1].1
                }
            };
            let Some([low, high]) = box_of_file else { continue };
            let size = (high - low).component_mul(&Vector3::from(*scale)).abs();
            let center = (low + high).component_mul(&Vector3::from(*scale)) / 2.0;
            if between_hips > 0.0 && size.max() > LARGEST_MESH * between_hips {
                continue;
            }
            let volume = size.x * size.y * size.z;
            if volume > best.as_ref().map_or(0.0, |(best, _)| *best) && volume.is_finite() {
                let X_LS = groups.X_BL[i].then(X_LS).then(&Pose { p: center, R: Matrix3::identity() });
                best = Some((volume, Shape { X_LS, kind: ShapeKind::Box { size: size.into() } }));
            }
        }
    }
    best.map(|(_, shape)| shape)
}

/// A box around the joints on a trunk.
fn trunk(ends: &[Vector3<f64>]) -> Option<Shape> {
    let [low, high] = bounds_of(ends.iter().copied())?;
    let length = (high - low).max();
    if length < LEAST_LENGTH {
        return None;
    }
    let size = (high - low).sup(&Vector3::new(TRUNK * length, TRUNK * length, TRUNK * length));
    Some(Shape {
        X_LS: Pose { p: (low + high) / 2.0, R: Matrix3::identity() },
        kind: ShapeKind::Box { size: size.into() },
    })
}

/// A capsule from the joint of a limb to its farthest end; it ends above the sphere of a foot.
fn limb(ends: &[Vector3<f64>], carries_foot: bool, foot_radius: f64) -> Option<Shape> {
    let end = ends.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
    let reach = end.norm();
    if reach < LEAST_LENGTH {
        return None;
    }
    let z = end / reach;
    let (radius, tip) = if carries_foot {
        (foot_radius.min(SLENDER * reach), (reach - 2.0 * foot_radius).max(0.5 * reach))
    } else {
        (SLENDER * reach, reach)
    };
    let mut least = 0;
    for k in 1..3 {
        if z[k].abs() < z[least].abs() {
            least = k;
        }
    }
    let mut x = Vector3::zeros();
    x[least] = 1.0;
    let x = (x - z * z[least]).normalize();
    let R = Matrix3::from_columns(&[x, z.cross(&x), z]);
    // A cylinder, which every reader of URDF knows; the simulator uses the capsule inside it.
    Some(Shape { X_LS: Pose { p: z * (tip / 2.0), R }, kind: ShapeKind::Cylinder { radius, length: tip } })
}
