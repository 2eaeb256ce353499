//! LCM networks that no other test, and no other process of the machine, uses.
//!
//! Crates without access to `tests/common` include this file with `#[path]`.
#![allow(dead_code, reason = "no test file needs all of it")]

use nix::sys::socket::{setsockopt, sockopt::ReuseAddr};
use std::collections::BTreeMap;
use std::net::{Ipv4Addr, UdpSocket};
use std::sync::Mutex;

/// Sockets that keep the ports reserved until the test program ends, by number of the network.
static RESERVED: Mutex<BTreeMap<u32, UdpSocket>> = Mutex::new(BTreeMap::new());

/// Port of the test program's network with this number.
///
/// The kernel chooses a free port for a socket without SO_REUSEADDR. With SO_REUSEADDR set afterwards, the sockets of an LCM network, which set it
/// too, can bind to the port; a request for any free port still does not get it. The socket is bound to the loopback address, so it receives no
/// multicast.
pub fn port(number: u32) -> u16 {
    let mut reserved = RESERVED.lock().unwrap();
    let socket = reserved.entry(number).or_insert_with(|| {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        setsockopt(&socket, ReuseAddr, &true).unwrap();
        socket
    });
    socket.local_addr().unwrap().port()
}

/// URL of the test program's network with this number. Networks differ by port: liblcm receives the messages of all groups on its port.
pub fn url(number: u32) -> String {
    format!("udpm://239.255.76.67:{}?ttl=0&recv_buf_size=2000000", port(number))
}
