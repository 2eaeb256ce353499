//! The source of the messages: a network or a log.

use crate::progress::Progress;
use replay::log::{EventRef, Format, Health, LogReader, Types};
use replay::play::{PlayOptions, Player};
use replay::traffic::{Live, Traffic};
use replay::udpm::Url;
use std::path::Path;
use std::time::Instant;

/// Events read between two updates of the progress bar.
const AT_A_TIME: u64 = 10_000;

/// Largest number of log events played before keys are read again.
const AT_ONCE: usize = 20_000;

/// Time before a seek position from which messages are counted, ns: rates use the last 2 s.
const RUN_UP_NS: i64 = 2_000_000_000;

/// The source of the messages.
pub enum Source {
    /// A network.
    Live(Live),
    /// A log, played at its own speed.
    Log(Box<LogPlayback>),
}

impl Source {
    /// Calls a function with the traffic.
    pub fn with<R>(&mut self, with: impl FnOnce(&mut Traffic) -> R) -> R {
        match self {
            Source::Live(live) => with(&mut live.traffic()),
            Source::Log(played) => with(&mut played.traffic),
        }
    }

    /// The time now in the clock of the receive times, ns.
    pub fn now_ns(&self) -> i64 {
        match self {
            Source::Live(live) => live.now_ns(),
            Source::Log(played) => played.first_ns.saturating_add(played.position_ns()),
        }
    }

    /// The log, if the source is one.
    pub fn log(&mut self) -> Option<&mut LogPlayback> {
        match self {
            Source::Live(_) => None,
            Source::Log(played) => Some(played),
        }
    }
}

/// Playback of a log.
pub struct LogPlayback {
    name: String,
    player: Player,
    traffic: Traffic,
    began: Instant,
    first_ns: i64,
    length_ns: i64,
}

impl LogPlayback {
    /// Reads a log once for its types and its length, and starts the playback.
    pub fn open(log: &Path, types: Types) -> anyhow::Result<Self> {
        let ReadLog { mut traffic, first_ns, last_ns, .. } = read_log(log, types)?;
        traffic.clear();
        let player = Player::open(log, PlayOptions::default(), 0)?;
        let (name, length_ns) = (log.display().to_string(), last_ns.saturating_sub(first_ns));
        Ok(LogPlayback { name, player, traffic, began: Instant::now(), first_ns, length_ns })
    }

    /// Plays the events that are due.
    pub fn advance(&mut self) -> anyhow::Result<()> {
        let now_ns = self.clock_ns();
        for _ in 0..AT_ONCE {
            if self.player.due_ns().is_none_or(|due| due > now_ns) || self.player.is_at_end() {
                break;
            }
            self.take(now_ns)?;
        }
        Ok(())
    }

    fn take(&mut self, now_ns: i64) -> anyhow::Result<()> {
        if let Some(event) = self.player.take(now_ns)? {
            let (channel, t_ns, number, offset) = (&event.channel, event.t_ns, event.number, event.offset);
            self.traffic.event(&EventRef { channel, t_ns, number, data: &event.data, offset, source: None });
        }
        Ok(())
    }

    /// Plays the next event and pauses.
    pub fn step(&mut self) -> anyhow::Result<()> {
        let now_ns = self.clock_ns();
        self.player.pause(now_ns);
        self.take(now_ns)
    }

    /// Goes to a time, ns since the log's first event; rates are computed from the two seconds before it.
    pub fn seek(&mut self, to_ns: i64) -> anyhow::Result<()> {
        let to_ns = to_ns.clamp(0, self.length_ns);
        let from_ns = (to_ns - RUN_UP_NS).max(0);
        let (now_ns, is_paused) = (self.clock_ns(), self.player.is_paused());
        self.player.resume(now_ns);
        self.player.seek(from_ns + self.player.begin_ns(), now_ns)?;
        // As if the playback had started early enough to reach the position now.
        #[expect(clippy::cast_possible_truncation, reason = "two seconds, at most a thousand times slower")]
        let ago_ns = ((to_ns - from_ns) as f64 / self.player.speed().unwrap_or(1.0)) as i64;
        self.player.pause(now_ns);
        self.player.resume(now_ns - ago_ns);
        self.traffic.clear();
        while self.player.due_ns().is_some_and(|due| due <= now_ns) && !self.player.is_at_end() {
            self.take(now_ns)?;
        }
        if is_paused {
            self.player.pause(now_ns);
        }
        Ok(())
    }

    /// Pauses or resumes.
    pub fn pause(&mut self) {
        let now_ns = self.clock_ns();
        if self.player.is_paused() {
            self.player.resume(now_ns);
        } else {
            self.player.pause(now_ns);
        }
    }

    /// Multiplies the speed.
    pub fn faster(&mut self, factor: f64) {
        let now_ns = self.clock_ns();
        self.player.set_speed((self.player.speed().unwrap_or(1.0) * factor).clamp(1e-3, 1e3), now_ns);
    }

    /// Position, ns since the log's first event.
    pub fn position_ns(&self) -> i64 {
        if self.player.is_at_end() {
            self.length_ns
        } else {
            (self.player.position_ns(self.clock_ns()) - self.player.begin_ns()).clamp(0, self.length_ns)
        }
    }

    /// Name, position in s since the run's first tick, and speed.
    pub fn title(&self) -> String {
        let pace = match self.player.speed() {
            _ if self.player.is_at_end() => "end".to_owned(),
            _ if self.player.is_paused() => "paused".to_owned(),
            Some(speed) => format!("x{speed}"),
            None => String::new(),
        };
        let seconds = |ns: i64| (ns + self.player.begin_ns()) as f64 * 1e-9;
        let [at, end] = [self.position_ns(), self.length_ns].map(seconds);
        format!("{}  {at:.3} of {end:.3} s  {pace}", self.name)
    }

    fn clock_ns(&self) -> i64 {
        i64::try_from(self.began.elapsed().as_nanos()).unwrap_or(i64::MAX)
    }
}

/// The contents of a log.
pub struct ReadLog {
    /// Its messages and types.
    pub traffic: Traffic,
    /// Its format.
    pub format: Format,
    /// Damage, if any.
    pub health: Health,
    /// Time of its first event, ns.
    pub first_ns: i64,
    /// Time of its last event, ns.
    pub last_ns: i64,
}

/// Reads a log from end to end.
pub fn read_log(log: &Path, types: Types) -> anyhow::Result<ReadLog> {
    let mut reader = LogReader::open(log)?;
    let (format, length) = (reader.format(), reader.bytes());
    let mut health = Health::default();
    let mut traffic = Traffic::new(types);
    let bar = Progress::new("read the log");
    let (mut events, mut first_ns, mut last_ns) = (0u64, None, 0);
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        traffic.event(&event);
        first_ns.get_or_insert(event.t_ns);
        last_ns = event.t_ns;
        events += 1;
        if events.is_multiple_of(AT_A_TIME) {
            bar.set(event.offset as f64 / length.max(1) as f64);
        }
    }
    Ok(ReadLog { traffic, format, health, first_ns: first_ns.unwrap_or(0), last_ns })
}

/// Text for a network without messages: what to check.
pub fn nothing_received(url: &Url) -> String {
    let mut lines = vec![
        format!("no message received on {url}"),
        "- do the senders use this URL? check their LCM_DEFAULT_URL and --lcm-url".to_owned(),
        format!("- is there a route for multicast? run: ip route get {}", url.group),
        "  for one machine: sudo ip route replace 224.0.0.0/4 dev lo".to_owned(),
    ];
    if url.ttl == 0 {
        lines.push("- senders on another machine: they need ttl=1 or more in their URL".to_owned());
    }
    lines.push("hoof doctor checks this machine.".to_owned());
    lines.join("\n")
}
