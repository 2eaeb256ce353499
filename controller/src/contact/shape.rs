//! What a kind of contact provides, and what it writes in a tick.

use crate::model::{FrameId, Kinematics, Model};
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};

/// Largest number of force variables of a contact.
pub const MAX_FORCE: usize = 6;

/// Kinematics and admissible forces of a kind of contact.
pub trait ContactModel: Send + Sync {
    /// Number of force variables: 3, or 6 with the moment.
    fn size(&self) -> usize;

    /// Writes the state of a contact at `frame`.
    ///
    /// - `n_W`: unit normal of the touched surface, towards the robot, in W.
    fn update(&self, model: &Model, kin: &Kinematics, frame: FrameId, n_W: &Vector3<f64>, state: &mut ContactState);

    /// Names of the rows of [`ContactModel::friction`], in their order.
    fn friction_names(&self) -> &'static [&'static str];

    /// Calls `give(row, a)` for every row of the admissible forces, `a·F ≤ 0` with `F` in W axes. Row 0 is `-n·F`, so that a controller can require a
    /// normal force by its right side.
    ///
    /// - `c`: largest tangential force along each tangent, relative to the normal force.
    fn friction(&self, state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE]));
}

/// A contact in a tick. [`Contact::update`](super::Contact::update) overwrites all of it.
#[derive(Clone, Debug)]
pub struct ContactState {
    /// Velocity of the contact, `J v`, size x nv: of the material point at the contact, in W axes, m/s; for a sole also the angular velocity, rad/s.
    pub J: DMatrix<f64>,
    /// Rate of `J v` at `vd = 0`, m/s² and rad/s²; the first `size` numbers are used. The material point changes while a sphere or a wheel rolls.
    pub a_bias_W: Vector6<f64>,
    /// Contact point from the origin of B, in W axes, m.
    pub p_BC_W: Vector3<f64>,
    /// Axes of the contact in W: two tangents and the normal.
    pub R_WC: Matrix3<f64>,
}

/// What a controller decides about a contact in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactLoad {
    /// Whether the contact can carry a force.
    pub active: bool,
    /// Least normal force, N.
    pub least_normal: f64,
    /// Lower bounds of the force variables in W axes, N and N m.
    pub lower: [f64; MAX_FORCE],
    /// Upper bounds, N and N m.
    pub upper: [f64; MAX_FORCE],
}

impl ContactLoad {
    /// A contact without force.
    pub const NONE: ContactLoad =
        ContactLoad { active: false, least_normal: 0.0, lower: [0.0; MAX_FORCE], upper: [0.0; MAX_FORCE] };

    /// A contact with any admissible force.
    pub const FREE: ContactLoad = ContactLoad {
        active: true,
        least_normal: 0.0,
        lower: [f64::NEG_INFINITY; MAX_FORCE],
        upper: [f64::INFINITY; MAX_FORCE],
    };
}

impl ContactState {
    /// Linear part of the bias acceleration, m/s².
    pub fn linear_bias(&self) -> Vector3<f64> {
        self.a_bias_W.fixed_rows::<3>(0).into_owned()
    }

    /// Moment about the axis `k` of W, through a point, of a unit of the force variable `i`.
    ///
    /// - `p_PC_W`: contact point from that point, in W axes, m.
    pub fn moment(p_PC_W: &Vector3<f64>, i: usize, k: usize) -> f64 {
        if i < 3 { p_PC_W.cross(&Vector3::ith(i, 1.0))[k] } else { f64::from(u8::from(i - 3 == k)) }
    }
}

/// Two orthogonal unit tangents of a surface with this normal; the first has no y component in W unless the normal is along y.
pub fn tangents(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let mut across = Vector3::y().cross(normal);
    if across.norm() < 1e-6 {
        across = normal.cross(&Vector3::z());
    }
    let t1 = across.normalize();
    [t1, normal.cross(&t1)]
}
