//! The screen: emergency stop, command, state of the controller, events. It fits a terminal of 80 by 24.

use super::link::{Follows, Status, Stop, TIMEOUT_NS};
use drivers::teleop::{GaitLimits, Limits, OperatorInput};
use lcmtypes::{ControllerTick, Event, OperatorCommand, enum_names};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

/// Characters of a bar on each side of its middle.
const BAR: usize = 6;

const HELP: [&str; 3] = [
    "Space walk/stop  Enter stand up/sit  r level/no torque/clear stop  Ctrl-C end",
    "w s forward/back   q e left/right   a d turn   + - pace        (hold to move)",
    "o l higher/lower   u j nose up/down   h k roll   g gait        (kept)",
];

/// Content of the screen.
pub struct Screen<'a> {
    /// Values set by the operator.
    pub input: &'a OperatorInput,
    /// Channel of the commands.
    pub channel: &'a str,
    /// State of the controller.
    pub status: &'a Status,
    /// Name of the gamepad.
    pub pad: Option<&'a str>,
    /// Why the last key had no effect, or why the request is rejected.
    pub message: &'a str,
    /// Present time, ns.
    pub now_ns: i64,
}

impl Screen<'_> {
    /// Draws the screen. If it does not fit, the oldest events are omitted.
    pub fn draw(&self, frame: &mut Frame) {
        let rows = [Constraint::Length(3), Constraint::Length(10), Constraint::Min(3), Constraint::Length(4)];
        let [stop, middle, events, foot] = Layout::vertical(rows).areas(frame.area());
        self.stop(frame, stop);
        let [left, right] = Layout::horizontal([Constraint::Length(44), Constraint::Min(30)]).areas(middle);
        panel(frame, left, "Command", self.command());
        panel(frame, right, "Controller", self.controller());
        panel(frame, events, "Events", self.events(events.height.saturating_sub(2)));
        let mut lines = vec![Line::styled(self.message.to_owned(), bold(Color::Yellow))];
        lines.extend(HELP.map(|text| Line::styled(text, Style::new().fg(Color::DarkGray))));
        frame.render_widget(Paragraph::new(lines), foot);
    }

    /// The emergency stop: always visible.
    fn stop(&self, frame: &mut Frame, area: Rect) {
        let is_damped = self.status.mode(self.now_ns) == Some(ControllerTick::MODE_DAMPING);
        let (text, style) = match self.status.stop(self.now_ns) {
            Some(Stop::Confirmed) => ("EMERGENCY STOP: joints damped.  r clears it", alarm()),
            Some(Stop::Sent) => ("EMERGENCY STOP sent.  r clears it", alarm()),
            Some(Stop::Failed) => ("EMERGENCY STOP NOT CONFIRMED: use the robot's stop button", alarm()),
            None if is_damped => ("SAFE STATE: the controller damps the joints.  r clears it", alarm()),
            None => ("EMERGENCY STOP:  Esc  or  x", bold(Color::Red)),
        };
        let block = Block::new().borders(Borders::ALL).border_style(style);
        frame.render_widget(Paragraph::new(Line::styled(text, style)).centered().style(style).block(block), area);
    }

    fn command(&self) -> Vec<Line<'static>> {
        // A copy: the command shown must not increase the seq of the commands sent.
        let Some(c) = self.input.clone().command(self.now_ns) else {
            if self.status.mode(self.now_ns) == Some(ControllerTick::MODE_DAMPING) {
                return vec![
                    Line::styled("no commands sent yet", bold(Color::Yellow)),
                    "The robot is damped.".into(),
                    "Press r to request IDLE.".into(),
                ];
            }
            return vec![
                Line::styled("no commands sent yet", bold(Color::Yellow)),
                "Waiting for the mode of the controller.".into(),
                "Enter requests STAND without waiting.".into(),
            ];
        };
        let Limits { orientation, height, .. } = *self.input.limits();
        let GaitLimits { name, speed, yaw_rate } = self.input.gait();
        let (speed, yaw_rate) = (*speed, *yaw_rate);
        let state = vec![
            Span::styled(enum_names::operator_mode(c.mode), bold(mode_colour(c.mode))),
            Span::raw(format!("   {name}   pace {:.0} %", self.input.pace() * 100.0)),
        ];
        vec![
            Line::from(state),
            row("forward", c.v_H[0], speed, "m/s"),
            row("left", c.v_H[1], speed, "m/s"),
            row("turn", c.yaw_rate, yaw_rate, "rad/s"),
            row("roll", c.roll, orientation, "rad"),
            row("pitch", c.pitch, orientation, "rad"),
            row("height", c.height_offset, height, "m"),
        ]
    }

    fn controller(&self) -> Vec<Line<'static>> {
        let Status { tick, rate_hz, follows, robot, commands, .. } = self.status;
        let mut lines = Vec::new();
        match tick {
            None => lines.push(Line::styled("no CONTROLLER_TICK received", bold(Color::Yellow))),
            Some((tick, at)) => {
                let age_ns = self.now_ns - at;
                let timed_out = age_ns > TIMEOUT_NS;
                let damped = tick.mode == ControllerTick::MODE_DAMPING;
                let colour = if damped { Color::Red } else { Color::Green };
                lines.push(Line::styled(
                    enum_names::mode(tick.mode),
                    bold(if timed_out { Color::DarkGray } else { colour }),
                ));
                lines.push(match tick.fault {
                    ControllerTick::FAULT_NONE => "no fault".into(),
                    fault => {
                        Line::styled(format!("{}: {:.3}", enum_names::fault(fault), tick.fault_value), bold(Color::Red))
                    }
                });
                lines.push(if timed_out {
                    Line::styled(format!("TIMED OUT {:.1} s ago", seconds(age_ns)), bold(Color::Red))
                } else {
                    Line::from(format!("tick {}, {rate_hz:.0} Hz", tick.tick))
                });
                lines.push(match follows {
                    Follows::Us => Line::styled("follows this operator", Style::new().fg(Color::Green)),
                    Follows::Another => Line::styled("follows another operator", bold(Color::Yellow)),
                    Follows::NoOperator => Line::styled("follows no operator", bold(Color::Yellow)),
                });
            }
        }
        let robot =
            robot.as_ref().map_or("limits: defaults, no RUN_INFO".to_owned(), |(name, _)| format!("limits: {name}"));
        lines.push(robot.into());
        lines.push(format!("{}: {commands} sent", self.channel).into());
        lines.push(self.pad.map_or(String::new(), |name| format!("gamepad: {name}")).into());
        lines
    }

    /// The newest events that fit, the newest last.
    fn events(&self, rows: u16) -> Vec<Line<'static>> {
        let events = &self.status.events;
        let skipped = events.len().saturating_sub(usize::from(rows));
        let line = |event: &Event| {
            let style = match event.level {
                Event::LEVEL_ERROR => bold(Color::Red),
                Event::LEVEL_WARNING => Style::new().fg(Color::Yellow),
                _ => Style::new(),
            };
            Line::styled(format!("{}: {}", event.source, event.text), style)
        };
        events.iter().skip(skipped).map(line).collect()
    }
}

fn row(name: &str, value: f64, limit: f64, unit: &str) -> Line<'static> {
    format!("{name:<8}{value:>+7.3} {} {limit:>4.2} {unit}", bar(value, limit)).into()
}

/// A value between its limits, as a bar: `|    ==.      |`.
fn bar(value: f64, limit: f64) -> String {
    let part = if limit > 0.0 { (value / limit).clamp(-1.0, 1.0) } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to BAR")]
    let filled = (part.abs() * BAR as f64).ceil() as usize;
    let cell = |distance: usize, side: bool| if side && distance < filled { '=' } else { ' ' };
    let left: String = (0..BAR).rev().map(|k| cell(k, part < 0.0)).collect();
    let right: String = (0..BAR).map(|k| cell(k, part > 0.0)).collect();
    format!("|{left}.{right}|")
}

fn mode_colour(mode: i8) -> Color {
    match mode {
        OperatorCommand::MODE_DAMPING => Color::Red,
        OperatorCommand::MODE_WALK => Color::Green,
        _ => Color::Cyan,
    }
}

fn panel(frame: &mut Frame, area: Rect, title: &'static str, lines: Vec<Line>) {
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), area);
}

fn bold(colour: Color) -> Style {
    Style::new().fg(colour).add_modifier(Modifier::BOLD)
}

fn alarm() -> Style {
    Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD)
}

#[expect(clippy::cast_precision_loss, reason = "ages are far below 2^53 ns")]
fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::teleop::{Axis, Press, Sign};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn drawn(input: &OperatorInput, status: &Status, message: &str) -> String {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        let screen = Screen { input, channel: "OPERATOR_TELEOP", status, pad: None, message, now_ns: 1_000_000_000 };
        terminal.draw(|frame| screen.draw(frame)).unwrap();
        let buffer = terminal.backend().buffer();
        let row = |y| (0..80).map(|x| buffer.cell((x, y)).unwrap().symbol()).collect::<String>();
        (0..24).map(row).collect::<Vec<_>>().join("\n")
    }

    fn status(mode: i8, fault: i32) -> Status {
        let tick = ControllerTick { mode, fault, tick: 4812, fault_value: 0.71, ..ControllerTick::default() };
        let mut status = Status::default();
        (status.tick, status.rate_hz, status.follows) = (Some((tick, 990_000_000)), 1000.2, Follows::Us);
        status
    }

    fn has(screen: &str, wanted: &[&str]) {
        for text in wanted {
            assert!(screen.contains(text), "{text:?} is not in\n{screen}");
        }
    }

    #[test]
    fn the_stop_keys_are_shown_before_the_controller_is_known() {
        let screen = drawn(&OperatorInput::new(Limits::default()), &Status::default(), "");
        has(&screen, &["EMERGENCY STOP:  Esc  or  x", "Ctrl-C end"]);
    }

    #[test]
    fn the_safe_state_is_shown_and_no_command() {
        let mut input = OperatorInput::new(Limits::default());
        input.set_robot_mode(ControllerTick::MODE_DAMPING);
        let status = status(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT);
        let screen = drawn(&input, &status, "");
        has(&screen, &["SAFE STATE", "DAMPING", enum_names::fault(ControllerTick::FAULT_TILT), "0.710"]);
        assert!(!screen.contains("m/s"), "{screen}");
    }

    #[test]
    fn a_walk_is_shown_with_its_limits() {
        let mut limits = Limits::default();
        (limits.gaits[0].speed, limits.gaits[0].yaw_rate) = (0.6, 0.8);
        let mut input = OperatorInput::new(limits);
        input.set_robot_mode(ControllerTick::MODE_STANCE);
        input.press(Press::Walk, 0).unwrap();
        input.press(Press::Move(Axis::Turn, Sign::Minus), 900_000_000).unwrap();
        let screen = drawn(&input, &status(ControllerTick::MODE_WALK, 0), "a message");
        has(
            &screen,
            &[
                "WALK   trot   pace 50 %",
                "turn     -0.400 |   ===.      | 0.80 rad/s",
                "tick 4812, 1000 Hz",
                "a message",
                "o l higher/lower",
            ],
        );
    }

    #[test]
    fn an_emergency_stop_is_shown_as_sent_confirmed_or_failed() {
        let mut input = OperatorInput::new(Limits::default());
        input.press(Press::Stop, 0).unwrap();
        let mut shown = |mode: i8, sent_ns: i64| {
            let mut status = status(mode, 0);
            status.sent(&input.command(sent_ns).unwrap());
            drawn(&input, &status, "")
        };
        has(&shown(ControllerTick::MODE_WALK, 900_000_000), &["EMERGENCY STOP sent"]);
        has(&shown(ControllerTick::MODE_DAMPING, 900_000_000), &["EMERGENCY STOP: joints damped"]);
        has(&shown(ControllerTick::MODE_WALK, 0), &["EMERGENCY STOP NOT CONFIRMED"]);
    }

    #[test]
    fn a_time_out_and_the_newest_events_are_shown() {
        let mut status = status(ControllerTick::MODE_WALK, 0);
        status.tick.as_mut().unwrap().1 = -1_500_000_000;
        for number in 0..30 {
            let text = format!("number {number}");
            status.events.push_back(Event { source: "executor".to_owned(), text, ..Event::default() });
        }
        let screen = drawn(&OperatorInput::new(Limits::default()), &status, "");
        has(&screen, &["2.5 s", "executor: number 29"]);
        assert!(!screen.contains("number 20 "), "{screen}");
    }

    #[test]
    fn a_bar_shows_direction_and_part() {
        assert_eq!(bar(0.0, 1.0), "|      .      |");
        assert_eq!(bar(1.0, 1.0), "|      .======|");
        assert_eq!(bar(-0.25, 1.0), "|    ==.      |");
        assert_eq!(bar(0.001, 1.0), "|      .=     |", "a small value is visible");
        assert_eq!(bar(1.0, 0.0), bar(f64::NAN, 1.0));
    }
}
