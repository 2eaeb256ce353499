//! Rigid-body model of a tree of fixed, revolute, continuous and prismatic joints, with a floating or a fixed base.
//!
//! [`UrdfTree`] is the content of a URDF, checked and in topological order. [`Model`] is what the equations need: links that are fixed
//! to each other are merged into one *body*, the bodies are one array with parents before children, and the kind of a joint is
//! data. [`Kinematics`] holds everything that depends on the state. It is allocated once and updated in place. Every
//! quantity below is a function of `(&Model, &Kinematics)`, so no quantity can be used before it is computed.
//!
//! ```text
//! v = [v_WB; w_WB_W; qd]          base part in W axes, linear first; v = qd for a fixed base
//! M(q) vd + h(q, v) = Sᵀ tau + Jᵀ F
//! ```
//!
//! All computations use one frame: W axes, origin of the base. Spatial inertias and wrenches of different bodies are then
//! added without transformation, and the base rows of `M` and `h` need no transformation either. `p_WB` and `v_WB` do not enter the
//! equations, so the results do not depend on them, not even by rounding.
//!
//! Order of joints: the order of the movable joints in the text of the URDF file, whatever the shape of the tree.
//! Every movable joint is actuated. The position of a continuous joint is its angle, not wrapped.
//!
//! This crate uses no message type, bus, file, clock or hash map; only `+ - * / sqrt` and `libm`; sums run in index order.
//! Source of the algorithms: R. Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 5 and 6.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]

mod bodies;
mod capsule;
mod centroidal;
pub mod description;
mod drive;
mod dynamics;
mod error;
pub mod eval;
mod fields;
mod inertia;
mod jacobian;
mod kinematics;
mod link_groups;
pub mod math;
mod names;
mod parse;
mod pose;
mod read;
mod relative;
mod runnable;
mod shapes;
pub mod srdf;
mod topology;
mod tree;
mod write;
mod xml;

pub use bodies::{Base, FrameId, GRAVITY, JointId, JointInfo, Model, impossible_moments};
pub use capsule::{Capsule, capsules, closest_points};
pub use centroidal::{
    centroidal_momentum, centroidal_momentum_matrix, com, com_bias_acceleration, com_jacobian, com_velocity, p_BC_W,
};
pub use description::{
    Contact, ContactGeometry, DescriptionError, JointDescription, JointRole, NOMINAL, RobotDescription,
};
pub use drive::DriveLimits;
pub use dynamics::{RneaScratch, bias_force, gravity_derivative, gravity_force, mass_matrix, rnea};
pub use error::{ModelError, ModelWarning};
pub use jacobian::{
    frame_bias_acceleration, frame_jacobian, point_bias_acceleration, point_jacobian, point_jacobian_linear,
};
pub use kinematics::{BaseState, Kinematics};
pub use link_groups::LinkGroups;
pub use names::{near_list, near_names};
pub use pose::Pose;
pub use relative::{for_each_relative_column, joints_between};
pub use runnable::check_runnable;
pub use shapes::{AddedShape, Bounds, bounds_of, untouchable, with_shapes};
pub use tree::{Inertial, Joint, JointKind, Limits, Link, Shape, ShapeKind, UrdfTree};
pub use write::xml_escaped;
