//! Contacts of a robot in MuJoCo: their points, and the forces on them.

use super::{ContactIndex, MujocoSim};
use nalgebra::Vector3;
use robot_model::ContactGeometry;
use robot_model::math::quaternion;

impl MujocoSim {
    /// Sums the contact forces on each foot, and their moments about its lowest point: `(p - p_WF) x f` of each point of contact. The moment on a
    /// point is 0 by definition: its sphere touches level ground at the lowest point. Valid between the computation of forces and the next collision pass.
    pub(super) fn read_contact_forces(&mut self) {
        self.f_F_W.fill([0.0; 3]);
        self.tau_F_W.fill([0.0; 3]);
        self.contact.fill(0);
        for (index, contact) in self.data.contact().iter().enumerate() {
            for (foot, index_of_foot) in self.contacts.iter().enumerate() {
                let geoms = [contact.geom1, contact.geom2];
                let Some(f_W) = force_on(index_of_foot.geom, geoms, &contact.frame, &self.data.contact_force(index))
                else {
                    continue;
                };
                if !index_of_foot.is_point() {
                    let p_FC_W = Vector3::from(contact.pos) - Vector3::from(self.lowest_point(index_of_foot));
                    let tau_W = p_FC_W.cross(&Vector3::from(f_W));
                    self.tau_F_W[foot].iter_mut().zip(tau_W.iter()).for_each(|(sum, part)| *sum += part);
                }
                self.f_F_W[foot].iter_mut().zip(f_W).for_each(|(sum, part)| *sum += part);
                self.contact[foot] |= i8::from(contact.exclude == 0);
            }
        }
    }

    /// Origin of a contact's link, in W, m.
    pub(super) fn p_WL(&self, contact: &ContactIndex) -> [f64; 3] {
        // The shape of a point, a wheel and a hand is at the origin of the link.
        if !matches!(contact.point.geometry, ContactGeometry::Sole { .. }) {
            return self.data.geom_xpos()[contact.geom];
        }
        let p_BL_W = quaternion::to_rotation(self.data.xquat()[contact.body]) * contact.X_BL.p;
        let p_WB = self.data.xpos()[contact.body];
        [p_WB[0] + p_BL_W.x, p_WB[1] + p_BL_W.y, p_WB[2] + p_BL_W.z]
    }

    /// The lowest point of a contact, below the origin of its link, in W, m.
    pub(super) fn lowest_point(&self, contact: &ContactIndex) -> [f64; 3] {
        let R_WL = quaternion::to_rotation(self.data.xquat()[contact.body]) * contact.X_BL.R;
        let [x, y, z] = self.p_WL(contact);
        [x, y, z - contact.point.depth(&R_WL)]
    }
}

impl ContactIndex {
    fn is_point(&self) -> bool {
        matches!(self.point.geometry, ContactGeometry::Point { .. })
    }
}

/// Force on a geom in a contact, in W, N; `None` if the geom is not part of the contact.
///
/// - `geoms`: the two geoms of the contact. Their order depends on the types of the shapes.
/// - `frame`: axes of the contact frame as rows; the first points from geom 1 to geom 2.
/// - `f`: MuJoCo's contact force, which acts on geom 2, in the contact frame.
pub(super) fn force_on(geom: usize, geoms: [i32; 2], frame: &[f64; 9], f: &[f64; 6]) -> Option<[f64; 3]> {
    let index = geoms.iter().position(|&other| usize::try_from(other) == Ok(geom))?;
    let sign = [-1.0, 1.0][index];
    Some(std::array::from_fn(|axis| sign * (f[0] * frame[axis] + f[1] * frame[3 + axis] + f[2] * frame[6 + axis])))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Foot: geom 7. Ground: geom 0. The ground pushes the foot up with 10 N and along +x with 2 N.
    #[test]
    fn the_force_on_a_foot_does_not_depend_on_the_order_of_the_geoms() {
        let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let frame = |normal: [f64; 3], t1: [f64; 3], t2: [f64; 3]| [normal, t1, t2].concat().try_into().unwrap();
        let ground_first = frame(up, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let f = [10.0, 2.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(force_on(7, [0, 7], &ground_first, &f), Some([2.0, 0.0, 10.0]));
        let foot_first = frame(down, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        let f = [10.0, 0.0, -2.0, 0.0, 0.0, 0.0];
        assert_eq!(force_on(7, [7, 0], &foot_first, &f), Some([2.0, 0.0, 10.0]));
        assert_eq!(force_on(6, [7, 0], &foot_first, &f), None);
    }
}
