//! LCM's UDP multicast protocol, heard from outside: what no LCM library shows of it.
//!
//! liblcm hands over messages, and neither the sender's sequence numbers nor reliable times of receipt. A recorder that is to say what it
//! did *not* hear has to read the datagrams itself.
//!
//! - [`Url`]: `udpm://239.255.76.67:7667?ttl=0&recv_buf_size=N`, as every LCM program takes it.
//! - [`Packet`]: one datagram, a short message or a fragment of a long one; [`split`] is the way back.
//! - [`Reassembler`]: fragments to messages, in any order, each fragment once, in bounded memory.
//! - [`Listener`]: the socket, with the kernel's time of receipt and its count of what it dropped.
//!
//! Source: LCM 1.5.3, `docs/content/udp-multicast-protocol.md`, `lcm/udpm_util.h`, `lcm/lcm_udpm.c`.

mod listener;
mod packet;
mod reassembly;
mod url;

use nix::time::{ClockId, clock_gettime};

pub use listener::{Datagram, Listener};
pub use packet::{FRAGMENT_BODY, Fragment, Malformed, Packet, Short, split};
pub use reassembly::{Abandoned, Outcome, Reassembler, Whole};
pub use url::Url;

/// Longest datagram that IPv4 carries, bytes.
pub const MAX_DATAGRAM: usize = 65_507;

/// Time since the Unix epoch, ns: the clock of the kernel's times of receipt.
pub(crate) fn now_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Monotonic time, ns: the clock of the messages of a live run.
pub(crate) fn monotonic_ns() -> i64 {
    // It exists on every Linux.
    clock_gettime(ClockId::CLOCK_MONOTONIC).map_or(0, |t| t.tv_sec() * 1_000_000_000 + t.tv_nsec())
}
