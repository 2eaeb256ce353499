//! What a controller's ticks tell a person: changes of its mode, what it refuses, why it gave up.

use lcmtypes::{ControllerTick, Event, words};

/// Watches the ticks of a run.
#[derive(Debug)]
pub struct ModeWatch {
    mode: i8,
    fault: i32,
}

/// What a tick has to tell: level and text of an EVENT.
#[derive(Debug, PartialEq, Eq)]
pub struct Said {
    /// `event_t` LEVEL_*.
    pub level: i8,
    /// One sentence.
    pub text: String,
    /// It is that the controller went to its safe state.
    pub is_safe_state: bool,
}

impl Default for ModeWatch {
    fn default() -> Self {
        ModeWatch { mode: ControllerTick::MODE_IDLE, fault: ControllerTick::FAULT_NONE }
    }
}

impl ModeWatch {
    /// `controller_tick_t` MODE_* of the last tick seen.
    pub fn mode(&self) -> i8 {
        self.mode
    }

    /// What is new in a tick, if anything. Ticks in the order of their numbers.
    pub fn see(&mut self, tick: &ControllerTick) -> Option<Said> {
        let ControllerTick { mode, fault, fault_index, fault_value, .. } = *tick;
        if fault == ControllerTick::FAULT_CONTROLLER {
            let is_new = std::mem::replace(&mut self.fault, fault) != fault;
            self.mode = mode;
            let text = "no controller runs: the joints are damped".to_owned();
            return is_new.then_some(Said { level: Event::LEVEL_WARNING, text, is_safe_state: true });
        }
        let fault_before = std::mem::replace(&mut self.fault, fault);
        let is_safe_state = mode == ControllerTick::MODE_DAMPING;
        let other_fault = fault != fault_before && fault != ControllerTick::FAULT_NONE;
        let refused = other_fault && !is_safe_state;
        if mode == self.mode && !other_fault {
            return None;
        }
        let stays = is_safe_state && mode == self.mode;
        self.mode = mode;
        let mut text = format!("controller {} in {}", if stays { "stays" } else { "is" }, words::mode(mode));
        let mut level = Event::LEVEL_INFO;
        if refused || is_safe_state {
            level = if refused { Event::LEVEL_WARNING } else { Event::LEVEL_ERROR };
            let index = usize::try_from(fault_index).ok();
            text += &format!("{}: {}", if refused { " and refuses" } else { "" }, words::fault(fault));
            text += &match (fault, index) {
                (ControllerTick::FAULT_OPERATOR_REFUSED, _) => {
                    format!(": {}", i8::try_from(fault_index).map_or("?", words::operator_mode))
                }
                (ControllerTick::FAULT_OPERATOR_RANGE, index) => {
                    let of = index.and_then(|i| ["swing_frequency", "duty", "step_height"].get(i));
                    format!(", value {fault_value} of {}", of.unwrap_or(&"?"))
                }
                (_, Some(index)) => format!(", value {fault_value}, index {index}"),
                (_, None) => format!(", value {fault_value}"),
            };
        }
        Some(Said { level, text, is_safe_state: is_safe_state && !stays })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(mode: i8, fault: i32) -> ControllerTick {
        ControllerTick { mode, fault, fault_index: 2, fault_value: 0.5, ..ControllerTick::default() }
    }

    #[test]
    fn a_mode_is_told_once_and_the_safe_state_with_its_reason() {
        let mut watch = ModeWatch::default();
        assert_eq!(watch.see(&tick(ControllerTick::MODE_IDLE, 0)), None);
        let stance = watch.see(&tick(ControllerTick::MODE_STANCE, 0)).unwrap();
        assert_eq!((stance.level, &*stance.text), (Event::LEVEL_INFO, "controller is in STANCE"));
        assert_eq!(watch.see(&tick(ControllerTick::MODE_STANCE, 0)), None);
        let safe = watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT)).unwrap();
        assert_eq!(&*safe.text, "controller is in DAMPING: tilt (rad), value 0.5, index 2");
        assert!(safe.is_safe_state && safe.level == Event::LEVEL_ERROR);
    }

    #[test]
    fn what_holds_it_in_the_safe_state_is_told_when_it_changes() {
        let mut watch = ModeWatch::default();
        watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_OPERATOR));
        let tilted = watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT)).unwrap();
        assert!(!tilted.is_safe_state, "it has been there before");
        assert_eq!(&*tilted.text, "controller stays in DAMPING: tilt (rad), value 0.5, index 2");
        assert_eq!(watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT)), None);
        let idle = watch.see(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_NONE)).unwrap();
        assert_eq!(&*idle.text, "controller is in IDLE");
        let walk = tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_REFUSED);
        let refused = watch.see(&ControllerTick { fault_index: 1, ..walk }).unwrap();
        let text = "controller is in IDLE and refuses: operator's wish cannot be followed from here: WALK";
        assert_eq!((refused.level, &*refused.text), (Event::LEVEL_WARNING, text));
    }

    #[test]
    fn what_is_refused_is_told_when_it_changes() {
        let mut watch = ModeWatch::default();
        let refused = watch.see(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_RANGE)).unwrap();
        assert_eq!(
            &*refused.text,
            "controller is in IDLE and refuses: operator command out of range, value 0.5 of step_height"
        );
        assert_eq!(watch.see(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_RANGE)), None);
    }
}
