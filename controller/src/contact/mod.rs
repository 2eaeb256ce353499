//! Contacts with the environment: kinematics and admissible forces of a point, a wheel, a sole and a hand.
//!
//! A [`Contact`] has 3 force variables, or 6 with moments for a sole. [`Contact::update`] writes its [`ContactState`] of a tick, which tasks and
//! constraints of every physical level read: at velocity level `J v = 0` keeps the contact at rest, at acceleration level `J vd = -a_bias`, and `Jᵀ F`
//! is the generalized force of the environment on the robot. [`ContactLoad`] is what a controller decides about a contact in a tick.
//!
//! A further kind of contact is one file with a [`ContactModel`] and one line in [`Contact::new`].

mod point;
mod shape;
mod sole;
mod wheel;

pub use shape::{ContactLoad, ContactModel, ContactState, MAX_FORCE, tangents};

use crate::model::description::ContactGeometry;
use crate::model::{FrameId, Kinematics, Model, ModelError, RobotDescription, frame_jacobian};
use nalgebra::{DMatrix, Matrix3, Vector3, Vector6};

/// Unit of the force variables, N or N m: `F = FORCE_UNIT f`. It gives forces and accelerations similar magnitudes.
pub const FORCE_UNIT: f64 = 100.0;

/// A contact of a robot.
pub struct Contact {
    /// Name.
    pub name: String,
    /// Link.
    pub frame: FrameId,
    /// Columns in which `J` may be non-zero, ascending.
    pub columns: Vec<usize>,
    shape: Box<dyn ContactModel>,
}

impl Contact {
    /// A contact of this shape at a link.
    ///
    /// - `geometry`: checked when a robot's description is read; the axis of a wheel is a unit vector.
    pub fn new(name: &str, model: &Model, frame: FrameId, geometry: &ContactGeometry) -> Self {
        let shape: Box<dyn ContactModel> = match *geometry {
            ContactGeometry::Point { radius } | ContactGeometry::Hand { radius } => Box::new(point::Point { radius }),
            ContactGeometry::Wheel { radius, axis } => Box::new(wheel::Wheel { radius, axis: axis.into() }),
            ContactGeometry::Sole { x, y } => Box::new(sole::Sole { x, y }),
        };
        Contact { name: name.to_owned(), frame, columns: columns(model, frame), shape }
    }

    /// The contacts of a robot, in the order of its description.
    ///
    /// # Errors
    /// A link that the model does not have, if it was made from another URDF.
    pub fn all(description: &RobotDescription, model: &Model) -> Result<Vec<Self>, ModelError> {
        let new = |contact: &robot_model::description::Contact| {
            Ok(Contact::new(&contact.name, model, model.frame(&contact.link)?, &contact.geometry))
        };
        description.contacts.iter().map(new).collect()
    }

    /// Number of force variables.
    pub fn size(&self) -> usize {
        self.shape.size()
    }

    /// Allocates its state, filled with NaN.
    pub fn state(&self, model: &Model) -> ContactState {
        let nan = f64::NAN;
        ContactState {
            J: DMatrix::from_element(self.size(), model.nv(), nan),
            a_bias_W: Vector6::from_element(nan),
            p_BC_W: Vector3::from_element(nan),
            R_WC: Matrix3::from_element(nan),
        }
    }

    /// Writes its state; see [`ContactModel::update`].
    pub fn update(&self, model: &Model, kin: &Kinematics, n_W: &Vector3<f64>, state: &mut ContactState) {
        self.shape.update(model, kin, self.frame, n_W, state);
    }

    /// See [`ContactModel::friction_names`].
    pub fn friction_names(&self) -> &'static [&'static str] {
        self.shape.friction_names()
    }

    /// See [`ContactModel::friction`].
    pub fn friction(&self, state: &ContactState, c: f64, give: &mut dyn FnMut(usize, &[f64; MAX_FORCE])) {
        self.shape.friction(state, c, give);
    }
}

/// Columns in which the Jacobian of a link may be non-zero, ascending: those of the base and of the joints between base and link.
pub fn columns(model: &Model, frame: FrameId) -> Vec<usize> {
    let (nv, nb) = (model.nv(), model.nv_base());
    let mut J = DMatrix::zeros(6, nv);
    // A joint's column is non-zero at any state: its angular part has norm 1 if it rotates, its linear part if it translates.
    frame_jacobian(model, &Kinematics::new(model), frame, &mut J);
    (0..nv).filter(|&col| col < nb || J.column(col).iter().any(|x| *x != 0.0)).collect()
}
