//! A wish to a live run, and the wait for its answer.

use anyhow::bail;
use lcmtypes::Message;
use lcmtypes::bus::{Bus, LcmBus, Received};
use replay::udpm::Url;
use std::time::{Duration, Instant};

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(2);
/// Receive buffer, bytes: all that the run says passes by.
const BUFFER: usize = 4_000_000;

/// A bus that does not lose an answer among what a run says otherwise; the network's name beside it.
///
/// # Errors
/// A URL that is none; a network that cannot be opened.
pub fn open(url: Option<&str>) -> anyhow::Result<(LcmBus, String)> {
    let mut url = Url::choose(url)?;
    let name = url.to_string();
    url.recv_buf_size.get_or_insert(BUFFER);
    Ok((LcmBus::open(&url.to_string())?, name))
}

/// Publishes a wish, and waits for the message that answers it.
///
/// - `again`: after which time it is sent anew, where that asks for nothing more: wish and answer may be lost.
///
/// # Errors
/// A bus that fails; nobody who answers.
pub fn ask<T>(
    bus: &mut dyn Bus,
    url: &str,
    channel: &str,
    wish: &impl Message,
    again: Option<Duration>,
    answer: impl Fn(&Received) -> Option<T>,
) -> anyhow::Result<T> {
    let mut bytes = Vec::new();
    wish.encode(&mut bytes)?;
    let asked = Instant::now();
    let mut due = Duration::ZERO;
    while asked.elapsed() < PATIENCE {
        if asked.elapsed() >= due {
            bus.publish(channel, &bytes)?;
            due = again.map_or(Duration::MAX, |again| due + again);
        }
        if let Some(answer) = bus.handle(Duration::from_millis(50))?.iter().find_map(&answer) {
            return Ok(answer);
        }
    }
    bail!(
        "nobody answers on {url}: is `hoof run` or `hoof controller` there? If it is, EVENT in its log says what came of it"
    )
}
