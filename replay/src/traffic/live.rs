//! A network as it is heard now.

use super::Traffic;
use crate::Error;
use crate::log::Types;
use crate::udpm::{self, Listener, Url};
use nix::errno::Errno;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long datagrams are left to gather in the kernel before they are fetched. The kernel has written down when each came, so nothing is lost
/// by it but wake-ups, which are what a listener costs at high rates.
const NAP: Duration = Duration::from_millis(5);
/// Datagrams taken before others get to look.
const AT_ONCE: usize = 512;
/// Longest that what has come before the end is fetched.
const LAST: Duration = Duration::from_millis(200);

/// Listens on a thread of its own. It joins the group as a socket, not as a subscriber of liblcm, and never sends: those who talk cannot tell
/// whether it is there.
pub struct Live {
    traffic: Arc<Mutex<Traffic>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), Errno>>>,
    url: Url,
    warning: Option<String>,
}

impl Live {
    /// Joins the network and begins to listen.
    ///
    /// # Errors
    /// Those of [`Listener::open`].
    pub fn start(url: &Url, types: Types) -> Result<Self, Error> {
        let mut listener = Listener::open(url)?;
        let warning = listener.warning();
        let traffic = Arc::new(Mutex::new(Traffic::new(types)));
        let stop = Arc::new(AtomicBool::new(false));
        let (shared, stopped) = (Arc::clone(&traffic), Arc::clone(&stop));
        let thread = std::thread::Builder::new()
            .name("spy".to_owned())
            .spawn(move || listen(&mut listener, &shared, &stopped))
            .map_err(|source| Error::Socket { url: url.to_string(), at: "thread", source })?;
        Ok(Live { traffic, stop, thread: Some(thread), url: url.clone(), warning })
    }

    /// What a person should know before it goes on.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// The network.
    pub fn url(&self) -> &Url {
        &self.url
    }

    /// What was heard so far; whoever holds it stops the listener, and the kernel waits for both.
    pub fn traffic(&self) -> MutexGuard<'_, Traffic> {
        self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Time of the network's clock, ns since the Unix epoch.
    pub fn now_ns(&self) -> i64 {
        udpm::now_ns()
    }

    /// Whether the socket has failed; [`Live::end`] says why.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Fetches what has come and listens no more.
    ///
    /// # Errors
    /// [`Error::Socket`] if the network failed.
    pub fn end(&mut self) -> Result<(), Error> {
        self.stop.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let listened = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        listened.map_err(|errno| Error::Socket { url: self.url.to_string(), at: "recvmsg", source: errno.into() })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // Nobody is left to be told.
        let _ = self.end();
    }
}

fn listen(listener: &mut Listener, traffic: &Mutex<Traffic>, stop: &AtomicBool) -> Result<(), Errno> {
    while !stop.load(Ordering::Relaxed) {
        let first = listener.receive()?;
        let came = first.is_some();
        {
            let mut traffic = traffic.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(datagram) = first {
                traffic.datagram(&datagram);
            }
            traffic.settle(udpm::now_ns());
        }
        if came && !fetch(listener, traffic)? {
            std::thread::sleep(NAP);
        }
    }
    let until = Instant::now() + LAST;
    while fetch(listener, traffic)? && Instant::now() < until {}
    Ok(())
}

/// Takes what has come; whether there may be more.
fn fetch(listener: &mut Listener, traffic: &Mutex<Traffic>) -> Result<bool, Errno> {
    let mut traffic = traffic.lock().unwrap_or_else(PoisonError::into_inner);
    for _ in 0..AT_ONCE {
        let Some(datagram) = listener.receive_now()? else { return Ok(false) };
        traffic.datagram(&datagram);
    }
    Ok(true)
}
