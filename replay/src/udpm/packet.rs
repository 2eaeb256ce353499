//! One datagram of LCM's UDP multicast protocol.
//!
//! ```text
//! short     "LC02" | sequence u32 | channel, NUL | data
//! fragment  "LC03" | sequence u32 | message size u32 | offset u32 | number u16 | count u16 | [number 0: channel, NUL |] data
//! ```
//! Big-endian. Each sender has one sequence over all its channels and both forms; it increases by one per message.

use super::MAX_DATAGRAM;
use crate::log::{MAX_CHANNEL, MAX_MESSAGE};
use crate::names::{name_bytes, name_text};
use std::borrow::Cow;

const SHORT: [u8; 4] = *b"LC02";
const FRAGMENT: [u8; 4] = *b"LC03";
const SHORT_HEADER: usize = 8;
const FRAGMENT_HEADER: usize = 20;

/// Bytes after the header of a full fragment, as LCM on Linux splits messages.
pub const FRAGMENT_BODY: usize = MAX_DATAGRAM - FRAGMENT_HEADER;

/// Lower limit of the fragment size, bytes: smaller than in any LCM implementation. It bounds the bookkeeping that a header can cause.
const SMALLEST_BODY: usize = 512;

/// Content of a datagram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Packet<'a> {
    /// A complete message.
    Short(Short<'a>),
    /// A fragment of a message.
    Fragment(Fragment<'a>),
}

/// A message in one datagram.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Short<'a> {
    /// Sequence number of the message.
    pub sequence: u32,
    /// Channel.
    pub channel: Cow<'a, str>,
    /// The message.
    pub data: &'a [u8],
}

/// A fragment of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fragment<'a> {
    /// Sequence number of the message.
    pub sequence: u32,
    /// Size of the complete message, bytes.
    pub size: u32,
    /// Offset of `data` in the message.
    pub offset: u32,
    /// Index of the fragment, from 0.
    pub number: u16,
    /// Number of fragments of the message.
    pub count: u16,
    /// Channel: only in fragment 0.
    pub channel: Option<Cow<'a, str>>,
    /// Bytes of the message.
    pub data: &'a [u8],
}

/// A datagram that violates the protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Malformed {
    /// Sequence number of its message, if the datagram has one.
    pub sequence: Option<u32>,
    /// What is wrong.
    pub why: &'static str,
}

impl<'a> Packet<'a> {
    /// Parses a datagram.
    ///
    /// # Errors
    /// [`Malformed`] if the datagram violates the protocol.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let Some((magic, rest)) = bytes.split_first_chunk::<4>() else {
            return Err(Malformed { sequence: None, why: "shorter than a header" });
        };
        if ![SHORT, FRAGMENT].contains(magic) {
            return Err(Malformed { sequence: None, why: "starts with neither LC02 nor LC03" });
        }
        let Some((sequence, body)) = rest.split_first_chunk() else {
            return Err(Malformed { sequence: None, why: "shorter than a header" });
        };
        let sequence = u32::from_be_bytes(*sequence);
        let packet = if *magic == SHORT { short(sequence, body) } else { fragment(sequence, body) };
        packet.map_err(|why| Malformed { sequence: Some(sequence), why })
    }

    /// Sequence number of the message.
    pub fn sequence(&self) -> u32 {
        match self {
            Packet::Short(short) => short.sequence,
            Packet::Fragment(fragment) => fragment.sequence,
        }
    }
}

fn short(sequence: u32, body: &[u8]) -> Result<Packet<'_>, &'static str> {
    let (channel, data) = channel(body)?;
    Ok(Packet::Short(Short { sequence, channel, data }))
}

fn fragment(sequence: u32, body: &[u8]) -> Result<Packet<'_>, &'static str> {
    let header: &[u8; FRAGMENT_HEADER - SHORT_HEADER] = body.first_chunk().ok_or("shorter than a header")?;
    let word = |at| u32::from_be_bytes(std::array::from_fn(|i| header[at + i]));
    let half = |at| u16::from_be_bytes(std::array::from_fn(|i| header[at + i]));
    let (size, offset, number, count) = (word(0), word(4), half(8), half(10));
    let body = &body[header.len()..];
    let (channel, data) =
        if number == 0 { channel(body).map(|(name, data)| (Some(name), data))? } else { (None, body) };
    if size as usize > MAX_MESSAGE {
        return Err("message longer than LCM allows");
    }
    if number >= count {
        return Err("fragment number above the fragment count");
    }
    if usize::from(count) > 1 + (size as usize + MAX_CHANNEL + 1) / SMALLEST_BODY {
        return Err("more fragments than a message of this size can have");
    }
    if offset as usize + data.len() > size as usize {
        return Err("fragment beyond the end of its message");
    }
    Ok(Packet::Fragment(Fragment { sequence, size, offset, number, count, channel, data }))
}

/// Splits off the channel at its NUL. A name can have any bytes; those that are not UTF-8 become private characters.
fn channel(body: &[u8]) -> Result<(Cow<'_, str>, &[u8]), &'static str> {
    let end = body.iter().take(MAX_CHANNEL + 1).position(|&byte| byte == 0).ok_or("channel name without NUL")?;
    if end == 0 {
        return Err("empty channel name");
    }
    Ok((name_text(&body[..end]), &body[end + 1..]))
}

/// Splits a message into datagrams as LCM on Linux does. The caller has checked channel and length.
pub fn split(sequence: u32, channel: &str, data: &[u8]) -> Vec<Vec<u8>> {
    let channel = &*name_bytes(channel);
    debug_assert!((1..=MAX_CHANNEL).contains(&channel.len()) && data.len() <= MAX_MESSAGE);
    let name_length = channel.len() + 1;
    if SHORT_HEADER + name_length + data.len() <= MAX_DATAGRAM {
        return vec![[&SHORT, &sequence.to_be_bytes()[..], channel, &[0], data].concat()];
    }
    let count = (name_length + data.len()).div_ceil(FRAGMENT_BODY);
    let fragment = |number: usize| {
        // The channel occupies the start of the first body and shifts the data.
        let from = (number * FRAGMENT_BODY).saturating_sub(name_length);
        let to = ((number + 1) * FRAGMENT_BODY - name_length).min(data.len());
        let mut bytes = Vec::with_capacity(FRAGMENT_HEADER + name_length + to - from);
        bytes.extend_from_slice(&FRAGMENT);
        for word in [sequence, data.len() as u32, from as u32] {
            bytes.extend_from_slice(&word.to_be_bytes());
        }
        for half in [number as u16, count as u16] {
            bytes.extend_from_slice(&half.to_be_bytes());
        }
        if number == 0 {
            bytes.extend_from_slice(channel);
            bytes.push(0);
        }
        bytes.extend_from_slice(&data[from..to]);
        bytes
    };
    (0..count).map(fragment).collect()
}
