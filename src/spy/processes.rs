//! Finds the program on this machine that owns a sender's port, as far as /proc shows it.

use std::collections::BTreeMap;
use std::fs;
use std::net::{SocketAddrV4, UdpSocket};
use std::path::Path;
use std::time::{Duration, Instant};

/// Time between two searches for unknown senders.
const INTERVAL: Duration = Duration::from_secs(2);
/// Largest number of senders that are stored.
const MAX: usize = 1000;

/// Program names by sender.
#[derive(Default)]
pub struct Processes {
    /// `None` for a sender on another machine, or a process that this user may not inspect.
    known: BTreeMap<String, Option<String>>,
    looked: Option<Instant>,
}

impl Processes {
    /// Finds the programs of new senders.
    pub fn look<'s>(&mut self, senders: impl Iterator<Item = &'s str>) {
        if self.looked.is_some_and(|looked| looked.elapsed() < INTERVAL) {
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
    // bind succeeds only for an address of this machine.
    UdpSocket::bind((*address.ip(), 0)).ok().map(|_| address.port())
}

/// Inode numbers of UDP sockets by port, from /proc/net/udp.
fn sockets() -> BTreeMap<u16, String> {
    let table = fs::read_to_string("/proc/net/udp").unwrap_or_default();
    let socket = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (_, port) = fields.get(1)?.split_once(':')?;
        Some((u16::from_str_radix(port, 16).ok()?, (*fields.get(9)?).to_owned()))
    };
    table.lines().skip(1).filter_map(socket).collect()
}

/// Programs by the inode number of each socket that they hold; processes of other users are visible to root only.
fn programs() -> BTreeMap<String, String> {
    let mut programs = BTreeMap::new();
    for process in fs::read_dir("/proc").into_iter().flatten().flatten() {
        let path = process.path();
        // Skip `self` and `thread-self`, which are links to processes.
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

/// Short name of a process: `hoof driver [812]` for `/usr/bin/hoof driver --robot hyq`.
fn name(process: &Path) -> String {
    let line = fs::read(process.join("cmdline")).unwrap_or_default();
    let parts = line.split(|byte| *byte == 0).map(|part| String::from_utf8_lossy(part).into_owned());
    let file =
        |part: String| Path::new(&part).file_name().map_or(part.clone(), |name| name.to_string_lossy().into_owned());
    let parts: Vec<String> =
        parts.take(2).filter(|part| !part.is_empty() && !part.starts_with('-')).map(file).collect();
    let number = process.file_name().unwrap_or_default().to_string_lossy();
    let text: String = parts.join(" ").chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("{text} [{number}]")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_socket_of_this_process_is_found() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let ours = socket.local_addr().unwrap().to_string();
        // A documentation address (RFC 5737), which no machine has.
        let (far, none) = ("203.0.113.7:9".to_owned(), "others".to_owned());
        let mut processes = Processes::default();
        processes.look([&ours, &far, &none].into_iter().map(String::as_str));
        let name = processes.of(&ours).unwrap();
        assert!(name.starts_with("hoof-") && name.ends_with(&format!(" [{}]", std::process::id())), "{name}");
        assert_eq!((processes.of(&far), processes.of(&none)), (None, None));
    }
}
