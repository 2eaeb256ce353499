//! Draws the screen.

use super::curve::Curve;
use super::help;
use super::plot;
use super::processes::Processes;
use super::screen_data::ScreenData;
use super::state::{Page, State};
use super::table::{self, Column};
use super::tree::{self, Decoded};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph, Wrap};
use replay::traffic::Row;

/// Width from which channels and message are shown side by side.
const WIDE: u16 = 150;
/// Curves shown below the table.
const STRIP: usize = 4;
/// Columns of a field's name beside its bars.
const NAME: usize = 34;

/// Everything that is drawn.
pub struct Screen<'a> {
    /// Network, or log with position and speed.
    pub title: &'a str,
    /// The source is a log.
    pub is_log: bool,
    /// The display is frozen; counting continues.
    pub is_frozen: bool,
    /// Status of the recording.
    pub recording: Option<String>,
    /// Result of the last key, if any.
    pub message: &'a str,
    /// Text while no message has been received.
    pub no_data_text: &'a str,
    /// Alarm conditions and how often each was raised.
    pub alarms: Vec<(String, u64)>,
    pub screen_data: &'a ScreenData,
    pub state: &'a State,
    /// Programs of the senders.
    pub processes: &'a Processes,
}

impl Screen<'_> {
    /// Draws everything; text that does not fit is truncated.
    pub fn draw(&self, frame: &mut Frame) {
        let rows = [Constraint::Length(2), Constraint::Min(3), Constraint::Length(2)];
        let [head, body, foot] = Layout::vertical(rows).areas(frame.area());
        self.head(frame, head);
        match self.state.page {
            _ if self.screen_data.is_empty && self.state.page != Page::Help => {
                frame.render_widget(Paragraph::new(self.no_data_text).wrap(Wrap { trim: false }), body);
            }
            Page::Channels | Page::Message if body.width >= WIDE => {
                let [left, right] =
                    Layout::horizontal([Constraint::Percentage(55), Constraint::Percentage(45)]).areas(body);
                self.channels(frame, left);
                self.message(frame, right);
            }
            Page::Channels => self.channels(frame, body),
            Page::Message => self.message(frame, body),
            Page::Plot => plot::draw(frame, body, self.screen_data, self.state),
            Page::Network => self.network(frame, body),
            Page::Help => frame.render_widget(Paragraph::new(help::text(self.is_log)).wrap(Wrap { trim: false }), body),
        }
        self.foot(frame, foot);
    }

    fn head(&self, frame: &mut Frame, area: Rect) {
        let ScreenData { rows, lost_duplicate_late: [lost, twice, late], raised, .. } = self.screen_data;
        let sum = |of: fn(&Row) -> f64| rows.iter().map(of).fold(0.0, |sum, one| sum + one);
        let mut first = vec![bold(self.title.to_owned()), Span::raw(format!("  {} channels", rows.len()))];
        if !self.is_log {
            let style = if *lost > 0 { Style::new().fg(Color::Yellow) } else { Style::new() };
            let mut text = format!("  lost {lost}");
            for (count, what) in [(twice, "twice"), (late, "late")] {
                if *count > 0 {
                    text += &format!(" {what} {count}");
                }
            }
            first.push(Span::styled(text, style));
        }
        first.push(Span::raw(format!(
            "  {} msg/s  {}B/s",
            table::number(sum(|row| row.rate_hz)),
            table::scaled(sum(|row| row.bytes_per_s))
        )));
        let mut second = Vec::new();
        for (page, name) in [
            (Page::Channels, "1 channels"),
            (Page::Message, "2 message"),
            (Page::Plot, "3 plot"),
            (Page::Network, "4 network"),
        ] {
            let style =
                if page == self.state.page { Style::new().add_modifier(Modifier::REVERSED) } else { Style::new() };
            second.extend([Span::styled(format!(" {name} "), style), Span::raw(" ")]);
        }
        let mut flag = |text: String, color| second.push(Span::styled(format!(" {text}"), bold_style().fg(color)));
        if self.is_frozen {
            flag("FROZEN".to_owned(), Color::Cyan);
        }
        if !raised.is_empty() {
            flag(format!("ALARM {}", raised.len()), Color::Red);
        }
        if self.screen_data.kernel_dropped > 0 {
            flag(format!("{} datagrams dropped by the kernel", self.screen_data.kernel_dropped), Color::Red);
        }
        if let Some(recording) = &self.recording {
            flag(recording.clone(), Color::Magenta);
        }
        frame.render_widget(Paragraph::new(vec![Line::from(first), Line::from(second)]), area);
    }

    fn channels(&self, frame: &mut Frame, area: Rect) {
        let strip = self.screen_data.curves.len().min(STRIP) as u16;
        let heights = [Constraint::Length(1), Constraint::Min(1), Constraint::Length(strip), Constraint::Length(1)];
        let [head, body, curves, detail] = Layout::vertical(heights).areas(area);
        let columns = table::fitting(area.width.into());
        let title = |column: Column| {
            let arrow = if self.state.is_reversed { '↑' } else { '↓' };
            if column == self.state.sort { format!("{}{arrow}", column.title()) } else { column.title().to_owned() }
        };
        frame.render_widget(Line::styled(table::line(&columns, title), dim_style()), head);

        let rows = self.state.rows(self.screen_data);
        let at = self.state.row_at(&rows);
        let line = |(place, row): (usize, &&Row)| {
            let style = self.row_style(row);
            let style = if place == at { style.add_modifier(Modifier::REVERSED) } else { style };
            Line::styled(table::line(&columns, |column| column.cell(row)), style)
        };
        let from = first_shown(at, rows.len(), body.height.into());
        let lines: Vec<Line> = rows.iter().enumerate().map(line).skip(from).take(body.height.into()).collect();
        frame.render_widget(Paragraph::new(lines), body);

        let bars = |curve: &Curve| {
            let name = format!("{} {}", curve.channel, curve.path);
            let width = usize::from(area.width).saturating_sub(NAME + 13);
            let last = curve.last().map_or(String::new(), table::number);
            Line::from(format!("{:<NAME$} {last:>11} {}", cut(&name, NAME), curve.bars(self.state.span_s, width)))
        };
        let strip: Vec<Line> = self.screen_data.curves.iter().take(STRIP).map(bars).collect();
        frame.render_widget(Paragraph::new(strip).style(Style::new().fg(Color::Cyan)), curves);
        if let Some(row) = rows.get(at) {
            let sender = |sender: &String| self.processes.of(sender).unwrap_or(sender).to_owned();
            let senders: Vec<String> = row.senders.iter().map(sender).collect();
            let senders = if senders.is_empty() { String::new() } else { format!("  from {}", senders.join(", ")) };
            let gap = Column::Gap.cell(row);
            let text = format!("{}  max gap {gap}{senders}", table::type_text(row));
            frame.render_widget(Line::styled(text, dim_style()), detail);
        }
    }

    fn row_style(&self, row: &Row) -> Style {
        if self.screen_data.raised.iter().any(|raised| raised.channel == row.name) {
            Style::new().fg(Color::Red).add_modifier(Modifier::BOLD)
        } else if row.rate_hz == 0.0 && row.count > 1 {
            dim_style()
        } else {
            Style::new()
        }
    }

    fn message(&self, frame: &mut Frame, area: Rect) {
        let [head, body] = Layout::vertical([Constraint::Length(1), Constraint::Min(1)]).areas(area);
        let channel = self.state.channel.as_deref().unwrap_or_default();
        let Some(row) = self.screen_data.rows.iter().find(|row| row.name == channel) else {
            frame.render_widget("no channel selected: press 1, then Enter", body);
            return;
        };
        let title = format!("{channel}  {}  #{}  {} ago", table::type_text(row), row.count, Column::Age.cell(row));
        frame.render_widget(Line::styled(title, self.row_style(row).add_modifier(Modifier::BOLD)), head);
        let height = usize::from(body.height);
        let lines: Vec<Line> = match self.screen_data.messages.get(channel) {
            Some(Decoded::Fields(_)) => {
                let lines = self.state.lines(self.screen_data).unwrap_or_default();
                let at = self.state.line_at(&lines);
                let from = first_shown(at, lines.len(), height);
                let shown = lines.iter().enumerate().skip(from).take(height);
                shown.map(|(place, line)| self.part(channel, line, place == at, body.width.into())).collect()
            }
            Some(Decoded::Bytes(why, rows)) => {
                let from = self.state.hex_from.min(rows.len().saturating_sub(1));
                let rows = rows.iter().skip(from).take(height.saturating_sub(1)).map(|row| Line::from(row.clone()));
                std::iter::once(Line::styled(why.clone(), Style::new().fg(Color::Yellow))).chain(rows).collect()
            }
            None => Vec::new(),
        };
        frame.render_widget(Paragraph::new(lines), body);
    }

    /// A line of the tree; a plotted field is followed by its bars.
    fn part(&self, channel: &str, line: &tree::Line, is_at: bool, width: usize) -> Line<'static> {
        let fold = match line.is_open {
            Some(true) => "▾ ",
            Some(false) => "▸ ",
            None => "  ",
        };
        let curve = self.screen_data.curves.iter().find(|curve| curve.channel == channel && curve.path == line.path);
        let name = format!("{}{fold}{:<18} ", "  ".repeat(line.depth), line.name);
        let mut text = format!("{name}{}", line.text);
        let mut spans = Vec::new();
        if let Some(curve) = curve {
            text = format!("{text:<52} ");
            let room = width.saturating_sub(text.chars().count());
            spans.push(Span::styled(curve.bars(self.state.span_s, room), Style::new().fg(Color::Cyan)));
        }
        let style = if is_at { Style::new().add_modifier(Modifier::REVERSED) } else { Style::new() };
        spans.insert(0, Span::styled(text, style));
        Line::from(spans)
    }

    fn network(&self, frame: &mut Frame, area: Rect) {
        let ScreenData { senders, raised, news, .. } = self.screen_data;
        let mut lines = Vec::new();
        if !self.is_log {
            lines.push(heading("Senders: messages, counted by sequence number"));
            for account in senders {
                lines.push(Line::from(table::sender_text(account)));
                lines.extend(
                    self.processes.of(&account.sender).map(|name| Line::styled(format!("  {name}"), dim_style())),
                );
            }
            lines.push(Line::default());
        }
        lines.push(heading("Alarms: how often each was raised"));
        if self.alarms.is_empty() {
            lines.push(Line::styled("none given (--alarm 'ROBOT_STATE rate<900')", dim_style()));
        }
        lines.extend(self.alarms.iter().map(|(text, times)| Line::from(format!("{times:>5}  {text}"))));
        let red = Style::new().fg(Color::Red);
        lines.extend(raised.iter().map(|raised| Line::styled(format!("now    {}", table::alarm_text(raised)), red)));
        if !self.is_log {
            lines.extend([Line::default(), heading("Network events")]);
            let found =
                |(age_s, text): &(f64, String)| Line::from(format!("{:>8} ago  {text}", table::time(age_s * 1e6)));
            lines.extend(news.iter().map(found));
        }
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn foot(&self, frame: &mut Frame, area: Rect) {
        let state = self.state;
        let yellow = Style::new().fg(Color::Yellow);
        let first = if state.is_typing || !state.filter.is_empty() {
            let (cursor, note) = match (state.is_typing, state.is_filter_bad) {
                (true, true) => ("_", "  invalid regular expression: the last valid one is in use"),
                (true, false) => ("_", "  Enter: apply, Esc: clear"),
                (false, _) => ("", "  Esc: clear"),
            };
            Line::styled(format!("/{}{cursor}{note}", state.filter), yellow)
        } else if !self.message.is_empty() {
            Line::styled(self.message.to_owned(), yellow)
        } else if let Some(raised) = self.screen_data.raised.first() {
            Line::styled(table::alarm_text(raised), Style::new().fg(Color::Red))
        } else {
            Line::default()
        };
        let keys = Line::styled(help::keys(state.page, self.is_log), dim_style());
        frame.render_widget(Paragraph::new(vec![first, keys]), area);
    }
}

/// First visible line, so that the line at the cursor is in the middle if the list is longer than the area.
pub fn first_shown(at: usize, length: usize, height: usize) -> usize {
    at.saturating_sub(height / 2).min(length.saturating_sub(height))
}

/// A text truncated to a width.
pub fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    text.chars().take(width.saturating_sub(1)).chain(['…']).collect()
}

/// A horizontal line with a title.
pub fn ruled(title: &str) -> Block<'static> {
    Block::new().borders(Borders::TOP).title(format!(" {title} ")).border_style(dim_style())
}

fn heading(text: &str) -> Line<'static> {
    Line::styled(text.to_owned(), bold_style())
}

fn bold(text: String) -> Span<'static> {
    Span::styled(text, bold_style())
}

fn bold_style() -> Style {
    Style::new().add_modifier(Modifier::BOLD)
}

/// Style of secondary text.
pub fn dim_style() -> Style {
    Style::new().fg(Color::DarkGray)
}
