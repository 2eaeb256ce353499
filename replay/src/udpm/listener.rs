//! The socket that receives a multicast group.

use super::{MAX_DATAGRAM, Url};
use crate::Error;
use nix::cmsg_space;
use nix::errno::Errno;
use nix::sys::socket::{
    AddressFamily, ControlMessageOwned, IpMembershipRequest, MsgFlags, SockFlag, SockType, SockaddrIn, bind,
    getsockopt, recvmsg, setsockopt, socket, sockopt,
};
use nix::sys::time::{TimeSpec, TimeVal, TimeValLike};
use std::io::IoSliceMut;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::os::fd::{AsRawFd, OwnedFd};

/// Default size of the receive buffer, bytes: more than 0.1 s of messages at 20 kHz.
const BUFFER: usize = 1 << 25;

/// Timeout of [`Listener::receive`], ms: the caller can check for a stop request in between.
const WAIT_MS: i64 = 20;

/// Receives every datagram of a group. It never sends.
pub struct Listener {
    socket: OwnedFd,
    /// Size of the receive buffer that the kernel granted, bytes.
    granted: usize,
    wanted: usize,
    data: Vec<u8>,
    control: Vec<u8>,
}

/// A received datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// Address of the sender: one per LCM instance.
    pub sender: SocketAddrV4,
    /// Receive time of the kernel, ns since the Unix epoch.
    pub t_ns: i64,
    /// Datagrams that the kernel dropped since the socket was opened, because its buffer was full.
    pub kernel_dropped: u32,
    /// Payload.
    pub bytes: &'a [u8],
}

impl Listener {
    /// Joins the group of a URL.
    ///
    /// # Errors
    /// [`Error::Socket`] with the call that failed.
    pub fn open(url: &Url) -> Result<Self, Error> {
        let failed =
            |at: &'static str| move |source: Errno| Error::Socket { url: url.to_string(), at, source: source.into() };
        let socket =
            socket(AddressFamily::Inet, SockType::Datagram, SockFlag::SOCK_CLOEXEC, None).map_err(failed("socket"))?;
        // All LCM programs on a machine bind the same port.
        setsockopt(&socket, sockopt::ReuseAddr, &true).map_err(failed("SO_REUSEADDR"))?;
        setsockopt(&socket, sockopt::ReusePort, &true).map_err(failed("SO_REUSEPORT"))?;
        setsockopt(&socket, sockopt::ReceiveTimestampns, &true).map_err(failed("SO_TIMESTAMPNS"))?;
        setsockopt(&socket, sockopt::RxqOvfl, &1).map_err(failed("SO_RXQ_OVFL"))?;
        setsockopt(&socket, sockopt::ReceiveTimeout, &TimeVal::milliseconds(WAIT_MS)).map_err(failed("SO_RCVTIMEO"))?;
        let wanted = url.recv_buf_size.unwrap_or(BUFFER);
        // Root may exceed net.core.rmem_max.
        setsockopt(&socket, sockopt::RcvBufForce, &wanted)
            .or_else(|_| setsockopt(&socket, sockopt::RcvBuf, &wanted))
            .map_err(failed("SO_RCVBUF"))?;
        // The kernel reports twice the requested size, because it includes its own overhead.
        let granted = getsockopt(&socket, sockopt::RcvBuf).map_err(failed("SO_RCVBUF"))? / 2;
        bind(socket.as_raw_fd(), &SockaddrIn::from(SocketAddrV4::new(url.group, url.port))).map_err(failed("bind"))?;
        let membership = IpMembershipRequest::new(url.group, None);
        setsockopt(&socket, sockopt::IpAddMembership, &membership).map_err(failed("IP_ADD_MEMBERSHIP"))?;
        Ok(Listener { socket, granted, wanted, data: vec![0; MAX_DATAGRAM + 1], control: cmsg_space!(TimeSpec, u32) })
    }

    /// A warning with a remedy if the kernel granted a smaller receive buffer than requested.
    pub fn warning(&self) -> Option<String> {
        (self.granted < self.wanted).then(|| {
            format!(
                "receive buffer of {} bytes instead of {}: bursts of messages may be lost; as root: \
                 sysctl -w net.core.rmem_max={}",
                self.granted, self.wanted, self.wanted
            )
        })
    }

    /// The next datagram; `None` after the timeout.
    ///
    /// # Errors
    /// [`Errno`] if the socket fails.
    pub fn receive(&mut self) -> Result<Option<Datagram<'_>>, Errno> {
        self.receive_with(MsgFlags::empty())
    }

    /// The next datagram that is already in the receive buffer; does not wait.
    ///
    /// # Errors
    /// [`Errno`] if the socket fails.
    pub fn receive_now(&mut self) -> Result<Option<Datagram<'_>>, Errno> {
        self.receive_with(MsgFlags::MSG_DONTWAIT)
    }

    fn receive_with(&mut self, flags: MsgFlags) -> Result<Option<Datagram<'_>>, Errno> {
        let mut parts = [IoSliceMut::new(&mut self.data)];
        let message = match recvmsg::<SockaddrIn>(self.socket.as_raw_fd(), &mut parts, Some(&mut self.control), flags) {
            Ok(message) => message,
            Err(Errno::EAGAIN | Errno::EINTR) => return Ok(None),
            Err(error) => return Err(error),
        };
        let (mut t_ns, mut kernel_dropped) = (None, 0);
        for part in message.cmsgs()? {
            match part {
                ControlMessageOwned::ScmTimestampns(time) => t_ns = Some(time.num_nanoseconds()),
                ControlMessageOwned::RxqOvfl(count) => kernel_dropped = count,
                _ => {}
            }
        }
        let sender = message.address.map_or(SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, 0), SocketAddrV4::from);
        let length = message.bytes;
        Ok(Some(Datagram {
            sender,
            t_ns: t_ns.unwrap_or_else(super::now_ns),
            kernel_dropped,
            bytes: &self.data[..length],
        }))
    }
}
