//! The contact forces do not press the contacts against each other.
//!
//! ```text
//! P F = 0,   P = 1 - G⁺ G          G F: net force and moment of the contact forces, 6
//! ```
//! `P` projects onto the forces without net force and moment. It is computed from an orthonormal basis of the rows of `G`. For contacts without moments it
//! depends neither on the point about which moments are taken nor on their unit. Source: Raiola et al. 2020, section 2.2, a task of last priority
//! that minimizes internal forces.

use crate::contact::{ContactState, FORCE_UNIT};
use crate::stack::{Basis, ModelState, Rows, Structure, Task};
use nalgebra::Vector3;
use std::ops::Range;

/// The task. One row for each force variable, N and N m. For points, 3 n - 6 of them are independent for n ≥ 3 contacts that carry load, 1 for two contacts,
/// 0 for one.
pub struct InternalForces {
    forces: Range<usize>,
    sizes: Vec<usize>,
    points: Vec<Option<Vector3<f64>>>,
    /// Contact of each force variable.
    owner: Vec<usize>,
    /// Rows of `G`, orthonormal.
    net: Basis,
}

impl InternalForces {
    /// For all contacts.
    pub fn new(of: &Structure<'_>) -> Self {
        let forces = of.variables.forces();
        let sizes: Vec<usize> = of.contacts.iter().map(crate::contact::Contact::size).collect();
        let owner = sizes.iter().enumerate().flat_map(|(i, size)| std::iter::repeat_n(i, *size)).collect();
        let net = Basis::new(forces.len(), 6);
        InternalForces { points: vec![None; sizes.len()], forces, sizes, owner, net }
    }
}

/// Writes an orthonormal basis of the rows of `G`, over the force variables of the contacts in W.
///
/// - `net`: as many numbers as force variables, 6 rows.
/// - `sizes`: number of force variables of each contact.
/// - `points`: contact points in W axes from any point, m; `None` for a contact that carries no load.
pub fn net_wrench(net: &mut Basis, sizes: &[usize], points: &[Option<Vector3<f64>>]) {
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for p in points.iter().flatten() {
        sum += p;
        count += 1.0;
    }
    // The centre of the contacts: moments about a far point would hide the forces in rounding errors.
    let center = if count > 0.0 { sum / count } else { sum };
    net.clear();
    for row in 0..6 {
        net.push(|i| {
            let (mut contact, mut k) = (0, i);
            while k >= sizes[contact] {
                k -= sizes[contact];
                contact += 1;
            }
            match &points[contact] {
                None => 0.0,
                Some(_) if row < 3 => f64::from(u8::from(k == row)),
                Some(p) => ContactState::moment(&(p - center), k, row - 3),
            }
        });
    }
}

impl Task for InternalForces {
    type Reference = ();

    fn size(&self) -> usize {
        self.forces.len()
    }

    fn rows(&self) -> Rows {
        Rows::new(self.forces.end, [(self.forces.len(), self.forces.clone().collect())])
    }

    fn update(&mut self, state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        for (point, (at, load)) in self.points.iter_mut().zip(state.at.iter().zip(state.loads)) {
            *point = load.active.then_some(at.p_BC_W);
        }
        let pressed = self.points.iter().flatten().count() > 1;
        rows.switch(0, pressed);
        if !pressed {
            return;
        }
        net_wrench(&mut self.net, &self.sizes, &self.points);
        for i in 0..self.owner.len() {
            for j in 0..self.owner.len() {
                let both = self.points[self.owner[i]].is_some() && self.points[self.owner[j]].is_some();
                let own = if i == j { 1.0 } else { 0.0 };
                let projected = (0..6).fold(own, |sum, q| sum - self.net.at(q, i) * self.net.at(q, j));
                rows.A[(i, self.forces.start + j)] = if both { projected * FORCE_UNIT } else { 0.0 };
            }
        }
    }
}
