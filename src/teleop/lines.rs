//! Lines of text as an operator: a script's, or another program's.

use super::link::now_ns;
use super::{Session, Signals};
use anyhow::Context;
use std::collections::VecDeque;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Where lines come from.
pub enum Source {
    /// All of them are here.
    Text(String),
    /// Standard input, as they are written.
    Input,
}

/// Obeys line by line until the last one has had its time; says why it ended.
///
/// # Errors
/// A line that is none, by its number; a bus that fails.
pub fn obey(session: &mut Session, signals: &Signals, source: Source, name: &str) -> anyhow::Result<&'static str> {
    let mut lines = Lines::of(source);
    let mut number = 0;
    let mut next_ns = i64::MIN;
    loop {
        let now = now_ns();
        if let Some(reason) = signals.asked()? {
            return Ok(reason);
        }
        session.beat(now)?;
        if now >= next_ns {
            match lines.next() {
                Next::Line(line) => {
                    number += 1;
                    let line = line.with_context(|| name.to_owned())?;
                    let wait = session.desk.line(&line).with_context(|| format!("{name}:{number}"))?;
                    if !wait.is_zero() {
                        next_ns = now + i64::try_from(wait.as_nanos()).unwrap_or(i64::MAX - now);
                    } else if !line.trim().is_empty() {
                        // At once: whoever writes an emergency stop does not want to wait for a heartbeat.
                        session.send(now)?;
                    }
                    continue;
                }
                Next::Nothing => {}
                Next::End => return Ok("the script has ended"),
            }
        }
        let rest = session.rest(now_ns());
        // Other programs' lines are looked for more often than heartbeats go out.
        std::thread::sleep(rest.min(std::time::Duration::from_millis(2)));
    }
}

enum Next {
    Line(std::io::Result<String>),
    Nothing,
    End,
}

enum Lines {
    Here(VecDeque<String>),
    Coming(Receiver<std::io::Result<String>>),
}

impl Lines {
    fn of(source: Source) -> Self {
        match source {
            Source::Text(text) => Lines::Here(text.lines().map(str::to_owned).collect()),
            Source::Input => {
                let (read, lines) = channel();
                // Standard input blocks, and the heartbeat must not wait for it.
                std::thread::spawn(move || {
                    for line in std::io::stdin().lock().lines() {
                        if read.send(line).is_err() {
                            return;
                        }
                    }
                });
                Lines::Coming(lines)
            }
        }
    }

    fn next(&mut self) -> Next {
        match self {
            Lines::Here(lines) => lines.pop_front().map_or(Next::End, |line| Next::Line(Ok(line))),
            Lines::Coming(lines) => match lines.try_recv() {
                Ok(line) => Next::Line(line),
                Err(TryRecvError::Empty) => Next::Nothing,
                Err(TryRecvError::Disconnected) => Next::End,
            },
        }
    }
}
