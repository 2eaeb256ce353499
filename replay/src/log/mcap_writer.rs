//! Writes MCAP with LCM payloads.
//!
//! - Payload: the encoded LCM message with its fingerprint; `message_encoding` is `lcm`.
//! - Schema: name of the type (`hoofprint.robot_state_t`), encoding `lcm`, data: the `.lcm` text of the type followed by the texts of
//!   its nested types, which together form a valid `.lcm` file. An unknown type has no schema.
//! - `log_time` = `publish_time` = log time of the event; `sequence` = event number, from 0. The upper 32 bits of a larger number are
//!   stored in the metadata of a separate MCAP channel.
//! - Chunks of 256 KiB before compression, zstd on the writing thread, CRCs and indexes: equal events produce equal bytes, and a process
//!   that is killed loses only the chunk that is not yet full.

use super::FileSchema;
use super::mcap_reader::NUMBER_HIGH;
use super::writer::Output;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, McapResult, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::BufWriter;
use std::sync::Arc;

const CHUNK_BYTES: u64 = 1 << 18;

pub(super) struct McapWriter {
    out: Writer<NoSeek<BufWriter<Output>>>,
    /// Per LCM channel: a channel whose type changes within a log becomes two MCAP channels with the same topic.
    channels: BTreeMap<String, Vec<ChannelOfType>>,
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
    pub fn new(out: Output) -> McapResult<Self> {
        // Without seeking, a chunk is written in one piece when it is full.
        let out = WriteOptions::new()
            .profile("")
            .library("hoofprint")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(out)))?;
        Ok(McapWriter { out, channels: BTreeMap::new() })
    }

    /// `schema` is called once per channel and type. The caller has checked that the time is not negative.
    pub fn write(
        &mut self,
        channel: &str,
        t_ns: u64,
        number: i64,
        data: &[u8],
        schema: impl FnOnce(u64) -> Option<Arc<FileSchema>>,
    ) -> McapResult<()> {
        let fingerprint = super::fingerprint(data);
        let number_high = (number >> 32) as i32;
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
                        id
                    }
                }
            }
        };
        let header = MessageHeader { channel_id, sequence: number as u32, log_time: t_ns, publish_time: t_ns };
        self.out.write_to_known_channel(&header, data)
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
        fingerprint.map(|f| ("lcm_fingerprint".to_owned(), format!("{f:016x}"))).into_iter().collect();
    if number_high != 0 {
        metadata.insert(NUMBER_HIGH.to_owned(), number_high.to_string());
    }
    out.add_channel(schema_id, channel, "lcm", &metadata)
}
