//! Sticks and buttons of a gamepad, by function.
//!
//! | control | PlayStation | Xbox | function |
//! |---|---|---|---|
//! | left stick | left stick | left stick | forward and backward, left and right |
//! | right stick | right stick | right stick | turn; nose down and up |
//! | bumper | L1 or R1 | LB or RB | held: the robot walks and the sticks are active; released: it stands |
//! | directional pad | same | same | up and down: height; left and right: roll |
//! | south | cross | A | switch gait |
//! | east | circle | B | emergency stop |
//! | start | Options | Menu | stand up, sit down |
//! | select | Share | View | level; if the robot sits: no torque; after an emergency stop: clear it |

use super::{Pose, Press, Sign};

/// Dead zone of a stick, as a fraction of its range: sticks do not return to the centre exactly.
const DEAD_ZONE: f64 = 0.1;

/// State of a gamepad.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PadState {
    /// Forward, -1 to 1.
    pub forward: f64,
    /// Left, -1 to 1.
    pub left: f64,
    /// Turn to the left, -1 to 1.
    pub turn: f64,
    /// Pitch, nose down, -1 to 1.
    pub pitch: f64,
    /// A bumper is held.
    pub bumper: bool,
    /// Buttons that are down, by index in [`BUTTONS`].
    pub down: [bool; BUTTONS.len()],
}

/// Action of each button when it is pressed. The emergency stop is last, so that it overrides buttons pressed at the same time.
pub const BUTTONS: [(Button, Press); 8] = [
    (Button::Up, Press::Pose(Pose::Height, Sign::Plus)),
    (Button::Down, Press::Pose(Pose::Height, Sign::Minus)),
    (Button::Left, Press::Pose(Pose::Roll, Sign::Minus)),
    (Button::Right, Press::Pose(Pose::Roll, Sign::Plus)),
    (Button::South, Press::Gait),
    (Button::Start, Press::Posture),
    (Button::Select, Press::Reset),
    (Button::East, Press::Stop),
];

/// A button, by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "documented in the table of the module")]
pub enum Button {
    Up,
    Down,
    Left,
    Right,
    South,
    East,
    Start,
    Select,
}

impl PadState {
    /// Sets a button as pressed or released.
    pub fn set(&mut self, button: Button, down: bool) {
        for (slot, (known, _)) in self.down.iter_mut().zip(BUTTONS) {
            if known == button {
                *slot = down;
            }
        }
    }

    /// Actions of the buttons that are pressed now and were not `before`.
    pub fn pressed_since(&self, before: &Self) -> impl Iterator<Item = Press> {
        let new: [bool; BUTTONS.len()] = std::array::from_fn(|k| self.down[k] && !before.down[k]);
        BUTTONS.into_iter().zip(new).filter(|(_, new)| *new).map(|((_, press), _)| press)
    }
}

/// Deflection of a stick with a dead zone around the centre, -1 to 1, continuous; 0 for NaN.
pub fn stick(deflection: f64) -> f64 {
    let beyond = (deflection.abs() - DEAD_ZONE) / (1.0 - DEAD_ZONE);
    if beyond > 0.0 { beyond.min(1.0).copysign(deflection) } else { 0.0 }
}
