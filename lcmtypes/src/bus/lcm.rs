//! A bus over liblcm.

use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};
use std::ptr::NonNull;
use std::time::Duration;

use super::{Bus, BusError, NO_ROUTE, QUEUE_CAPACITY, Received, check_channel, check_size, ffi, whole_name};

const ADVICE_UDPM: &str = "expected udpm://239.255.76.67:7667?ttl=0&recv_buf_size=BYTES or part of it";
const ADVICE_OTHER: &str =
    "expected one of udpm://239.255.76.67:7667?ttl=0, memq://, file://PATH?mode=w (or mode=r&speed=0)";

/// A handle to LCM: `udpm://` between processes, `memq://` within this handle, `file://` to and from an event log.
#[derive(Debug)]
pub struct LcmBus {
    url: String,
    lcm: NonNull<ffi::lcm_t>,
    /// Created by `Box::leak`, freed on drop. Written only by callbacks, which run only inside `lcm_handle_timeout`.
    inbox: NonNull<Inbox>,
}

#[derive(Debug, Default)]
struct Inbox {
    queue: VecDeque<Received>,
    /// The message in dispatch is already in the queue: LCM calls back once per matching subscription.
    taken: bool,
}

// SAFETY: a liblcm handle is not tied to a thread and has its own locks; `inbox` is owned and accessed only through `&mut self`.
unsafe impl Send for LcmBus {}

impl LcmBus {
    /// Opens LCM. An empty URL selects `LCM_DEFAULT_URL` of the environment, else `udpm://239.255.76.67:7667?ttl=0`.
    ///
    /// For high data rates add `recv_buf_size=2000000` to a `udpm://` URL: the default of the kernel is about 200 KB.
    ///
    /// # Errors
    /// [`BusError::Open`], with advice.
    pub fn open(url: &str) -> Result<Self, BusError> {
        let is_udpm = url.is_empty() || url.starts_with("udpm:");
        // Checked here, because liblcm prints several lines of its own about it.
        if is_udpm && !has_multicast_route(url) {
            return Err(BusError::Open { url: url.to_owned(), advice: NO_ROUTE });
        }
        let advice = if is_udpm { ADVICE_UDPM } else { ADVICE_OTHER };
        let error = || BusError::Open { url: url.to_owned(), advice };
        let c_url = CString::new(url).map_err(|_| error())?;
        let provider = if url.is_empty() { std::ptr::null() } else { c_url.as_ptr() };
        // SAFETY: `provider` is NULL, which lcm_create takes for the default, or a C string that outlives the call.
        let lcm = NonNull::new(unsafe { ffi::lcm_create(provider) }).ok_or_else(error)?;
        let inbox = NonNull::from(Box::leak(Box::<Inbox>::default()));
        Ok(Self { url: url.to_owned(), lcm, inbox })
    }

    fn inbox(&mut self) -> &mut Inbox {
        // SAFETY: the box lives as long as `self`; callbacks borrow it only inside lcm_handle_timeout, during which no other borrow exists.
        unsafe { self.inbox.as_mut() }
    }

    /// Lets LCM put one message into the inbox; false if none arrived in time.
    fn dispatch_one(&mut self, timeout_ms: c_int) -> Result<bool, BusError> {
        self.inbox().taken = false;
        // SAFETY: the handle is open until drop, and `&mut self` prevents a second thread from handling it at the same time.
        let status = unsafe { ffi::lcm_handle_timeout(self.lcm.as_ptr(), timeout_ms) };
        if status >= 0 {
            return Ok(status > 0);
        }
        let reason = io::Error::last_os_error();
        // An interrupting signal is not an error of the bus: its handler has run, and the caller checks its flag.
        if reason.kind() == io::ErrorKind::Interrupted {
            return Ok(false);
        }
        Err(BusError::Receive { url: self.url.clone(), reason: reason.to_string() })
    }
}

/// Whether the group of a `udpm:` URL can be reached; LCM's default group if the URL names none.
fn has_multicast_route(url: &str) -> bool {
    let group = url.strip_prefix("udpm://").and_then(|rest| rest.split('?').next()?.parse::<SocketAddrV4>().ok());
    let group = group.unwrap_or(SocketAddrV4::new(Ipv4Addr::new(239, 255, 76, 67), 7667));
    let unreachable = |error: &io::Error| error.kind() == io::ErrorKind::NetworkUnreachable;
    let connected = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).and_then(|socket| socket.connect(group));
    !connected.is_err_and(|error| unreachable(&error))
}

/// Copies a message into the inbox that `user_data` points to.
unsafe extern "C" fn take(rbuf: *const ffi::lcm_recv_buf_t, channel: *const c_char, user_data: *mut c_void) {
    // SAFETY: liblcm passes a valid buffer and a C string; `user_data` is the inbox given to lcm_subscribe, alive and not borrowed.
    let (rbuf, channel, inbox) = unsafe { (&*rbuf, CStr::from_ptr(channel), &mut *user_data.cast::<Inbox>()) };
    if std::mem::replace(&mut inbox.taken, true) {
        return;
    }
    let data = if rbuf.data_size == 0 {
        Vec::new() // `data` may be NULL
    } else {
        // SAFETY: `data` points to `data_size` bytes that are valid until the callback returns.
        unsafe { std::slice::from_raw_parts(rbuf.data.cast::<u8>(), rbuf.data_size as usize) }.to_vec()
    };
    let channel = channel.to_string_lossy().into_owned();
    inbox.queue.push_back(Received { channel, data, recv_utime: Some(rbuf.recv_utime) });
}

impl Bus for LcmBus {
    fn publish(&mut self, channel: &str, bytes: &[u8]) -> Result<(), BusError> {
        check_channel(channel)?;
        check_size(channel, bytes)?;
        // On the stack, so that publishing does not allocate: a name has at most 63 bytes and a NUL.
        let mut name = [0u8; ffi::LCM_MAX_CHANNEL_NAME_LENGTH as usize + 1];
        name[..channel.len()].copy_from_slice(channel.as_bytes());
        let length = u32::try_from(bytes.len()).expect("check_size allows 2^28 bytes");
        // SAFETY: `name` ends in NUL; `bytes` has `length` bytes; liblcm keeps neither.
        let status =
            unsafe { ffi::lcm_publish(self.lcm.as_ptr(), name.as_ptr().cast(), bytes.as_ptr().cast(), length) };
        if status == 0 {
            return Ok(());
        }
        let reason = io::Error::last_os_error().to_string();
        Err(BusError::Publish { channel: channel.to_owned(), length: bytes.len(), reason })
    }

    fn subscribe(&mut self, channels: &str) -> Result<(), BusError> {
        whole_name(channels)?;
        let error = || BusError::Subscribe { pattern: channels.to_owned(), url: self.url.clone() };
        // liblcm adds `^` and `$`, which without the group would apply only to the outer branches of `A|B`.
        let pattern = CString::new(format!("(?:{channels})")).map_err(|_| error())?;
        // SAFETY: the pattern outlives the call; `take` has the type of a handler, and the inbox lives until lcm_destroy.
        let subscription =
            unsafe { ffi::lcm_subscribe(self.lcm.as_ptr(), pattern.as_ptr(), Some(take), self.inbox.as_ptr().cast()) };
        let subscription = NonNull::new(subscription).ok_or_else(error)?;
        let capacity = c_int::try_from(QUEUE_CAPACITY).expect("a small number");
        // SAFETY: the subscription was just created and lives until lcm_destroy.
        let status = unsafe { ffi::lcm_subscription_set_queue_capacity(subscription.as_ptr(), capacity) };
        if status == 0 { Ok(()) } else { Err(error()) }
    }

    fn handle(&mut self, timeout: Duration) -> Result<Vec<Received>, BusError> {
        // Rounded up: a timeout of 0.5 ms must not become zero.
        let mut wait = c_int::try_from(timeout.as_micros().div_ceil(1000)).unwrap_or(c_int::MAX);
        while self.inbox().queue.len() < QUEUE_CAPACITY {
            match self.dispatch_one(wait) {
                Ok(true) => wait = 0,
                Ok(false) => break,
                Err(error) if self.inbox().queue.is_empty() => return Err(error),
                // Messages received before the error are returned first; the next call returns the error.
                Err(_) => break,
            }
        }
        Ok(self.inbox().queue.drain(..).collect())
    }

    /// liblcm does not count dropped messages; compare the `seq` or `tick` of the messages instead.
    fn dropped(&self) -> u64 {
        0
    }
}

impl Drop for LcmBus {
    fn drop(&mut self) {
        // SAFETY: both were created in `open` and are not used elsewhere; liblcm stops its threads before the inbox is freed.
        unsafe {
            ffi::lcm_destroy(self.lcm.as_ptr());
            drop(Box::from_raw(self.inbox.as_ptr()));
        }
    }
}
