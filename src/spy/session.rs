//! The interactive session: reads keys, updates the view and draws it.

use super::processes::Processes;
use super::recording::Recording;
use super::screen_data::{Scope, ScreenData};
use super::source::{Source, nothing_received};
use super::state::{Action, State};
use super::view::Screen;
use anyhow::Context;
use crossterm::event::{Event as Input, KeyEventKind, poll, read};
use ratatui::DefaultTerminal;
use replay::traffic::Alarms;
use replay::udpm::Url;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two redraws; also suitable for a slow terminal connection.
const REDRAW: Duration = Duration::from_millis(200);
/// Time between two steps of log playback.
const PLAY: Duration = Duration::from_millis(20);
/// Time after the start or a reset without alarms and without the "nothing received" text: rates need this long to be known.
const WARM_UP: Duration = Duration::from_secs(2);

/// Runs the screen until the user quits. Returns a summary of the recording, if one was running.
pub fn interact(source: Source, alarms: Alarms, stop: &AtomicBool) -> anyhow::Result<Option<String>> {
    let terminal = ratatui::try_init().context("no terminal; use --once to print the table")?;
    let now = Instant::now();
    let (state, screen_data) = (State::default(), ScreenData::default());
    let session = Session {
        source,
        alarms,
        state,
        screen_data,
        frozen: false,
        recording: None,
        processes: Processes::default(),
        message: String::new(),
        since: now,
        terminal,
    };
    let shown = session.run(stop);
    ratatui::restore();
    shown
}

struct Session {
    source: Source,
    alarms: Alarms,
    state: State,
    screen_data: ScreenData,
    frozen: bool,
    recording: Option<Recording>,
    processes: Processes,
    message: String,
    /// Time of the start or of the last reset.
    since: Instant,
    terminal: DefaultTerminal,
}

impl Session {
    fn run(mut self, stop: &AtomicBool) -> anyhow::Result<Option<String>> {
        let mut drawn: Option<Instant> = None;
        while !stop.load(Ordering::Relaxed) {
            if let Some(log) = self.source.log() {
                log.advance()?;
            }
            if drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW) {
                self.look();
                self.draw()?;
                drawn = Some(Instant::now());
            }
            let left = REDRAW.saturating_sub(drawn.map_or(Duration::ZERO, |drawn| drawn.elapsed()));
            let wait = if self.source.log().is_some() { left.min(PLAY) } else { left };
            if !poll(wait)? {
                continue;
            }
            match read()? {
                Input::Key(key) if key.kind != KeyEventKind::Release => {
                    self.message.clear();
                    match self.state.key(&key, &self.screen_data) {
                        Some(Action::Quit) => break,
                        Some(action) => self.execute(action)?,
                        None => {}
                    }
                    drawn = None;
                }
                Input::Resize(..) => drawn = None,
                _ => {}
            }
        }
        if let Source::Live(live) = &mut self.source {
            live.end()?;
        }
        Ok(self.recording.map(Recording::end))
    }

    /// Updates the data of the screen unless it is frozen; alarms are always checked.
    fn look(&mut self) {
        let now_ns = self.source.now_ns();
        let Session { source, alarms, state, screen_data, frozen, since, .. } = self;
        let is_early = since.elapsed() < WARM_UP;
        let mut taken = source.with(|traffic| {
            let rows = traffic.rows(now_ns);
            let raised = if is_early { Vec::new() } else { alarms.check(&rows) };
            if *frozen {
                return None;
            }
            let channel = state.channel.as_deref().unwrap_or_default();
            let scope = Scope { message: Some(channel), span_s: state.span_s };
            Some(ScreenData::take(traffic, now_ns, rows, raised, &scope))
        });
        if let Some(taken) = taken.take() {
            *screen_data = taken;
        }
        self.state.settle(&self.screen_data);
        self.processes.look(self.screen_data.senders.iter().map(|account| &*account.sender));
        if let Source::Live(live) = &self.source
            && live.has_failed()
        {
            "socket error; quit with q to see it".clone_into(&mut self.message);
        }
        if let Some(ended) = self.recording.take_if(|recording| recording.has_ended()) {
            self.message = ended.end();
        }
    }

    fn draw(&mut self) -> anyhow::Result<()> {
        let Session { source, alarms, state, screen_data, frozen, recording, processes, message, since, terminal } =
            self;
        let (title, no_data_text, is_log) = match source {
            Source::Live(live) => {
                let no_data_text = if since.elapsed() < WARM_UP { String::new() } else { nothing_received(live.url()) };
                (short_name(live.url()), no_data_text, false)
            }
            Source::Log(played) => (played.title(), String::new(), true),
        };
        let screen = Screen {
            title: &title,
            is_log,
            is_frozen: *frozen,
            recording: recording.as_ref().map(Recording::status),
            message,
            no_data_text: &no_data_text,
            alarms: alarms.times().map(|(text, times)| (alarm_label(text, alarms), times)).collect(),
            screen_data,
            state,
            processes,
        };
        terminal.draw(|frame| screen.draw(frame))?;
        Ok(())
    }

    fn execute(&mut self, action: Action) -> anyhow::Result<()> {
        match action {
            Action::Quit => {}
            Action::Freeze => self.freeze(),
            Action::Record => self.record(),
            Action::Clear => {
                self.source.with(replay::traffic::Traffic::clear);
                self.since = Instant::now();
            }
            Action::Follow(channel, path) => self.follow(&channel, &path),
            Action::Seek(_) | Action::Step | Action::Faster(_) => match self.source.log() {
                Some(log) => {
                    match action {
                        Action::Seek(seconds) => log.seek(log.position_ns() + nanoseconds(seconds))?,
                        Action::Step => log.step()?,
                        Action::Faster(factor) => log.faster(factor),
                        _ => {}
                    }
                    self.since = Instant::now();
                }
                None => "this key works with a log only: hoof spy --log FILE".clone_into(&mut self.message),
            },
        }
        Ok(())
    }

    fn freeze(&mut self) {
        if let Some(log) = self.source.log() {
            log.pause();
            return;
        }
        self.frozen = !self.frozen;
        if self.frozen {
            let now_ns = self.source.now_ns();
            let raised = std::mem::take(&mut self.screen_data.raised);
            self.screen_data = self
                .source
                .with(|traffic| ScreenData::take(traffic, now_ns, traffic.rows(now_ns), raised, &Scope::ALL));
        }
    }

    fn record(&mut self) {
        self.message = match (self.recording.take(), &self.source) {
            (Some(recording), _) => recording.end(),
            (None, Source::Log(_)) => "the source is a log; hoof log trim copies a part of it".to_owned(),
            (None, Source::Live(live)) => match Recording::start(live.url()) {
                Ok(recording) => {
                    self.recording = Some(recording);
                    String::new()
                }
                Err(error) => format!("{error:#}"),
            },
        };
    }

    fn follow(&mut self, channel: &str, path: &str) {
        let is_followed = self.screen_data.curves.iter().any(|curve| curve.channel == channel && curve.path == path);
        self.source.with(|traffic| {
            if is_followed {
                traffic.unfollow(channel, path);
            } else {
                traffic.follow(channel, path);
            }
        });
        self.screen_data.curves.retain(|curve| !is_followed || curve.channel != channel || curve.path != path);
        self.message =
            format!("{path} {}", if is_followed { "removed from the plot" } else { "added to the plot (page 3)" });
    }
}

/// An alarm condition, with a note if it matches no channel.
fn alarm_label(text: &str, alarms: &Alarms) -> String {
    match alarms.unmatched().find(|alarm| *alarm == text) {
        Some(_) => format!("{text}  (matches no channel yet)"),
        None => text.to_owned(),
    }
}

/// Address of a network: group, port, and TTL if it is not 0.
fn short_name(url: &Url) -> String {
    let ttl = if url.ttl > 0 { format!(" ttl={}", url.ttl) } else { String::new() };
    format!("{}:{}{ttl}", url.group, url.port)
}

fn nanoseconds(seconds: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "the keys give 1 or 10 s")]
    let ns = (seconds * 1e9) as i64;
    ns
}
