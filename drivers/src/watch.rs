//! What a controller's ticks tell a person: changes of its mode, what it refuses, why it gave up.

use lcmtypes::{ControllerTick, Event, enum_names};

/// Watches the ticks of a run.
#[derive(Debug)]
pub struct ModeWatch {
    /// Names of the actuated joints, in URDF order.
    joints: Vec<String>,
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

impl ModeWatch {
    /// A watch for a robot with these actuated joints, in URDF order.
    pub fn new(joints: Vec<String>) -> Self {
        ModeWatch { joints, mode: ControllerTick::MODE_IDLE, fault: ControllerTick::FAULT_NONE }
    }

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
        let mut text = format!("controller {} in {}", if stays { "stays" } else { "is" }, enum_names::mode(mode));
        let mut level = Event::LEVEL_INFO;
        if refused || is_safe_state {
            // Who presses the emergency stop knows why.
            let is_wanted = refused || fault == ControllerTick::FAULT_OPERATOR;
            level = if is_wanted { Event::LEVEL_WARNING } else { Event::LEVEL_ERROR };
            text += if refused { " and refuses: " } else { ": " };
            text += enum_names::fault(fault);
            text += &self.found(fault, fault_index, fault_value);
        }
        Some(Said { level, text, is_safe_state: is_safe_state && !stays })
    }

    /// What was found, and where.
    fn found(&self, fault: i32, index: i32, value: f64) -> String {
        let place = usize::try_from(index).ok();
        let whole = value.fract() == 0.0 || !value.is_finite();
        let value = if whole { value.to_string() } else { format!("{value:.3}") };
        match (fault, place) {
            (ControllerTick::FAULT_OPERATOR, _) => String::new(),
            (ControllerTick::FAULT_OPERATOR_REFUSED, _) => {
                format!(": {}", i8::try_from(index).map_or("?", enum_names::operator_mode))
            }
            (ControllerTick::FAULT_OPERATOR_RANGE, place) => {
                let of = place.and_then(|i| ["swing_frequency", "duty", "step_height"].get(i));
                format!(": {} {value}", of.unwrap_or(&"?"))
            }
            (_, Some(place)) => match self.joints.get(place) {
                Some(joint) => format!(": {joint} {value}"),
                None => format!(": joint {place} {value}"),
            },
            (_, None) => format!(": {value}"),
        }
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
        let mut watch = ModeWatch::new(["a", "b", "lf_kfe_joint"].map(str::to_owned).to_vec());
        assert_eq!(watch.see(&tick(ControllerTick::MODE_IDLE, 0)), None);
        let stance = watch.see(&tick(ControllerTick::MODE_STANCE, 0)).unwrap();
        assert_eq!((stance.level, &*stance.text), (Event::LEVEL_INFO, "controller is in STANCE"));
        assert_eq!(watch.see(&tick(ControllerTick::MODE_STANCE, 0)), None);
        let safe = watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_JOINT_VELOCITY)).unwrap();
        assert_eq!(&*safe.text, "controller is in DAMPING: joint velocity too high (rad/s): lf_kfe_joint 0.500");
        assert!(safe.is_safe_state && safe.level == Event::LEVEL_ERROR);
    }

    #[test]
    fn what_holds_it_in_the_safe_state_is_told_when_it_changes() {
        let mut watch = ModeWatch::new(["a", "b", "lf_kfe_joint"].map(str::to_owned).to_vec());
        let asked = watch.see(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_OPERATOR)).unwrap();
        let text = "controller is in DAMPING: operator asked for it";
        assert_eq!((asked.level, &*asked.text), (Event::LEVEL_WARNING, text));
        let tilt = ControllerTick { fault_index: -1, ..tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT) };
        let tilted = watch.see(&tilt).unwrap();
        assert!(!tilted.is_safe_state, "it has been there before");
        assert_eq!(&*tilted.text, "controller stays in DAMPING: tilt (rad): 0.500");
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
        let mut watch = ModeWatch::new(["a", "b", "lf_kfe_joint"].map(str::to_owned).to_vec());
        let refused = watch.see(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_RANGE)).unwrap();
        assert_eq!(
            &*refused.text,
            "controller is in IDLE and refuses: operator command out of range: step_height 0.500"
        );
        assert_eq!(watch.see(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_RANGE)), None);
    }
}
