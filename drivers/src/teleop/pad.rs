//! A gamepad's sticks and buttons, by what they are for.
//!
//! | control | PlayStation | Xbox | does |
//! |---|---|---|---|
//! | left stick | left stick | left stick | forward and backward, left and right |
//! | right stick | right stick | right stick | turn; nose down and up |
//! | bumper | L1 or R1 | LB or RB | held: the robot walks and the sticks count; let go: it stands |
//! | directional pad | same | same | up and down: height; left and right: roll |
//! | south | cross | A | the other gait |
//! | east | circle | B | emergency stop |
//! | start | Options | Menu | stand up, sit down |
//! | select | Share | View | level; no torque for a robot that sits; after an emergency stop, takes it back |

use super::{Pose, Press, Sign};

/// Part of a stick's way that counts as none: sticks do not spring back exactly.
const DEAD: f64 = 0.1;

/// How a pad is held.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PadState {
    /// Forward, -1 to 1.
    pub forward: f64,
    /// To the left, -1 to 1.
    pub left: f64,
    /// Turning to the left, -1 to 1.
    pub turn: f64,
    /// Nose down, -1 to 1.
    pub pitch: f64,
    /// Either bumper is held.
    pub bumper: bool,
    /// Buttons that are down, by number in [`BUTTONS`].
    pub down: [bool; BUTTONS.len()],
}

/// What buttons do when they go down. The emergency stop comes last: whatever goes down with it, it is what counts.
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

/// A button, by where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the table of the module says it")]
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
    /// Notes that a button went down or up.
    pub fn set(&mut self, button: Button, down: bool) {
        for (slot, (known, _)) in self.down.iter_mut().zip(BUTTONS) {
            if known == button {
                *slot = down;
            }
        }
    }

    /// What the buttons ask for that are down and were not before.
    pub fn pressed_since(&self, before: &Self) -> impl Iterator<Item = Press> {
        let new: [bool; BUTTONS.len()] = std::array::from_fn(|k| self.down[k] && !before.down[k]);
        BUTTONS.into_iter().zip(new).filter(|(_, new)| *new).map(|((_, press), _)| press)
    }
}

/// A stick's way without the part around its middle, -1 to 1, continuous; what is not a number is none.
pub fn stick(way: f64) -> f64 {
    let beyond = (way.abs() - DEAD) / (1.0 - DEAD);
    if beyond > 0.0 { beyond.min(1.0).copysign(way) } else { 0.0 }
}
