//! Records of an MCAP file. A record may be longer than its known parts: the rest is ignored, as the specification asks of readers.

use super::mcap_writer::NAME;
use super::{FileChannel, FileSchema};
use crate::names::name_text;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Reads the parts of a record's body one after the other; `None` if the body is too short.
pub(super) struct Parts<'a>(pub &'a [u8]);

impl<'a> Parts<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (part, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(part)
    }

    pub fn u16(&mut self) -> Option<u16> {
        self.take(2)?.first_chunk().map(|bytes| u16::from_le_bytes(*bytes))
    }

    pub fn u32(&mut self) -> Option<u32> {
        self.take(4)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))
    }

    pub fn u64(&mut self) -> Option<u64> {
        self.take(8)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
    }

    /// Bytes with a length of 32 bits.
    pub fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(usize::try_from(length).ok()?)
    }

    /// A text. Bytes that are not UTF-8 are replaced.
    pub fn text(&mut self) -> Option<String> {
        self.bytes().map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    /// A map, and the number of entries whose key occurs again later: the last one counts.
    pub fn map(&mut self) -> Option<(BTreeMap<String, String>, u64)> {
        let mut entries = Parts(self.bytes()?);
        let (mut map, mut repeated) = (BTreeMap::new(), 0);
        while !entries.0.is_empty() {
            let (key, value) = (entries.text()?, entries.text()?);
            repeated += u64::from(map.insert(key, value).is_some());
        }
        Some((map, repeated))
    }
}

/// Id and content of a schema.
pub(super) fn schema(body: &[u8]) -> Option<(u16, FileSchema)> {
    let mut parts = Parts(body);
    let id = parts.u16()?;
    Some((id, FileSchema { name: parts.text()?, encoding: parts.text()?, data: parts.bytes()?.to_vec() }))
}

/// Id, id of the schema, and content of a channel, whose schema the caller looks up.
pub(super) fn channel(body: &[u8]) -> Option<(u16, u16, FileChannel)> {
    let mut parts = Parts(body);
    let (id, schema_id) = (parts.u16()?, parts.u16()?);
    let topic = parts.bytes()?;
    let message_encoding = parts.text()?;
    let (metadata, repeated_keys) = parts.map()?;
    let name = metadata.get(NAME).and_then(|name| from_hex(name));
    let topic = Arc::from(name_text(name.as_deref().unwrap_or(topic)));
    Some((id, schema_id, FileChannel { topic, message_encoding, metadata, repeated_keys, schema: None }))
}

fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digit = |digit: u8| char::from(digit).to_digit(16);
    let byte = |pair: &[u8]| match *pair {
        [high, low] => Some((digit(high)? << 4 | digit(low)?) as u8),
        _ => None,
    };
    text.as_bytes().chunks(2).map(byte).collect()
}

/// Profile and library of a header.
pub(super) fn header(body: &[u8]) -> Option<(String, String)> {
    let mut parts = Parts(body);
    Some((parts.text()?, parts.text()?))
}

/// Name and content of a metadata record, and the number of repeated keys.
pub(super) fn metadata(body: &[u8]) -> Option<(mcap::records::Metadata, u64)> {
    let mut parts = Parts(body);
    let name = parts.text()?;
    let (metadata, repeated) = parts.map()?;
    Some((mcap::records::Metadata { name, metadata }, repeated))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeated_keys_and_added_fields_are_accepted() {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
        let map = [text("k"), text("1"), text("k"), text("2")].concat();
        let body = [&[7, 0, 3, 0][..], &text("topic"), &text("cdr"), &(map.len() as u32).to_le_bytes(), &map].concat();
        for added in [&b""[..], b"\x01\xff\xff"] {
            let (id, schema_id, channel) = channel(&[&body[..], added].concat()).unwrap();
            assert_eq!((id, schema_id, &*channel.topic, channel.repeated_keys), (7, 3, "topic", 1));
            assert_eq!(channel.metadata["k"], "2");
        }
        // A map that ends inside an entry, and a body that ends early.
        assert!(channel(&body[..body.len() - 1]).is_none());
    }
}
