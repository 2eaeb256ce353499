//! Display of a live run: one line per process at the bottom, events above. Without a terminal, only the events.

use super::process::{Line, Process};
use crate::note;
use drivers::live::clock::now_ns;
use drivers::live::{EventLimit, Suppressed};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use lcmtypes::{ControllerTick, Event, Message, enum_names};
use replay::{printable, printable_path};
use std::path::{Path, PathBuf};
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// Interval for the rate of states.
const RATE_INTERVAL: Duration = Duration::from_secs(1);

/// The screen.
pub struct Screen {
    all: MultiProgress,
    rows: Vec<ProgressBar>,
    start: Instant,
    log: PathBuf,
    status: Status,
    limit: EventLimit,
}

/// Status of the run, from the messages of its processes.
struct Status {
    tick: Option<ControllerTick>,
    /// Number of states, and start of the interval.
    states: (u32, Instant),
    rate_hz: Option<f64>,
}

impl Screen {
    /// A screen without processes, for a run that is recorded in `log`.
    pub fn new(log: PathBuf) -> Self {
        let status = Status { tick: None, states: (0, Instant::now()), rate_hz: None };
        Screen {
            all: MultiProgress::new(),
            rows: Vec::new(),
            start: Instant::now(),
            log,
            status,
            limit: EventLimit::default(),
        }
    }

    /// Whether the lines of the processes are shown on a terminal.
    pub fn is_visible(&self) -> bool {
        !self.all.is_hidden()
    }

    /// Adds a line for a process.
    pub fn add(&mut self, process: &Process) {
        let row = self.all.add(ProgressBar::no_length());
        row.set_style(ProgressStyle::with_template("{wide_msg}").expect("the template is a constant that parses"));
        self.rows.push(row);
        self.say(&format!("{}: process {}", process.name, process.id()));
        self.show(self.rows.len() - 1, process, None);
    }

    /// Takes a CONTROLLER_TICK.
    pub fn tick(&mut self, tick: &[u8]) {
        self.status.tick = ControllerTick::decode(tick).ok().or(self.status.tick.take());
    }

    /// Counts a ROBOT_STATE.
    pub fn state(&mut self) {
        self.status.states.0 += 1;
    }

    /// Updates the line of a process.
    pub fn show(&mut self, place: usize, process: &Process, ended: Option<ExitStatus>) {
        let state = match ended {
            Some(status) => format!("ended, {status}"),
            None => self.status.of(process.name, &self.log),
        };
        self.rows[place].set_message(format!("{:<10} {:>7}  {state}", process.name, process.id()));
        self.rows[place].tick();
    }

    /// Shows a line of the standard error of a process.
    pub fn line(&self, line: &Line) {
        self.say(&format!("{}: {}", line.process, printable(&line.text)));
    }

    /// Shows an EVENT, unless its source sends too many.
    pub fn event(&mut self, event: &Event) {
        if !self.limit.passes(now_ns(), event) {
            return;
        }
        let mark = match event.level {
            Event::LEVEL_ERROR => "ERROR ",
            Event::LEVEL_WARNING => "warning ",
            _ => "",
        };
        self.say(&format!("{mark}{}: {}", printable(&event.source), printable(&event.text)));
    }

    /// Shows how many EVENTs were not shown.
    pub fn show_suppressed(&mut self) {
        let suppressed = self.limit.take_suppressed(now_ns());
        self.say_suppressed(suppressed);
    }

    /// [`Screen::show_suppressed`] at the end of the run.
    pub fn show_rest(&mut self) {
        let suppressed = self.limit.take_rest();
        self.say_suppressed(suppressed);
    }

    fn say_suppressed(&self, suppressed: Vec<Suppressed>) {
        for suppressed in suppressed {
            self.say(&format!("warning {}: {}", printable(&suppressed.source), suppressed.text()));
        }
    }

    /// Shows a line with the time since the start.
    pub fn say(&self, text: &str) {
        let time = format!("{:8.3} s  ", self.start.elapsed().as_secs_f64());
        if self.is_visible() {
            let width = crossterm::terminal::size().map_or(80, |(columns, _)| usize::from(columns));
            // A failing terminal must not stop the robot.
            let _ = self.all.println(wrapped(&time, text, width));
        } else {
            note(format!("{time}{text}"));
        }
    }
}

/// Wraps a text between words into lines of at most `width` characters; `head` precedes the first line and indents the others.
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

impl Status {
    /// Status of a running process.
    #[expect(clippy::cast_precision_loss, reason = "a size for a person to read")]
    fn of(&mut self, process: &str, log: &Path) -> String {
        match (process, &self.tick) {
            ("recorder", _) => {
                let size = std::fs::metadata(log).map_or(0, |file| file.len());
                format!("{:.1} MB in {}", size as f64 * 1e-6, printable_path(log))
            }
            ("driver", _) => self.rate_hz().map_or_else(String::new, |rate| format!("{rate:.0} states/s")),
            (_, Some(tick)) => format!("{}, tick {}", enum_names::mode(tick.mode), tick.tick),
            (_, None) => String::new(),
        }
    }

    /// States per second, over the last second.
    fn rate_hz(&mut self) -> Option<f64> {
        let (count, since) = self.states;
        let time = since.elapsed();
        if time >= RATE_INTERVAL {
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
    fn each_process_has_its_own_status() {
        let mut screen = Screen::new("no/such.mcap".into());
        let of = |screen: &mut Screen, name: &str| screen.status.of(name, &screen.log);
        assert_eq!(
            ["recorder", "driver", "controller"].map(|name| of(&mut screen, name)),
            ["0.0 MB in no/such.mcap", "", ""]
        );
        let tick = ControllerTick { tick: 4812, mode: ControllerTick::MODE_WALK, ..ControllerTick::default() };
        let mut bytes = Vec::new();
        tick.encode(&mut bytes).unwrap();
        screen.tick(&bytes);
        screen.tick(b"not a tick");
        assert_eq!(of(&mut screen, "controller"), "WALK, tick 4812");
        // Ten states in the last two seconds.
        screen.status.states = (10, Instant::now().checked_sub(Duration::from_secs(2)).unwrap());
        assert_eq!(of(&mut screen, "driver"), "5 states/s");
    }

    #[test]
    fn lines_break_between_words() {
        assert_eq!(wrapped("1 s  ", "a robot walks", 13), "1 s  a robot\n     walks");
        assert_eq!(wrapped("1 s  ", "a robot walks", 18), "1 s  a robot walks");
        assert_eq!(
            wrapped("1 s  ", "udpm://239.255.76.67:7667 is used", 12),
            "1 s  udpm://239.255.76.67:7667\n     is used"
        );
    }
}
