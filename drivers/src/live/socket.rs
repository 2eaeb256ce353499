//! Sends and receives on an LCM network from a real-time thread: no further thread, no lock, no allocation.

use crate::DriverError;
use replay::udpm::{Listener, MAX_DATAGRAM, Packet, Url};
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

/// Largest number of datagrams taken at once: more than the receive buffer holds, so that the newest is always among them.
const DATAGRAMS: usize = 4096;
/// Receive buffer, bytes: a tenth of a second of a busy network. A control loop has no use for older messages.
const BUFFER: usize = 1 << 20;
/// Time between two polls of [`has_traffic`].
const POLL: Duration = Duration::from_millis(2);
/// First bytes of a message that fits one datagram.
const SHORT: [u8; 4] = *b"LC02";

/// Receives the messages of an LCM network that fit one datagram each.
pub struct LcmReceiver {
    listener: Listener,
}

impl LcmReceiver {
    /// Joins the network.
    ///
    /// # Errors
    /// If the network cannot be joined.
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        Ok(LcmReceiver { listener: Listener::open(&Url { recv_buf_size: Some(BUFFER), ..url.clone() })? })
    }

    /// Calls `take` with sender address, channel and bytes of each message that has arrived since the last call, oldest first. Does not wait.
    pub fn receive(&mut self, mut take: impl FnMut(SocketAddrV4, &str, &[u8])) {
        for _ in 0..DATAGRAMS {
            // A failing socket gives no messages; the age of the last message shows it.
            let Ok(Some(datagram)) = self.listener.receive_now() else { return };
            if let Ok(Packet::Short(message)) = Packet::parse(datagram.bytes) {
                take(datagram.sender, &message.channel, message.data);
            }
        }
    }
}

/// Whether a message arrives on a channel `within` a time; returns at the first one.
///
/// # Errors
/// If the network cannot be joined.
pub fn has_traffic(url: &Url, channel: &str, within: Duration) -> Result<bool, DriverError> {
    let mut receiver = LcmReceiver::open(url)?;
    let (end, mut found) = (Instant::now() + within, false);
    while !found && Instant::now() < end {
        std::thread::sleep(POLL);
        receiver.receive(|_, from, _| found |= from == channel);
    }
    Ok(found)
}

/// Sends messages to an LCM network, each in one datagram.
pub struct LcmSender {
    socket: UdpSocket,
    to: SocketAddrV4,
    sequence: u32,
    datagram: Vec<u8>,
}

impl LcmSender {
    /// Opens a socket.
    ///
    /// # Errors
    /// [`DriverError::Socket`]
    pub fn open(url: &Url) -> Result<Self, DriverError> {
        let socket = || -> std::io::Result<UdpSocket> {
            let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
            socket.set_multicast_ttl_v4(u32::from(url.ttl))?;
            // If the send buffer is full, the message is dropped: the next one is due in a period.
            socket.set_nonblocking(true)?;
            Ok(socket)
        };
        let socket = socket().map_err(|source| DriverError::Socket { url: url.to_string(), source })?;
        let to = SocketAddrV4::new(url.group, url.port);
        Ok(LcmSender { socket, to, sequence: 0, datagram: Vec::with_capacity(MAX_DATAGRAM) })
    }

    /// Sends a message; false if it does not fit one datagram or the system does not accept it now.
    pub fn send(&mut self, channel: &str, data: &[u8]) -> bool {
        let LcmSender { socket, to, sequence, datagram } = self;
        datagram.clear();
        for part in [&SHORT[..], &sequence.to_be_bytes(), channel.as_bytes(), &[0], data] {
            datagram.extend_from_slice(part);
        }
        *sequence = sequence.wrapping_add(1);
        datagram.len() <= MAX_DATAGRAM && socket.send_to(datagram, *to).is_ok()
    }
}
