//! What a person sees of a live run: a line for each process at the bottom, everything that happens above it. Without a terminal, only what happens.

use super::process::{Line, Process};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use lcmtypes::{ControllerTick, Event, Message, enum_names};
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// Over how long states are counted.
const COUNTED: Duration = Duration::from_secs(1);

/// The screen.
pub struct Screen {
    all: MultiProgress,
    rows: Vec<ProgressBar>,
    began: Instant,
    log: PathBuf,
    pulse: Pulse,
}

/// How the run goes, by what its processes send.
struct Pulse {
    tick: Option<ControllerTick>,
    /// States since when, and of the time before that.
    states: (u32, Instant),
    rate_hz: Option<f64>,
}

impl Screen {
    /// A screen without processes, of a run that is recorded in `log`.
    pub fn new(log: PathBuf) -> Self {
        let pulse = Pulse { tick: None, states: (0, Instant::now()), rate_hz: None };
        Screen { all: MultiProgress::new(), rows: Vec::new(), began: Instant::now(), log, pulse }
    }

    /// Somebody sees the lines of the processes.
    pub fn is_seen(&self) -> bool {
        !self.all.is_hidden()
    }

    /// A line for one more process.
    pub fn add(&mut self, process: &Process) {
        let row = self.all.add(ProgressBar::no_length());
        row.set_style(ProgressStyle::with_template("{wide_msg}").expect("the template is a constant that parses"));
        self.rows.push(row);
        self.say(&format!("{}: process {}", process.name, process.id()));
        self.show(self.rows.len() - 1, process, None);
    }

    /// Takes in the tick of a controller.
    pub fn tick(&mut self, tick: &[u8]) {
        self.pulse.tick = ControllerTick::decode(tick).ok().or(self.pulse.tick.take());
    }

    /// Counts the state of a robot.
    pub fn state(&mut self) {
        self.pulse.states.0 += 1;
    }

    /// Shows how a process is.
    pub fn show(&mut self, place: usize, process: &Process, ended: Option<ExitStatus>) {
        let state = match ended {
            Some(status) => format!("ended, {status}"),
            None => self.pulse.of(process.name, &self.log),
        };
        self.rows[place].set_message(format!("{:<10} {:>7}  {state}", process.name, process.id()));
        self.rows[place].tick();
    }

    /// What a process says.
    pub fn line(&self, line: &Line) {
        self.say(&format!("{}: {}", line.process, line.text));
    }

    /// What somebody says on the network.
    pub fn event(&self, event: &Event) {
        let mark = match event.level {
            Event::LEVEL_ERROR => "ERROR ",
            Event::LEVEL_WARNING => "warning ",
            _ => "",
        };
        self.say(&format!("{mark}{}: {}", event.source, event.text));
    }

    /// What happens.
    pub fn say(&self, text: &str) {
        let time = format!("{:8.3} s  ", self.began.elapsed().as_secs_f64());
        if self.is_seen() {
            let width = crossterm::terminal::size().map_or(80, |(columns, _)| usize::from(columns));
            // A terminal that takes no more text is no reason to stop a robot.
            let _ = self.all.println(wrapped(&time, text, width));
        } else {
            eprintln!("{time}{text}");
        }
    }
}

/// Breaks a text between words, as far as it goes, into lines of up to `width` characters that stand behind `head`.
fn wrapped(head: &str, text: &str, width: usize) -> String {
    let indent = head.chars().count();
    let (mut lines, mut column) = (head.to_owned(), indent);
    for word in text.split(' ') {
        let length = word.chars().count();
        if column > indent && column + 1 + length > width {
            lines += &format!("\n{:indent$}", "");
            column = indent;
        } else if column > indent {
            lines.push(' ');
            column += 1;
        }
        lines += word;
        column += length;
    }
    lines
}

impl Pulse {
    /// What there is to say of a process that runs.
    #[expect(clippy::cast_precision_loss, reason = "a size for a person to read")]
    fn of(&mut self, process: &str, log: &Path) -> String {
        match (process, &self.tick) {
            ("recorder", _) => {
                let size = std::fs::metadata(log).map_or(0, |file| file.len());
                format!("{:.1} MB in {}", size as f64 * 1e-6, log.display())
            }
            ("driver", _) => self.rate_hz().map_or_else(String::new, |rate| format!("{rate:.0} states/s")),
            (_, Some(tick)) => format!("{}, tick {}", enum_names::mode(tick.mode), tick.tick),
            (_, None) => String::new(),
        }
    }

    /// States per second, of the last second.
    fn rate_hz(&mut self) -> Option<f64> {
        let (count, since) = self.states;
        let time = since.elapsed();
        if time >= COUNTED {
            self.rate_hz = Some(f64::from(count) / time.as_secs_f64());
            self.states = (0, Instant::now());
        }
        self.rate_hz
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.rows.iter().for_each(ProgressBar::finish);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_shown_by_what_it_does() {
        let mut screen = Screen::new("no/such.mcap".into());
        let of = |screen: &mut Screen, name: &str| screen.pulse.of(name, &screen.log);
        assert_eq!(
            ["recorder", "driver", "controller"].map(|name| of(&mut screen, name)),
            ["0.0 MB in no/such.mcap", "", ""]
        );
        let tick = ControllerTick { tick: 4812, mode: ControllerTick::MODE_WALK, ..ControllerTick::default() };
        let mut bytes = Vec::new();
        tick.encode(&mut bytes).unwrap();
        screen.tick(&bytes);
        screen.tick(b"no tick");
        assert_eq!(of(&mut screen, "controller"), "WALK, tick 4812");
        // Ten states in the two seconds that are over.
        screen.pulse.states = (10, Instant::now().checked_sub(Duration::from_secs(2)).unwrap());
        assert_eq!(of(&mut screen, "driver"), "5 states/s");
    }

    #[test]
    fn lines_break_between_words() {
        assert_eq!(wrapped("1 s  ", "a robot walks", 13), "1 s  a robot\n     walks");
        assert_eq!(wrapped("1 s  ", "a robot walks", 18), "1 s  a robot walks");
        assert_eq!(
            wrapped("1 s  ", "udpm://239.255.76.67:7667 it is", 12),
            "1 s  udpm://239.255.76.67:7667\n     it is"
        );
    }
}
