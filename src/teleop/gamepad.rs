//! Gamepad input through gilrs, which maps the layouts of most gamepads.

use anyhow::{Context, bail};
use drivers::teleop::pad::{Button, PadState, stick};
use gilrs::{Axis, EventType, GamepadId, Gilrs};

/// The first gamepad of the system.
pub struct Gamepad {
    gilrs: Gilrs,
    id: GamepadId,
    name: String,
    state: PadState,
}

impl Gamepad {
    /// Opens the first gamepad.
    ///
    /// # Errors
    /// If there is none, or it cannot be accessed.
    pub fn open() -> anyhow::Result<Self> {
        // Without filters: the dead zone removes jitter, and the controller filters the commands.
        let gilrs = Gilrs::new().map_err(|error| anyhow::anyhow!("{error}")).context("gamepads")?;
        let Some((id, pad)) = gilrs.gamepads().next() else {
            bail!("no gamepad found; check that it is connected and that /dev/input/event* is readable");
        };
        let name = pad.name().to_owned();
        Ok(Gamepad { gilrs, id, name, state: PadState::default() })
    }

    /// Name of the gamepad.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Present state; `None` if it is disconnected.
    pub fn state(&mut self) -> Option<&PadState> {
        while let Some(event) = self.gilrs.next_event() {
            if event.id != self.id {
                continue;
            }
            match event.event {
                EventType::ButtonPressed(button, _) => note_button(&mut self.state, button, true),
                EventType::ButtonReleased(button, _) => note_button(&mut self.state, button, false),
                EventType::AxisChanged(axis, deflection, _) => note_axis(&mut self.state, axis, deflection.into()),
                EventType::Disconnected => return None,
                _ => {}
            }
        }
        let bumper = |button| self.gilrs.gamepad(self.id).is_pressed(button);
        // Two buttons with the same function: their state is read, since an event reports only one of them.
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

/// Sticks are positive to the right and up. The robot's velocities are positive forward and to the left, its pitch nose down.
fn note_axis(state: &mut PadState, axis: Axis, deflection: f64) {
    match axis {
        Axis::LeftStickX => state.left = -stick(deflection),
        Axis::LeftStickY => state.forward = stick(deflection),
        Axis::RightStickX => state.turn = -stick(deflection),
        Axis::RightStickY => state.pitch = stick(deflection),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::teleop::{Limits, OperatorInput};
    use lcmtypes::{ControllerTick, OperatorCommand};

    #[test]
    fn sticks_set_the_velocities_of_their_direction() {
        let mut state = PadState::default();
        note_axis(&mut state, Axis::LeftStickY, 1.0);
        note_axis(&mut state, Axis::LeftStickX, 1.0);
        note_axis(&mut state, Axis::RightStickX, -1.0);
        note_axis(&mut state, Axis::RightStickY, 0.05);
        note_axis(&mut state, Axis::LeftZ, 1.0);
        assert_eq!(state, PadState { forward: 1.0, left: -1.0, turn: 1.0, pitch: 0.0, ..PadState::default() });
    }

    #[test]
    fn buttons_and_sticks_make_a_command() {
        let limits = Limits::default();
        let mut input = OperatorInput::new(limits.clone());
        input.set_robot_mode(ControllerTick::MODE_STANCE);
        let mut state = PadState { bumper: true, ..PadState::default() };
        note_axis(&mut state, Axis::RightStickX, 1.0);
        note_button(&mut state, gilrs::Button::South, true);
        note_button(&mut state, gilrs::Button::DPadUp, true);
        note_button(&mut state, gilrs::Button::North, true);
        input.apply_pad(&state, 0).unwrap();
        let command = input.command(0).unwrap();
        assert_eq!((command.mode, command.gait), (OperatorCommand::MODE_WALK, OperatorCommand::GAIT_CRAWL));
        assert_eq!(command.yaw_rate, -limits.gaits[1].yaw_rate);
        assert!(command.height_offset > 0.0);

        note_button(&mut state, gilrs::Button::East, true);
        input.apply_pad(&state, 0).unwrap();
        assert_eq!(input.mode(), Some(OperatorCommand::MODE_DAMPING));
        note_button(&mut state, gilrs::Button::East, false);
        input.apply_pad(&state, 0).unwrap();
        assert_eq!(input.mode(), Some(OperatorCommand::MODE_DAMPING), "releasing the button does not clear the stop");
    }
}
