//! A relay that drops, duplicates and reorders datagrams and records every action.
//!
//! Each sender is relayed from a separate socket, so that a receiver behind the relay sees one sequence per sender, as before it.
#![allow(clippy::unwrap_used, missing_docs)]

use controller::math::Rng;
use replay::udpm::{Packet, Url};
use serde::Serialize;
use std::collections::BTreeMap;
use std::net::{SocketAddrV4, UdpSocket};

/// Number of later datagrams of the same sender that a held datagram lets pass.
const OVERTAKEN_BY: usize = 3;

/// Share of datagrams per action, 0 to 1 each.
#[derive(Debug, Clone, Copy, Default)]
pub struct Shares {
    pub drop: f64,
    pub duplicate: f64,
    pub reorder: f64,
}

/// Actions so far, in total, per channel and per sender.
#[derive(Debug, Default, Serialize)]
pub struct Account {
    #[serde(flatten)]
    pub total: Counts,
    pub channels: BTreeMap<String, Counts>,
    pub senders: Vec<SenderAccount>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Messages received by the relay.
    pub messages: u64,
    /// Messages of which at least one datagram was dropped.
    pub lost: u64,
    /// Datagrams received by the relay, including those dropped.
    pub datagrams: u64,
    pub dropped: u64,
    /// Datagrams sent twice.
    pub duplicated: u64,
    /// Datagrams sent after later ones of their sender.
    pub reordered: u64,
}

#[derive(Debug, Clone, Serialize)]
pub struct SenderAccount {
    /// Address of the sender.
    pub from: String,
    /// Port from which the relay sends.
    pub port: u16,
    #[serde(flatten)]
    pub counts: Counts,
    /// Lost messages before the first and after the last message that passed; sequence numbers do not show them.
    pub lost_at_ends: u64,
    /// Sequence numbers of the lost messages.
    pub lost_sequences: Vec<u32>,
}

pub struct Relay {
    to: Url,
    shares: Shares,
    random: Rng,
    channels: BTreeMap<String, Counts>,
    senders: BTreeMap<SocketAddrV4, Sender>,
}

struct Sender {
    socket: UdpSocket,
    counts: Counts,
    lost_sequences: Vec<u32>,
    /// Message of the last datagram.
    message: Option<Message>,
    got_through: bool,
    /// Messages lost since the last message that passed completely.
    lost_in_a_row: u64,
    lost_before_first: u64,
    held: Vec<Held>,
}

struct Message {
    sequence: u32,
    channel: String,
    is_lost: bool,
}

struct Held {
    datagram: Vec<u8>,
    channel: String,
    overtaken_by: usize,
}

impl Relay {
    pub fn new(to: Url, shares: Shares, seed: u64) -> Self {
        Relay { to, shares, random: Rng::from_state(seed), channels: BTreeMap::new(), senders: BTreeMap::new() }
    }

    /// Processes a datagram: sends it once, twice, later or never.
    pub fn datagram(&mut self, from: SocketAddrV4, bytes: &[u8]) -> std::io::Result<()> {
        let chance: [f64; 3] = std::array::from_fn(|_| self.random());
        let ttl = self.to.ttl;
        let sender = match self.senders.entry(from) {
            std::collections::btree_map::Entry::Occupied(known) => known.into_mut(),
            std::collections::btree_map::Entry::Vacant(new) => new.insert(Sender::new(ttl)?),
        };
        // Other datagrams are relayed as well.
        let packet = Packet::parse(bytes).ok();
        let channel = match &packet {
            Some(Packet::Short(short)) => short.channel.to_string(),
            Some(Packet::Fragment(fragment)) => {
                fragment.channel.as_deref().unwrap_or_else(|| sender.channel_of(fragment.sequence)).to_owned()
            }
            None => "(no LCM)".to_owned(),
        };
        let counts = self.channels.entry(channel.clone()).or_default();
        let sequence = packet.as_ref().map(Packet::sequence);
        let is_new = sequence.is_some_and(|sequence| sender.begin(sequence, &channel));
        let is_dropped = chance[0] < self.shares.drop;
        let is_first_loss = is_dropped && sender.lose();
        let is_doubled = !is_dropped && chance[1] < self.shares.duplicate;
        let is_held = !is_dropped && !is_doubled && chance[2] < self.shares.reorder;
        for counts in [counts, &mut sender.counts] {
            counts.datagrams += 1;
            counts.messages += u64::from(is_new);
            counts.lost += u64::from(is_first_loss);
            counts.dropped += u64::from(is_dropped);
            counts.duplicated += u64::from(is_doubled);
        }
        if is_held {
            sender.held.push(Held { datagram: bytes.to_vec(), channel, overtaken_by: 0 });
        } else if !is_dropped {
            let to = (self.to.group, self.to.port);
            (0..1 + u8::from(is_doubled)).try_for_each(|_| sender.socket.send_to(bytes, to).map(drop))?;
            sender.overtake();
            for held in sender.held.extract_if(.., |held| held.overtaken_by == OVERTAKEN_BY) {
                sender.socket.send_to(&held.datagram, to)?;
                sender.counts.reordered += 1;
                self.channels.entry(held.channel).or_default().reordered += 1;
            }
        }
        Ok(())
    }

    /// Sends all held datagrams.
    pub fn flush(&mut self) -> std::io::Result<()> {
        let to = (self.to.group, self.to.port);
        for sender in self.senders.values_mut() {
            for held in sender.held.drain(..) {
                sender.socket.send_to(&held.datagram, to)?;
                let is_late = u64::from(held.overtaken_by > 0);
                sender.counts.reordered += is_late;
                self.channels.entry(held.channel).or_default().reordered += is_late;
            }
        }
        Ok(())
    }

    /// The actions so far.
    pub fn account(&self) -> Account {
        let senders: Vec<SenderAccount> = self.senders.iter().map(|(from, sender)| sender.account(*from)).collect();
        let total = self.channels.values().fold(Counts::default(), |sum, one| Counts {
            messages: sum.messages + one.messages,
            lost: sum.lost + one.lost,
            datagrams: sum.datagrams + one.datagrams,
            dropped: sum.dropped + one.dropped,
            duplicated: sum.duplicated + one.duplicated,
            reordered: sum.reordered + one.reordered,
        });
        Account { total, channels: self.channels.clone(), senders }
    }

    /// Uniform in 0..1.
    fn random(&mut self) -> f64 {
        self.random.uniform(0.0, 1.0)
    }
}

impl Sender {
    fn new(ttl: u8) -> std::io::Result<Self> {
        let socket = UdpSocket::bind("0.0.0.0:0")?;
        socket.set_multicast_ttl_v4(ttl.into())?;
        Ok(Sender {
            socket,
            counts: Counts::default(),
            lost_sequences: Vec::new(),
            message: None,
            got_through: false,
            lost_in_a_row: 0,
            lost_before_first: 0,
            held: Vec::new(),
        })
    }

    /// `true` if this is the first datagram of its message.
    fn begin(&mut self, sequence: u32, channel: &str) -> bool {
        if self.message.as_ref().is_some_and(|message| message.sequence == sequence) {
            return false;
        }
        self.close();
        self.message = Some(Message { sequence, channel: channel.to_owned(), is_lost: false });
        true
    }

    /// Marks the message as lost; `false` if it already was.
    fn lose(&mut self) -> bool {
        let Some(message) = self.message.as_mut().filter(|message| !message.is_lost) else { return false };
        message.is_lost = true;
        self.lost_sequences.push(message.sequence);
        true
    }

    /// Ends the last message: none of its datagrams follow.
    fn close(&mut self) {
        let Some(message) = &self.message else { return };
        if message.is_lost {
            self.lost_in_a_row += 1;
            return;
        }
        if !self.got_through {
            self.lost_before_first = self.lost_in_a_row;
        }
        self.got_through = true;
        self.lost_in_a_row = 0;
    }

    /// Channel of a message: only its first fragment contains the name.
    fn channel_of(&self, sequence: u32) -> &str {
        let message = self.message.as_ref().filter(|message| message.sequence == sequence);
        message.map_or("(unknown)", |message| &message.channel)
    }

    fn overtake(&mut self) {
        self.held.iter_mut().for_each(|held| held.overtaken_by += 1);
    }

    fn account(&self, from: SocketAddrV4) -> SenderAccount {
        let last_is_lost = self.message.as_ref().map(|message| message.is_lost);
        let lost_after_last = match last_is_lost {
            Some(true) => self.lost_in_a_row + 1,
            _ => 0,
        };
        let got_through = self.got_through || last_is_lost == Some(false);
        let before_first = if self.got_through { self.lost_before_first } else { self.lost_in_a_row };
        SenderAccount {
            from: from.to_string(),
            port: self.socket.local_addr().map_or(0, |address| address.port()),
            counts: self.counts,
            lost_at_ends: if got_through { before_first + lost_after_last } else { self.counts.lost },
            lost_sequences: self.lost_sequences.clone(),
        }
    }
}
