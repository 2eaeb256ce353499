//! The screen: how to stop the robot, what is asked of it, what it says. It fits a terminal of 80 by 24.

use super::link::{Follows, Heard, SILENCE_NS};
use drivers::teleop::{Desk, Limits};
use lcmtypes::{ControllerTick, Event, OperatorCommand, enum_names};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

/// Characters of a bar to either side of its middle.
const BAR: usize = 6;

const HELP: [&str; 3] = [
    "Space walk/stop  Enter stand up/sit  r level/no torque/stop back  Ctrl-C end",
    "w s forward/back   q e left/right   a d turn   + - pace        (hold to move)",
    "o l higher/lower   u j nose up/down   h k roll   g gait        (stays as set)",
];

/// All that is shown.
pub struct Screen<'a> {
    /// What the person has set.
    pub desk: &'a Desk,
    /// Where it goes.
    pub channel: &'a str,
    /// What came back.
    pub heard: &'a Heard,
    /// Name of the pad.
    pub pad: Option<&'a str>,
    /// Why a key did nothing.
    pub message: &'a str,
    /// Now.
    pub now_ns: i64,
}

/// A mode that is asked for, as a word.
pub fn mode(mode: i8) -> &'static str {
    match mode {
        OperatorCommand::MODE_STAND => "STAND",
        OperatorCommand::MODE_WALK => "WALK",
        OperatorCommand::MODE_DAMPING => "EMERGENCY STOP",
        OperatorCommand::MODE_SIT => "SIT",
        OperatorCommand::MODE_IDLE => "IDLE",
        _ => "?",
    }
}

impl Screen<'_> {
    /// Draws it; what does not fit is cut from the end of the events.
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

    /// The emergency stop: always there, never scrolled away.
    fn stop(&self, frame: &mut Frame, area: Rect) {
        let stopped = self.desk.mode() == Some(OperatorCommand::MODE_DAMPING);
        let saved = self.heard.mode(self.now_ns) == Some(ControllerTick::MODE_DAMPING);
        let (text, style) = match (stopped, saved) {
            (true, true) => ("EMERGENCY STOP: joints are damped.  r takes it back", alarm()),
            (true, false) => ("EMERGENCY STOP is sent.  r takes it back", alarm()),
            (false, true) => ("THE ROBOT HAS STOPPED ITSELF: joints are damped.  r takes it back", alarm()),
            (false, false) => ("EMERGENCY STOP:  Esc  or  x", bold(Color::Red)),
        };
        let block = Block::new().borders(Borders::ALL).border_style(style);
        frame.render_widget(Paragraph::new(Line::styled(text, style)).centered().style(style).block(block), area);
    }

    fn command(&self) -> Vec<Line<'static>> {
        // A copy, since what is shown must not count as sent.
        let Some(c) = self.desk.clone().command(self.now_ns) else {
            if self.heard.mode(self.now_ns) == Some(ControllerTick::MODE_DAMPING) {
                return vec![
                    Line::styled("nothing is sent yet", bold(Color::Yellow)),
                    "The robot is damped, and stays so".into(),
                    "until r takes it back.".into(),
                ];
            }
            return vec![
                Line::styled("nothing is sent yet", bold(Color::Yellow)),
                "Waiting for the controller, to begin with".into(),
                "what the robot does. Enter sends STAND".into(),
                "without waiting.".into(),
            ];
        };
        let Limits { speed, yaw_rate, orientation, height } = self.desk.limits();
        let gait = if c.gait == OperatorCommand::GAIT_CRAWL { "crawl" } else { "trot" };
        let state = vec![
            Span::styled(mode(c.mode), bold(mode_colour(c.mode))),
            Span::raw(format!("   {gait}   pace {:.0} %", self.desk.pace() * 100.0)),
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
        let Heard { tick, rate_hz, follows, robot, commands, .. } = self.heard;
        let mut lines = Vec::new();
        match tick {
            None => lines.push(Line::styled("nothing heard of it", bold(Color::Yellow))),
            Some((tick, at)) => {
                let age_ns = self.now_ns - at;
                let silent = age_ns > SILENCE_NS;
                let damped = tick.mode == ControllerTick::MODE_DAMPING;
                let colour = if damped { Color::Red } else { Color::Green };
                lines.push(Line::styled(
                    enum_names::mode(tick.mode),
                    bold(if silent { Color::DarkGray } else { colour }),
                ));
                lines.push(match tick.fault {
                    ControllerTick::FAULT_NONE => "no fault".into(),
                    fault => {
                        Line::styled(format!("{}: {:.3}", enum_names::fault(fault), tick.fault_value), bold(Color::Red))
                    }
                });
                lines.push(if silent {
                    Line::styled(format!("SILENT for {:.1} s", seconds(age_ns)), bold(Color::Red))
                } else {
                    Line::from(format!("tick {}, {rate_hz:.0} Hz", tick.tick))
                });
                lines.push(match follows {
                    Follows::Us => Line::styled("follows this operator", Style::new().fg(Color::Green)),
                    Follows::Another => Line::styled("follows another operator", bold(Color::Yellow)),
                    Follows::Nobody => Line::styled("follows nobody", bold(Color::Yellow)),
                });
            }
        }
        let robot =
            robot.as_ref().map_or("limits: defaults, no RUN_INFO".to_owned(), |(name, _)| format!("limits: {name}'s"));
        lines.push(robot.into());
        lines.push(format!("{}: {commands} sent", self.channel).into());
        lines.push(self.pad.map_or(String::new(), |name| format!("pad: {name}")).into());
        lines
    }

    /// The newest ones that fit, the newest last.
    fn events(&self, rows: u16) -> Vec<Line<'static>> {
        let events = &self.heard.events;
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

/// A value between its limits: `|    ==.      |`.
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

#[expect(clippy::cast_precision_loss, reason = "a silence for a person to read")]
fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivers::teleop::{Axis, Press, Sign};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn drawn(desk: &Desk, heard: &Heard, message: &str) -> String {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        let screen = Screen { desk, channel: "OPERATOR_TELEOP", heard, pad: None, message, now_ns: 1_000_000_000 };
        terminal.draw(|frame| screen.draw(frame)).unwrap();
        let buffer = terminal.backend().buffer();
        let row = |y| (0..80).map(|x| buffer.cell((x, y)).unwrap().symbol()).collect::<String>();
        (0..24).map(row).collect::<Vec<_>>().join("\n")
    }

    fn heard(mode: i8, fault: i32) -> Heard {
        let tick = ControllerTick { mode, fault, tick: 4812, fault_value: 0.71, ..ControllerTick::default() };
        let mut heard = Heard::default();
        (heard.tick, heard.rate_hz, heard.follows) = (Some((tick, 990_000_000)), 1000.2, Follows::Us);
        heard
    }

    fn has(screen: &str, wanted: &[&str]) {
        for text in wanted {
            assert!(screen.contains(text), "{text:?} is not in\n{screen}");
        }
    }

    #[test]
    fn before_anything_is_known_the_stop_is_there() {
        let screen = drawn(&Desk::new(Limits::default()), &Heard::default(), "");
        has(&screen, &["EMERGENCY STOP:  Esc  or  x", "nothing is sent yet", "nothing heard of it", "Ctrl-C end"]);
    }

    #[test]
    fn at_a_damped_robot_nothing_is_sent() {
        let mut desk = Desk::new(Limits::default());
        desk.hear(ControllerTick::MODE_DAMPING);
        let screen = drawn(&desk, &heard(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT), "");
        has(&screen, &["THE ROBOT HAS STOPPED ITSELF", "nothing is sent yet", "until r takes it back."]);
    }

    #[test]
    fn a_walk_is_seen_with_its_limits() {
        let mut desk = Desk::new(Limits { speed: 0.6, yaw_rate: 0.8, orientation: 0.35, height: 0.12 });
        desk.hear(ControllerTick::MODE_STANCE);
        desk.press(Press::Walk, 0).unwrap();
        desk.press(Press::Move(Axis::Turn, Sign::Minus), 900_000_000).unwrap();
        let screen = drawn(&desk, &heard(ControllerTick::MODE_WALK, 0), "Space begins to walk");
        has(
            &screen,
            &[
                "WALK   trot   pace 50 %",
                "turn     -0.400 |   ===.      | 0.80 rad/s",
                "no fault",
                "tick 4812, 1000 Hz",
            ],
        );
        has(&screen, &["follows this operator", "Space begins to walk", "o l higher/lower"]);
    }

    #[test]
    fn a_stop_is_told_apart_by_who_wanted_it() {
        let mut desk = Desk::new(Limits::default());
        desk.hear(ControllerTick::MODE_STANCE);
        let saved = heard(ControllerTick::MODE_DAMPING, ControllerTick::FAULT_TILT);
        has(&drawn(&desk, &saved, ""), &["THE ROBOT HAS STOPPED ITSELF", "tilt (rad): 0.710", "DAMPING"]);
        desk.press(Press::Stop, 0).unwrap();
        has(&drawn(&desk, &saved, ""), &["EMERGENCY STOP: joints are damped.  r takes it back"]);
        has(&drawn(&desk, &heard(ControllerTick::MODE_WALK, 0), ""), &["EMERGENCY STOP is sent."]);
    }

    #[test]
    fn a_silent_controller_and_the_newest_events_are_seen() {
        let mut heard = heard(ControllerTick::MODE_WALK, 0);
        heard.tick.as_mut().unwrap().1 = -1_500_000_000;
        for number in 0..30 {
            let text = format!("number {number}");
            heard.events.push_back(Event { source: "executor".to_owned(), text, ..Event::default() });
        }
        let screen = drawn(&Desk::new(Limits::default()), &heard, "");
        has(&screen, &["SILENT for 2.5 s", "executor: number 29"]);
        assert!(!screen.contains("number 20 "), "{screen}");
    }

    #[test]
    fn a_bar_shows_direction_and_part() {
        assert_eq!(bar(0.0, 1.0), "|      .      |");
        assert_eq!(bar(1.0, 1.0), "|      .======|");
        assert_eq!(bar(-0.25, 1.0), "|    ==.      |");
        assert_eq!(bar(0.001, 1.0), "|      .=     |", "a little is not nothing");
        assert_eq!(bar(1.0, 0.0), bar(f64::NAN, 1.0));
    }
}
