//! LCM's UDP multicast protocol, read from the socket.
//!
//! liblcm delivers messages, but neither the sequence numbers of their senders nor the kernel's receive times. A recorder that reports lost
//! messages has to read the datagrams itself.
//!
//! - [`Url`]: `udpm://239.255.76.67:7667?ttl=0&recv_buf_size=N`, as in every LCM program.
//! - [`Packet`]: one datagram, a short message or a fragment of a long one; [`split`] encodes a message.
//! - [`Reassembler`]: reassembles messages from fragments in any order, ignores duplicates, in bounded memory.
//! - [`Listener`]: the socket, with the kernel's receive time and drop count.
//!
//! Source: LCM 1.5.3, `docs/content/udp-multicast-protocol.md`, `lcm/udpm_util.h`, `lcm/lcm_udpm.c`.

mod listener;
mod packet;
mod reassembly;
mod url;

use nix::time::{ClockId, clock_gettime};

pub use listener::{Datagram, Listener};
pub use packet::{FRAGMENT_BODY, Fragment, Malformed, Packet, Short, split};
pub use reassembly::{Abandoned, Outcome, Reassembled, Reassembler};
pub use url::Url;

/// Longest UDP payload over IPv4, bytes.
pub const MAX_DATAGRAM: usize = 65_507;

/// Time since the Unix epoch, ns: the clock of the kernel's receive times.
pub(crate) fn now_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Monotonic time, ns: the clock of the messages of a live run.
pub(crate) fn monotonic_ns() -> i64 {
    // CLOCK_MONOTONIC exists on every Linux.
    clock_gettime(ClockId::CLOCK_MONOTONIC).map_or(0, |t| t.tv_sec() * 1_000_000_000 + t.tv_nsec())
}
