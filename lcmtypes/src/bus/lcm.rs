//! A bus over liblcm.

use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::io;
use std::ptr::NonNull;
use std::time::Duration;

use super::{Bus, BusError, QUEUE_CAPACITY, Received, check_channel, check_size, ffi, whole_name};

const ADVICE_UDPM: &str = "UDP multicast needs a route; `ip route replace 224.0.0.0/4 dev lo` as root makes one that stays on \
                           this machine (for a robot's network, put its interface in place of `lo`)";
const ADVICE_OTHER: &str =
    "the URL is one of udpm://239.255.76.67:7667?ttl=0, memq://, file://PATH?mode=w (or mode=r&speed=0)";

/// A handle to LCM: `udpm://` between processes, `memq://` within this handle, `file://` to and from an event log.
#[derive(Debug)]
pub struct LcmBus {
    url: String,
    lcm: NonNull<ffi::lcm_t>,
    /// Made by `Box::into_raw`, freed on drop. Callbacks write to it, and they run only inside `lcm_handle_timeout`.
    inbox: NonNull<Inbox>,
}

#[derive(Debug, Default)]
struct Inbox {
    queue: VecDeque<Received>,
    /// The message in dispatch is in the queue: LCM calls once for each subscription that it matches.
    taken: bool,
}

// SAFETY: liblcm ties no handle to a thread and guards it with its own locks; `inbox` is owned, and reached through `&mut self` only.
unsafe impl Send for LcmBus {}

impl LcmBus {
    /// Opens LCM. An empty URL stands for the environment's `LCM_DEFAULT_URL`, or `udpm://239.255.76.67:7667?ttl=0`.
    ///
    /// Add `recv_buf_size=2000000` to a `udpm://` URL where much is received: the kernel's default holds 200 KB.
    ///
    /// # Errors
    /// [`BusError::Open`], which says what to do.
    pub fn open(url: &str) -> Result<Self, BusError> {
        let advice = if url.is_empty() || url.starts_with("udpm:") { ADVICE_UDPM } else { ADVICE_OTHER };
        let error = || BusError::Open { url: url.to_owned(), advice };
        let c_url = CString::new(url).map_err(|_| error())?;
        let provider = if url.is_empty() { std::ptr::null() } else { c_url.as_ptr() };
        // SAFETY: `provider` is NULL, which lcm_create takes for the default, or a C string that outlives the call.
        let lcm = NonNull::new(unsafe { ffi::lcm_create(provider) }).ok_or_else(error)?;
        let inbox = NonNull::from(Box::leak(Box::<Inbox>::default()));
        Ok(Self { url: url.to_owned(), lcm, inbox })
    }

    fn inbox(&mut self) -> &mut Inbox {
        // SAFETY: the box lives as long as `self`; callbacks borrow it only inside lcm_handle_timeout, where no borrow of ours lives.
        unsafe { self.inbox.as_mut() }
    }

    /// Lets LCM put one message into the inbox; `false` if none came in time.
    fn dispatch_one(&mut self, timeout_ms: c_int) -> Result<bool, BusError> {
        self.inbox().taken = false;
        // SAFETY: the handle is open until drop, and `&mut self` keeps a second thread from handling it at the same time.
        let status = unsafe { ffi::lcm_handle_timeout(self.lcm.as_ptr(), timeout_ms) };
        if status >= 0 {
            return Ok(status > 0);
        }
        let reason = io::Error::last_os_error();
        // A signal is no failure of the bus: its handler has run, and the caller decides what it means.
        if reason.kind() == io::ErrorKind::Interrupted {
            return Ok(false);
        }
        Err(BusError::Receive { url: self.url.clone(), reason: reason.to_string() })
    }
}

/// Copies a message into the inbox that `user_data` points to.
unsafe extern "C" fn take(rbuf: *const ffi::lcm_recv_buf_t, channel: *const c_char, user_data: *mut c_void) {
    // SAFETY: liblcm passes a valid buffer and a C string; `user_data` is the inbox given to lcm_subscribe, alive and not borrowed.
    let (rbuf, channel, inbox) = unsafe { (&*rbuf, CStr::from_ptr(channel), &mut *user_data.cast::<Inbox>()) };
    if std::mem::replace(&mut inbox.taken, true) {
        return;
    }
    let data = if rbuf.data_size == 0 {
        Vec::new() // `data` may be NULL then
    } else {
        // SAFETY: liblcm vouches for `data_size` bytes at `data` until the callback returns.
        unsafe { std::slice::from_raw_parts(rbuf.data.cast::<u8>(), rbuf.data_size as usize) }.to_vec()
    };
    let channel = channel.to_string_lossy().into_owned();
    inbox.queue.push_back(Received { channel, data, recv_utime: Some(rbuf.recv_utime) });
}

impl Bus for LcmBus {
    fn publish(&mut self, channel: &str, bytes: &[u8]) -> Result<(), BusError> {
        check_channel(channel)?;
        check_size(channel, bytes)?;
        // On the stack, so that publishing does not allocate: a name is at most 63 bytes and its NUL.
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
        // liblcm puts `^` and `$` around it, which would bind to the outer branches of `A|B` alone.
        let pattern = CString::new(format!("(?:{channels})")).map_err(|_| error())?;
        // SAFETY: the pattern outlives the call; `take` has the type that liblcm calls, and the inbox lives until lcm_destroy.
        let subscription =
            unsafe { ffi::lcm_subscribe(self.lcm.as_ptr(), pattern.as_ptr(), Some(take), self.inbox.as_ptr().cast()) };
        let subscription = NonNull::new(subscription).ok_or_else(error)?;
        let capacity = c_int::try_from(QUEUE_CAPACITY).expect("a small number");
        // SAFETY: the subscription was just made, and lives until lcm_destroy.
        let status = unsafe { ffi::lcm_subscription_set_queue_capacity(subscription.as_ptr(), capacity) };
        if status == 0 { Ok(()) } else { Err(error()) }
    }

    fn handle(&mut self, timeout: Duration) -> Result<Vec<Received>, BusError> {
        // Rounded up: a wait of 0.5 ms must not become none at all.
        let mut wait = c_int::try_from(timeout.as_micros().div_ceil(1000)).unwrap_or(c_int::MAX);
        while self.inbox().queue.len() < QUEUE_CAPACITY {
            match self.dispatch_one(wait) {
                Ok(true) => wait = 0,
                Ok(false) => break,
                Err(error) if self.inbox().queue.is_empty() => return Err(error),
                // What came before the failure goes out first; the next call meets the failure again.
                Err(_) => break,
            }
        }
        Ok(self.inbox().queue.drain(..).collect())
    }

    /// liblcm counts nothing; whoever needs it compares the `seq` or `tick` of the messages.
    fn dropped(&self) -> u64 {
        0
    }
}

impl Drop for LcmBus {
    fn drop(&mut self) {
        // SAFETY: both were made in `open` and are used by nothing else; liblcm stops its threads before the inbox goes.
        unsafe {
            ffi::lcm_destroy(self.lcm.as_ptr());
            drop(Box::from_raw(self.inbox.as_ptr()));
        }
    }
}
