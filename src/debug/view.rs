//! The screen: one tick at a glance.

use super::events::{Event, Kind};
use super::layout::{Column, Row, cut, join, table, text_width};
use controller::dump::{ContactSummary, LevelSummary, Overview, PhaseKind, Quantity, Value};
use controller::qp::QpStatus;
use lcmtypes::{ControllerTick, Message, RobotCommand, RunInfo, channels, enum_names};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};
use replay::engine::Moment;

/// Keys and what they do.
const KEYS: [&str; 12] = [
    "←→ tick",
    "↑↓ 10",
    "PgUp/PgDn 100",
    "b/s state",
    "n/N event",
    "t touchdown",
    "f QP",
    "m late",
    "d differs",
    "e EVENT",
    "g go to",
    "q quit",
];
/// Rows from which on panels have room to spare.
const TALL: u16 = 30;

/// What the screen shows.
pub struct Screen<'a> {
    /// Name of the log.
    pub log: &'a str,
    /// Description of the run.
    pub info: &'a RunInfo,
    /// Names of the joints, in URDF order; empty if the URDF of the log cannot be read.
    pub joints: &'a [String],
    /// Last tick of the log.
    pub last_tick: i64,
    /// The tick shown.
    pub moment: &'a Moment,
    /// Events of the tick.
    pub events: &'a [Event],
    /// Result of the last key; may be empty.
    pub message: &'a str,
}

impl Screen<'_> {
    /// Draws the screen. A panel that has no room for all its lines gives the number of missing ones; a line that is too long ends with `…`.
    pub fn draw(&self, frame: &mut Frame) {
        let area = frame.area();
        let tall = u16::from(area.height >= TALL);
        let n_contacts = u16::try_from(self.overview().contacts.len().max(1)).unwrap_or(u16::MAX);
        let rows = [
            Constraint::Length(2),
            Constraint::Length(n_contacts.saturating_add(2 + tall)),
            Constraint::Length(6 + tall),
            Constraint::Min(5),
            Constraint::Length(2 + 3 * tall),
            Constraint::Length(if text_width(&KEYS.join("  ")) <= columns(area) { 2 } else { 3 }),
        ];
        let [head, contacts, base, qp, events, foot] = Layout::vertical(rows).areas(area);
        self.head(frame, head);
        self.contacts(frame, contacts);
        let [left, right] = halves(base);
        panel(frame, left, "Base", self.base(columns(left)));
        panel(frame, right, "Feed-forward torques, URDF order (N m)", self.command(columns(right)));
        let [left, right] = halves(qp);
        panel(frame, left, "Tasks: weight, |A x - b|", self.tasks(columns(left)));
        let conflict = self.overview().conflict.is_some();
        let title = if conflict { "Constraints that contradict each other" } else { "Active constraints" };
        panel(frame, right, title, self.constraints(columns(right)));
        panel(frame, events, "Events", self.events(columns(events)));
        self.foot(frame, foot);
    }

    fn overview(&self) -> &Overview {
        &self.moment.dump.overview
    }

    /// The replayed message of a type.
    fn message<M: Message>(&self, channel: &str) -> Option<M> {
        M::decode(self.moment.replayed(channel)?).ok()
    }

    fn head(&self, frame: &mut Frame, area: Rect) {
        let Moment { tick, since_s, divergence, is_snapshot, .. } = self.moment;
        let bold = |text: String| Span::styled(text, Style::new().add_modifier(Modifier::BOLD));
        let mode = self.message::<ControllerTick>(channels::CONTROLLER_TICK).map_or("-", |t| enum_names::mode(t.mode));
        let verdict = match divergence {
            None if self.moment.recorded.is_empty() => Span::styled("nothing recorded", Style::new().fg(Color::Yellow)),
            None => Span::styled("agrees with the record", Style::new().fg(Color::Green)),
            Some(d) => Span::styled(
                format!("DIFFERS in stage {}: {} {}", d.stage, d.channel, d.field),
                Style::new().fg(Color::Red).add_modifier(Modifier::BOLD),
            ),
        };
        let mut place = vec![
            bold(format!("tick {tick} of {}", self.last_tick)),
            bold(format!("{since_s:.3} s")),
            bold(mode.to_owned()),
            verdict,
        ];
        if *is_snapshot {
            place.push(bold("[state recorded]".to_owned()));
        }
        let title = format!("{}  {} {}", self.log, self.info.robot, self.info.scenario_name);
        let width = columns(area);
        frame.render_widget(Paragraph::new(vec![cut(&title, width), join(place, "  ", width)]), area);
    }

    fn foot(&self, frame: &mut Frame, area: Rect) {
        let width = columns(area);
        let mut lines = vec![cut(self.message, width).style(Style::new().fg(Color::Yellow))];
        let mut keys = &KEYS[..];
        for row in (0..area.height.saturating_sub(1)).rev() {
            let fitting = (1..=keys.len()).rev().find(|n| text_width(&keys[..*n].join("  ")) <= width).unwrap_or(0);
            let shown = if row == 0 { keys.len() } else { fitting };
            let parts = keys[..shown].iter().map(|key| Span::raw(*key)).collect();
            lines.push(join(parts, "  ", width).style(Style::new().fg(Color::DarkGray)));
            keys = &keys[shown..];
        }
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn contacts(&self, frame: &mut Frame, area: Rect) {
        let mut title = "Contacts".to_owned();
        if let Some(gait) = &self.overview().gait {
            title += &format!(": {} gait, clock {:.3} s", gait.name, gait.clock);
        }
        title += " (fz in N, t in s, p_des in H in m)";
        let contacts = &self.overview().contacts;
        let lines = if contacts.is_empty() { vec![not_computed()] } else { contact_table(contacts, columns(area)) };
        panel(frame, area, &title, lines);
    }

    fn base(&self, width: usize) -> Vec<Line<'static>> {
        let base = &self.overview().base;
        if base.is_empty() {
            return vec![not_computed()];
        }
        let label = |q: &Quantity| if q.unit.is_empty() { q.name.clone() } else { format!("{} ({})", q.name, q.unit) };
        let label_width = base.iter().map(|q| text_width(&label(q))).max().unwrap_or(0);
        let line = |q: &Quantity| {
            let mut parts = vec![Span::raw(format!("{:<label_width$}", label(q)))];
            parts.extend(values(&q.value).into_iter().map(Span::raw));
            join(parts, " ", width)
        };
        base.iter().map(line).collect()
    }

    fn command(&self, width: usize) -> Vec<Line<'static>> {
        let mut lines = Vec::new();
        if let Some(tick) = self.message::<ControllerTick>(channels::CONTROLLER_TICK)
            && tick.fault != ControllerTick::FAULT_NONE
        {
            let red = Style::new().fg(Color::Red);
            lines.push(cut(&format!("fault: {}", enum_names::fault(tick.fault)), width).style(red));
            let mut parts = vec![Span::raw(format!("value {:.3}", tick.fault_value))];
            if let Some(joint) = self.joint_of_fault(&tick) {
                parts.push(Span::raw(joint.clone()));
            }
            lines.push(join(parts, ", ", width).style(red));
        }
        let Some(command) = self.message::<RobotCommand>(channels::ROBOT_COMMAND) else { return lines };
        let texts: Vec<String> = command.tau.iter().map(|tau| format!("{tau:.1}")).collect();
        let cell = texts.iter().map(|text| text_width(text)).max().unwrap_or(0).max(7);
        let fitting = ((width + 1) / (cell + 1)).clamp(1, 6);
        // A multiple of three keeps the joints of a leg together.
        let per_row = if fitting >= 3 { fitting / 3 * 3 } else { fitting };
        for row in texts.chunks(per_row) {
            lines.push(join(row.iter().map(|text| Span::raw(format!("{text:>cell$}"))).collect(), " ", width));
        }
        lines
    }

    /// Name of the joint that a fault of one joint is about.
    fn joint_of_fault(&self, tick: &ControllerTick) -> Option<&String> {
        let of_joint = [
            ControllerTick::FAULT_JOINT_POSITION,
            ControllerTick::FAULT_JOINT_VELOCITY,
            ControllerTick::FAULT_JOINT_TORQUE,
            ControllerTick::FAULT_POSTURE,
        ];
        let index = usize::try_from(tick.fault_index).ok().filter(|_| of_joint.contains(&tick.fault))?;
        self.joints.get(index)
    }

    fn tasks(&self, width: usize) -> Vec<Line<'static>> {
        let levels = &self.overview().levels;
        if levels.is_empty() {
            return vec![not_computed()];
        }
        levels.iter().enumerate().flat_map(|(k, level)| level_lines(k, level, width)).collect()
    }

    fn constraints(&self, width: usize) -> Vec<Line<'static>> {
        let Overview { conflict, levels, .. } = self.overview();
        if let Some(conflict) = conflict {
            let red = Style::new().fg(Color::Red);
            return conflict
                .iter()
                .map(|violation| cut(&format!("by {:.3}: {}", violation.by, violation.name), width).style(red))
                .collect();
        }
        if levels.is_empty() {
            return vec![not_computed()];
        }
        let of_level = |(k, level): (usize, &LevelSummary)| -> Vec<Line<'static>> {
            level.active.iter().map(|name| cut(&format!("{}: {name}", k + 1), width)).collect()
        };
        let lines: Vec<Line> = levels.iter().enumerate().flat_map(of_level).collect();
        if lines.is_empty() { vec![dim("none")] } else { lines }
    }

    fn events(&self, width: usize) -> Vec<Line<'static>> {
        let line = |event: &Event| {
            let color = match event.kind {
                Kind::Touchdown => Color::Cyan,
                Kind::Event => Color::Reset,
                Kind::QpFailure | Kind::MissedDeadline | Kind::Divergence => Color::Red,
            };
            let mut spans = vec![Span::raw(format!("{:<16}", event.kind.name()))];
            spans.extend(cut(&event.text, width.saturating_sub(16)).spans);
            Line::from(spans).style(Style::new().fg(color))
        };
        self.events.iter().map(line).collect()
    }
}

fn contact_table(contacts: &[ContactSummary], width: usize) -> Vec<Line<'static>> {
    let column = |title, right| Column { title, right };
    let columns = [
        column("", false),
        column("phase", false),
        column("t", true),
        column("contact", false),
        column("fz est", true),
        column("fz QP", true),
        column("fz bounds", true),
        column("p_des", true),
    ];
    let missing = || "-".to_owned();
    let number = |x: Option<f64>, decimals: usize| x.map_or_else(missing, |x| format!("{x:.decimals$}"));
    let row = |contact: &ContactSummary| {
        let ContactSummary { name, phase, t_phase, in_contact, f_z_est, f_z_qp, f_z_bounds, p_des } = contact;
        let color = match phase.map(|phase| phase.kind) {
            Some(PhaseKind::Stance) => Color::Reset,
            Some(PhaseKind::Swing) => Color::Cyan,
            Some(PhaseKind::Unplanned) | None => Color::Yellow,
        };
        let cells = vec![
            name.clone(),
            phase.map_or_else(missing, |phase| phase.name.to_owned()),
            number(*t_phase, 3),
            in_contact.map_or_else(missing, |yes| if yes { "●" } else { "·" }.to_owned()),
            number(*f_z_est, 1),
            number(*f_z_qp, 1),
            f_z_bounds.map_or_else(missing, |[lower, upper]| format!("{lower:.0}..{upper:.0}")),
            p_des.map_or_else(missing, |p| p.map(|x| format!("{x:+.3}")).join(" ")),
        ];
        Row { cells, color }
    };
    table(&columns, &contacts.iter().map(row).collect::<Vec<_>>(), width)
}

fn level_lines(k: usize, level: &LevelSummary, width: usize) -> Vec<Line<'static>> {
    let status = level.status;
    let mut parts = vec![Span::raw(format!("level {}: {}", k + 1, level.status_name()))];
    if status.is_some() {
        parts.push(Span::raw(format!("{} iter.", level.iterations)));
        parts.push(Span::raw(format!("{} active", level.n_active)));
    }
    let color = if status == Some(QpStatus::Solved) { Color::Green } else { Color::Red };
    let mut lines = vec![join(parts, ", ", width).style(Style::new().fg(color))];
    let columns = [("", false), ("", true), ("", true)].map(|(title, right)| Column { title, right });
    let rows: Vec<Row> = level
        .terms
        .iter()
        .map(|term| Row {
            cells: vec![format!("  {}", term.task), format!("{:e}", term.weight), format!("{:.2e}", term.residual)],
            color: Color::Reset,
        })
        .collect();
    lines.extend(table(&columns, &rows, width));
    lines
}

/// The numbers of a value, or its name.
fn values(value: &Value) -> Vec<String> {
    match value {
        Value::Flag(v) => vec![v.to_string()],
        Value::Integer(v) => vec![v.to_string()],
        Value::Number(v) => vec![format!("{v:.4}")],
        Value::Text(v) => vec![v.clone()],
        Value::Numbers(v) => v.iter().map(|x| format!("{x:+.4}")).collect(),
        Value::Matrix(_) | Value::List(_) | Value::Group(_) => Vec::new(),
    }
}

/// Left and right half, with a gap between them.
fn halves(area: Rect) -> [Rect; 2] {
    Layout::horizontal([Constraint::Percentage(50); 2]).spacing(2).areas(area)
}

fn columns(area: Rect) -> usize {
    usize::from(area.width)
}

/// Lines below a title. If there is no room for all of them, the last line gives the number of missing ones.
fn panel(frame: &mut Frame, area: Rect, title: &str, mut lines: Vec<Line<'static>>) {
    let title = cut(title, columns(area).saturating_sub(2));
    let mut padded = vec![Span::raw(" ")];
    padded.extend(title.spans);
    padded.push(Span::raw(" "));
    let border = Style::new().fg(Color::DarkGray);
    let block = Block::new().borders(Borders::TOP).title(Line::from(padded)).border_style(border);
    let room = usize::from(block.inner(area).height);
    if lines.len() > room {
        let shown = room.saturating_sub(1);
        let more = format!("… {} more", lines.len() - shown);
        let more = if text_width(&more) <= columns(area) { more } else { "…".to_owned() };
        lines.truncate(shown);
        lines.push(dim(&more));
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn dim(text: &str) -> Line<'static> {
    Line::styled(text.to_owned(), Style::new().fg(Color::DarkGray))
}

fn not_computed() -> Line<'static> {
    dim("not computed in this tick")
}
