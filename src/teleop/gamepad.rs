//! A gamepad, by gilrs, which knows the layouts of hundreds of them.

use anyhow::{Context, bail};
use drivers::teleop::pad::{Button, PadState, stick};
use gilrs::{Axis, EventType, GamepadId, Gilrs};

/// The first pad that is there.
pub struct Gamepad {
    gilrs: Gilrs,
    id: GamepadId,
    name: String,
    state: PadState,
}

impl Gamepad {
    /// Takes the first pad.
    ///
    /// # Errors
    /// There is none, or the system shows none.
    pub fn open() -> anyhow::Result<Self> {
        // Filters would take jitter out of sticks; the dead middle does, and the controller filters.
        let gilrs = Gilrs::new().map_err(|error| anyhow::anyhow!("{error}")).context("gamepads")?;
        let Some((id, pad)) = gilrs.gamepads().next() else {
            bail!("there is no gamepad (whoever uses one has to be allowed to read /dev/input/event*)");
        };
        let name = pad.name().to_owned();
        Ok(Gamepad { gilrs, id, name, state: PadState::default() })
    }

    /// What it calls itself.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How it is held now; `None` when it is gone.
    pub fn state(&mut self) -> Option<&PadState> {
        while let Some(event) = self.gilrs.next_event() {
            if event.id != self.id {
                continue;
            }
            match event.event {
                EventType::ButtonPressed(button, _) => note_button(&mut self.state, button, true),
                EventType::ButtonReleased(button, _) => note_button(&mut self.state, button, false),
                EventType::AxisChanged(axis, way, _) => note_axis(&mut self.state, axis, way.into()),
                EventType::Disconnected => return None,
                _ => {}
            }
        }
        let bumper = |button| self.gilrs.gamepad(self.id).is_pressed(button);
        // Two buttons, one meaning: their state, since an event tells of one.
        self.state.bumper = bumper(gilrs::Button::LeftTrigger) || bumper(gilrs::Button::RightTrigger);
        Some(&self.state)
    }
}

fn note_button(state: &mut PadState, button: gilrs::Button, down: bool) {
    let button = match button {
        gilrs::Button::DPadUp => Button::Up,
        gilrs::Button::DPadDown => Button::Down,
        gilrs::Button::DPadLeft => Button::Left,
        gilrs::Button::DPadRight => Button::Right,
        gilrs::Button::South => Button::South,
        gilrs::Button::East => Button::East,
        gilrs::Button::Start => Button::Start,
        gilrs::Button::Select => Button::Select,
        _ => return,
    };
    state.set(button, down);
}

/// Sticks are positive to the right and up; the robot's velocities, forward and to the left; its pitch, nose down.
fn note_axis(state: &mut PadState, axis: Axis, way: f64) {
    match axis {
        Axis::LeftStickX => state.left = -stick(way),
        Axis::LeftStickY => state.forward = stick(way),
        Axis::RightStickX => state.turn = -stick(way),
        Axis::RightStickY => state.pitch = stick(way),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::teleop::{Desk, Limits};
    use lcmtypes::{ControllerTick, OperatorCommand};

    #[test]
    fn sticks_go_where_the_thumb_goes() {
        let mut state = PadState::default();
        note_axis(&mut state, Axis::LeftStickY, 1.0);
        note_axis(&mut state, Axis::LeftStickX, 1.0);
        note_axis(&mut state, Axis::RightStickX, -1.0);
        note_axis(&mut state, Axis::RightStickY, 0.05);
        note_axis(&mut state, Axis::LeftZ, 1.0);
        assert_eq!(state, PadState { forward: 1.0, left: -1.0, turn: 1.0, pitch: 0.0, ..PadState::default() });
    }

    #[test]
    fn from_buttons_to_a_command() {
        let limits = Limits::default();
        let mut desk = Desk::new(limits);
        desk.hear(ControllerTick::MODE_STANCE);
        let mut state = PadState { bumper: true, ..PadState::default() };
        note_axis(&mut state, Axis::RightStickX, 1.0);
        note_button(&mut state, gilrs::Button::South, true);
        note_button(&mut state, gilrs::Button::DPadUp, true);
        note_button(&mut state, gilrs::Button::North, true);
        desk.hold(&state, 0).unwrap();
        let command = desk.command(0).unwrap();
        assert_eq!((command.mode, command.gait), (OperatorCommand::MODE_WALK, OperatorCommand::GAIT_CRAWL));
        assert_eq!(command.yaw_rate, -limits.yaw_rate);
        assert!(command.height_offset > 0.0);

        note_button(&mut state, gilrs::Button::East, true);
        desk.hold(&state, 0).unwrap();
        assert_eq!(desk.mode(), Some(OperatorCommand::MODE_DAMPING));
        note_button(&mut state, gilrs::Button::East, false);
        desk.hold(&state, 0).unwrap();
        assert_eq!(desk.mode(), Some(OperatorCommand::MODE_DAMPING), "letting go of it takes nothing back");
    }
}
