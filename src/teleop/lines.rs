//! Operation by lines of text, from a script file or from another program on standard input.

use super::{Session, Signals};
use anyhow::Context;
use drivers::live::clock::now_ns;
use std::collections::VecDeque;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Source of the lines.
pub enum Source {
    /// A text.
    Text(String),
    /// Standard input, as the lines arrive.
    Input,
}

/// Applies the lines until the end of the last one; returns the reason for the end.
///
/// # Errors
/// If a line is invalid (with its number) or the bus fails.
pub fn operate(session: &mut Session, signals: &Signals, source: Source, name: &str) -> anyhow::Result<&'static str> {
    let mut lines = Lines::of(source);
    let mut number = 0;
    let mut next_ns = i64::MIN;
    loop {
        let now = now_ns();
        if let Some(reason) = signals.received()? {
            return Ok(reason);
        }
        session.heartbeat(now)?;
        session.warn_of_failed_stop(now);
        if now >= next_ns {
            match lines.next() {
                Next::Line(line) => {
                    number += 1;
                    let line = line.with_context(|| name.to_owned())?;
                    let wait = session.input.apply_line(&line).with_context(|| format!("{name}:{number}"))?;
                    if !wait.is_zero() {
                        next_ns = now + i64::try_from(wait.as_nanos()).unwrap_or(i64::MAX - now);
                    } else if !line.trim().is_empty() {
                        // At once: an emergency stop must not wait for the next heartbeat.
                        session.send(now)?;
                    }
                    continue;
                }
                Next::Nothing => {}
                Next::End => return Ok("end of script"),
            }
        }
        let rest = session.rest(now_ns());
        // Standard input is polled more often than heartbeats are sent.
        std::thread::sleep(rest.min(std::time::Duration::from_millis(2)));
    }
}

enum Next {
    Line(std::io::Result<String>),
    Nothing,
    End,
}

enum Lines {
    Text(VecDeque<String>),
    Input(Receiver<std::io::Result<String>>),
}

impl Lines {
    fn of(source: Source) -> Self {
        match source {
            Source::Text(text) => Lines::Text(text.lines().map(str::to_owned).collect()),
            Source::Input => {
                let (read, lines) = channel();
                // In a separate thread: standard input blocks, and the heartbeat must not wait for it.
                std::thread::spawn(move || {
                    for line in std::io::stdin().lock().lines() {
                        if read.send(line).is_err() {
                            return;
                        }
                    }
                });
                Lines::Input(lines)
            }
        }
    }

    fn next(&mut self) -> Next {
        match self {
            Lines::Text(lines) => lines.pop_front().map_or(Next::End, |line| Next::Line(Ok(line))),
            Lines::Input(lines) => match lines.try_recv() {
                Ok(line) => Next::Line(line),
                Err(TryRecvError::Empty) => Next::Nothing,
                Err(TryRecvError::Disconnected) => Next::End,
            },
        }
    }
}
