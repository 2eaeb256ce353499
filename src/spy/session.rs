//! The screen at work: keys in, pictures out.

use super::picture::{Picture, Wanted};
use super::processes::Processes;
use super::recording::Recording;
use super::source::{Source, nothing_heard};
use super::state::{State, Wish};
use super::view::Screen;
use anyhow::Context;
use crossterm::event::{Event as Input, KeyEventKind, poll, read};
use ratatui::DefaultTerminal;
use replay::traffic::Alarms;
use replay::udpm::Url;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often the screen is drawn: a person reads no faster, and a slow line carries it.
const REDRAW: Duration = Duration::from_millis(200);
/// How often a log is played on in between.
const PLAY: Duration = Duration::from_millis(20);
/// How long nothing is said of silence, and alarms wait, since rates have to be known first.
const PATIENCE: Duration = Duration::from_secs(2);

/// Shows what is heard until the person has seen enough; what is left to be said then.
pub fn interact(source: Source, alarms: Alarms, stop: &AtomicBool) -> anyhow::Result<Option<String>> {
    let terminal = ratatui::try_init().context("no terminal to draw on (--once prints the table)")?;
    let now = Instant::now();
    let (state, picture) = (State::default(), Picture::default());
    let session = Session {
        source,
        alarms,
        state,
        picture,
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
    picture: Picture,
    frozen: bool,
    recording: Option<Recording>,
    processes: Processes,
    message: String,
    /// When counting began.
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
                    match self.state.key(&key, &self.picture) {
                        Some(Wish::Quit) => break,
                        Some(wish) => self.grant(wish)?,
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

    /// Takes a new picture, unless it is to stand still; alarms are counted all the same.
    fn look(&mut self) {
        let now_ns = self.source.now_ns();
        let Session { source, alarms, state, picture, frozen, since, .. } = self;
        let is_early = since.elapsed() < PATIENCE;
        let mut taken = source.with(|traffic| {
            let rows = traffic.rows(now_ns);
            let raised = if is_early { Vec::new() } else { alarms.check(&rows) };
            if *frozen {
                return None;
            }
            let channel = state.channel.as_deref().unwrap_or_default();
            let wanted = Wanted { message: Some(channel), span_s: state.span_s };
            Some(Picture::take(traffic, now_ns, rows, raised, &wanted))
        });
        if let Some(taken) = taken.take() {
            *picture = taken;
        }
        self.state.settle(&self.picture);
        self.processes.look(self.picture.senders.iter().map(|account| &*account.sender));
        if let Source::Live(live) = &self.source
            && live.has_failed()
        {
            "the socket has failed; q says why".clone_into(&mut self.message);
        }
        if let Some(ended) = self.recording.take_if(|recording| recording.has_ended()) {
            self.message = ended.end();
        }
    }

    fn draw(&mut self) -> anyhow::Result<()> {
        let Session { source, alarms, state, picture, frozen, recording, processes, message, since, terminal } = self;
        let (title, silence, is_log) = match source {
            Source::Live(live) => {
                let silence = if since.elapsed() < PATIENCE { String::new() } else { nothing_heard(live.url()) };
                (short_name(live.url()), silence, false)
            }
            Source::Log(played) => (played.title(), String::new(), true),
        };
        let screen = Screen {
            title: &title,
            is_log,
            is_frozen: *frozen,
            recording: recording.as_ref().map(Recording::status),
            message,
            silence: &silence,
            alarms: alarms.times().map(|(text, times)| (told(text, alarms), times)).collect(),
            picture,
            state,
            processes,
        };
        terminal.draw(|frame| screen.draw(frame))?;
        Ok(())
    }

    fn grant(&mut self, wish: Wish) -> anyhow::Result<()> {
        match wish {
            Wish::Quit => {}
            Wish::Freeze => self.freeze(),
            Wish::Record => self.record(),
            Wish::Clear => {
                self.source.with(replay::traffic::Traffic::clear);
                self.since = Instant::now();
            }
            Wish::Follow(channel, path) => self.follow(&channel, &path),
            Wish::Seek(_) | Wish::Step | Wish::Faster(_) => match self.source.log() {
                Some(log) => {
                    match wish {
                        Wish::Seek(seconds) => log.seek(log.position_ns() + nanoseconds(seconds))?,
                        Wish::Step => log.step()?,
                        Wish::Faster(factor) => log.faster(factor),
                        _ => {}
                    }
                    self.since = Instant::now();
                }
                None => "only a log can be played at will: hoof spy --log FILE".clone_into(&mut self.message),
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
            let raised = std::mem::take(&mut self.picture.raised);
            self.picture =
                self.source.with(|traffic| Picture::take(traffic, now_ns, traffic.rows(now_ns), raised, &Wanted::ALL));
        }
    }

    fn record(&mut self) {
        self.message = match (self.recording.take(), &self.source) {
            (Some(recording), _) => recording.end(),
            (None, Source::Log(_)) => "this is a log already: hoof log trim copies a part of it".to_owned(),
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
        let is_followed = self.picture.curves.iter().any(|curve| curve.channel == channel && curve.path == path);
        self.source.with(|traffic| {
            if is_followed {
                traffic.unfollow(channel, path);
            } else {
                traffic.follow(channel, path);
            }
        });
        self.picture.curves.retain(|curve| !is_followed || curve.channel != channel || curve.path != path);
        self.message = format!("{path} {}", if is_followed { "is plotted no more" } else { "is plotted: 3" });
    }
}

/// A network, without what goes without saying.
/// A condition, and whether it is about anything.
fn told(text: &str, alarms: &Alarms) -> String {
    match alarms.unmatched().find(|alarm| *alarm == text) {
        Some(_) => format!("{text}  (no channel of that name yet)"),
        None => text.to_owned(),
    }
}

fn short_name(url: &Url) -> String {
    let ttl = if url.ttl > 0 { format!(" ttl={}", url.ttl) } else { String::new() };
    format!("{}:{}{ttl}", url.group, url.port)
}

fn nanoseconds(seconds: f64) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "the keys say 1 or 10 s")]
    let ns = (seconds * 1e9) as i64;
    ns
}
