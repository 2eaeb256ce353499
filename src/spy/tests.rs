//! The screen after some messages and keys, drawn into memory.
#![allow(clippy::unwrap_used)]

use super::processes::Processes;
use super::screen_data::{Scope, ScreenData};
use super::state::{Action, Page, State};
use super::view::Screen;
use crossterm::event::{KeyCode, KeyEvent};
use lcmtypes::{Message, RobotState, channels};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::style::{Color, Modifier};
use replay::traffic::{Alarm, Alarms, Traffic};
use replay::udpm::{Datagram, split};
use std::net::{Ipv4Addr, SocketAddrV4};

const MS: i64 = 1_000_000;

/// Half a second of three channels: ROBOT_STATE at 1 kHz with every hundredth message lost, PLAIN at 100 Hz from the same sender, OTHER
/// from another sender.
fn traffic() -> Traffic {
    let mut traffic = Traffic::default();
    traffic.follow(channels::ROBOT_STATE, "q[1]");
    let mut sequences = [0, 0];
    for ms in 0..500 {
        let mut send = |sender: usize, channel: &str, data: &[u8], is_lost: bool| {
            let bytes = &split(sequences[sender], channel, data)[0];
            sequences[sender] += 1;
            let sender = SocketAddrV4::new(Ipv4Addr::LOCALHOST, [5000, 6000][sender]);
            if !is_lost {
                traffic.datagram(&Datagram { sender, t_ns: ms * MS, kernel_dropped: 0, bytes });
            }
        };
        let (q, qd, tau) = (vec![0.25, ms as f64 * 0.01], vec![0.0; 2], vec![0.0; 2]);
        let mut state = Vec::new();
        RobotState { t_ns: ms * MS, seq: ms, nj: 2, q, qd, tau, ..Default::default() }.encode(&mut state).unwrap();
        send(0, channels::ROBOT_STATE, &state, ms % 100 == 50);
        if ms % 10 == 0 {
            send(0, "PLAIN", b"some bytes of no type", false);
            send(1, "OTHER", b"short", false);
        }
    }
    traffic.settle(2000 * MS);
    traffic
}

struct Shown {
    traffic: Traffic,
    alarms: Alarms,
    state: State,
}

impl Shown {
    fn new() -> Self {
        let alarms = vec![Alarm::new("OTHER rate>50").unwrap(), Alarm::new("GONE age>1").unwrap()];
        Shown { traffic: traffic(), alarms: Alarms::new(alarms), state: State::default() }
    }

    fn screen_data(&mut self) -> ScreenData {
        let now_ns = 500 * MS;
        let rows = self.traffic.rows(now_ns);
        let raised = self.alarms.check(&rows);
        let screen_data = ScreenData::take(&self.traffic, now_ns, rows, raised, &Scope::ALL);
        self.state.settle(&screen_data);
        screen_data
    }

    /// Presses some keys and returns the action of the last.
    fn press(&mut self, keys: &[KeyCode]) -> Option<Action> {
        let mut action = None;
        for key in keys {
            let screen_data = self.screen_data();
            action = self.state.key(&KeyEvent::from(*key), &screen_data);
        }
        action
    }

    fn type_in(&mut self, text: &str) -> Option<Action> {
        self.press(&text.chars().map(KeyCode::Char).collect::<Vec<_>>())
    }

    fn draw(&mut self, width: u16, height: u16) -> Terminal<TestBackend> {
        let screen_data = self.screen_data();
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        let screen = Screen {
            title: "239.255.76.67:7667",
            is_log: false,
            is_frozen: true,
            recording: Some("REC log.mcap 3 s".to_owned()),
            message: "",
            no_data_text: "nothing received",
            alarms: self.alarms.times().map(|(text, times)| (text.to_owned(), times)).collect(),
            screen_data: &screen_data,
            state: &self.state,
            processes: &Processes::default(),
        };
        terminal.draw(|frame| screen.draw(frame)).unwrap();
        terminal
    }

    fn lines(&mut self, width: u16, height: u16) -> Vec<String> {
        let terminal = self.draw(width, height);
        let buffer = terminal.backend().buffer();
        let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned();
        (0..height).map(row).collect()
    }
}

#[test]
fn the_channel_table_fits_80_by_24_characters() {
    let mut shown = Shown::new();
    let lines = shown.lines(80, 24);
    assert_eq!(lines[0], "239.255.76.67:7667  3 channels  lost 5  1190 msg/s  93.7 kB/s");
    assert!(lines[1].contains("FROZEN") && lines[1].contains("ALARM 2") && lines[1].contains("REC log.mcap 3 s"));
    assert_eq!(lines[2], "channel↓                  count  rate Hz   jitter      B/s   lost   late     age");
    // Without a counter in the messages the bound is the loss of the sender on all channels; OTHER's sender lost nothing.
    assert_eq!(lines[3], "OTHER                        50    100.0     0 us     500       0      0   10 ms");
    assert_eq!(lines[4], "PLAIN                        50    100.0     0 us    2.1 k     ≤5      0   10 ms");
    assert_eq!(lines[5], "ROBOT_STATE                 495    990.0     0 us   91.1 k      5      0 1.00 ms");
}

#[test]
fn a_channel_with_an_alarm_is_red_and_the_cursor_is_reversed() {
    let mut shown = Shown::new();
    shown.press(&[KeyCode::Down]);
    let terminal = shown.draw(80, 24);
    let style = |y| terminal.backend().buffer()[(0, y)].style();
    assert_eq!(style(3).fg, Some(Color::Red));
    assert_eq!(style(4).fg, Some(Color::Reset));
    let reversed: Vec<u16> = (3..6).filter(|y| style(*y).add_modifier.contains(Modifier::REVERSED)).collect();
    assert_eq!(reversed, [4]);
}

#[test]
fn a_filter_applies_while_it_is_typed() {
    let mut shown = Shown::new();
    let channels = |shown: &mut Shown| -> Vec<String> {
        let screen_data = shown.screen_data();
        shown.state.rows(&screen_data).iter().map(|row| row.name.clone()).collect()
    };
    shown.type_in("/^o|st");
    assert_eq!(channels(&mut shown), ["OTHER", "ROBOT_STATE"]);
    // An open bracket is invalid; the last valid filter stays.
    shown.type_in("(");
    assert_eq!(channels(&mut shown), ["OTHER", "ROBOT_STATE"]);
    assert!(shown.state.is_filter_bad);
    // Other keys are text here.
    assert_eq!(shown.type_in("q"), None);
    shown.press(&[KeyCode::Esc]);
    assert_eq!(channels(&mut shown).len(), 3);
    assert_eq!(shown.type_in("q"), Some(Action::Quit));
}

#[test]
fn rows_are_sorted_by_any_column_both_ways() {
    let mut shown = Shown::new();
    shown.type_in("ss");
    let first = |shown: &mut Shown| shown.lines(80, 24)[3].split(' ').next().unwrap().to_owned();
    assert!(shown.lines(80, 24)[2].contains("count↓"));
    assert_eq!(first(&mut shown), "ROBOT_STATE");
    shown.type_in("S");
    assert_eq!(first(&mut shown), "PLAIN");
}

#[test]
fn a_field_of_a_message_is_selected_and_plotted() {
    let mut shown = Shown::new();
    shown.press(&[KeyCode::End, KeyCode::Enter, KeyCode::Down, KeyCode::Down, KeyCode::Down, KeyCode::Down]);
    assert!(shown.lines(80, 24).iter().any(|line| line.starts_with("▸ q                  [2] 0.250 4.990")));
    // A time span of 0.6 s instead of 10 s.
    shown.type_in("----");
    // Expanded, the second element is the plotted one, followed by its bars.
    shown.press(&[KeyCode::Right, KeyCode::Down, KeyCode::Down]);
    let lines = shown.lines(80, 24);
    let line = lines.iter().find(|line| line.starts_with("    [1]")).unwrap();
    assert!(line.contains("4.99") && line.contains('█') && line.contains('▁'), "{line}");
    let action = shown.type_in("p");
    assert_eq!(action, Some(Action::Follow(channels::ROBOT_STATE.to_owned(), "q[1]".to_owned())));
    // Up to its array, collapse it, and back to the channels.
    shown.press(&[KeyCode::Left]);
    assert_eq!(shown.state.part, "q");
    shown.press(&[KeyCode::Left, KeyCode::Left]);
    assert_eq!(shown.state.page, Page::Channels);
}

#[test]
fn messages_of_unknown_type_are_shown_as_bytes() {
    let mut shown = Shown::new();
    shown.press(&[KeyCode::Down, KeyCode::Enter]);
    let lines = shown.lines(80, 24);
    assert_eq!(lines[2], "PLAIN  ? 736f6d6520627974  #50  10 ms ago");
    assert!(lines[3].starts_with("21 bytes"), "{}", lines[3]);
    assert_eq!(lines[4], "000000  73 6f 6d 65 20 62 79 74 65 73 20 6f 66 20 6e 6f  some bytes of no");
}

#[test]
fn the_plot_has_axes_and_a_legend() {
    let mut shown = Shown::new();
    shown.type_in("3-");
    let lines = shown.lines(80, 24);
    assert!(lines.iter().any(|line| line.contains("-5 s")), "{lines:#?}");
    let listed = lines.iter().find(|line| line.starts_with("ROBOT_STATE q[1]")).unwrap();
    assert!(listed.ends_with("4.990  from 0.0 to 4.990"), "{listed}");
    assert!(lines.iter().any(|line| line.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c))));
}

#[test]
fn the_network_page_lists_every_sender_and_alarm() {
    let mut shown = Shown::new();
    shown.type_in("4");
    let text = shown.lines(100, 24).join("\n");
    for line in [
        "127.0.0.1:5000              545 received, lost 5, duplicate 0, late 0",
        "127.0.0.1:6000               50 received, lost 0, duplicate 0, late 0",
        "    1  OTHER rate>50",
        "now    OTHER rate>50: OTHER is 100.0, raised once",
        "now    GONE age>1: no messages, raised once",
        "127.0.0.1:5000 lost 5: sequence 55, 165, 275, 385, 495",
    ] {
        assert!(text.contains(line), "{line} in\n{text}");
    }
}

#[test]
fn wide_screens_show_channels_and_message_beside_each_other() {
    let mut shown = Shown::new();
    shown.press(&[KeyCode::End]);
    let text = shown.lines(200, 30).join("\n");
    assert!(text.contains("OTHER") && text.contains("robot_state_t") && text.contains("[2] 0.250 4.990"), "{text}");
}

#[test]
fn an_empty_network_shows_a_text_and_any_screen_size_works() {
    let mut shown = Shown::new();
    shown.traffic = Traffic::default();
    shown.alarms = Alarms::default();
    assert_eq!(shown.lines(80, 24)[2], "nothing received");
    for page in ["1", "2", "3", "4", "?"] {
        let mut shown = Shown::new();
        shown.type_in(page);
        for (width, height) in [(1, 1), (20, 4), (79, 7), (300, 100)] {
            shown.draw(width, height);
        }
    }
}
