//! A rectangular sole: six force variables, the force and the moment about the origin of the link, in W axes.
//!
//! The admissible wrenches are those that four corner forces with friction pyramids `|f_x| ≤ c f_z`, `|f_y| ≤ c f_z` can have. With half lengths
//! `X`, `Y` and the moment `τ` about the centre of the rectangle, in the axes of the link:
//!
//! ```text
//! f_z ≥ 0,   |f_x| ≤ c f_z,   |f_y| ≤ c f_z                        friction
//! |τ_x| ≤ Y f_z,   |τ_y| ≤ X f_z                                   centre of pressure inside the rectangle
//! |Y f_x - c τ_x| + |X f_y - c τ_y| - c (X + Y) f_z ≤ τ_z          yaw moment
//! τ_z ≤ c (X + Y) f_z - |Y f_x + c τ_x| - |X f_y + c τ_y|
//! ```
//! This is exact for the pyramids. Source: S. Caron, Q.-C. Pham, Y. Nakamura, *Stability of surface contacts for humanoid robots: closed-form formulae of
//! the contact wrench cone for rectangular support areas*, ICRA 2015. With `c = μ √2/2` the pyramids lie inside the friction cones of the corners.

use super::shape::{ContactModel, ContactState, MAX_FORCE};
use crate::model::{FrameId, Kinematics, Model, frame_bias_acceleration, frame_jacobian};
use nalgebra::Vector3;

/// Rectangle in the plane z = 0 of the link.
pub(super) struct Sole {
    /// Smallest and largest x, m.
    pub x: [f64; 2],
    /// Smallest and largest y, m.
    pub y: [f64; 2],
}

const NAMES: [&str; 17] = [
    "normal force",
    "friction t1+",
    "friction t1-",
    "friction t2+",
    "friction t2-",
    "centre of pressure y+",
    "centre of pressure y-",
    "centre of pressure x-",
    "centre of pressure x+",
    "yaw moment 1",
    "yaw moment 2",
    "yaw moment 3",
    "yaw moment 4",
    "yaw moment 5",
    "yaw moment 6",
    "yaw moment 7",
    "yaw moment 8",
];

impl ContactModel for Sole {
    fn size(&self) -> usize {
        6
    }

    /// The normal is that of the sole, not `n_W`.
    fn update(&self, model: &Model, kin: &Kinematics, frame: FrameId, _n_W: &Vector3<f64>, state: &mut ContactState) {
        frame_jacobian(model, kin, frame, &mut state.J);
        state.a_bias_W = frame_bias_acceleration(model, kin, frame);
        state.p_BC_W = kin.p_BF_W(model, frame);
        state.R_WC = kin.R_WF(model, frame);
    }

    fn friction_names(&self) -> &'static [&'static str] {
        &NAMES
    }

    fn friction(&self, state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE])) {
        let center = Vector3::new(0.5 * (self.x[0] + self.x[1]), 0.5 * (self.y[0] + self.y[1]), 0.0);
        let (X, Y) = (0.5 * (self.x[1] - self.x[0]), 0.5 * (self.y[1] - self.y[0]));
        let mut row = 0;
        // A row over force and moment about the centre, in the axes of the link: τ_center = τ - p x f, so a·τ_center = a·τ - (a x p)·f.
        let mut put = |force: [f64; 3], moment: [f64; 3]| {
            let (a_f, a_m) = (Vector3::from(force), Vector3::from(moment));
            let (f, m) = (state.R_WC * (a_f - a_m.cross(&center)), state.R_WC * a_m);
            give(row, &[f.x, f.y, f.z, m.x, m.y, m.z]);
            row += 1;
        };
        put([0.0, 0.0, -1.0], [0.0; 3]);
        for k in 0..2 {
            for sign in [1.0, -1.0] {
                let mut force = [0.0, 0.0, -c];
                force[k] = sign;
                put(force, [0.0; 3]);
            }
        }
        for (k, half) in [(0, Y), (1, X)] {
            for sign in [1.0, -1.0] {
                let mut moment = [0.0; 3];
                moment[k] = sign;
                put([0.0, 0.0, -half], moment);
            }
        }
        // ±τ_z + s1 (Y f_x ± c τ_x) + s2 (X f_y ± c τ_y) ≤ c (X + Y) f_z
        for side in [1.0, -1.0] {
            for s1 in [1.0, -1.0] {
                for s2 in [1.0, -1.0] {
                    put([s1 * Y, s2 * X, -c * (X + Y)], [s1 * side * c, s2 * side * c, side]);
                }
            }
        }
    }
}
