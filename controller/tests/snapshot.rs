//! A snapshot contains every field of the state, whatever values the fields have.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::hyq;
use controller::Controller;
use controller::math::Rng;
use lcmtypes::{Message, QuadrupedState};

/// Integers of `quadruped_state_t` that are a number of elements or name a value of an enumeration, with the largest valid number.
const LIMITED: [(&str, u64); 5] = [("gait_running", 1), ("gait", 1), ("mode", 5), ("move_phase", 6), ("leg_state", 4)];

/// Gives every field of an encoded state a random value, in place.
fn fill(bytes: &mut [u8], random: &mut Rng) {
    let mut leaves = Vec::new();
    let ty = lcmtypes::types().of_message(bytes).unwrap();
    ty.walk(bytes, |path, leaf| leaves.push((path.to_string(), size(&format!("{leaf:?}"))))).unwrap();
    let mut at = 8;
    for (path, size) in leaves {
        let name = path.split(['[', '.']).next().unwrap().to_owned();
        let number = random.next_u64();
        let limit = LIMITED.iter().find(|(limited, _)| *limited == name).map(|(_, last)| number % (last + 1));
        let value = match size {
            8 if ["t_ns", "tick"].contains(&&*name) => number >> 2,
            8 => (number as f64 / u64::MAX as f64 + 0.25).to_bits(),
            4 => number % 1000,
            _ => limit.unwrap_or(number % 2),
        };
        if name != "nj" {
            bytes[at..at + size].copy_from_slice(&value.to_be_bytes()[8 - size..]);
        }
        at += size;
    }
    assert_eq!(at, bytes.len());
}

/// Bytes of a number, from the name of its type.
fn size(leaf: &str) -> usize {
    match leaf.split('(').next().unwrap() {
        "Double" | "Int64" => 8,
        "Int32" => 4,
        "Int8" | "Boolean" => 1,
        other => panic!("{other}: a field of the state that this test does not know"),
    }
}

#[test]
fn every_field_is_read_from_a_snapshot_and_written_to_the_next() {
    let (mut controller, mut random) = (hyq(), Rng::from_state(11));
    let mut initial = Vec::new();
    controller.snapshot(&mut initial);
    for _ in 0..50 {
        let mut state = initial.clone();
        fill(&mut state, &mut random);
        controller.restore(&state).unwrap();
        // The buffer through which states go in and out still contains this state.
        controller.poison_workspace();
        let mut written = Vec::new();
        controller.snapshot(&mut written);
        let field = || {
            let ty = lcmtypes::types().by_fingerprint(QuadrupedState::FINGERPRINT).unwrap();
            ty.first_difference(&state, &written).unwrap().map(|difference| difference.path)
        };
        assert!(written == state, "{:?}", field());
    }
}
