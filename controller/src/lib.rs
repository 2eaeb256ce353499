//! The controllers: rigid-body model, tasks, quadratic program, gait, estimators, and the step that ties them together.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]

pub mod model;
pub mod params;
