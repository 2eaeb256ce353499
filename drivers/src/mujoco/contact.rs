//! Contact forces of MuJoCo as forces on a foot.

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
