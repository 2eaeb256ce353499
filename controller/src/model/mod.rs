//! Rigid-body model of a tree of fixed, revolute, continuous and prismatic joints, with a floating or a fixed base.
//!
//! [`UrdfTree`] is what a URDF says, checked and in topological order. [`Model`] is what the equations need: links that do
//! not move against each other are merged into one *body*, bodies lie in one array with parents before children, and a
//! joint's kind is data. [`Kinematics`] holds everything that depends on the state; it is allocated once and updated in
//! place, and every quantity below is a function of `(&Model, &Kinematics)`, so nothing can be "not computed yet".
//!
//! ```text
//! v = [v_WB; w_WB_W; qd]          base parts in W axes, linear first; a fixed base leaves qd alone
//! M(q) vd + h(q, v) = Sᵀ tau + Jᵀ F
//! ```
//!
//! All of it is computed in one frame: W axes at the origin of the base. Spatial inertias and wrenches of different bodies then
//! add without transformation, the base rows of `M` and `h` fall out as they stand, and nothing depends on `p_WB` or `v_WB`
//! by construction, not up to rounding: the equations never see them.
//!
//! Order of joints: the order in which the movable joints stand in the text of the URDF file, whatever the shape of the tree.
//! Every movable joint is actuated. A continuous joint is stored as its angle, not wrapped.
//!
//! No message type, bus, file, clock or hash map in here; `+ - * / sqrt` and `libm` only, sums in index order.
//! Source of the algorithms: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 5 and 6.

mod bodies;
mod centroidal;
mod dynamics;
mod error;
pub mod eval;
mod inertia;
mod jacobian;
mod kinematics;
mod locate;
mod pose;
mod topology;
mod tree;

pub use bodies::{Base, FrameId, GRAVITY, JointId, JointInfo, Model};
pub use centroidal::{
    centroidal_momentum, centroidal_momentum_matrix, com, com_bias_acceleration, com_jacobian, com_velocity,
};
pub use dynamics::{RneaScratch, bias_force, gravity_force, mass_matrix, rnea};
pub use error::{ModelError, ModelWarning};
pub use jacobian::{
    frame_bias_acceleration, frame_jacobian, point_bias_acceleration, point_jacobian, point_jacobian_linear,
};
pub use kinematics::{BaseState, Kinematics};
pub use pose::Pose;
pub use tree::{Inertial, Joint, JointKind, Limits, Link, Shape, ShapeKind, UrdfTree};
