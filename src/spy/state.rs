//! What a person has chosen to see, and what keys change of it.

use super::picture::Picture;
use super::table::Column;
use super::tree::{self, Decoded, Line};
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use regex_lite::Regex;
use replay::traffic::Row;
use std::collections::{BTreeMap, BTreeSet};

/// Lines that a page key moves by.
const PAGE: usize = 10;
/// Shortest and longest stretch of time that is plotted, s.
const SPANS: (f64, f64) = (0.25, 600.0);

/// One screen of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Page {
    Channels,
    Message,
    Plot,
    Network,
    Help,
}

/// What a key asks for that is not a matter of looking.
#[derive(Debug, Clone, PartialEq)]
pub enum Wish {
    /// End.
    Quit,
    /// Let the picture stand still, or go on.
    Freeze,
    /// Begin or end a recording.
    Record,
    /// Count anew.
    Clear,
    /// Follow a field of a channel, or follow it no more.
    Follow(String, String),
    /// Go to another time of a log, s from here.
    Seek(f64),
    /// The next event of a log.
    Step,
    /// Play a log so many times faster.
    Faster(f64),
}

/// The choices.
pub struct State {
    pub page: Page,
    /// Where help was asked for.
    before_help: Page,
    pub sort: Column,
    pub is_reversed: bool,
    /// Being typed: a regular expression of which channels show it in their name.
    pub filter: String,
    pub is_typing: bool,
    /// The last filter that is one.
    regex: Option<Regex>,
    pub is_filter_bad: bool,
    /// Channel at the cursor.
    pub channel: Option<String>,
    /// Branches that were folded or unfolded, of each channel.
    toggled: BTreeMap<String, BTreeSet<String>>,
    /// Part of the message at the cursor.
    pub part: String,
    /// First row of bytes of a message of no known type.
    pub hex_from: usize,
    /// Curve at the cursor.
    pub curve: usize,
    /// Stretch of time that is plotted, s.
    pub span_s: f64,
    /// Each curve fills the plot.
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
    /// The rows that pass the filter, in order.
    pub fn rows<'p>(&self, picture: &'p Picture) -> Vec<&'p Row> {
        let passes = |row: &&Row| self.regex.as_ref().is_none_or(|regex| regex.is_match(&row.name));
        let mut rows: Vec<&Row> = picture.rows.iter().filter(passes).collect();
        rows.sort_by(|a, b| self.sort.order(a, b));
        if self.is_reversed {
            rows.reverse();
        }
        rows
    }

    /// Place of the cursor among rows.
    pub fn row_at(&self, rows: &[&Row]) -> usize {
        rows.iter().position(|row| Some(&row.name) == self.channel.as_ref()).unwrap_or(0)
    }

    /// The lines of the message at the cursor; `None` if its type is not known.
    pub fn lines(&self, picture: &Picture) -> Option<Vec<Line>> {
        let none = BTreeSet::new();
        let channel = self.channel.as_ref()?;
        let Decoded::Fields(nodes) = picture.messages.get(channel)? else { return None };
        Some(tree::lines(nodes, self.toggled.get(channel).unwrap_or(&none)))
    }

    /// Place of the cursor among lines: where the part is, or what it lies in.
    pub fn line_at(&self, lines: &[Line]) -> usize {
        let holds = |line: &Line| {
            let rest = self.part.strip_prefix(&line.path);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        lines.iter().rposition(holds).unwrap_or(0)
    }

    /// Puts the cursor on a channel, if it is on none.
    pub fn settle(&mut self, picture: &Picture) {
        let rows = self.rows(picture);
        if !rows.iter().any(|row| Some(&row.name) == self.channel.as_ref()) && self.page == Page::Channels {
            self.channel = rows.first().map(|row| row.name.clone());
        }
        self.curve = self.curve.min(picture.curves.len().saturating_sub(1));
    }

    /// Does what a key says; what it asks of others.
    pub fn key(&mut self, key: &KeyEvent, picture: &Picture) -> Option<Wish> {
        if key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL) {
            return Some(Wish::Quit);
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
            KeyCode::Char('q') => return Some(Wish::Quit),
            KeyCode::Char(' ' | 'f') => return Some(Wish::Freeze),
            KeyCode::Char('r') => return Some(Wish::Record),
            KeyCode::Char('c') => return Some(Wish::Clear),
            KeyCode::Char(',') => return Some(Wish::Seek(-1.0)),
            KeyCode::Char('.') => return Some(Wish::Seek(1.0)),
            KeyCode::Char('<') => return Some(Wish::Seek(-10.0)),
            KeyCode::Char('>') => return Some(Wish::Seek(10.0)),
            KeyCode::Char('n') => return Some(Wish::Step),
            KeyCode::Char('[') => return Some(Wish::Faster(0.5)),
            KeyCode::Char(']') => return Some(Wish::Faster(2.0)),
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
                    Page::Channels => self.channels_key(code, picture),
                    Page::Message => self.message_key(code, picture),
                    Page::Plot => self.plot_key(code, picture),
                    Page::Network | Page::Help => self.back_key(code),
                };
            }
        }
        None
    }

    fn type_filter(&mut self, code: KeyCode) {
        match code {
            KeyCode::Enter => self.is_typing = false,
            KeyCode::Esc => {
                self.is_typing = false;
                self.filter.clear();
            }
            KeyCode::Backspace => drop(self.filter.pop()),
            KeyCode::Char(c) => self.filter.push(c),
            _ => {}
        }
        // What is half typed is often no regular expression yet: the last that was one stays.
        let regex = Regex::new(&format!("(?i){}", self.filter));
        self.is_filter_bad = regex.is_err();
        if let Ok(regex) = regex {
            self.regex = Some(regex).filter(|_| !self.filter.is_empty());
        }
    }

    fn channels_key(&mut self, code: KeyCode, picture: &Picture) -> Option<Wish> {
        let rows = self.rows(picture);
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

    fn message_key(&mut self, code: KeyCode, picture: &Picture) -> Option<Wish> {
        let Some(lines) = self.lines(picture) else {
            let rows = match self.channel.as_ref().and_then(|channel| picture.messages.get(channel)) {
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
                return self.channel.clone().map(|channel| Wish::Follow(channel, line.path.clone()));
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

    fn plot_key(&mut self, code: KeyCode, picture: &Picture) -> Option<Wish> {
        let curve = picture.curves.get(self.curve);
        match (code, curve) {
            (KeyCode::Char('p') | KeyCode::Delete, Some(curve)) => {
                return Some(Wish::Follow(curve.channel.clone(), curve.path.clone()));
            }
            _ => match moved(self.curve, picture.curves.len(), code) {
                Some(at) => self.curve = at,
                None => return self.back_key(code),
            },
        }
        None
    }

    fn back_key(&mut self, code: KeyCode) -> Option<Wish> {
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

/// Where a key leads in a list; `None` if it is no key for that, or there is nowhere to go.
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
