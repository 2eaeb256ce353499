//! An axis of a link points to a target, given in the world or in the axes of another link.
//!
//! ```text
//! u_i · (ω + d × v / ρ) = u_i · (k e + d × v_target / ρ),   i = 1, 2          e = θ (a × d)/|a × d|
//! ```
//! `a`: the axis; `d`, `ρ`: direction and distance from the link to the target; `v`, `ω`: twist of the link relative to the other link; `u_1`, `u_2`: unit vectors
//! of the link, perpendicular to `a`. The left side is the angular velocity of the link relative to the direction, so the angle θ between axis and direction
//! decreases by `dθ/dt = -k θ` while link and target move. θ is the full angle: the error grows up to π for a target behind the link. A target exactly behind is
//! reached by a turn about `u_1`. The turn about `a` is free.
//!
//! Source: the motion relative to a link is that of Laurenzi 2020, eqs. (5.22)-(5.24); the rows follow from `dd/dt = (E - d dᵀ)(v_target - v)/ρ`.

use crate::math::{atan2, norm, z_onto};
use crate::model::{FrameId, for_each_relative_column};
use crate::stack::{ModelState, Rows, Structure, Task};
use nalgebra::{Matrix3, Vector3};

/// Distance of the target below which the direction is undefined and the rows are switched off, m.
const NEAREST: f64 = 1e-3;
/// Sine of the angle between axis and direction below which they count as parallel.
const PARALLEL: f64 = 1e-9;

/// The task: two rows, rad/s. Its options may change between ticks.
pub struct Gaze {
    /// Link with the axis, through its origin.
    pub link: FrameId,
    /// Link in whose axes the target is given; `None` for the world.
    pub relative_to: Option<FrameId>,
    /// Gain k, 1/s.
    pub gain: f64,
    /// Joints whose columns stay 0, by velocity index.
    pub disabled: Vec<usize>,
    /// `u_1`, `u_2` and the axis as columns, in the axes of the link.
    R_LG: Matrix3<f64>,
    nv: usize,
}

impl Gaze {
    /// - `axis`: unit vector in the axes of the link.
    /// - `relative_to`: `None` for the world.
    /// - `gain`: 1/s.
    pub fn new(
        of: &Structure<'_>,
        link: FrameId,
        axis: &Vector3<f64>,
        relative_to: Option<FrameId>,
        gain: f64,
    ) -> Self {
        Gaze { link, relative_to, gain, disabled: Vec::new(), R_LG: z_onto(axis), nv: of.model.nv() }
    }
}

impl Task for Gaze {
    /// Position and velocity of the target in the axes of the other link or of the world, m and m/s.
    type Reference = (Vector3<f64>, Vector3<f64>);

    fn size(&self) -> usize {
        2
    }

    /// One block of two; it has memory for all columns.
    fn rows(&self) -> Rows {
        Rows::new(self.nv, [(2, (0..self.nv).collect())])
    }

    fn update(&mut self, state: &ModelState<'_>, (target, v_target): &Self::Reference, rows: &mut Rows) {
        let ModelState { model, kin, .. } = *state;
        let p = kin.p_BF_W(model, self.link);
        let (to_target, v_target) = match self.relative_to {
            None => (target - kin.base().p_WB - p, *v_target),
            Some(other) => {
                let R = kin.R_WF(model, other);
                (kin.p_BF_W(model, other) + R * target - p, R * v_target)
            }
        };
        let distance = norm(&to_target);
        if distance < NEAREST {
            rows.switch(0, false);
            return;
        }
        let d = to_target / distance;
        let R_WG = kin.R_WF(model, self.link) * self.R_LG;
        let u: [Vector3<f64>; 3] = [0, 1, 2].map(|k| R_WG.column(k).into());
        let (across, along) = (u[2].cross(&d), u[2].dot(&d));
        let sine = norm(&across);
        let angle = atan2(sine, along);
        let e = match (sine > PARALLEL, along > 0.0) {
            (true, _) => across * (angle / sine),
            (false, true) => across,
            (false, false) => u[0] * angle,
        };
        rows.restart(0);
        for_each_relative_column(model, kin, (self.link, self.relative_to), &p, |col, linear, angular| {
            if !self.disabled.contains(&col) {
                let turn = angular + d.cross(&linear) / distance;
                rows.add_column(0, col).copy_from_slice(&[u[0].dot(&turn), u[1].dot(&turn)]);
            }
        });
        let turn = e * self.gain + d.cross(&v_target) / distance;
        (rows.b[0], rows.b[1]) = (u[0].dot(&turn), u[1].dot(&turn));
    }
}
