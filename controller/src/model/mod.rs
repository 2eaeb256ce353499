//! Rigid-body model.
