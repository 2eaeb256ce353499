//! Joints of a chain move towards a posture with more manipulability, up the gradient of
//!
//! ```text
//! m(q) = √det(J Jᵀ)          ∂m/∂q_k = m Σ_i K_i · ∂J_i/∂q_k,    K = (J Jᵀ)⁻¹ J
//! ```
//! `J`: Jacobian of the link relative to the base link of the chain, its column i with linear part `l_i` and angular part `w_i`. With the joints counted from the base
//! link, the columns of the geometric Jacobian change by
//!
//! ```text
//! ∂J_i/∂q_k = [ w_k × l_i ; w_k × w_i ]  for k ≤ i,        [ w_i × l_k ; 0 ]  for k > i
//! ```
//! since a joint turns everything after it and moves the end point alone for the joints before it. The floating base is not part of the chain.
//!
//! Source: T. Yoshikawa, *Manipulability of robotic mechanisms* (1985), for m; H. Bruyninckx, J. De Schutter, *Symbolic differentiation of the velocity mapping for a
//! serial kinematic chain* (1996), for the derivative.

use crate::model::{FrameId, Kinematics, Model, for_each_relative_column, joints_between};
use crate::stack::{ModelState, Rows, StackError, Structure, Task};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Ratio of the smallest to the largest pivot of the Cholesky factor of `J Jᵀ` below which the posture is singular: the gradient is not defined there, and is 0.
const SINGULAR: f64 = 1e-6;

/// Rows of the Jacobian that the manipulability counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Linear velocity, 3.
    Position,
    /// Linear and angular velocity, 6; m and rad have the same weight.
    Pose,
}

/// The task: one row for each joint of the chain from the base link to the link, rad/s or m/s.
pub struct Manipulability {
    /// Gain k; of a chain of rotations, rad²/(s mⁿ) with n = 3.
    pub gain: f64,
    link: FrameId,
    base_link: FrameId,
    motion: Motion,
    nv: usize,
    /// Velocity indices, counted from the base link.
    columns: Vec<usize>,
    /// Place in `columns` of each velocity index.
    place: Vec<usize>,
    /// Linear and angular part of each column.
    J: Vec<[Vector3<f64>; 2]>,
    gradient: Vec<f64>,
}

impl Manipulability {
    /// - `name`: name of the task, used in errors.
    /// - `base_link`: base link of the chain; `None` for the root link.
    ///
    /// # Errors
    /// Fewer joints between the two links than rows of the Jacobian: the manipulability is 0 in every posture.
    pub fn new(
        name: &str,
        of: &Structure<'_>,
        (link, base_link): (FrameId, Option<FrameId>),
        motion: Motion,
        gain: f64,
    ) -> Result<Self, StackError> {
        let base_link = base_link.unwrap_or(of.model.base_frame());
        let [to_link, mut columns] = joints_between(of.model, link, Some(base_link));
        columns.extend(to_link.iter().rev());
        let (found, needed) = (columns.len(), if motion == Motion::Pose { 6 } else { 3 });
        if found < needed {
            let link = of.model.frames().nth(link.index()).map_or(String::new(), |(_, name)| name.to_owned());
            return Err(StackError::ShortChain { task: name.to_owned(), link, found, needed });
        }
        let mut place = vec![usize::MAX; of.model.nv()];
        columns.iter().enumerate().for_each(|(i, &col)| place[col] = i);
        let nan = Vector3::from_element(f64::NAN);
        let (J, gradient) = (vec![[nan; 2]; found], vec![f64::NAN; found]);
        Ok(Manipulability { gain, link, base_link, motion, nv: of.model.nv(), columns, place, J, gradient })
    }

    /// The manipulability m, and its gradient by the joints of the chain in the order of the rows.
    pub fn evaluate(&mut self, model: &Model, kin: &Kinematics) -> (f64, &[f64]) {
        let Manipulability { J, place, gradient, .. } = self;
        let (chain, p) = ((self.link, Some(self.base_link)), kin.p_BF_W(model, self.link));
        let with_turns = self.motion == Motion::Pose;
        for_each_relative_column(model, kin, chain, &p, |col, linear, angular| J[place[col]] = [linear, angular]);
        let stacked = |[l, w]: &[Vector3<f64>; 2]| {
            let w = if with_turns { *w } else { Vector3::zeros() };
            Vector6::new(l.x, l.y, l.z, w.x, w.y, w.z)
        };
        // Without angular rows, a unit block in their place leaves the determinant as it is.
        let mut JJ = if with_turns { Matrix6::zeros() } else { Matrix6::identity() };
        JJ.fixed_view_mut::<3, 3>(0, 0).fill(0.0);
        for column in J.iter().map(stacked) {
            JJ += column * column.transpose();
        }
        gradient.fill(0.0);
        let Some(factor) = JJ.cholesky() else { return (0.0, gradient) };
        let pivots = factor.l_dirty().diagonal();
        let m = pivots.iter().fold(1.0, |product, pivot| product * pivot);
        if pivots.min() <= SINGULAR * pivots.max() {
            return (m, gradient);
        }
        for (i, column) in J.iter().enumerate() {
            let K = factor.solve(&stacked(column));
            let (K_l, K_w): (Vector3<f64>, Vector3<f64>) = (K.fixed_rows::<3>(0).into(), K.fixed_rows::<3>(3).into());
            let [l_i, w_i] = column;
            for (k, [l_k, w_k]) in J.iter().enumerate() {
                gradient[k] += m * if k <= i {
                    K_l.dot(&w_k.cross(l_i)) + K_w.dot(&w_k.cross(w_i))
                } else {
                    K_l.dot(&w_i.cross(l_k))
                };
            }
        }
        (m, gradient)
    }
}

impl Task for Manipulability {
    type Reference = ();

    fn size(&self) -> usize {
        self.columns.len()
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, self.columns.iter().copied())
    }

    fn update(&mut self, state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        let gain = self.gain;
        let (_, gradient) = self.evaluate(state.model, state.kin);
        for (b, slope) in rows.b.iter_mut().zip(gradient) {
            *b = gain * slope;
        }
    }
}
