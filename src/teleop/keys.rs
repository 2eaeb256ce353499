//! Key bindings.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use drivers::teleop::{Axis, Pose, Press, Sign};

/// Action of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// An operator action.
    Press(Press),
    /// End of the program.
    Quit,
}

impl Key {
    /// Action of a key event; `None` if the key is not bound.
    ///
    /// Any key with Alt is an emergency stop: a terminal sends Alt as Esc before the key, so Esc followed quickly by a key arrives as Alt.
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
    fn every_form_of_the_stop_keys_is_an_emergency_stop() {
        let stop = Some(Key::Press(Press::Stop));
        assert_eq!(key(KeyCode::Esc, KeyModifiers::NONE), stop);
        assert_eq!(key(KeyCode::Char('x'), KeyModifiers::NONE), stop);
        assert_eq!(key(KeyCode::Char('X'), KeyModifiers::SHIFT), stop);
        assert_eq!(key(KeyCode::Char('w'), KeyModifiers::ALT), stop, "Esc followed by w");
        assert_eq!(key(KeyCode::Enter, KeyModifiers::ALT), stop);
    }

    #[test]
    fn keys_have_the_documented_actions() {
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
    fn only_ctrl_c_ends_the_program_and_releases_are_ignored() {
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Key::Quit));
        assert_eq!(key(KeyCode::Char('w'), KeyModifiers::CONTROL), None);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::NONE), None);
        let mut event = KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE);
        event.kind = KeyEventKind::Release;
        assert_eq!(Key::of(&event), None);
    }
}
