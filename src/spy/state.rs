//! View state of the screen, and how keys change it.

use super::screen_data::ScreenData;
use super::table::Column;
use super::tree::{self, Decoded, Line};
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use regex_lite::Regex;
use replay::traffic::Row;
use std::collections::{BTreeMap, BTreeSet};

/// Lines per page key.
const PAGE: usize = 10;
/// Shortest and longest time span of a plot, s.
const SPANS: (f64, f64) = (0.25, 600.0);

/// A page of the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Page {
    Channels,
    Message,
    Plot,
    Network,
    Help,
}

/// An action that a key requests and that is more than a change of the view.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Exit.
    Quit,
    /// Freeze or resume the display; of a log: pause or resume.
    Freeze,
    /// Start or stop a recording.
    Record,
    /// Reset all counts.
    Clear,
    /// Start or stop plotting a field of a channel.
    Follow(String, String),
    /// Seek in a log, s relative to the position.
    Seek(f64),
    /// Show the next event of a log.
    Step,
    /// Multiply the playback speed of a log.
    Faster(f64),
}

/// View state.
pub struct State {
    pub page: Page,
    /// Page to which help returns.
    before_help: Page,
    pub sort: Column,
    pub is_reversed: bool,
    /// Text of the filter: a regular expression that matches any part of a channel's name.
    pub filter: String,
    pub is_typing: bool,
    /// The last valid filter.
    regex: Option<Regex>,
    pub is_filter_bad: bool,
    /// Channel at the cursor.
    pub channel: Option<String>,
    /// Branches whose expansion differs from the default, by channel.
    toggled: BTreeMap<String, BTreeSet<String>>,
    /// Field at the cursor.
    pub part: String,
    /// First byte row shown of a message of unknown type.
    pub hex_from: usize,
    /// Curve at the cursor.
    pub curve: usize,
    /// Time span of the plot, s.
    pub span_s: f64,
    /// Each curve is scaled to the height of the plot.
    pub is_normalised: bool,
}

impl Default for State {
    fn default() -> Self {
        State {
            page: Page::Channels,
            before_help: Page::Channels,
            sort: Column::Name,
            is_reversed: false,
            filter: String::new(),
            is_typing: false,
            regex: None,
            is_filter_bad: false,
            channel: None,
            toggled: BTreeMap::new(),
            part: String::new(),
            hex_from: 0,
            curve: 0,
            span_s: 10.0,
            is_normalised: false,
        }
    }
}

impl State {
    /// The rows that match the filter, sorted.
    pub fn rows<'p>(&self, screen_data: &'p ScreenData) -> Vec<&'p Row> {
        let passes = |row: &&Row| self.regex.as_ref().is_none_or(|regex| regex.is_match(&row.name));
        let mut rows: Vec<&Row> = screen_data.rows.iter().filter(passes).collect();
        rows.sort_by(|a, b| self.sort.order(a, b));
        if self.is_reversed {
            rows.reverse();
        }
        rows
    }

    /// Index of the cursor in the rows.
    pub fn row_at(&self, rows: &[&Row]) -> usize {
        rows.iter().position(|row| Some(&row.name) == self.channel.as_ref()).unwrap_or(0)
    }

    /// The lines of the message at the cursor; `None` if its type is unknown.
    pub fn lines(&self, screen_data: &ScreenData) -> Option<Vec<Line>> {
        let none = BTreeSet::new();
        let channel = self.channel.as_ref()?;
        let Decoded::Fields(nodes) = screen_data.messages.get(channel)? else { return None };
        Some(tree::lines(nodes, self.toggled.get(channel).unwrap_or(&none)))
    }

    /// Index of the cursor in the lines: the field, or the innermost visible branch that contains it.
    pub fn line_at(&self, lines: &[Line]) -> usize {
        let holds = |line: &Line| {
            let rest = self.part.strip_prefix(&line.path);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        lines.iter().rposition(holds).unwrap_or(0)
    }

    /// Puts the cursor on the first channel if it is on none.
    pub fn settle(&mut self, screen_data: &ScreenData) {
        let rows = self.rows(screen_data);
        if !rows.iter().any(|row| Some(&row.name) == self.channel.as_ref()) && self.page == Page::Channels {
            self.channel = rows.first().map(|row| row.name.clone());
        }
        self.curve = self.curve.min(screen_data.curves.len().saturating_sub(1));
    }

    /// Applies a key to the view. Returns the action that the session must do, if any.
    pub fn key(&mut self, key: &KeyEvent, screen_data: &ScreenData) -> Option<Action> {
        if key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL) {
            return Some(Action::Quit);
        }
        if self.is_typing {
            self.type_filter(key.code);
            return None;
        }
        if self.page == Page::Help {
            self.page = self.before_help;
            return None;
        }
        match key.code {
            KeyCode::Char('q') => return Some(Action::Quit),
            KeyCode::Char(' ' | 'f') => return Some(Action::Freeze),
            KeyCode::Char('r') => return Some(Action::Record),
            KeyCode::Char('c') => return Some(Action::Clear),
            KeyCode::Char(',') => return Some(Action::Seek(-1.0)),
            KeyCode::Char('.') => return Some(Action::Seek(1.0)),
            KeyCode::Char('<') => return Some(Action::Seek(-10.0)),
            KeyCode::Char('>') => return Some(Action::Seek(10.0)),
            KeyCode::Char('n') => return Some(Action::Step),
            KeyCode::Char('[') => return Some(Action::Faster(0.5)),
            KeyCode::Char(']') => return Some(Action::Faster(2.0)),
            KeyCode::Char('?') => {
                self.before_help = self.page;
                self.page = Page::Help;
            }
            KeyCode::Char('1') => self.page = Page::Channels,
            KeyCode::Char('2') => self.page = Page::Message,
            KeyCode::Char('3') => self.page = Page::Plot,
            KeyCode::Char('4') => self.page = Page::Network,
            KeyCode::Tab => self.page = self.page.next(),
            KeyCode::Char('/') => {
                self.page = Page::Channels;
                self.is_typing = true;
            }
            KeyCode::Char('+' | '=') => self.span_s = (self.span_s * 2.0).min(SPANS.1),
            KeyCode::Char('-') => self.span_s = (self.span_s / 2.0).max(SPANS.0),
            KeyCode::Char('z') => self.is_normalised = !self.is_normalised,
            code => {
                return match self.page {
                    Page::Channels => self.channels_key(code, screen_data),
                    Page::Message => self.message_key(code, screen_data),
                    Page::Plot => self.plot_key(code, screen_data),
                    Page::Network | Page::Help => self.back_key(code),
                };
            }
        }
        None
    }

    fn type_filter(&mut self, code: KeyCode) {
        match code {
            // An invalid expression is not applied.
            KeyCode::Enter => self.is_typing = self.is_filter_bad,
            KeyCode::Esc => {
                self.is_typing = false;
                self.filter.clear();
            }
            KeyCode::Backspace => drop(self.filter.pop()),
            KeyCode::Char(c) => self.filter.push(c),
            _ => {}
        }
        // A partly typed expression is often invalid; the last valid one stays in use.
        let regex = Regex::new(&format!("(?i){}", self.filter));
        self.is_filter_bad = regex.is_err();
        if let Ok(regex) = regex {
            self.regex = Some(regex).filter(|_| !self.filter.is_empty());
        }
    }

    fn channels_key(&mut self, code: KeyCode, screen_data: &ScreenData) -> Option<Action> {
        let rows = self.rows(screen_data);
        match code {
            KeyCode::Enter | KeyCode::Right | KeyCode::Char('l') if self.channel.is_some() => self.page = Page::Message,
            KeyCode::Char('s') => self.sort = self.sort.next(),
            KeyCode::Char('S') => self.is_reversed = !self.is_reversed,
            KeyCode::Esc => {
                self.filter.clear();
                self.regex = None;
            }
            code => {
                if let Some(at) = moved(self.row_at(&rows), rows.len(), code) {
                    self.channel = Some(rows[at].name.clone());
                    self.part.clear();
                    self.hex_from = 0;
                }
            }
        }
        None
    }

    fn message_key(&mut self, code: KeyCode, screen_data: &ScreenData) -> Option<Action> {
        let Some(lines) = self.lines(screen_data) else {
            let rows = match self.channel.as_ref().and_then(|channel| screen_data.messages.get(channel)) {
                Some(Decoded::Bytes(_, rows)) => rows.len(),
                _ => 0,
            };
            self.hex_from = moved(self.hex_from, rows, code).unwrap_or(self.hex_from);
            return self.back_key(code);
        };
        let at = self.line_at(&lines);
        let Some(line) = lines.get(at) else { return self.back_key(code) };
        match (code, line.is_open) {
            (KeyCode::Char('p'), _) | (KeyCode::Enter, None) if line.is_number => {
                return self.channel.clone().map(|channel| Action::Follow(channel, line.path.clone()));
            }
            (KeyCode::Enter, Some(_))
            | (KeyCode::Right | KeyCode::Char('l'), Some(false))
            | (KeyCode::Left | KeyCode::Char('h'), Some(true)) => self.toggle(&line.path),
            (KeyCode::Left | KeyCode::Char('h'), _) => {
                let above = lines[..at].iter().rposition(|above| above.depth < line.depth);
                match above {
                    Some(above) => self.part.clone_from(&lines[above].path),
                    None => self.page = Page::Channels,
                }
            }
            (code, _) => match moved(at, lines.len(), code) {
                Some(at) => self.part.clone_from(&lines[at].path),
                None => return self.back_key(code),
            },
        }
        None
    }

    fn toggle(&mut self, path: &str) {
        let Some(channel) = &self.channel else { return };
        let toggled = self.toggled.entry(channel.clone()).or_default();
        if !toggled.remove(path) {
            toggled.insert(path.to_owned());
        }
        path.clone_into(&mut self.part);
    }

    fn plot_key(&mut self, code: KeyCode, screen_data: &ScreenData) -> Option<Action> {
        let curve = screen_data.curves.get(self.curve);
        match (code, curve) {
            (KeyCode::Char('p') | KeyCode::Delete, Some(curve)) => {
                return Some(Action::Follow(curve.channel.clone(), curve.path.clone()));
            }
            _ => match moved(self.curve, screen_data.curves.len(), code) {
                Some(at) => self.curve = at,
                None => return self.back_key(code),
            },
        }
        None
    }

    fn back_key(&mut self, code: KeyCode) -> Option<Action> {
        if let KeyCode::Esc | KeyCode::Backspace | KeyCode::Left = code {
            self.page = Page::Channels;
        }
        None
    }
}

impl Page {
    fn next(self) -> Self {
        match self {
            Page::Channels => Page::Message,
            Page::Message => Page::Plot,
            Page::Plot => Page::Network,
            Page::Network | Page::Help => Page::Channels,
        }
    }
}

/// New index in a list after a key; `None` for an empty list or another key.
fn moved(at: usize, length: usize, code: KeyCode) -> Option<usize> {
    let last = length.checked_sub(1)?;
    Some(match code {
        KeyCode::Down | KeyCode::Char('j') => at.saturating_add(1),
        KeyCode::Up | KeyCode::Char('k') => at.saturating_sub(1),
        KeyCode::PageDown => at.saturating_add(PAGE),
        KeyCode::PageUp => at.saturating_sub(PAGE),
        KeyCode::Home | KeyCode::Char('g') => 0,
        KeyCode::End | KeyCode::Char('G') => last,
        _ => return None,
    })
    .map(|at| at.min(last))
}
