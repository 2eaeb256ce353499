//! Hears and speaks on an LCM network from a real-time thread: no thread of its own between, no lock, no allocation.

use crate::DriverError;
use replay::udpm::{Listener, MAX_DATAGRAM, Packet, Url};
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

/// Datagrams taken at once at most: more than the receive buffer holds, so that the newest is always among them.
const DATAGRAMS: usize = 4096;
/// Receive buffer, bytes: a tenth of a second of a busy network. What is older is of no use to a control loop.
const BUFFER: usize = 1 << 20;
/// How often an ear that waits for somebody listens.
const LOOK: Duration = Duration::from_millis(2);
/// First bytes of a message in one datagram.
const SHORT: [u8; 4] = *b"LC02";

/// Hears an LCM network, as far as its messages fit one datagram each.
pub struct Ear {
    listener: Listener,
}

impl Ear {
    /// Joins the network.
    ///
    /// # Errors
    /// If it cannot be joined.
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        Ok(Ear { listener: Listener::open(&Url { recv_buf_size: Some(BUFFER), ..url.clone() })? })
    }

    /// Gives channel and bytes of each message that has come since the last call to `take`, oldest first.
    pub fn hear(&mut self, mut take: impl FnMut(&str, &[u8])) {
        for _ in 0..DATAGRAMS {
            // A socket that fails gives no messages, and who waits for them sees the last one grow old.
            let Ok(Some(datagram)) = self.listener.receive_now() else { return };
            if let Ok(Packet::Short(message)) = Packet::parse(datagram.bytes) {
                take(message.channel, message.data);
            }
        }
    }
}

/// Whether anybody speaks on a channel: listens for a while, or until somebody does.
///
/// # Errors
/// If the network cannot be joined.
pub fn somebody_speaks(url: &Url, channel: &str, within: Duration) -> Result<bool, DriverError> {
    let mut ear = Ear::open(url)?;
    let (end, mut heard) = (Instant::now() + within, false);
    while !heard && Instant::now() < end {
        std::thread::sleep(LOOK);
        ear.hear(|from, _| heard |= from == channel);
    }
    Ok(heard)
}

/// A sender of an LCM network. Its messages fit one datagram each.
pub struct Speaker {
    socket: UdpSocket,
    to: SocketAddrV4,
    sequence: u32,
    datagram: Vec<u8>,
}

impl Speaker {
    /// Opens a socket.
    ///
    /// # Errors
    /// [`DriverError::Socket`]
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        let socket = || -> std::io::Result<UdpSocket> {
            let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
            socket.set_multicast_ttl_v4(u32::from(url.ttl))?;
            // Rather lose a message than wait for a full buffer: the next one is due in a period.
            socket.set_nonblocking(true)?;
            Ok(socket)
        };
        let socket = socket().map_err(|source| DriverError::Socket { url: url.to_string(), source })?;
        let to = SocketAddrV4::new(url.group, url.port);
        Ok(Speaker { socket, to, sequence: 0, datagram: Vec::with_capacity(MAX_DATAGRAM) })
    }

    /// Sends a message; false if it does not fit or the system takes none now.
    pub fn say(&mut self, channel: &str, data: &[u8]) -> bool {
        let Speaker { socket, to, sequence, datagram } = self;
        datagram.clear();
        for part in [&SHORT[..], &sequence.to_be_bytes(), channel.as_bytes(), &[0], data] {
            datagram.extend_from_slice(part);
        }
        *sequence = sequence.wrapping_add(1);
        datagram.len() <= MAX_DATAGRAM && socket.send_to(datagram, *to).is_ok()
    }
}
