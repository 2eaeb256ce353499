//! Which program on this machine a sender is, as far as the system tells: a port means little to a person.

use std::collections::BTreeMap;
use std::fs;
use std::net::{SocketAddrV4, UdpSocket};
use std::path::Path;
use std::time::{Duration, Instant};

/// How often senders that are not known yet are looked for.
const LOOK: Duration = Duration::from_secs(2);
/// Senders that are remembered.
const MAX: usize = 1000;

/// Programs by sender.
#[derive(Default)]
pub struct Processes {
    /// `None` of a sender on another machine, or whose program may not be looked at.
    known: BTreeMap<String, Option<String>>,
    looked: Option<Instant>,
}

impl Processes {
    /// Looks for the programs of senders that are new.
    pub fn look<'s>(&mut self, senders: impl Iterator<Item = &'s str>) {
        if self.looked.is_some_and(|looked| looked.elapsed() < LOOK) {
            return;
        }
        let new: Vec<&str> =
            senders.filter(|sender| !self.known.contains_key(*sender)).take(MAX - self.known.len()).collect();
        if new.is_empty() {
            return;
        }
        self.looked = Some(Instant::now());
        let sockets = sockets();
        let programs = if new.iter().any(|sender| local_port(sender).is_some()) { programs() } else { BTreeMap::new() };
        for sender in new {
            let socket = local_port(sender).and_then(|port| sockets.get(&port));
            self.known.insert(sender.to_owned(), socket.and_then(|socket| programs.get(socket)).cloned());
        }
    }

    /// The program of a sender, such as `hoof driver [812]`.
    pub fn of(&self, sender: &str) -> Option<&str> {
        self.known.get(sender)?.as_deref()
    }
}

/// The port of a sender on this machine.
fn local_port(sender: &str) -> Option<u16> {
    let address: SocketAddrV4 = sender.parse().ok()?;
    // Only an address of this machine can be bound.
    UdpSocket::bind((*address.ip(), 0)).ok().map(|_| address.port())
}

/// UDP sockets by port, as the kernel numbers them.
fn sockets() -> BTreeMap<u16, String> {
    let table = fs::read_to_string("/proc/net/udp").unwrap_or_default();
    let socket = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (_, port) = fields.get(1)?.split_once(':')?;
        Some((u16::from_str_radix(port, 16).ok()?, (*fields.get(9)?).to_owned()))
    };
    table.lines().skip(1).filter_map(socket).collect()
}

/// Programs by the number of each socket that they hold; those of other users only for root.
fn programs() -> BTreeMap<String, String> {
    let mut programs = BTreeMap::new();
    for process in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let path = process.path();
        // `self` is a process by another name.
        if !process.file_name().to_string_lossy().bytes().all(|byte| byte.is_ascii_digit()) {
            continue;
        }
        let Ok(files) = fs::read_dir(path.join("fd")) else { continue };
        let links = files.flatten().filter_map(|file| fs::read_link(file.path()).ok());
        let number = |link: &Path| Some(link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned());
        for number in links.filter_map(|link| number(&link)) {
            programs.entry(number).or_insert_with(|| name(&path));
        }
    }
    programs
}

/// `hoof driver [812]` of `/usr/bin/hoof driver --robot hyq`.
fn name(process: &Path) -> String {
    let line = fs::read(process.join("cmdline")).unwrap_or_default();
    let words = line.split(|byte| *byte == 0).map(|word| String::from_utf8_lossy(word).into_owned());
    let file =
        |word: String| Path::new(&word).file_name().map_or(word.clone(), |name| name.to_string_lossy().into_owned());
    let words: Vec<String> =
        words.take(2).filter(|word| !word.is_empty() && !word.starts_with('-')).map(file).collect();
    let number = process.file_name().unwrap_or_default().to_string_lossy();
    format!("{} [{number}]", replay::printable(&words.join(" ")))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_of_this_program_is_known_as_such() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let ours = socket.local_addr().unwrap().to_string();
        // Of those documentation addresses (RFC 5737) that no machine has.
        let (far, none) = ("203.0.113.7:9".to_owned(), "others".to_owned());
        let mut processes = Processes::default();
        processes.look([&ours, &far, &none].into_iter().map(String::as_str));
        let name = processes.of(&ours).unwrap();
        assert!(name.starts_with("hoof-") && name.ends_with(&format!(" [{}]", std::process::id())), "{name}");
        assert_eq!((processes.of(&far), processes.of(&none)), (None, None));
    }
}
