//! Events from the ticks of a controller: changes of mode, rejected requests, faults.

use crate::fault_limits::FaultLimits;
use lcmtypes::{ControllerTick, Event, Message, RunInfo, channels, enum_names};

/// Keys and units of the operator command, by the index in a fault.
const OPERATOR_KEYS: [&str; 9] = [
    "swing_frequency (Hz)",
    "duty",
    "step_height (m)",
    "roll (rad)",
    "pitch (rad)",
    "height_offset (m)",
    "v_H[0] (m/s)",
    "v_H[1] (m/s)",
    "yaw_rate (rad/s)",
];

/// Watches the ticks of a run.
#[derive(Debug)]
pub struct ModeWatch {
    /// Names of the actuated joints, in URDF order.
    joints: Vec<String>,
    /// Names of the components of the run.
    components: Vec<String>,
    limits: Option<FaultLimits>,
    mode: i8,
    fault: i32,
    index: i32,
    value: f64,
}

/// A fault that led to the safe state; fields as in `controller_tick_t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultOfRun {
    /// FAULT_*.
    pub code: i32,
    /// Joint, leg or row; -1 = none.
    pub index: i32,
    /// Value that caused it.
    pub value: f64,
}

/// Level and text of an EVENT.
#[derive(Debug, PartialEq, Eq)]
pub struct ModeEvent {
    /// `event_t` LEVEL_*.
    pub level: i8,
    /// One sentence.
    pub text: String,
    /// The controller entered its safe state in this tick.
    pub is_safe_state: bool,
}

impl ModeWatch {
    /// A watch for a robot with these actuated joints, in URDF order.
    pub fn new(joints: Vec<String>) -> Self {
        ModeWatch {
            joints,
            components: Vec::new(),
            limits: None,
            mode: ControllerTick::MODE_IDLE,
            fault: ControllerTick::FAULT_NONE,
            index: -1,
            value: 0.0,
        }
    }

    /// The texts of faults contain the limits of this run, and the names of its components.
    #[must_use]
    pub fn with_limits(self, info: &RunInfo) -> Self {
        let components = info.components.iter().map(|component| component.name.clone()).collect();
        ModeWatch { limits: FaultLimits::new(info), components, ..self }
    }

    /// Takes a changed parameter, from which limits follow.
    pub fn change(&mut self, key: &str, value: &str) {
        if let Some(limits) = &mut self.limits {
            limits.change(key, value);
        }
    }

    /// `controller_tick_t` MODE_* of the last tick.
    pub fn mode(&self) -> i8 {
        self.mode
    }

    /// The fault with which the controller is in its safe state; `None` in other modes and after an emergency stop.
    pub fn fault_of_safe_state(&self) -> Option<FaultOfRun> {
        let is_fault = self.mode == ControllerTick::MODE_DAMPING && self.fault != ControllerTick::FAULT_OPERATOR;
        is_fault.then_some(FaultOfRun { code: self.fault, index: self.index, value: self.value })
    }

    /// Takes the next tick; returns an event if mode or fault is new.
    pub fn update(&mut self, tick: &ControllerTick) -> Option<ModeEvent> {
        let ControllerTick { mode, fault, .. } = *tick;
        (self.index, self.value) = (tick.fault_index, tick.fault_value);
        let mode_before = std::mem::replace(&mut self.mode, mode);
        let is_new_fault = std::mem::replace(&mut self.fault, fault) != fault && fault != ControllerTick::FAULT_NONE;
        let warning = |text: String| Some(ModeEvent { level: Event::LEVEL_WARNING, text, is_safe_state: false });
        if fault == ControllerTick::FAULT_CONTROLLER {
            let event = warning("no controller is running: joints damped".to_owned())?;
            return is_new_fault.then_some(ModeEvent { is_safe_state: true, ..event });
        }
        let state = enum_names::mode(mode);
        match (mode == ControllerTick::MODE_DAMPING, mode != mode_before) {
            (true, is_entered) if is_entered || is_new_fault => {
                // The operator knows the reason of its own emergency stop.
                let is_requested = fault == ControllerTick::FAULT_OPERATOR;
                let level = if is_requested { Event::LEVEL_WARNING } else { Event::LEVEL_ERROR };
                let verb = if is_entered { "is" } else { "stays" };
                let text = format!("controller {verb} in {state}: {}", self.description(tick));
                Some(ModeEvent { level, text, is_safe_state: is_entered })
            }
            (false, true) if is_new_fault => warning(format!("controller is in {state}; {}", self.rejection(tick))),
            (false, false) if is_new_fault => warning(self.rejection(tick)),
            (false, true) => {
                let text = format!("controller is in {state}");
                Some(ModeEvent { level: Event::LEVEL_INFO, text, is_safe_state: false })
            }
            _ => None,
        }
    }

    /// A request that the controller did not follow, and the reason.
    fn rejection(&self, tick: &ControllerTick) -> String {
        let state = enum_names::mode(tick.mode);
        if tick.fault == ControllerTick::FAULT_OPERATOR_REFUSED {
            let requested = i8::try_from(tick.fault_index).map_or("?", enum_names::operator_mode);
            return format!("{requested} rejected: not possible in {state}");
        }
        if [ControllerTick::FAULT_OPERATOR_LIMITED, ControllerTick::FAULT_COMPONENT].contains(&tick.fault) {
            return self.description(tick);
        }
        if tick.fault == ControllerTick::FAULT_NO_GROUND {
            return format!("gait stopped: {}", self.description(tick));
        }
        format!("operator command rejected: {}", self.description(tick))
    }

    /// The fault with joint or key, value and limit.
    fn description(&self, tick: &ControllerTick) -> String {
        let ControllerTick { fault, fault_index, .. } = *tick;
        let limit = self.limits.as_ref().and_then(|limits| limits.text(fault, usize::try_from(fault_index).ok()));
        limit.map_or_else(|| self.fault(tick), |limit| format!("{}, {limit}", self.fault(tick)))
    }

    /// The fault with joint or key and value.
    fn fault(&self, tick: &ControllerTick) -> String {
        let ControllerTick { fault, fault_index, fault_value, .. } = *tick;
        let (name, value) = (enum_names::fault(fault), fault_value);
        let index = usize::try_from(fault_index).ok();
        let is_whole = value.fract() == 0.0 || !value.is_finite();
        let value = if is_whole { value.to_string() } else { format!("{value:.3}") };
        match (fault, index) {
            (ControllerTick::FAULT_OPERATOR, _) => name.to_owned(),
            (ControllerTick::FAULT_OPERATOR_REFUSED, _) => {
                format!("{name}: {}", i8::try_from(fault_index).map_or("?", enum_names::operator_mode))
            }
            (ControllerTick::FAULT_OPERATOR_RANGE | ControllerTick::FAULT_OPERATOR_LIMITED, index) => {
                let key = index.and_then(|i| OPERATOR_KEYS.get(i));
                format!("{name}: {} {value}", key.unwrap_or(&"?"))
            }
            (ControllerTick::FAULT_NO_GROUND, index) => {
                let leg = index.and_then(|i| enum_names::LEGS.get(i));
                format!("{name}: {} {value}", leg.unwrap_or(&"?"))
            }
            (ControllerTick::FAULT_COMPONENT, index) => {
                let component = index.and_then(|i| self.components.get(i)).map_or("?", String::as_str);
                let age = if fault_value < 0.0 {
                    "none arrived".to_owned()
                } else {
                    format!("the last one {value} ticks ago")
                };
                format!("{name}: {component}, {age}")
            }
            (_, Some(index)) => match self.joints.get(index) {
                Some(joint) => format!("{name}: {joint} {value}"),
                None => format!("{name}: joint {index} {value}"),
            },
            (_, None) => format!("{name}: {value}"),
        }
    }
}

/// Watches the ticks of the components beside the first one.
#[derive(Debug)]
pub struct ComponentWatch {
    components: Vec<(String, ModeWatch)>,
}

/// What a component beside the first one reports.
#[derive(Debug, PartialEq, Eq)]
pub struct ComponentEvent {
    /// Its name: the source of the EVENT.
    pub component: String,
    /// Time of its tick, ns.
    pub t_ns: i64,
    /// The event.
    pub event: ModeEvent,
}

impl ComponentWatch {
    /// A watch for the components of a run.
    pub fn new(info: &RunInfo) -> Self {
        let others = info.components.iter().skip(1);
        let watch = |name: &String| (name.clone(), ModeWatch::new(info.joints.clone()));
        ComponentWatch { components: others.map(|component| watch(&component.name)).collect() }
    }

    /// Whether the run has one component only.
    pub fn is_empty(&self) -> bool {
        self.components.is_empty()
    }

    /// Takes a message of the run; messages that are not the tick of a component beside the first one change nothing.
    pub fn update(&mut self, channel: &str, data: &[u8]) -> Option<ComponentEvent> {
        let (component, name) = channels::split(channel);
        let (source, modes) = self.components.iter_mut().find(|(known, _)| known == component)?;
        let tick = if name == channels::CONTROLLER_TICK { ControllerTick::decode(data).ok()? } else { return None };
        let event = modes.update(&tick)?;
        Some(ComponentEvent { component: source.clone(), t_ns: tick.t_ns, event })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(mode: i8, fault: i32) -> ControllerTick {
        ControllerTick { mode, fault, fault_index: 2, fault_value: 0.5, ..ControllerTick::default() }
    }

    fn watch() -> ModeWatch {
        ModeWatch::new(["a", "b", "lf_kfe_joint"].map(str::to_owned).to_vec())
    }

    /// Asserts that an event names all of these.
    #[track_caller]
    fn assert_names(event: &ModeEvent, names: &[&str]) {
        assert!(names.iter().all(|name| event.text.contains(name)), "{names:?}: {}", event.text);
    }

    #[test]
    fn a_new_mode_is_reported_once_and_a_fault_with_joint_and_value() {
        let mut watch = watch();
        assert_eq!(watch.update(&tick(ControllerTick::MODE_IDLE, 0)), None);
        let stance = watch.update(&tick(ControllerTick::MODE_STANCE, 0)).unwrap();
        assert_eq!((stance.level, stance.is_safe_state), (Event::LEVEL_INFO, false));
        assert_names(&stance, &["STANCE"]);
        assert_eq!(watch.update(&tick(ControllerTick::MODE_STANCE, 0)), None);
        let safe = watch.update(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_JOINT_VELOCITY)).unwrap();
        assert_eq!((safe.level, safe.is_safe_state), (Event::LEVEL_ERROR, true));
        let fault = enum_names::fault(ControllerTick::FAULT_JOINT_VELOCITY);
        assert_names(&safe, &["DAMPING", fault, "lf_kfe_joint", "0.500"]);
    }

    #[test]
    fn a_foot_without_ground_is_reported_once_with_leg_and_depth() {
        let mut watch = watch();
        watch.update(&tick(ControllerTick::MODE_WALK, 0));
        let held =
            ControllerTick { fault_value: 0.1, ..tick(ControllerTick::MODE_WALK, ControllerTick::FAULT_NO_GROUND) };
        let event = watch.update(&held).unwrap();
        assert_eq!((event.level, event.is_safe_state), (Event::LEVEL_WARNING, false));
        assert_names(&event, &["LH", "0.100", enum_names::fault(ControllerTick::FAULT_NO_GROUND)]);
        assert_eq!(watch.update(&held), None);
        assert_eq!(watch.fault_of_safe_state(), None);
        for index in [-1, 4, i32::MAX] {
            let unknown = ControllerTick { fault_index: index, ..held.clone() };
            watch.update(&tick(ControllerTick::MODE_WALK, 0));
            assert_names(&watch.update(&unknown).unwrap(), &["?"]);
        }
    }

    #[test]
    fn a_new_fault_in_the_safe_state_is_reported() {
        let mut watch = watch();
        let requested = watch.update(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_OPERATOR)).unwrap();
        assert_eq!((requested.level, requested.is_safe_state), (Event::LEVEL_WARNING, true));
        let tilt = ControllerTick { fault_index: -1, ..tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT) };
        let tilted = watch.update(&tilt).unwrap();
        assert_eq!((tilted.level, tilted.is_safe_state), (Event::LEVEL_ERROR, false), "it was in DAMPING before");
        assert_names(&tilted, &["DAMPING", enum_names::fault(ControllerTick::FAULT_TILT), "0.500"]);
        assert_eq!(watch.update(&tick(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT)), None);
        assert_names(&watch.update(&tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_NONE)).unwrap(), &["IDLE"]);
    }

    #[test]
    fn a_rejected_request_is_reported_once() {
        let mut watch = watch();
        let refused = tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_REFUSED);
        let event = watch.update(&ControllerTick { fault_index: 1, ..refused }).unwrap();
        assert_eq!((event.level, &*event.text), (Event::LEVEL_WARNING, "WALK rejected: not possible in IDLE"));
        let range = tick(ControllerTick::MODE_IDLE, ControllerTick::FAULT_OPERATOR_RANGE);
        let event = watch.update(&range).unwrap();
        assert_eq!(event.level, Event::LEVEL_WARNING);
        assert_names(&event, &["step_height", "0.500"]);
        assert_eq!(watch.update(&range), None);
    }

    #[test]
    fn a_component_whose_commands_do_not_arrive_is_named() {
        let component = |name: &str| lcmtypes::ComponentInfo { name: name.to_owned(), ..Default::default() };
        let info = RunInfo { components: ["legs", "arms", "tail"].map(component).to_vec(), ..RunInfo::default() };
        let mut watch = watch().with_limits(&info);
        let stance = ControllerTick::MODE_STANCE;
        watch.update(&tick(stance, 0));
        let late =
            watch.update(&ControllerTick { fault_value: 350.0, ..tick(stance, ControllerTick::FAULT_COMPONENT) });
        let late = late.unwrap();
        assert_names(&late, &["tail", "350 ticks"]);
        assert_eq!((late.level, late.is_safe_state), (Event::LEVEL_WARNING, false));
        assert!(["rejected", "lf_kfe_joint"].iter().all(|word| !late.text.contains(word)), "{}", late.text);
        watch.update(&tick(stance, 0));
        let none =
            ControllerTick { fault_index: 1, fault_value: -1.0, ..tick(stance, ControllerTick::FAULT_COMPONENT) };
        assert_names(&watch.update(&none).unwrap(), &["arms", "none arrived"]);
    }

    #[test]
    fn the_ticks_of_each_component_are_watched() {
        let component = |name: &str| lcmtypes::ComponentInfo { name: name.to_owned(), ..Default::default() };
        let info = RunInfo { components: ["legs", "arms", "tail"].map(component).to_vec(), ..RunInfo::default() };
        let mut watch = ComponentWatch::new(&info);
        let mut bytes = Vec::new();
        ControllerTick { t_ns: 5, ..tick(ControllerTick::MODE_STANCE, 0) }.encode(&mut bytes).unwrap();
        for other in ["CONTROLLER_TICK", "legs/CONTROLLER_TICK", "arms/ROBOT_COMMAND", "wings/CONTROLLER_TICK"] {
            assert_eq!(watch.update(other, &bytes), None, "{other}");
        }
        assert_eq!(watch.update("arms/CONTROLLER_TICK", &[1, 2]), None);
        for name in ["tail", "arms"] {
            let found = watch.update(&format!("{name}/CONTROLLER_TICK"), &bytes).unwrap();
            assert_eq!((&*found.component, found.t_ns), (name, 5));
            assert_eq!(watch.update(&format!("{name}/CONTROLLER_TICK"), &bytes), None, "{name}");
        }
    }
}
