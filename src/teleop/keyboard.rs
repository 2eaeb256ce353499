//! Interactive operation: keys, screen, and a gamepad if there is one.

use super::gamepad::Gamepad;
use super::keys::Key;
use super::view::Screen;
use super::{Session, Signals};
use anyhow::{Context, anyhow};
use crossterm::event::Event as Input;
use drivers::live::clock::now_ns;
use ratatui::DefaultTerminal;
use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};

/// Period of the screen, ns.
const FRAME_NS: i64 = 100_000_000;
/// Time for which a message is shown, ns.
const MESSAGE_NS: i64 = 4_000_000_000;

/// Checks that standard input and output are a terminal.
///
/// # Errors
/// If they are not.
pub fn check() -> anyhow::Result<()> {
    anyhow::ensure!(
        std::io::stdin().is_terminal() && std::io::stdout().is_terminal(),
        "standard input or output is not a terminal; use --no-screen to read lines from standard input"
    );
    Ok(())
}

/// Sends commands from keys and gamepad until the operator ends it; returns the reason.
///
/// # Errors
/// If the terminal or the gamepad is disconnected, or the bus fails.
pub fn operate(session: &mut Session, signals: &Signals, pad: Option<Gamepad>) -> anyhow::Result<&'static str> {
    let mut terminal = ratatui::try_init().context("terminal")?;
    let ended =
        Console { session, signals, pad, terminal: &mut terminal, keys: read_keys(), message: None, drawn_ns: 0 }.run();
    // If the terminal is disconnected, restoring it fails; the last command must be sent nevertheless. Dropping the terminal with a hidden cursor
    // would print to a closed standard error and panic.
    let _ = ratatui::try_restore();
    if terminal.show_cursor().is_err() {
        std::mem::forget(terminal);
    }
    ended
}

/// Terminal events, read by a separate thread: the heartbeat must not wait for them.
fn read_keys() -> Receiver<Input> {
    let (send, keys) = channel();
    std::thread::spawn(move || {
        while let Ok(event) = crossterm::event::read() {
            if send.send(event).is_err() {
                return;
            }
        }
    });
    keys
}

struct Console<'a> {
    session: &'a mut Session,
    signals: &'a Signals,
    pad: Option<Gamepad>,
    terminal: &'a mut DefaultTerminal,
    keys: Receiver<Input>,
    /// Why the last key had no effect, and its time, ns.
    message: Option<(&'static str, i64)>,
    drawn_ns: i64,
}

impl Console<'_> {
    fn run(mut self) -> anyhow::Result<&'static str> {
        loop {
            let event = self.keys.recv_timeout(self.session.rest(now_ns()));
            let now = now_ns();
            match event {
                Ok(Input::Key(key)) => match Key::of(&key) {
                    Some(Key::Quit) => return Ok("ended by Ctrl-C"),
                    Some(Key::Press(press)) => {
                        let done = self.session.input.press(press, now);
                        self.note(done, now);
                        self.session.send(now)?;
                    }
                    None => {}
                },
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(anyhow!("terminal disconnected")),
            }
            if let Some(reason) = self.signals.received()? {
                return Ok(reason);
            }
            if self.session.due_ns <= now {
                self.read_pad(now)?;
                // A read from a disconnected terminal may return no error.
                anyhow::ensure!(std::io::stdin().is_terminal(), "terminal disconnected");
            }
            self.session.heartbeat(now)?;
            if now - self.drawn_ns >= FRAME_NS {
                self.drawn_ns = now;
                self.draw(now)?;
            }
        }
    }

    fn read_pad(&mut self, now: i64) -> anyhow::Result<()> {
        let Some(pad) = &mut self.pad else { return Ok(()) };
        let Some(state) = pad.state() else { return Err(anyhow!("gamepad disconnected")) };
        let done = self.session.input.apply_pad(state, now);
        self.note(done, now);
        Ok(())
    }

    fn note(&mut self, done: Result<(), &'static str>, now: i64) {
        if let Err(why) = done {
            self.message = Some((why, now));
            self.drawn_ns = 0;
        }
    }

    fn draw(&mut self, now: i64) -> anyhow::Result<()> {
        let status = &self.session.link.status;
        let message = self.message.filter(|(_, at)| now - at < MESSAGE_NS).map(|(text, _)| text);
        let screen = Screen {
            input: &self.session.input,
            channel: self.session.link.channel(),
            status,
            pad: self.pad.as_ref().map(Gamepad::name),
            message: message.or(status.rejection()).unwrap_or_default(),
            now_ns: now,
        };
        self.terminal.draw(|frame| screen.draw(frame)).context("terminal")?;
        Ok(())
    }
}
