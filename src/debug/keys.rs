//! The interactive screen: what each key does.

use super::events::{self, Kind};
use super::view::Screen;
use anyhow::Context;
use crossterm::event::{Event as Input, KeyCode, KeyEventKind, KeyModifiers, poll, read};
use lcmtypes::RunInfo;
use ratatui::DefaultTerminal;
use replay::engine::{Cursor, Moment};
use std::time::Duration;

/// Ticks that a search examines before it checks for a key that stops it.
const SEARCH_STEP: u64 = 500;

/// Shows ticks until the user quits.
///
/// - `joints`: names of the joints, in URDF order.
///
/// # Errors
/// If there is no terminal, or the log cannot be read or replayed.
pub fn interact(
    log: &str,
    info: &RunInfo,
    joints: &[String],
    cursor: &mut Cursor,
    moment: Moment,
) -> anyhow::Result<()> {
    let terminal =
        ratatui::try_init().context("cannot open the terminal; `--once` prints a single tick without one")?;
    let shown = Session { log, info, joints, cursor, moment, terminal, message: String::new() }.run();
    ratatui::restore();
    shown
}

struct Session<'a, 'r> {
    log: &'a str,
    info: &'a RunInfo,
    joints: &'a [String],
    cursor: &'a mut Cursor<'r>,
    moment: Moment,
    terminal: DefaultTerminal,
    message: String,
}

impl Session<'_, '_> {
    fn run(mut self) -> anyhow::Result<()> {
        loop {
            self.draw()?;
            let Input::Key(key) = read()? else { continue };
            if key.kind != KeyEventKind::Press {
                continue;
            }
            self.message.clear();
            let tick = self.moment.tick;
            match key.code {
                KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => return Ok(()),
                KeyCode::Char('q') | KeyCode::Esc => return Ok(()),
                KeyCode::Right | KeyCode::Char('l') => self.go_to(tick + 1)?,
                KeyCode::Left | KeyCode::Char('h') => self.go_to(tick - 1)?,
                KeyCode::Down | KeyCode::Char('j') => self.go_to(tick + 10)?,
                KeyCode::Up | KeyCode::Char('k') => self.go_to(tick - 10)?,
                KeyCode::PageDown => self.go_to(tick + 100)?,
                KeyCode::PageUp => self.go_to(tick - 100)?,
                KeyCode::Home => self.go_to(self.cursor.first_tick())?,
                KeyCode::End => self.go_to(self.cursor.last_tick())?,
                KeyCode::Char('b') => {
                    let state = self.cursor.state_before(tick)?;
                    self.go_to_state(state, "no recorded state before this tick")?;
                }
                KeyCode::Char('s') => {
                    let state = self.cursor.state_after(tick)?;
                    self.go_to_state(state, "no recorded state after this tick")?;
                }
                KeyCode::Char('n') => self.search(None)?,
                KeyCode::Char('N') => self.search_back()?,
                KeyCode::Char('t') => self.search(Some(Kind::Touchdown))?,
                KeyCode::Char('f') => self.search(Some(Kind::QpFailure))?,
                KeyCode::Char('m') => self.search(Some(Kind::MissedDeadline))?,
                KeyCode::Char('d') => self.search(Some(Kind::Divergence))?,
                KeyCode::Char('e') => self.search(Some(Kind::Event))?,
                KeyCode::Char('g') => self.ask_tick()?,
                _ => {}
            }
        }
    }

    fn draw(&mut self) -> anyhow::Result<()> {
        let events = events::at(self.cursor, &self.moment)?;
        let last_tick = self.cursor.last_tick();
        let Session { log, info, joints, moment, message, terminal, .. } = self;
        let screen = Screen { log, info, joints, last_tick, moment, events: &events, message };
        terminal.draw(|frame| screen.draw(frame))?;
        Ok(())
    }

    /// Shows a tick; a number outside the log is limited to its first or last tick.
    fn go_to(&mut self, tick: i64) -> anyhow::Result<()> {
        let tick = tick.clamp(self.cursor.first_tick(), self.cursor.last_tick());
        match self.cursor.go_to(tick) {
            Ok(moment) => self.moment = moment,
            Err(error @ (replay::Error::NoSuchTick { .. } | replay::Error::StateUnknown { .. })) => {
                self.message = error.to_string();
            }
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    fn go_to_state(&mut self, state: Option<i64>, none: &str) -> anyhow::Result<()> {
        match state {
            Some(state) => self.go_to(state),
            None => {
                none.clone_into(&mut self.message);
                Ok(())
            }
        }
    }

    fn search(&mut self, kind: Option<Kind>) -> anyhow::Result<()> {
        let what = kind.map_or("event", Kind::name);
        let mut from = self.moment.tick;
        while from < self.cursor.last_tick() {
            if let Some(moment) = events::next(self.cursor, from, kind, SEARCH_STEP)? {
                self.moment = moment;
                return Ok(());
            }
            from = from.saturating_add_unsigned(SEARCH_STEP);
            if poll(Duration::ZERO)? {
                self.message = format!("search stopped at tick {from}: no {what} found");
                return Ok(());
            }
            self.message = format!("searching for the next {what}: tick {from} (any key stops)");
            self.draw()?;
        }
        self.message = format!("no {what} after this tick");
        Ok(())
    }

    fn search_back(&mut self) -> anyhow::Result<()> {
        match events::previous(self.cursor, self.moment.tick)? {
            Some(moment) => self.moment = moment,
            None => "no event before this tick".clone_into(&mut self.message),
        }
        Ok(())
    }

    /// Reads the number of a tick from the keyboard and shows that tick.
    fn ask_tick(&mut self) -> anyhow::Result<()> {
        let mut digits = String::new();
        loop {
            self.message = format!("go to tick: {digits}");
            self.draw()?;
            let Input::Key(key) = read()? else { continue };
            match key.code {
                KeyCode::Char(c) if c.is_ascii_digit() && digits.len() < 18 => digits.push(c),
                KeyCode::Backspace => drop(digits.pop()),
                KeyCode::Enter => break,
                KeyCode::Esc => {
                    digits.clear();
                    break;
                }
                _ => {}
            }
        }
        self.message.clear();
        digits.parse().map_or(Ok(()), |tick| self.go_to(tick))
    }
}
