//! Which key does what.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use drivers::teleop::{Axis, Pose, Press, Sign};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Something of the robot.
    Press(Press),
    /// The end of this program.
    Quit,
}

impl Key {
    /// What a key event asks for; `None` of a key without meaning.
    ///
    /// With Alt, whatever the key: a terminal sends Alt as an Esc before it, so Esc and a key soon behind it arrive as this. The Esc is what counts.
    pub fn of(event: &KeyEvent) -> Option<Self> {
        if event.kind == KeyEventKind::Release {
            return None;
        }
        if event.modifiers.contains(KeyModifiers::ALT) {
            return Some(Key::Press(Press::Stop));
        }
        if event.modifiers.contains(KeyModifiers::CONTROL) {
            return matches!(event.code, KeyCode::Char('c')).then_some(Key::Quit);
        }
        let press = match event.code {
            KeyCode::Esc => Press::Stop,
            KeyCode::Enter => Press::Posture,
            // Caps lock must not disable the emergency stop.
            KeyCode::Char(key) => match key.to_ascii_lowercase() {
                'x' => Press::Stop,
                'w' => Press::Move(Axis::Forward, Sign::Plus),
                's' => Press::Move(Axis::Forward, Sign::Minus),
                'q' => Press::Move(Axis::Left, Sign::Plus),
                'e' => Press::Move(Axis::Left, Sign::Minus),
                'a' => Press::Move(Axis::Turn, Sign::Plus),
                'd' => Press::Move(Axis::Turn, Sign::Minus),
                'o' => Press::Pose(Pose::Height, Sign::Plus),
                'l' => Press::Pose(Pose::Height, Sign::Minus),
                'u' => Press::Pose(Pose::Pitch, Sign::Minus),
                'j' => Press::Pose(Pose::Pitch, Sign::Plus),
                'h' => Press::Pose(Pose::Roll, Sign::Minus),
                'k' => Press::Pose(Pose::Roll, Sign::Plus),
                '+' | '=' => Press::Pace(Sign::Plus),
                '-' => Press::Pace(Sign::Minus),
                'g' => Press::Gait,
                'r' => Press::Reset,
                ' ' => Press::Walk,
                _ => return None,
            },
            _ => return None,
        };
        Some(Key::Press(press))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode, modifiers: KeyModifiers) -> Option<Key> {
        Key::of(&KeyEvent::new(code, modifiers))
    }

    #[test]
    fn the_emergency_stop_is_reached_in_every_way() {
        let stop = Some(Key::Press(Press::Stop));
        assert_eq!(key(KeyCode::Esc, KeyModifiers::NONE), stop);
        assert_eq!(key(KeyCode::Char('x'), KeyModifiers::NONE), stop);
        assert_eq!(key(KeyCode::Char('X'), KeyModifiers::SHIFT), stop);
        assert_eq!(key(KeyCode::Char('w'), KeyModifiers::ALT), stop, "Esc, and w soon after it");
        assert_eq!(key(KeyCode::Enter, KeyModifiers::ALT), stop);
    }

    #[test]
    fn keys_are_those_that_users_know() {
        let press = |c| match key(KeyCode::Char(c), KeyModifiers::NONE) {
            Some(Key::Press(press)) => press,
            other => panic!("{c}: {other:?}"),
        };
        assert_eq!(press('w'), Press::Move(Axis::Forward, Sign::Plus));
        assert_eq!(press('W'), press('w'));
        assert_eq!(press('d'), Press::Move(Axis::Turn, Sign::Minus));
        assert_eq!(press('j'), Press::Pose(Pose::Pitch, Sign::Plus));
        assert_eq!(press(' '), Press::Walk);
        assert_eq!(key(KeyCode::Enter, KeyModifiers::NONE), Some(Key::Press(Press::Posture)));
    }

    #[test]
    fn only_ctrl_c_ends_it_and_a_release_is_none() {
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Key::Quit));
        assert_eq!(key(KeyCode::Char('w'), KeyModifiers::CONTROL), None);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::NONE), None);
        let mut event = KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE);
        event.kind = KeyEventKind::Release;
        assert_eq!(Key::of(&event), None);
    }
}
