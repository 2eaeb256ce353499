//! The four legs and the phases of a leg.

use std::ops::{Index, IndexMut};

/// A leg, in the order of all arrays and messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leg {
    /// Left front.
    LF,
    /// Right front.
    RF,
    /// Left hind.
    LH,
    /// Right hind.
    RH,
}

impl Leg {
    /// All legs, in order.
    pub const ALL: [Leg; 4] = [Leg::LF, Leg::RF, Leg::LH, Leg::RH];

    /// The diagonally opposite leg: RH for LF, LH for RF, and vice versa.
    pub fn opposite(self) -> Leg {
        Leg::ALL[3 - self as usize]
    }

    /// Name in figures and errors.
    pub fn name(self) -> &'static str {
        lcmtypes::enum_names::LEGS[self as usize]
    }
}

/// One value for each leg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerLeg<T>(pub [T; 4]);

impl<T> PerLeg<T> {
    /// Iterates over the legs and their values, in order.
    pub fn iter(&self) -> impl Iterator<Item = (Leg, &T)> {
        Leg::ALL.into_iter().zip(&self.0)
    }
}

impl<T> Index<Leg> for PerLeg<T> {
    type Output = T;
    fn index(&self, leg: Leg) -> &T {
        &self.0[leg as usize]
    }
}

impl<T> IndexMut<Leg> for PerLeg<T> {
    fn index_mut(&mut self, leg: Leg) -> &mut T {
        &mut self.0[leg as usize]
    }
}

/// Phase of a leg. Source: Raiola et al. 2020, section 4.3. The transitions are in [`super::gait`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LegPhase {
    /// On the ground: the contact task is active, with the force bounds of stance.
    #[default]
    Stance,
    /// First half of the swing. Contact is ignored, because it may be that of the lift-off.
    SwingUp,
    /// Second half of the swing. A contact is a touchdown.
    SwingDown,
    /// The swing time is over without contact: the foot continues downward.
    Reach,
    /// The reach found no ground: the gait stops, and the foot is held in place.
    FaultHold,
}

impl LegPhase {
    /// All phases, by their number in `leg_state_t`.
    pub const ALL: [LegPhase; 5] =
        [LegPhase::Stance, LegPhase::SwingUp, LegPhase::SwingDown, LegPhase::Reach, LegPhase::FaultHold];

    /// Name, as in dumps.
    pub fn name(self) -> &'static str {
        ["Stance", "SwingUp", "SwingDown", "Reach", "FaultHold"][self as usize]
    }

    /// Whether the foot should carry load.
    pub fn is_stance(self) -> bool {
        self == LegPhase::Stance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::LegState;

    #[test]
    fn numbers_of_the_phases_are_those_of_the_message() {
        let names = [
            LegState::STATE_STANCE,
            LegState::STATE_SWING_UP,
            LegState::STATE_SWING_DOWN,
            LegState::STATE_REACH,
            LegState::STATE_FAULT_HOLD,
        ];
        for (phase, number) in LegPhase::ALL.iter().zip(names) {
            assert_eq!(*phase as i8, number);
        }
    }
}
