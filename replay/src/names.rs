//! Channel names: bytes in files and datagrams, text in this project.

use std::borrow::Cow;

/// First of the characters that stand for bytes which are not UTF-8: byte `b` is the character `BYTES + b`, U+EF80 to U+EFFF. These are
/// the private characters that OPTU-8 uses for the same purpose.
const BYTES: u32 = 0xef00;

/// The byte that a character of a name stands for.
pub(crate) fn byte_of(c: char) -> Option<u8> {
    (u32::from(c).checked_sub(BYTES)).and_then(|byte| u8::try_from(byte).ok()).filter(|byte| *byte >= 0x80)
}

/// Text of a channel name. Bytes that are not UTF-8 become private characters, so that [`name_bytes`] restores every name.
pub(crate) fn name_text(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(bytes)
        && !text.contains(|c| byte_of(c).is_some())
    {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(3 * bytes.len());
    let escaped = |byte: &u8| char::from_u32(BYTES + u32::from(*byte)).unwrap_or(char::REPLACEMENT_CHARACTER);
    for chunk in bytes.utf8_chunks() {
        for c in chunk.valid().chars() {
            match byte_of(c) {
                // These characters themselves are escaped byte by byte.
                Some(_) => out.extend(c.encode_utf8(&mut [0; 4]).as_bytes().iter().map(escaped)),
                None => out.push(c),
            }
        }
        out.extend(chunk.invalid().iter().map(escaped));
    }
    Cow::Owned(out)
}

/// Bytes of a channel name: the inverse of [`name_text`].
pub(crate) fn name_bytes(name: &str) -> Cow<'_, [u8]> {
    if !name.contains(|c| byte_of(c).is_some()) {
        return Cow::Borrowed(name.as_bytes());
    }
    let mut out = Vec::with_capacity(name.len());
    for c in name.chars() {
        match byte_of(c) {
            Some(byte) => out.push(byte),
            None => out.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_restored() {
        let names: [&[u8]; 6] =
            [b"PLAIN", b"caf\xe9", b"a\tb", "Größe".as_bytes(), "\u{efe9}x".as_bytes(), b"\xff\xfe\xee\xbf\xa9"];
        for name in names {
            assert_eq!(name_bytes(&name_text(name)), name, "{name:?}");
        }
        assert_eq!(name_text(b"caf\xe9"), "caf\u{efe9}");
        // Two names never become one.
        assert_ne!(name_text("\u{efe9}".as_bytes()), name_text(b"\xe9"));
    }
}
