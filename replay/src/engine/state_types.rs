//! Types of the controller states in a CONTROLLER_SNAPSHOT: the fingerprint of the message does not cover them.

use crate::log::fingerprint;
use lcmtypes::{ComponentState, Message, SequenceState, SharedState};

/// Fingerprint of the controller's state in a snapshot, then those of the states in it, of a component that shares the joints and of a sequence; 0 for one
/// that is too short to have one. `None`: the snapshot, or a state in it whose type is known, does not decode.
pub(super) fn state_types(snapshot: &[u8]) -> Option<Vec<u64>> {
    let mut state = ComponentState::decode(snapshot).ok()?.controller.data;
    let mut types = vec![checked(&state)?];
    if types.ends_with(&[SharedState::FINGERPRINT]) {
        state = SharedState::decode(&state).ok()?.own.data;
        types.push(checked(&state)?);
    }
    if types.ends_with(&[SequenceState::FINGERPRINT]) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::{ControllerState, HoldState, PostureState};

    fn bytes(message: &impl Message) -> Vec<u8> {
        let mut bytes = Vec::new();
        message.encode(&mut bytes).unwrap();
        bytes
    }

    fn of(data: Vec<u8>) -> ControllerState {
        ControllerState { size: data.len().try_into().unwrap(), data }
    }

    fn snapshot(state: Vec<u8>) -> Vec<u8> {
        bytes(&ComponentState { controller: of(state), ..ComponentState::default() })
    }

    fn shared(own: Vec<u8>) -> Vec<u8> {
        bytes(&SharedState { own: of(own), ..SharedState::default() })
    }

    #[test]
    fn the_states_in_other_states_are_found_in_their_order() {
        let (hold, posture) = (bytes(&HoldState::default()), bytes(&PostureState::default()));
        let parts = vec![of(hold.clone()), of(posture.clone()), of(vec![1])];
        let sequence = bytes(&SequenceState { num_parts: 3, parts, ..SequenceState::default() });
        let (h, p) = (HoldState::FINGERPRINT, PostureState::FINGERPRINT);
        let (of_shared, of_sequence) = (SharedState::FINGERPRINT, SequenceState::FINGERPRINT);
        assert_eq!(state_types(&snapshot(hold.clone())), Some(vec![h]));
        assert_eq!(state_types(&snapshot(shared(hold.clone()))), Some(vec![of_shared, h]));
        assert_eq!(state_types(&snapshot(sequence.clone())), Some(vec![of_sequence, h, p, 0]));
        assert_eq!(state_types(&snapshot(shared(sequence))), Some(vec![of_shared, of_sequence, h, p, 0]));
        assert_eq!(first_difference(&[of_shared, p], &[of_shared, h]), Some((p, h)));
        // A state of a known type that is cut.
        assert_eq!(state_types(&snapshot(shared(hold[..hold.len() - 1].to_vec()))), None);
    }
}
