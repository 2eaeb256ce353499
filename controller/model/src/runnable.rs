//! Checks that a robot can run, before it runs.

use super::bodies::Model;
use super::dynamics::mass_matrix;
use super::error::ModelError;
use super::kinematics::{BaseState, Kinematics};
use nalgebra::DMatrix;

/// Smallest mass that a joint may move, as a fraction of the robot's.
const LEAST_SHARE: f64 = 1e-6;
/// Largest number of movable joints: the mass matrix grows with its square.
const MAX_MOVABLE: usize = 500;
/// Square of the distance from a joint's axis at which that mass has the smallest inertia, m².
const LEAST_RADIUS_2: f64 = 1e-4;

/// Checks that a controller can move the robot: each joint has positive effort and velocity limits and moves a sufficient mass and inertia.
///
/// - `q`: a posture, nj. The inertias are those of this posture.
///
/// # Errors
/// [`ModelError::CannotRun`] for the first joint that fails, [`ModelError::TooManyJoints`].
pub fn check_runnable(model: &Model, q: &[f64]) -> Result<(), ModelError> {
    check_size(model)?;
    let mut moved: Vec<f64> = model.bodies.iter().map(|body| body.m).collect();
    for i in (1..model.bodies.len()).rev() {
        moved[model.bodies[i].parent] += moved[i];
    }
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
    let mut M = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, &kin, &mut M);
    let least = LEAST_SHARE * model.total_mass();
    for (i, body) in model.bodies.iter().enumerate().skip(1) {
        let joint = &model.joints[body.i_q];
        let inertia = M[(body.i_v, body.i_v)];
        for (quantity, found, at_least, expected) in [
            ("effort limit", joint.effort, 0.0, "more than 0"),
            ("velocity limit", joint.velocity, 0.0, "more than 0"),
            ("moved mass", moved[i], least, "more than 1e-6 of the robot's mass"),
            (
                "inertia about the joint",
                inertia,
                least * LEAST_RADIUS_2,
                "more than that of 1e-6 of the robot's mass at 0.01 m",
            ),
        ] {
            if found.is_nan() || found <= at_least {
                let link = model.frames.iter().find(|frame| frame.body == i).map(|frame| frame.name.clone());
                return Err(ModelError::CannotRun {
                    robot: model.name.clone(),
                    joint: joint.name.clone(),
                    link: link.unwrap_or_default(),
                    quantity,
                    found,
                    expected,
                });
            }
        }
    }
    Ok(())
}

/// Checks that the dynamics of a model fit into memory.
///
/// # Errors
/// [`ModelError::TooManyJoints`] above 500 movable joints.
pub(super) fn check_size(model: &Model) -> Result<(), ModelError> {
    if model.nj() > MAX_MOVABLE {
        return Err(ModelError::TooManyJoints { robot: model.name.clone(), found: model.nj(), limit: MAX_MOVABLE });
    }
    Ok(())
}
