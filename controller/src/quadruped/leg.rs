//! The four legs and what a leg does.

use std::ops::{Index, IndexMut};

/// A leg, in the order of every array and message.
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

    /// The leg across the body: LF and RH, RF and LH.
    pub fn opposite(self) -> Leg {
        Leg::ALL[3 - self as usize]
    }

    /// Name as in figures and errors.
    pub fn name(self) -> &'static str {
        ["LF", "RF", "LH", "RH"][self as usize]
    }
}

/// One value a leg.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerLeg<T>(pub [T; 4]);

impl<T> PerLeg<T> {
    /// The values with their legs, in order.
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

/// What a leg does. Source: Raiola et al. 2020, section 4.3; the table stands in [`super::gait`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LegPhase {
    /// On the ground: contact task on, force bounds of stance.
    #[default]
    Stance,
    /// First half of the swing: contact is ignored, it may be the lift-off itself.
    SwingUp,
    /// Second half: a contact is a touchdown.
    SwingDown,
    /// Swing time is over and no contact yet: the foot goes on downward.
    Reach,
    /// The reach found no ground: the gait stops, the foot is kept where it is.
    FaultHold,
}

impl LegPhase {
    /// All phases, by their number in `leg_state_t`.
    pub const ALL: [LegPhase; 5] =
        [LegPhase::Stance, LegPhase::SwingUp, LegPhase::SwingDown, LegPhase::Reach, LegPhase::FaultHold];

    /// The foot is meant to carry load.
    pub fn is_stance(self) -> bool {
        self == LegPhase::Stance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::LegState;

    #[test]
    fn numbers_are_those_of_the_message() {
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
