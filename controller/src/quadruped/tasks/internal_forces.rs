//! Task `internal_forces`: the contact forces do not press the feet against each other.
//!
//! ```text
//! P F = 0,   P = 1 - G⁺ G          G F: net force and moment of the contact forces, 6
//! ```
//! `P` projects onto the forces without net force and moment. It is computed from an orthonormal basis of the rows of `G`, which depends neither on
//! the point about which moments are taken nor on their unit. Source: Raiola et al. 2020, section 2.2, a task of last priority that minimizes internal
//! forces.
//!
//! Twelve rows, x y z of LF RF LH RH, N; 3 n - 6 of them are independent for n = 3 or 4 feet that carry load, 1 for two feet, 0 for one.

use super::forces::{FORCE_UNIT, force_column};
use super::task::{Task, TaskInput};
use crate::quadruped::foot_load::carries;
use crate::quadruped::leg::Leg;
use crate::quadruped::robot::Robot;
use crate::stack::{Basis, Rows};
use nalgebra::Vector3;

struct InternalForces {
    /// Rows of `G`, orthonormal.
    net: Basis,
}

/// Builds the task.
pub fn new(robot: &Robot) -> (Rows, Box<dyn Task>) {
    let nv = robot.model.nv();
    (Rows::new(nv + 12, [(12, (nv..nv + 12).collect())]), Box::new(InternalForces { net: Basis::new(12, 6) }))
}

/// Writes an orthonormal basis of the rows of `G`, over the forces x y z of LF RF LH RH in W.
///
/// - `net`: 12 numbers, 6 rows.
/// - `feet`: contact points in W axes from any point, m; `None` for a foot that carries no load.
pub fn net_wrench(net: &mut Basis, feet: &[Option<Vector3<f64>>; 4]) {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for p in feet.iter().flatten() {
        sum += p;
        count += 1.0;
    }
    // The centre of the feet: moments about a far point would hide the forces in rounding errors.
    let center = if count > 0.0 { sum / count } else { sum };
    net.clear();
    for row in 0..6 {
        net.push(|i| {
            let (leg, k) = (i / 3, i % 3);
            match &feet[leg] {
                None => 0.0,
                Some(_) if row < 3 => f64::from(u8::from(k == row)),
                // Moment about the axis `row - 3` of a unit force along the axis `k`.
                Some(p) => (p - center).cross(&Vector3::ith(k, 1.0))[row - 3],
            }
        });
    }
}

impl Task for InternalForces {
    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows) {
        let nv = input.robot.model.nv();
        let feet = Leg::ALL.map(|leg| carries(input.state, leg).then_some(input.estimate.legs[leg].p_BF_W));
        let pressed = feet.iter().flatten().count() > 1;
        rows.switch(0, pressed);
        if !pressed {
            return;
        }
        net_wrench(&mut self.net, &feet);
        for i in 0..12 {
            for leg in Leg::ALL {
                for k in 0..3 {
                    let j = 3 * leg as usize + k;
                    let both = feet[i / 3].is_some() && feet[leg as usize].is_some();
                    let own = if i == j { 1.0 } else { 0.0 };
                    let projected = (0..6).fold(own, |sum, q| sum - self.net.at(q, i) * self.net.at(q, j));
                    rows.A[(i, force_column(nv, leg, k))] = if both { projected * FORCE_UNIT } else { 0.0 };
                }
            }
        }
    }
}
