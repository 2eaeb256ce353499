//! Writes MCAP with LCM payloads.
//!
//! - Payload: the encoded LCM message with its fingerprint; `message_encoding` is `lcm`.
//! - Schema: name of the type (`hoofprint.robot_state_t`), encoding `lcm`, data: the `.lcm` text of the type followed by the texts of
//!   its nested types, which together form a valid `.lcm` file. An unknown type has no schema.
//! - `log_time` = `publish_time` = log time of the event; `sequence` = event number, from 0. The upper 32 bits of a larger number are
//!   stored in the metadata of a separate MCAP channel.
//! - Topics are UTF-8. The bytes of another channel name are stored, in hexadecimal, in the metadata of its MCAP channel.
//! - MCAP has at most 65,535 channels. Messages of the channels beyond [`MAX_CHANNELS`] share one, `LCM_FURTHER_CHANNELS`, and start with the
//!   name of their channel and a NUL.
//! - Chunks of 256 KiB before compression, zstd on the writing thread, CRCs and indexes: equal events produce equal bytes, and a process
//!   that is killed loses only the chunk that is not yet full.

use super::writer::Output;
use super::{FileChannel, FileSchema};
use crate::names::name_bytes;
use mcap::records::{AttachmentHeader, MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapResult, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::sync::Arc;

const CHUNK_BYTES: u64 = 1 << 18;

/// Metadata key of an MCAP channel: the upper 32 bits of its event numbers. The lower 32 bits are the `sequence` of a message.
pub(super) const NUMBER_HIGH: &str = "lcm_event_number_high";
/// Metadata key of an MCAP channel: the fingerprint of its messages.
const FINGERPRINT: &str = "lcm_fingerprint";
/// Metadata key of the MCAP channel for further names: each message starts with the name of its channel and a NUL.
pub(super) const NAMED: &str = "lcm_channel_in_message";
/// Metadata key of an MCAP channel: the bytes of a name that is not UTF-8, in hexadecimal.
pub(super) const NAME: &str = "lcm_channel_bytes";
/// Keys that a copy writes again.
const OWN_METADATA: [&str; 4] = [NUMBER_HIGH, FINGERPRINT, NAMED, NAME];
/// Channels with an MCAP channel of their own.
const MAX_CHANNELS: usize = 65_000;
/// Topic of the MCAP channel for further names.
const FURTHER: &str = "LCM_FURTHER_CHANNELS";

impl FileChannel {
    /// Whether the channel in the file contains no information beyond its name and the type of its LCM messages.
    pub fn is_plain_lcm(&self) -> bool {
        self.message_encoding == "lcm"
            && self.schema.as_ref().is_none_or(|schema| schema.encoding == "lcm")
            && self.metadata.keys().all(|key| OWN_METADATA.contains(&key.as_str()))
    }
}

/// Splits a message of the channel for further names into the name of its channel and the message.
pub(super) fn split_named(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = data.iter().position(|&byte| byte == 0)?;
    Some((&data[..end], &data[end + 1..]))
}

pub(super) struct McapWriter {
    out: Writer<NoSeek<BufWriter<Output>>>,
    /// Per LCM channel: a channel whose type changes within a log becomes two MCAP channels with the same topic.
    channels: BTreeMap<String, Vec<ChannelOfType>>,
    /// MCAP channels for LCM messages.
    added: usize,
    /// Channels of other files, by the address of their entry, which the map keeps alive.
    copied: BTreeMap<usize, (Arc<FileChannel>, u16)>,
    /// A message with its name in front.
    named: Vec<u8>,
}

/// Unknown types per channel that are kept apart. Payloads that are not LCM messages seem to have a new type each time, and MCAP allows
/// 65,536 channels.
const UNKNOWN_TYPES: usize = 16;

struct ChannelOfType {
    fingerprint: Option<u64>,
    number_high: i32,
    has_schema: bool,
    id: u16,
}

impl McapWriter {
    /// `profile`: that of the header.
    pub fn new(out: Output, profile: &str) -> McapResult<Self> {
        // Without seeking, a chunk is written in one piece when it is full.
        let out = WriteOptions::new()
            .profile(profile)
            .library("hoofprint")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(out)))?;
        Ok(McapWriter { out, channels: BTreeMap::new(), added: 0, copied: BTreeMap::new(), named: Vec::new() })
    }

    /// `times`: log time and publish time, ns. `schema` is called once per channel and type.
    pub fn write(
        &mut self,
        channel: &str,
        times: [u64; 2],
        number: i64,
        data: &[u8],
        schema: impl FnOnce(u64) -> Option<Arc<FileSchema>>,
    ) -> McapResult<()> {
        let fingerprint = super::fingerprint(data);
        let number_high = (number >> 32) as i32;
        let [log_time, publish_time] = times;
        let sequence = number as u32;
        if self.added >= MAX_CHANNELS && !self.channels.contains_key(channel) {
            let metadata =
                [(NAMED.to_owned(), "1".to_owned()), (NUMBER_HIGH.to_owned(), number_high.to_string())].into();
            let channel_id = self.out.add_channel(0, FURTHER, "lcm", &metadata)?;
            self.named.clear();
            self.named.extend_from_slice(&name_bytes(channel));
            self.named.push(0);
            self.named.extend_from_slice(data);
            let header = MessageHeader { channel_id, sequence, log_time, publish_time };
            return self.out.write_to_known_channel(&header, &self.named);
        }
        let known = match self.channels.get_mut(channel) {
            Some(known) => known,
            None => self.channels.entry(channel.into()).or_default(),
        };
        let find = |known: &[ChannelOfType], fingerprint| {
            known.iter().find(|c| c.fingerprint == fingerprint && c.number_high == number_high).map(|c| c.id)
        };
        let channel_id = match find(known, fingerprint) {
            Some(id) => id,
            None => {
                let schema = fingerprint.and_then(schema);
                let unknown = known.iter().filter(|c| !c.has_schema).count();
                let fingerprint = fingerprint.filter(|_| schema.is_some() || unknown < UNKNOWN_TYPES);
                match find(known, fingerprint) {
                    Some(id) => id,
                    None => {
                        let id = add(&mut self.out, channel, fingerprint, number_high, schema.as_deref())?;
                        known.push(ChannelOfType { fingerprint, number_high, has_schema: schema.is_some(), id });
                        self.added += 1;
                        id
                    }
                }
            }
        };
        self.out.write_to_known_channel(&MessageHeader { channel_id, sequence, log_time, publish_time }, data)
    }

    /// Copies a message of another file with its channel.
    pub fn copy(&mut self, channel: &Arc<FileChannel>, times: [u64; 2], sequence: u32, data: &[u8]) -> McapResult<()> {
        let address = Arc::as_ptr(channel) as usize;
        let channel_id = match self.copied.get(&address) {
            Some((_, id)) => *id,
            None => {
                let FileChannel { topic, message_encoding, metadata, repeated_keys: _, schema } = &**channel;
                let schema_id = match schema {
                    Some(schema) => self.out.add_schema(&schema.name, &schema.encoding, &schema.data)?,
                    None => 0,
                };
                let id = add_channel(&mut self.out, schema_id, topic, message_encoding, metadata.clone())?;
                self.copied.insert(address, (Arc::clone(channel), id));
                id
            }
        };
        let [log_time, publish_time] = times;
        self.out.write_to_known_channel(&MessageHeader { channel_id, sequence, log_time, publish_time }, data)
    }

    /// Starts an attachment of `length` bytes.
    pub fn start_attachment(&mut self, length: u64, header: AttachmentHeader) -> McapResult<()> {
        self.out.start_attachment(length, header)
    }

    /// Appends bytes to the attachment.
    pub fn put_attachment(&mut self, bytes: &[u8]) -> McapResult<()> {
        self.out.put_attachment_bytes(bytes)
    }

    /// Completes the attachment.
    pub fn finish_attachment(&mut self) -> McapResult<()> {
        self.out.finish_attachment()
    }

    /// Writes a metadata record.
    pub fn metadata(&mut self, metadata: &Metadata) -> McapResult<()> {
        self.out.write_metadata(metadata)
    }

    /// Writes a private record: opcode from 0x80.
    pub fn private(&mut self, opcode: u8, body: &[u8]) -> McapResult<()> {
        self.out.write_private_record(opcode, body, Default::default())
    }

    /// Ends the chunk, so that every event so far is in the file.
    pub fn flush(&mut self) -> McapResult<()> {
        self.out.flush()
    }

    /// Writes the last chunk and the index.
    pub fn finish(mut self) -> McapResult<()> {
        self.out.finish().map(drop)
    }
}

/// Adds an MCAP channel. The fingerprint in its metadata also distinguishes two types of one topic, which the writer would merge.
fn add(
    out: &mut Writer<NoSeek<BufWriter<Output>>>,
    channel: &str,
    fingerprint: Option<u64>,
    number_high: i32,
    schema: Option<&FileSchema>,
) -> McapResult<u16> {
    let schema_id = match schema {
        Some(schema) => out.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    let mut metadata: BTreeMap<_, _> =
        fingerprint.map(|f| (FINGERPRINT.to_owned(), format!("{f:016x}"))).into_iter().collect();
    if number_high != 0 {
        metadata.insert(NUMBER_HIGH.to_owned(), number_high.to_string());
    }
    add_channel(out, schema_id, channel, "lcm", metadata)
}

/// Adds an MCAP channel whose name may have any bytes.
fn add_channel(
    out: &mut Writer<NoSeek<BufWriter<Output>>>,
    schema_id: u16,
    name: &str,
    message_encoding: &str,
    mut metadata: BTreeMap<String, String>,
) -> McapResult<u16> {
    let bytes = name_bytes(name);
    let topic = match std::str::from_utf8(&bytes) {
        Ok(topic) => topic,
        Err(_) => {
            metadata.insert(NAME.to_owned(), bytes.iter().map(|byte| format!("{byte:02x}")).collect());
            name
        }
    };
    out.add_channel(schema_id, topic, message_encoding, &metadata)
}
