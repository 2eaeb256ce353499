//! Legs, feet and IMU of a quadruped that nobody has named: found in the tree of its URDF.

use anyhow::bail;
use controller::model::{Base, BaseState, JointKind, Kinematics, Model, ShapeKind, UrdfTree};
use nalgebra::Vector3;

/// Radius of a foot whose URDF has no sphere, m.
const FOOT_RADIUS: f64 = 0.02;

/// A leg: three joints from the base outward, and its foot.
#[derive(Clone, Debug)]
pub struct Leg {
    /// Joints, as places in [`Model::joints`].
    pub joints: [usize; 3],
    /// Links behind these joints; their origins are on the axes.
    pub links: [usize; 3],
    /// Link of the foot.
    pub foot: usize,
}

/// What is found of a quadruped.
#[derive(Clone, Debug)]
pub struct Found {
    /// LF RF LH RH.
    pub legs: [Leg; 4],
    /// Radius of the feet, m.
    pub foot_radius: f64,
    /// Link of the IMU.
    pub imu: usize,
    /// How the IMU was found.
    pub imu_because: &'static str,
    /// How the radius was found.
    pub radius_because: &'static str,
    /// What a person must look at.
    pub look_at: Vec<String>,
}

/// Finds the legs.
///
/// # Errors
/// Other than four chains of three rotary joints from the base to the ground; movable joints besides; feet that are not one to a corner.
pub fn find(tree: &UrdfTree, model: &Model) -> anyhow::Result<Found> {
    let mut look_at = Vec::new();
    let mut legs = Vec::new();
    let ends = (0..tree.joints.len()).filter(|&j| movable(tree, j) && !movable_behind(tree, tree.joints[j].child));
    for end in ends {
        legs.push((chain(tree, tree.joints[end].child), end));
    }
    let names = |joints: &[usize]| joints.iter().map(|&j| tree.joints[j].name.as_str()).collect::<Vec<_>>().join(", ");
    let chains = || legs.iter().map(|(joints, _)| format!("({})", names(joints))).collect::<Vec<_>>().join(", ");
    if legs.len() < 4 {
        let found = if legs.is_empty() { "none".to_owned() } else { chains() };
        bail!("a quadruped has four legs, this robot has {} chains of movable joints: {found}", legs.len());
    }
    let kin = at_zero(model);
    let place = |link: usize| model.frame(&tree.links[link].name).map(|frame| kin.p_WF(model, frame));
    if legs.len() > 4 {
        // The lowest four are legs; what else moves, such as an arm, the controller does not know how to hold.
        let mut by_height = Vec::new();
        for (joints, end) in legs {
            by_height.push((place(foot_of(tree, tree.joints[end].child, &place)?)?.z, joints));
        }
        by_height.sort_by(|a, b| a.0.total_cmp(&b.0));
        let rest: Vec<usize> = by_height.iter().skip(4).flat_map(|(_, joints)| joints.clone()).collect();
        bail!(
            "these joints belong to none of the four lowest chains, the legs: {}; make them fixed in the URDF",
            names(&rest)
        );
    }
    let mut found = Vec::with_capacity(4);
    for (joints, end) in &legs {
        let Ok(three) = <[usize; 3]>::try_from(joints.as_slice()) else {
            bail!("the leg of the joints {} has {} of them, expected 3", names(joints), joints.len());
        };
        if let Some(&slides) = three.iter().find(|&&j| tree.joints[j].kind == JointKind::Prismatic) {
            bail!("leg joint {} is prismatic, expected a revolute one", tree.joints[slides].name);
        }
        let foot = foot_of(tree, tree.joints[*end].child, &place)?;
        let links = three.map(|j| tree.joints[j].child);
        if (place(foot)? - place(links[2])?).norm() < 1e-3 {
            let (name, joint) = (&tree.links[foot].name, &tree.joints[*end].name);
            bail!(
                "the leg behind {joint} ends in link {name}, whose origin is on that joint: the URDF needs a link for the foot, where it touches"
            );
        }
        let mut places = [0; 3];
        for (place, j) in places.iter_mut().zip(three) {
            *place = model.joint(&tree.joints[j].name)?.index();
        }
        found.push(Leg { joints: places, links, foot });
    }
    let legs = ordered(tree, found, &place)?;
    let (foot_radius, radius_because) = radius(tree, &legs, &mut look_at);
    let (imu, imu_because) = imu(tree, &mut look_at);
    Ok(Found { legs, foot_radius, imu, imu_because, radius_because, look_at })
}

/// The model at zero, its base at the origin.
fn at_zero(model: &Model) -> Kinematics {
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), &vec![0.0; model.nj()], &vec![0.0; model.nj()]);
    kin
}

/// The floating-base model of a tree.
pub fn model(tree: &UrdfTree) -> anyhow::Result<Model> {
    Ok(Model::new(tree, Base::Floating)?)
}

fn movable(tree: &UrdfTree, joint: usize) -> bool {
    tree.joints[joint].kind != JointKind::Fixed
}

fn children(tree: &UrdfTree, link: usize) -> impl Iterator<Item = usize> {
    (0..tree.joints.len()).filter(move |&j| tree.joints[j].parent == link)
}

fn movable_behind(tree: &UrdfTree, link: usize) -> bool {
    children(tree, link).any(|j| movable(tree, j) || movable_behind(tree, tree.joints[j].child))
}

/// Movable joints from the root out to a link.
fn chain(tree: &UrdfTree, link: usize) -> Vec<usize> {
    let (mut joints, mut at) = (Vec::new(), link);
    while let Some(joint) = tree.links[at].parent_joint {
        if movable(tree, joint) {
            joints.push(joint);
        }
        at = tree.joints[joint].parent;
    }
    joints.reverse();
    joints
}

/// Of the links that are fixed behind a leg's last joint and carry no other, the one that is a foot: with a sphere rather than without, and the
/// farthest from the joint.
fn foot_of(
    tree: &UrdfTree,
    last: usize,
    place: &dyn Fn(usize) -> Result<Vector3<f64>, controller::model::ModelError>,
) -> anyhow::Result<usize> {
    let mut best = (false, -1.0, last);
    let mut open = vec![last];
    while let Some(link) = open.pop() {
        let behind: Vec<usize> = children(tree, link).map(|j| tree.joints[j].child).collect();
        if behind.is_empty() {
            let candidate = (sphere(tree, link).is_some(), (place(link)? - place(last)?).norm(), link);
            if (candidate.0, candidate.1) > (best.0, best.1) {
                best = candidate;
            }
        }
        open.extend(behind);
    }
    Ok(best.2)
}

/// Radius and offset of the first sphere that a link collides or looks as.
fn sphere(tree: &UrdfTree, link: usize) -> Option<(f64, Vector3<f64>)> {
    let link = &tree.links[link];
    link.collisions.iter().chain(&link.visuals).find_map(|shape| match shape.kind {
        ShapeKind::Sphere { radius } => Some((radius, shape.X_LS.p)),
        _ => None,
    })
}

/// Legs as LF RF LH RH, by where their second joints are: the first ones may all be in the middle.
fn ordered(
    tree: &UrdfTree,
    legs: Vec<Leg>,
    place: &dyn Fn(usize) -> Result<Vector3<f64>, controller::model::ModelError>,
) -> anyhow::Result<[Leg; 4]> {
    let hips = legs.iter().map(|leg| place(leg.links[1])).collect::<Result<Vec<_>, _>>()?;
    let middle = hips.iter().sum::<Vector3<f64>>() / 4.0;
    let mut corners: [Option<Leg>; 4] = [const { None }; 4];
    for (leg, hip) in legs.into_iter().zip(&hips) {
        let corner = usize::from(hip.y < middle.y) + 2 * usize::from(hip.x < middle.x);
        let name = |leg: &Leg| tree.links[leg.foot].name.clone();
        if let Some(other) = &corners[corner] {
            let where_ = ["left front", "right front", "left hind", "right hind"][corner];
            bail!(
                "the legs of {} and {} are both {where_}: x of the root link must point forward, y to the left",
                name(other),
                name(&leg)
            );
        }
        corners[corner] = Some(leg);
    }
    let [Some(lf), Some(rf), Some(lh), Some(rh)] = corners else { bail!("the legs are not one to a corner") };
    Ok([lf, rf, lh, rh])
}

fn radius(tree: &UrdfTree, legs: &[Leg; 4], look_at: &mut Vec<String>) -> (f64, &'static str) {
    let spheres: Vec<_> = legs.iter().map(|leg| sphere(tree, leg.foot)).collect();
    let Some((radius, offset)) = spheres[0] else {
        look_at.push(format!("robot.foot_radius: {} has no sphere", tree.links[legs[0].foot].name));
        return (FOOT_RADIUS, "a guess: the feet have no sphere");
    };
    if spheres.iter().any(|sphere| sphere.is_none_or(|(r, _)| (r - radius).abs() > 1e-9)) {
        look_at.push("robot.foot_radius: the feet differ, this is the left front one's".to_owned());
    }
    if offset.norm() > 1e-6 {
        let (name, distance) = (&tree.links[legs[0].foot].name, offset.norm());
        look_at.push(format!(
            "robot.feet: the sphere of {name} is {distance:.4} m from the link's origin, which the controller takes for its centre"
        ));
    }
    (radius, "sphere of the foot's link")
}

/// A link that is fixed to the base and has `imu` in its name, or the root.
fn imu(tree: &UrdfTree, look_at: &mut Vec<String>) -> (usize, &'static str) {
    let named = |&link: &usize| tree.links[link].name.to_lowercase().contains("imu") && chain(tree, link).is_empty();
    match (0..tree.links.len()).find(named) {
        Some(link) => (link, "fixed to the base, and named so"),
        None => {
            look_at.push(format!(
                "robot.imu_link: no link fixed to the base has `imu` in its name, so the IMU is taken to measure in the axes of {}",
                tree.links[0].name
            ));
            (0, "a guess: no link is named so")
        }
    }
}
