//! The text of the parameter file.

use super::gains::Gains;
use super::legs::FoundLegs;
use super::posture::Posture;
use super::scaled::Scaled;
use super::srdf::FromSrdf;
use crate::model::{Model, UrdfTree};
use crate::params::{quoted, toml_key};

/// What the file contains.
pub(super) struct Parts<'a> {
    pub(super) name: &'a str,
    /// File name of the URDF.
    pub(super) urdf: &'a str,
    pub(super) tree: &'a UrdfTree,
    pub(super) model: &'a Model,
    pub(super) found: &'a FoundLegs,
    pub(super) stance: &'a Posture,
    pub(super) lying: &'a [f64],
    pub(super) scaled: &'a Scaled,
    pub(super) gains: &'a Gains,
    pub(super) srdf: &'a FromSrdf,
}

/// Writes the file.
pub(super) fn write(parts: &Parts) -> String {
    let Parts { name, urdf, tree, model, found, stance, lying, scaled, gains, srdf } = parts;
    let link = |link: usize| quoted(&tree.links[link].name);
    let feet = found.legs.iter().map(|leg| link(leg.foot)).collect::<Vec<_>>().join(", ");
    let (mass, height) = (model.total_mass(), stance.hip_height + found.foot_radius);
    let joints = |q: &[f64]| -> String {
        let legs = found.legs.iter().flat_map(|leg| leg.joints);
        legs.map(|j| format!("{} = {:?}\n", toml_key(&model.joints[j].name), q[j])).collect()
    };
    let Scaled { f_z_min, f_max, qdd_max, step_height, step_length, trot, capture, capture_threshold } = scaled;
    let Gains { swing_kp, swing_kd, stand_stiffness, stand_damping, limp_damping } = gains;
    let passive: String =
        srdf.passive.iter().map(|joint| format!("{} = {{ role = \"passive\" }}\n", toml_key(joint))).collect();
    let passive = if passive.is_empty() { passive } else { format!("\n[robot.joints]\n{passive}") };
    format!(
        "# Parameters of {name} that its URDF does not contain. A first guess by `hoof robot init`. Keys that are left out have their defaults;\n\
         # `hoof robot info {name}.toml --params` lists them.\n\n\
         [robot]\nname = {}\nurdf = {}\nfeet = [{feet}]\nfoot_radius = {}\nimu_link = {}\n\n\
         # Hips {:.3} m above the centres of the feet, 85 % of the length of the shortest leg.\n[robot.posture]\n{}\n\
         # On the ground, with the legs folded: the robot stays there without torque.\n[robot.lying]\n{}\
         {}{}{passive}{}\n\
         # HyQ's forces, scaled by mass: {mass:.1} kg, and its joint accelerations, by the height of the hips.\n\
         [wbc]\nf_z_min = {f_z_min:?}\nf_z_max = {f_max:?}\nf_xy_max = {f_max:?}\nqdd_max = {qdd_max:?}\n\n\
         # HyQ's steps, scaled by the height of the hips: {height:.3} m.\n[swing]\nheight = {step_height:?}\n\n\
         [foothold]\nmax_step_length = {step_length:?}\n\n[recovery]\nmax_capture = {capture:?}\ncapture_threshold = {capture_threshold:?}\n\n\
         [gait.trot]\nduty = 0.55\nswing_frequency = {trot:?}\nlift_off_phase = [0.0, 0.5, 0.5, 0.0]\n\n\
         # HyQ's gains, scaled by the inertia of the legs.\n[posture]\nswing_kp = {swing_kp:?}\nswing_kd = {swing_kd:?}\n\n\
         [stand]\nstiffness = {stand_stiffness:?}\ndamping = {stand_damping:?}\n\n\
         [safety]\ndamping = {limp_damping:?}\n",
        quoted(name),
        quoted(urdf),
        found.foot_radius,
        link(found.imu),
        stance.hip_height,
        joints(&stance.q),
        joints(lying),
        srdf.groups,
        srdf.postures,
        srdf.collisions,
    )
}
