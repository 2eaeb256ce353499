//! A wish to a live run, and the wait for its answer.

use anyhow::bail;
use lcmtypes::Message;
use lcmtypes::bus::{Bus, Received};
use std::time::{Duration, Instant};

/// How long an answer is waited for.
const PATIENCE: Duration = Duration::from_secs(2);

/// Publishes a wish, and waits for the message that answers it.
///
/// # Errors
/// A bus that fails; nobody who answers.
pub fn ask<T>(
    bus: &mut dyn Bus,
    url: &str,
    channel: &str,
    wish: &impl Message,
    answer: impl Fn(&Received) -> Option<T>,
) -> anyhow::Result<T> {
    let mut bytes = Vec::new();
    wish.encode(&mut bytes)?;
    bus.publish(channel, &bytes)?;
    let asked = Instant::now();
    while asked.elapsed() < PATIENCE {
        if let Some(answer) = bus.handle(Duration::from_millis(50))?.iter().find_map(&answer) {
            return Ok(answer);
        }
    }
    bail!("nobody answers on {url}: is `hoof run` or `hoof controller` there?")
}
