//! A person in front of a screen: keys, and a gamepad where there is one.

use super::gamepad::Gamepad;
use super::keys::Key;
use super::link::now_ns;
use super::view::Screen;
use super::{Session, Signals};
use anyhow::{Context, anyhow};
use crossterm::event::Event as Input;
use ratatui::DefaultTerminal;
use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};

/// Time between two drawings, ns.
const FRAME_NS: i64 = 100_000_000;
/// How long a message stays, ns.
const MESSAGE_NS: i64 = 4_000_000_000;

/// Asks for a terminal.
///
/// # Errors
/// There is none.
pub fn check() -> anyhow::Result<()> {
    anyhow::ensure!(
        std::io::stdin().is_terminal() && std::io::stdout().is_terminal(),
        "there is no terminal for keys and screen: --no-screen takes lines from standard input"
    );
    Ok(())
}

/// Obeys keys and pad until the person ends it; says so.
///
/// # Errors
/// The terminal or the pad is gone, or the bus fails.
pub fn obey(session: &mut Session, signals: &Signals, pad: Option<Gamepad>) -> anyhow::Result<&'static str> {
    let mut terminal = ratatui::try_init().context("terminal")?;
    let ended =
        Desk { session, signals, pad, terminal: &mut terminal, keys: listen(), message: None, drawn_ns: 0 }.run();
    // A terminal that is gone needs no restoring, and must not keep the robot from being told: dropped with its cursor hidden, it would
    // complain on a standard error that is gone too, and panic.
    let _ = ratatui::try_restore();
    if terminal.show_cursor().is_err() {
        std::mem::forget(terminal);
    }
    ended
}

/// Terminal events, read by a thread of their own, since the heartbeat must not wait for them.
fn listen() -> Receiver<Input> {
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

struct Desk<'a> {
    session: &'a mut Session,
    signals: &'a Signals,
    pad: Option<Gamepad>,
    terminal: &'a mut DefaultTerminal,
    keys: Receiver<Input>,
    /// What came of a key, and when.
    message: Option<(&'static str, i64)>,
    drawn_ns: i64,
}

impl Desk<'_> {
    fn run(mut self) -> anyhow::Result<&'static str> {
        loop {
            let event = self.keys.recv_timeout(self.session.rest(now_ns()));
            let now = now_ns();
            match event {
                Ok(Input::Key(key)) => match Key::of(&key) {
                    Some(Key::Quit) => return Ok("ended by Ctrl-C"),
                    Some(Key::Press(press)) => {
                        let done = self.session.desk.press(press, now);
                        self.note(done, now);
                        self.session.send(now)?;
                    }
                    None => {}
                },
                Ok(_) | Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(anyhow!("the terminal is gone")),
            }
            if let Some(reason) = self.signals.asked()? {
                return Ok(reason);
            }
            if self.session.due_ns <= now {
                self.look_at_pad(now)?;
                // A terminal that was hung up need not say so to whoever reads from it.
                anyhow::ensure!(std::io::stdin().is_terminal(), "the terminal is gone");
            }
            self.session.beat(now)?;
            if now - self.drawn_ns >= FRAME_NS {
                self.drawn_ns = now;
                self.draw(now)?;
            }
        }
    }

    fn look_at_pad(&mut self, now: i64) -> anyhow::Result<()> {
        let Some(pad) = &mut self.pad else { return Ok(()) };
        let Some(state) = pad.state() else { return Err(anyhow!("the gamepad is gone")) };
        let done = self.session.desk.hold(state, now);
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
        let screen = Screen {
            desk: &self.session.desk,
            channel: self.session.link.channel(),
            heard: &self.session.link.heard,
            pad: self.pad.as_ref().map(Gamepad::name),
            message: self.message.filter(|(_, at)| now - at < MESSAGE_NS).map_or("", |(text, _)| text),
            now_ns: now,
        };
        self.terminal.draw(|frame| screen.draw(frame)).context("terminal")?;
        Ok(())
    }
}
