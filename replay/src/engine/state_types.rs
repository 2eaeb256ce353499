//! Types of the controller states in a CONTROLLER_SNAPSHOT: the fingerprint of the message does not cover them.

use crate::log::fingerprint;
use lcmtypes::{ComponentState, Message, SequenceState};

/// Fingerprint of the controller's state in a snapshot, then those of the states in a sequence; 0 for one that is too short to have one. `None`: the
/// snapshot, or a state in it whose type is known, does not decode.
pub(super) fn state_types(snapshot: &[u8]) -> Option<Vec<u64>> {
    let state = ComponentState::decode(snapshot).ok()?.controller.data;
    let mut types = vec![checked(&state)?];
    if types[0] == SequenceState::FINGERPRINT {
        for part in SequenceState::decode(&state).ok()?.parts {
            types.push(checked(&part.data)?);
        }
    }
    Some(types)
}

/// First difference between the types of two snapshots: found, expected; 0 for a state that one of them lacks.
pub(super) fn first_difference(found: &[u64], expected: &[u64]) -> Option<(u64, u64)> {
    let at = |types: &[u64], k: usize| types.get(k).copied().unwrap_or(0);
    let pairs = (0..found.len().max(expected.len())).map(|k| (at(found, k), at(expected, k)));
    pairs.into_iter().find(|(found, expected)| found != expected)
}

/// The fingerprint of a state; `None` if it has a type of this build and does not decode.
fn checked(state: &[u8]) -> Option<u64> {
    let decodes = lcmtypes::types().of_message(state).is_none_or(|ty| ty.walk(state, |_, _| ()).is_ok());
    decodes.then(|| fingerprint(state).unwrap_or(0))
}
