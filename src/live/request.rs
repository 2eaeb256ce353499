//! A request to a live run, and its REQUEST_REPLY.

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
        let mut network = Url::choose(url)?;
        let url = network.to_string();
        network.recv_buf_size.get_or_insert(BUFFER);
        let mut bus = LcmBus::open(&network.to_string())?;
        bus.subscribe(channels::REQUEST_REPLY)?;
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
            let replies = self.bus.handle(POLL)?;
            let replies = replies.iter().filter_map(|message| RequestReply::decode(&message.data).ok());
            let id = (kind, self.sender_id, request_id);
            if let Some(reply) = { replies }.find(|reply| (reply.kind, reply.sender_id, reply.request_id) == id) {
                return Ok(reply);
            }
        }
        bail!(
            "no reply on {} within {} s; check that `hoof run` or `hoof controller` is running there (`hoof spy` shows its messages)",
            self.url,
            TIMEOUT.as_secs()
        )
    }
}
