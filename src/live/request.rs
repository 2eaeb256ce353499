//! A request to a live run, and its reply.

use anyhow::bail;
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{Message, RequestReply, channels, new_sender_id};
use replay::udpm::Url;
use std::time::{Duration, Instant};

/// Longest wait for a reply.
const TIMEOUT: Duration = Duration::from_secs(2);
/// Time after which a request is sent again: request or reply may be lost. The run carries it out once.
const RESEND: Duration = Duration::from_millis(400);
/// Longest wait for one message.
const POLL: Duration = Duration::from_millis(50);
/// Receive buffer, bytes: for all messages of the run between two polls.
const BUFFER: usize = 4_000_000;

/// Sends requests to a run and receives the replies.
pub struct Client {
    bus: LcmBus,
    url: String,
    sender_id: i64,
    next_request_id: i64,
}

impl Client {
    /// Joins the network at `url`, else that of LCM_DEFAULT_URL, else LCM's default.
    ///
    /// # Errors
    /// If the URL is invalid or the network cannot be joined.
    pub fn open(url: Option<&str>) -> anyhow::Result<Self> {
        Self::listening(url, channels::REQUEST_REPLY)
    }

    /// As [`Client::open`], for replies on channels that match an LCM pattern.
    ///
    /// # Errors
    /// As [`Client::open`].
    pub fn listening(url: Option<&str>, pattern: &str) -> anyhow::Result<Self> {
        let mut network = Url::choose(url)?;
        let url = network.to_string();
        network.recv_buf_size.get_or_insert(BUFFER);
        let mut bus = LcmBus::open(&network.to_string())?;
        bus.subscribe(pattern)?;
        Ok(Client { bus, url, sender_id: new_sender_id(), next_request_id: 1 })
    }

    /// Publishes the request that `make` returns for a sender_id and a request_id, and waits for its reply.
    ///
    /// - `kind`: `request_reply_t` KIND_*.
    ///
    /// # Errors
    /// If the bus fails, or no reply arrives within [`TIMEOUT`].
    pub fn request<M: Message>(
        &mut self,
        channel: &str,
        kind: i8,
        make: impl FnOnce(i64, i64) -> M,
    ) -> anyhow::Result<RequestReply> {
        self.ask(channel, make, |bytes, sender_id, request_id| {
            let id = (kind, sender_id, request_id);
            RequestReply::decode(bytes).ok().filter(|reply| (reply.kind, reply.sender_id, reply.request_id) == id)
        })
    }

    /// Waits for a message, without a request.
    ///
    /// # Errors
    /// If the bus fails, or no such message arrives within [`TIMEOUT`].
    pub fn wait<R>(&mut self, take: impl Fn(&[u8]) -> Option<R>) -> anyhow::Result<R> {
        let start = Instant::now();
        while start.elapsed() < TIMEOUT {
            let messages = self.bus.handle(POLL)?;
            if let Some(found) = messages.iter().find_map(|message| take(&message.data)) {
                return Ok(found);
            }
        }
        bail!(
            "no message on {} within {} s; check that a Cartesian server is running there",
            self.url,
            TIMEOUT.as_secs()
        )
    }

    /// Publishes the request that `make` returns for a sender_id and a request_id, and waits for the message in which `take` finds its answer.
    ///
    /// - `take`: the bytes of a message, sender_id and request_id.
    ///
    /// # Errors
    /// If the bus fails, or no answer arrives within [`TIMEOUT`].
    pub fn ask<M: Message, R>(
        &mut self,
        channel: &str,
        make: impl FnOnce(i64, i64) -> M,
        take: impl Fn(&[u8], i64, i64) -> Option<R>,
    ) -> anyhow::Result<R> {
        let request_id = self.next_request_id;
        self.next_request_id += 1;
        let mut bytes = Vec::new();
        make(self.sender_id, request_id).encode(&mut bytes)?;
        let start = Instant::now();
        let mut due = Duration::ZERO;
        while start.elapsed() < TIMEOUT {
            if start.elapsed() >= due {
                self.bus.publish(channel, &bytes)?;
                due += RESEND;
            }
            let messages = self.bus.handle(POLL)?;
            let mut answers = messages.iter().filter_map(|message| take(&message.data, self.sender_id, request_id));
            if let Some(answer) = answers.next() {
                return Ok(answer);
            }
        }
        bail!(
            "no reply on {} within {} s; check that `hoof run` or `hoof controller` is running there (`hoof spy` shows its messages)",
            self.url,
            TIMEOUT.as_secs()
        )
    }
}
