//! The fault type.

use lcmtypes::ControllerTick;

/// The reason for the safe state: a code of `controller_tick_t`, the joint, leg or row that it concerns, and the value found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// FAULT_* of `controller_tick_t`.
    pub code: i32,
    /// Joint (URDF order), leg or row; -1 = none.
    pub index: i32,
    /// The value found, in the unit of the checked quantity.
    pub value: f64,
}

impl Default for Fault {
    fn default() -> Self {
        Fault { code: ControllerTick::FAULT_NONE, index: -1, value: 0.0 }
    }
}

/// Builds the result of a check that failed.
///
/// - `code`: FAULT_* of `controller_tick_t`.
/// - `index`: joint, leg or row.
/// - `value`: value found.
pub fn fault(code: i32, index: Option<usize>, value: f64) -> Option<Fault> {
    let index = index.map_or(-1, |i| i32::try_from(i).unwrap_or(i32::MAX));
    Some(Fault { code, index, value })
}
