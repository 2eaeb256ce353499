//! Statistics of a live network.

use super::Traffic;
use crate::Error;
use crate::log::Types;
use crate::udpm::{self, Listener, Url};
use nix::errno::Errno;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Sleep between two batches of datagrams. The kernel stores the receive time of each, so a batch only reduces the number of wake-ups.
const BATCH_INTERVAL: Duration = Duration::from_millis(5);
/// Largest number of datagrams read while the lock is held.
const BATCH: usize = 512;
/// Longest time to read remaining datagrams at the end.
const DRAIN_LIMIT: Duration = Duration::from_millis(200);

/// Receives on its own thread. It joins the multicast group with its own socket, not through liblcm, and never sends.
pub struct Live {
    traffic: Arc<Mutex<Traffic>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<(), Errno>>>,
    url: Url,
    warning: Option<String>,
}

impl Live {
    /// Joins the network and starts to receive.
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

    /// Warning for the user, such as a small receive buffer.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// The network.
    pub fn url(&self) -> &Url {
        &self.url
    }

    /// The statistics. While the guard is held, the receiving thread waits and datagrams stay in the kernel.
    pub fn traffic(&self) -> MutexGuard<'_, Traffic> {
        self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Time now in the clock of the receive times, ns since the Unix epoch.
    pub fn now_ns(&self) -> i64 {
        udpm::now_ns()
    }

    /// Whether the socket has failed; [`Live::end`] returns the error.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Reads the remaining datagrams and stops.
    ///
    /// # Errors
    /// [`Error::Socket`] if the socket failed.
    pub fn end(&mut self) -> Result<(), Error> {
        self.stop.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let listened = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        listened.map_err(|errno| Error::Socket { url: self.url.to_string(), at: "recvmsg", source: errno.into() })
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // An error cannot be reported from drop.
        let _ = self.end();
    }
}

fn listen(listener: &mut Listener, traffic: &Mutex<Traffic>, stop: &AtomicBool) -> Result<(), Errno> {
    while !stop.load(Ordering::Relaxed) {
        let first = listener.receive()?;
        let received = first.is_some();
        {
            let mut traffic = traffic.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(datagram) = first {
                traffic.datagram(&datagram);
            }
            traffic.settle(udpm::now_ns());
        }
        if received && !fetch(listener, traffic)? {
            std::thread::sleep(BATCH_INTERVAL);
        }
    }
    let until = Instant::now() + DRAIN_LIMIT;
    while fetch(listener, traffic)? && Instant::now() < until {}
    Ok(())
}

/// Reads a batch of datagrams. Returns whether there may be more.
fn fetch(listener: &mut Listener, traffic: &Mutex<Traffic>) -> Result<bool, Errno> {
    let mut traffic = traffic.lock().unwrap_or_else(PoisonError::into_inner);
    for _ in 0..BATCH {
        let Some(datagram) = listener.receive_now()? else { return Ok(false) };
        traffic.datagram(&datagram);
    }
    Ok(true)
}
