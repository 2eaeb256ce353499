//! Links of the robot do not touch each other: the nearest pairs approach at most at a velocity that decreases with their distance.
//!
//! ```text
//! n · (v_1 - v_2) ≤ k (δ - δ_min)          one row for each pair with δ < δ_on
//! ```
//! `δ`: distance of two capsules; `n`: unit vector from the point of the first that is nearest to the second, to the latter; `v_1`, `v_2`: velocities of these two points.
//! Since `p_2 - p_1` is parallel to `n`, joints that move both links have no entry. A pair nearer than `δ_min` separates. With the equality in every step the distance
//! decays to `δ_min` without crossing it, if `k dt < 1`.
//!
//! Capsules contain the shapes of the links ([`crate::model::Capsule::around`]), so they are larger: pairs nearer than `δ_min` in the nominal posture are left out,
//! since the posture would be forbidden. So are links of one body or of neighbouring bodies, and pairs that the caller disables. The number of rows is constant;
//! the nearest pairs come first, of equal ones the first in the list of pairs.
//!
//! Source: B. Faverjon, P. Tournassoud, *A local based approach for path planning of manipulators with a high number of degrees of freedom* (1987), the velocity damper.

use crate::math::norm;
use crate::model::{Capsule, FrameId, Kinematics, Model, closest_points, for_each_relative_column, joints_between};
use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use nalgebra::Vector3;

/// Distance of the axes of two capsules below which their direction is undefined: such a pair has no row, m.
const CROSSING: f64 = 1e-9;

/// Parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfCollisionParams {
    /// Smallest distance `δ_min`, m.
    pub margin: f64,
    /// Gain k, 1/s.
    pub gain: f64,
    /// Distance `δ_on` below which a pair has a row, m.
    pub threshold: f64,
    /// Largest number of pairs with a row.
    pub rows: usize,
}

/// Two links and their distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPair {
    /// The links.
    pub links: [FrameId; 2],
    /// Distance of their capsules, m; negative if they overlap.
    pub distance: f64,
    /// Nearest point of the first capsule's axis, from the origin of B in W axes, m.
    p: Vector3<f64>,
    /// Direction to the second capsule, in W axes.
    n: Vector3<f64>,
}

/// The constraint.
pub struct SelfCollision {
    params: SelfCollisionParams,
    capsules: Vec<(FrameId, Capsule)>,
    /// Indices of the capsules of each pair.
    pairs: Vec<[usize; 2]>,
    touching: Vec<[FrameId; 2]>,
    /// Columns of the joints that move any pair.
    columns: Vec<usize>,
    /// Capsules from the origin of B, in W axes.
    placed: Vec<Capsule>,
    nearest: Vec<NearPair>,
}

impl SelfCollision {
    /// - `capsules`: of [`crate::model::capsules`].
    /// - `nominal`: kinematics in the nominal posture.
    /// - `disabled`: pairs of links that are not compared, in any order.
    pub fn new(
        of: &Structure<'_>,
        capsules: Vec<(FrameId, Capsule)>,
        nominal: &Kinematics,
        disabled: &[[FrameId; 2]],
        params: SelfCollisionParams,
    ) -> Self {
        let placed = capsules.iter().map(|(_, capsule)| *capsule).collect();
        let (pairs, touching, columns, nearest) = (Vec::new(), Vec::new(), Vec::new(), Vec::with_capacity(params.rows));
        let mut own = SelfCollision { params, capsules, pairs, touching, columns, placed, nearest };
        own.place(of.model, nominal);
        let mut moves = vec![false; of.model.nv()];
        for second in 0..own.capsules.len() {
            for first in 0..second {
                let links = [first, second].map(|i| own.capsules[i].0);
                let joints = joints_between(of.model, links[0], Some(links[1]));
                let is_disabled = disabled.iter().any(|pair| *pair == links || *pair == [links[1], links[0]]);
                if joints[0].len() + joints[1].len() < 2 || is_disabled {
                    continue;
                }
                let between = between(&own.placed[first], &own.placed[second]);
                if between.is_none_or(|(distance, ..)| distance < params.margin) {
                    own.touching.push(links);
                    continue;
                }
                own.pairs.push([first, second]);
                joints.iter().flatten().for_each(|&col| moves[col] = true);
            }
        }
        own.columns = (0..moves.len()).filter(|&col| moves[col]).collect();
        own
    }

    /// Number of pairs of capsules that are compared.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Pairs that are left out because they are nearer than the margin in the nominal posture; a pair of links with several shapes can occur more than once.
    pub fn touching(&self) -> &[[FrameId; 2]] {
        &self.touching
    }

    /// The pairs of the last update that have a row, the nearest first.
    pub fn nearest(&self) -> &[NearPair] {
        &self.nearest
    }

    fn place(&mut self, model: &Model, kin: &Kinematics) {
        for ((frame, capsule), placed) in self.capsules.iter().zip(&mut self.placed) {
            let (p, R) = (kin.p_BF_W(model, *frame), kin.R_WF(model, *frame));
            placed.ends = capsule.ends.map(|end| p + R * end);
        }
    }

    /// Collects the nearest pairs below the threshold.
    fn search(&mut self) {
        let SelfCollision { params, capsules, pairs, placed, nearest, .. } = self;
        nearest.clear();
        for &[first, second] in pairs.iter() {
            let (a, b) = (&placed[first], &placed[second]);
            let limit = if nearest.len() < params.rows {
                params.threshold
            } else {
                nearest.last().map_or(f64::NEG_INFINITY, |last| last.distance)
            };
            if at_least(a, b) >= limit {
                continue;
            }
            let Some((distance, p, n)) = between(a, b) else { continue };
            if distance < limit {
                if nearest.len() == params.rows {
                    nearest.pop();
                }
                let at = nearest.iter().position(|near| distance < near.distance).unwrap_or(nearest.len());
                nearest.insert(at, NearPair { links: [capsules[first].0, capsules[second].0], distance, p, n });
            }
        }
    }
}

/// A lower bound of the distance of two capsules: the distance of the spheres around them.
fn at_least(a: &Capsule, b: &Capsule) -> f64 {
    let half = |capsule: &Capsule| norm(&(capsule.ends[1] - capsule.ends[0])) * 0.5 + capsule.radius;
    norm(&(a.ends[0] + a.ends[1] - b.ends[0] - b.ends[1])) * 0.5 - half(a) - half(b)
}

/// Distance of two capsules, the nearest point of the axis of `a`, and the direction to `b`; `None` if the axes touch.
fn between(a: &Capsule, b: &Capsule) -> Option<(f64, Vector3<f64>, Vector3<f64>)> {
    let [p, q] = closest_points(&a.ends, &b.ends);
    let distance = norm(&(q - p));
    (distance > CROSSING).then(|| (distance - a.radius - b.radius, p, (q - p) / distance))
}

impl Constraint for SelfCollision {
    fn size(&self) -> Size {
        Size { equalities: 0, inequalities: self.params.rows }
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        for &col in &self.columns {
            rows.qp.C.view_mut((rows.inequality, col), (self.params.rows, 1)).fill(1.0);
        }
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        self.place(state.model, state.kin);
        self.search();
        let (qp, first) = (&mut *rows.qp, rows.inequality);
        for &col in &self.columns {
            qp.C.view_mut((first, col), (self.params.rows, 1)).fill(0.0);
        }
        qp.d.rows_mut(first, self.params.rows).fill(1.0);
        for (row, near) in self.nearest.iter().enumerate() {
            let chain = (near.links[0], Some(near.links[1]));
            for_each_relative_column(state.model, state.kin, chain, &near.p, |col, linear, _| {
                qp.C[(first + row, col)] = near.n.dot(&linear);
            });
            qp.d[first + row] = self.params.gain * (near.distance - self.params.margin);
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        [Vec::new(), (0..self.params.rows).map(|row| format!("self-collision {row}")).collect()]
    }
}
