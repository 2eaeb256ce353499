//! The screen: one tick at a glance.

use super::events::{Event, Kind};
use controller::dump::Quantity;
use lcmtypes::RunInfo;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};
use replay::engine::Moment;

/// As long as a screen of 100 columns is wide.
const HELP: &str =
    "←→ tick ↑↓ 10 PgUp/Dn 100 b/s state n/N event t touchdown f QP m late d differs e EVENT g go q quit";

/// All that is shown.
pub struct Screen<'a> {
    /// Name of the log.
    pub log: &'a str,
    /// What the log says of its run.
    pub info: &'a RunInfo,
    /// Last tick of the log.
    pub last_tick: i64,
    /// The tick shown.
    pub moment: &'a Moment,
    /// What happened in it.
    pub events: &'a [Event],
    /// What the last key led to, if it is worth saying.
    pub message: &'a str,
}

impl Screen<'_> {
    /// Draws it; what does not fit is cut.
    pub fn draw(&self, frame: &mut Frame) {
        let rows = [
            Constraint::Length(2),
            Constraint::Length(7),
            Constraint::Length(7),
            Constraint::Min(6),
            Constraint::Length(5),
            Constraint::Length(2),
        ];
        let [head, legs, base, qp, events, foot] = Layout::vertical(rows).areas(frame.area());
        self.head(frame, head);
        panel(frame, legs, "Legs", self.legs());
        let [left, right] = Layout::horizontal([Constraint::Percentage(50); 2]).areas(base);
        panel(frame, left, "Base", self.base());
        panel(frame, right, "Command", self.command());
        let [left, right] = Layout::horizontal([Constraint::Percentage(50); 2]).areas(qp);
        panel(frame, left, "Tasks and programs", self.tasks());
        panel(
            frame,
            right,
            if self.failed() { "Constraints that contradict each other" } else { "Active constraints" },
            self.active(),
        );
        panel(frame, events, "Events", self.events());
        let message = Line::styled(self.message.to_owned(), Style::new().fg(Color::Yellow));
        frame.render_widget(Paragraph::new(vec![message, dim(HELP)]), foot);
    }

    fn head(&self, frame: &mut Frame, area: Rect) {
        let Moment { tick, since_s, divergence, is_snapshot, .. } = self.moment;
        let mode = self.text("output.mode");
        let state = if *is_snapshot { "  [state recorded]" } else { "" };
        let verdict = match divergence {
            None if self.moment.recorded.is_empty() => Span::styled("nothing recorded", Style::new().fg(Color::Yellow)),
            None => Span::styled("agrees with the record", Style::new().fg(Color::Green)),
            Some(d) => Span::styled(
                format!("DIFFERS in stage {}: {} {}", d.stage, d.channel, d.field),
                Style::new().fg(Color::Red).add_modifier(Modifier::BOLD),
            ),
        };
        let title = format!("{}  {} {}", self.log, self.info.robot, self.info.scenario_name);
        let place = format!("tick {tick} of {}  {since_s:.3} s  {mode}{state}  ", self.last_tick);
        let bold = Style::new().add_modifier(Modifier::BOLD);
        let lines = vec![Line::from(title), Line::from(vec![Span::styled(place, bold), verdict])];
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn legs(&self) -> Vec<Line<'static>> {
        let head = format!(
            "{:<4}{:<11}{:>7}{:>9}{:>10}{:>10}{:>16}  {:<24}",
            "", "phase", "t (s)", "contact", "est fz", "QP fz", "bounds fz (N)", "foot reference, H (m)"
        );
        let mut lines = vec![dim(&head)];
        for leg in lcmtypes::enum_names::LEGS {
            let phase = self.text(&format!("gait.legs.{leg}.phase"));
            let contact = matches!(self.get(&format!("estimation.legs.{leg}.contact")), Some(Quantity::Flag(true)));
            let z = |path: &str| self.numbers(path).get(2).copied();
            let bounds = self.numbers(&format!("tasks.f_z_bounds.{leg}"));
            let bounds =
                if bounds.len() == 2 { format!("{:.0} … {:.0}", bounds[0], bounds[1]) } else { "-".to_owned() };
            let foot: Vec<String> =
                self.numbers(&format!("gait.legs.{leg}.p_BF_H_des")).iter().map(|x| format!("{x:+.3}")).collect();
            let t = match self.get(&format!("gait.legs.{leg}.t_leg")) {
                Some(Quantity::Number(t)) if t.is_finite() => format!("{t:.3}"),
                _ => "-".to_owned(),
            };
            let text = format!(
                "{leg:<4}{phase:<11}{t:>7}{:>9}{:>10}{:>10}{bounds:>16}  {:<24}",
                if contact { "●" } else { "·" },
                number(z(&format!("estimation.legs.{leg}.f_F_W")), 1),
                number(z(&format!("qp.f_F_W.{leg}")), 1),
                foot.join(" ")
            );
            let color = match phase.as_str() {
                "Stance" => Color::Reset,
                "SwingUp" | "SwingDown" => Color::Cyan,
                _ => Color::Yellow,
            };
            lines.push(Line::styled(text, Style::new().fg(color)));
        }
        lines
    }

    fn base(&self) -> Vec<Line<'static>> {
        let three = |path: &str| {
            let texts: Vec<String> = self.numbers(path).iter().map(|x| format!("{x:+.4}")).collect();
            texts.join(" ")
        };
        vec![
            Line::from(format!("roll pitch yaw  {}", three("estimation.rpy"))),
            Line::from(format!("error (rad)     {}", three("tasks.e_o_W"))),
            Line::from(format!("height (m)      {}", number(self.number("estimation.height"), 4))),
            Line::from(format!("v command, H    {}", three("gait.v_H_des"))),
            Line::from(format!(
                "{} gait, clock {} s",
                self.text("gait.gait"),
                number(self.number("gait.gait_clock"), 3)
            )),
        ]
    }

    fn command(&self) -> Vec<Line<'static>> {
        let tau = self.numbers("output.tau");
        let mut lines = vec![dim("joint torques, URDF order (N m)")];
        for row in tau.chunks(6) {
            let texts: Vec<String> = row.iter().map(|x| format!("{x:>7.1}")).collect();
            lines.push(Line::from(texts.join(" ")));
        }
        let code = self.get("output.fault_code");
        if !matches!(code, None | Some(Quantity::Integer(0))) {
            let value = number(self.number("output.fault_value"), 3);
            lines.push(Line::styled(format!("fault {}, value {value}", shown(code)), Style::new().fg(Color::Red)));
        }
        lines
    }

    fn tasks(&self) -> Vec<Line<'static>> {
        let mut lines = Vec::new();
        let levels = if let Some(Quantity::List(levels)) = self.get("qp.levels") { &levels[..] } else { &[] };
        for (k, level) in levels.iter().enumerate() {
            let status = shown(level.get("status"));
            let line = format!(
                "level {}: {status}, {} iterations, {} active",
                k + 1,
                shown(level.get("iterations")),
                shown(level.get("n_active"))
            );
            let color = if status == "Solved" { Color::Green } else { Color::Red };
            lines.push(Line::styled(line, Style::new().fg(color)));
            let terms = if let Some(Quantity::List(terms)) = level.get("terms") { &terms[..] } else { &[] };
            for term in terms {
                let of = |name: &str| match term.get(name) {
                    Some(Quantity::Number(x)) => *x,
                    _ => f64::NAN,
                };
                let (weight, residual) = (of("weight"), of("residual"));
                let text = format!("  {:<10} weight {weight:<7e} |A vd - b| {residual:.2e}", shown(term.get("task")));
                lines.push(Line::from(text));
            }
        }
        if lines.is_empty() {
            lines.push(dim("not computed in this tick"));
        }
        lines
    }

    fn failed(&self) -> bool {
        self.get("qp.conflict").is_some()
    }

    fn active(&self) -> Vec<Line<'static>> {
        if let Some(Quantity::List(conflict)) = self.get("qp.conflict") {
            let line = |c: &Quantity| {
                let by = if let Some(Quantity::Number(by)) = c.get("by") { *by } else { f64::NAN };
                Line::styled(format!("{} by {by:.3}", shown(c.get("constraint"))), Style::new().fg(Color::Red))
            };
            return conflict.iter().map(line).collect();
        }
        let Some(Quantity::List(levels)) = self.get("qp.levels") else { return vec![dim("-")] };
        let names = levels.iter().enumerate().flat_map(|(k, level)| match level.get("active") {
            Some(Quantity::List(names)) => {
                names.iter().map(|name| format!("{}: {}", k + 1, shown(Some(name)))).collect()
            }
            _ => Vec::new(),
        });
        let lines: Vec<Line> = names.map(Line::from).collect();
        if lines.is_empty() { vec![dim("none")] } else { lines }
    }

    fn events(&self) -> Vec<Line<'static>> {
        let line = |event: &Event| {
            let color = match event.kind {
                Kind::Touchdown => Color::Cyan,
                Kind::Event => Color::Reset,
                Kind::QpFailure | Kind::MissedDeadline | Kind::Divergence => Color::Red,
            };
            Line::styled(format!("{:<16}{}", event.kind.name(), event.text), Style::new().fg(color))
        };
        self.events.iter().map(line).collect()
    }

    fn get(&self, path: &str) -> Option<&Quantity> {
        self.moment.dump.0.get(path)
    }

    fn text(&self, path: &str) -> String {
        shown(self.get(path))
    }

    fn number(&self, path: &str) -> Option<f64> {
        if let Some(Quantity::Number(x)) = self.get(path) { Some(*x) } else { None }
    }

    fn numbers(&self, path: &str) -> &[f64] {
        if let Some(Quantity::Numbers(x)) = self.get(path) { x } else { &[] }
    }
}

/// Lines below a title; the last says how many there was no room for.
fn panel(frame: &mut Frame, area: Rect, title: &str, mut lines: Vec<Line<'static>>) {
    let block =
        Block::new().borders(Borders::TOP).title(format!(" {title} ")).border_style(Style::new().fg(Color::DarkGray));
    let room = usize::from(block.inner(area).height);
    if lines.len() > room {
        let shown = room.saturating_sub(1);
        let more = dim(&format!("… {} more", lines.len() - shown));
        lines.truncate(shown);
        lines.push(more);
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn dim(text: &str) -> Line<'static> {
    Line::styled(text.to_owned(), Style::new().fg(Color::DarkGray))
}

fn number(x: Option<f64>, decimals: usize) -> String {
    x.map_or("-".to_owned(), |x| format!("{x:.decimals$}"))
}

fn shown(quantity: Option<&Quantity>) -> String {
    match quantity {
        Some(Quantity::Text(text)) => text.clone(),
        Some(Quantity::Integer(x)) => x.to_string(),
        Some(Quantity::Number(x)) => format!("{x}"),
        Some(Quantity::Flag(x)) => x.to_string(),
        _ => "-".to_owned(),
    }
}
