//! MCAP with LCM payloads.
//!
//! - Payload: the bytes of the LCM message, fingerprint included; `message_encoding` is `lcm`.
//! - Schema: name of the type (`hoofprint.robot_state_t`), encoding `lcm`, data: the `.lcm` text of the type followed by the texts of
//!   the types inside it, which together are again one valid `.lcm` file. A type that nobody knows gets no schema.
//! - `log_time` = `publish_time` = time of the event; `sequence` = its number, which counts the events of a log from 0. Of a number
//!   that does not fit into 32 bits the rest stands in the metadata of a channel of its own.
//! - Chunks of 256 KiB before compression, zstd on the writing thread, CRCs and indexes on: equal events give equal bytes, and a
//!   process that dies loses no more than the chunk that it was filling.

use super::FileSchema;
use super::mcap_reader::NUMBER_HIGH;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{Compression, McapResult, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;

const CHUNK_BYTES: u64 = 1 << 18;

pub(super) struct McapWriter {
    out: Writer<NoSeek<BufWriter<File>>>,
    /// A channel whose type changes within a log becomes two MCAP channels of one topic.
    channels: BTreeMap<String, Vec<ChannelOfType>>,
}

struct ChannelOfType {
    fingerprint: Option<u64>,
    number_high: i32,
    id: u16,
}

impl McapWriter {
    pub fn new(file: File) -> McapResult<Self> {
        // Without seeking, a chunk goes out in one piece when it is full, never as a half-written one.
        let out = WriteOptions::new()
            .profile("")
            .library("hoofprint")
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(BufWriter::new(file)))?;
        Ok(McapWriter { out, channels: BTreeMap::new() })
    }

    /// `schema` is asked once per channel and type. The caller has checked that the time is not negative.
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
        let is = |c: &ChannelOfType| c.fingerprint == fingerprint && c.number_high == number_high;
        let id = match known.iter().find(|c| is(c)) {
            Some(known) => known.id,
            None => {
                let schema_id = match fingerprint.and_then(schema) {
                    Some(schema) => self.out.add_schema(&schema.name, &schema.encoding, &schema.data)?,
                    None => 0,
                };
                // The fingerprint as metadata also keeps two types of one topic apart, which otherwise count as one channel.
                let mut metadata: BTreeMap<_, _> =
                    fingerprint.map(|f| ("lcm_fingerprint".to_owned(), format!("{f:016x}"))).into_iter().collect();
                if number_high != 0 {
                    metadata.insert(NUMBER_HIGH.to_owned(), number_high.to_string());
                }
                let id = self.out.add_channel(schema_id, channel, "lcm", &metadata)?;
                known.push(ChannelOfType { fingerprint, number_high, id });
                id
            }
        };
        let header = MessageHeader { channel_id: id, sequence: number as u32, log_time: t_ns, publish_time: t_ns };
        self.out.write_to_known_channel(&header, data)
    }

    /// Ends the chunk, so that everything up to here is in the file.
    pub fn flush(&mut self) -> McapResult<()> {
        self.out.flush()
    }

    /// Writes the rest and the index.
    pub fn finish(mut self) -> McapResult<()> {
        self.out.finish().map(drop)
    }
}
