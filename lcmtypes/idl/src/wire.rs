//! The byte format: functions that generated code calls.
//!
//! A message is its type's fingerprint, then its fields in order, all big-endian and without padding. A struct inside a struct has
//! no fingerprint; an array has no length of its own; a string has a 32-bit length that counts its final NUL.

use crate::{DecodeError, DecodeProblem, EncodeError};

/// Greatest nesting of structs, so that hostile bytes cannot exhaust the stack.
pub const MAX_DEPTH: usize = 128;

/// Elements that take no bytes (a struct without fields, a row of length 0) allowed in one message: nothing else bounds them.
pub const MAX_EMPTY: usize = 1 << 16;

/// A type that is sent on a channel.
pub trait Message: Wire + Clone + Default + PartialEq + std::fmt::Debug {
    /// Name with package, such as `hoofprint.robot_state_t`.
    const TYPE: &'static str;
    /// The hash that starts every message of this type.
    const FINGERPRINT: u64;

    /// Appends fingerprint and fields to `out`. Does not allocate once `out` has the capacity.
    ///
    /// # Errors
    /// [`EncodeError::Length`] if an array's length is not that of its length field; `out` is then as it was.
    fn encode(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let start = out.len();
        out.extend_from_slice(&Self::FINGERPRINT.to_be_bytes());
        self.put(out).inspect_err(|_| out.truncate(start))
    }

    /// Reads a whole message: fingerprint, fields, and nothing after them.
    ///
    /// # Errors
    /// [`DecodeError`] with type, field and offset. Lengths are checked against the bytes that remain before anything is allocated.
    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let mut wire = Reader::new(bytes);
        let message = wire.fingerprint(Self::FINGERPRINT).and_then(|()| Self::take(&mut wire));
        message.and_then(|m| wire.finish().map(|()| m)).map_err(|e| e.of_type(Self::TYPE))
    }

    /// Reads a whole message over this one. Its vectors and strings are used again, also those of structs in a list, so this does not allocate once they
    /// have the capacity. Lists of strings are new. After an error the message is partly the new one.
    ///
    /// # Errors
    /// As [`Message::decode`].
    fn decode_into(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        let mut wire = Reader::new(bytes);
        let taken = wire.fingerprint(Self::FINGERPRINT).and_then(|()| self.retake(&mut wire));
        taken.and_then(|()| wire.finish()).map_err(|e| e.of_type(Self::TYPE))
    }
}

/// A value of known shape on the wire: primitives, strings, fixed arrays of them, and generated structs and enums.
pub trait Wire: Sized {
    /// Fewest bytes that a value takes.
    const MIN_SIZE: usize;
    /// Appends the value.
    ///
    /// # Errors
    /// As [`Message::encode`].
    fn put(&self, out: &mut Vec<u8>) -> Result<(), EncodeError>;
    /// Reads a value.
    ///
    /// # Errors
    /// As [`Message::decode`].
    fn take(wire: &mut Reader<'_>) -> Result<Self, DecodeError>;
    /// Reads a value in the place of this one.
    ///
    /// # Errors
    /// As [`Message::decode`].
    fn retake(&mut self, wire: &mut Reader<'_>) -> Result<(), DecodeError> {
        *self = Self::take(wire)?;
        Ok(())
    }
}

macro_rules! number {
    ($($t:ty),*) => {$(
        impl Wire for $t {
            const MIN_SIZE: usize = size_of::<$t>();
            fn put(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
                out.extend_from_slice(&self.to_be_bytes());
                Ok(())
            }
            fn take(wire: &mut Reader<'_>) -> Result<Self, DecodeError> {
                wire.bytes().map(<$t>::from_be_bytes)
            }
        }
    )*};
}
number!(i8, i16, i32, i64, u8, f32, f64);

impl Wire for bool {
    const MIN_SIZE: usize = 1;
    fn put(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        out.push(u8::from(*self));
        Ok(())
    }
    /// Rejects bytes other than 0 and 1, so that a decoded value encodes to the same bytes; a lenient reader counts them.
    fn take(wire: &mut Reader<'_>) -> Result<Self, DecodeError> {
        match wire.bytes::<1>()? {
            [0] => Ok(false),
            [1] => Ok(true),
            [_] if wire.lenient => {
                wire.deviations.booleans += 1;
                Ok(true)
            }
            [found] => Err(wire.error_before(1, DecodeProblem::Boolean { found })),
        }
    }
}

impl Wire for String {
    const MIN_SIZE: usize = 5;
    fn put(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        put_str(self, out)
    }
    fn take(wire: &mut Reader<'_>) -> Result<Self, DecodeError> {
        wire.text().map(str::to_owned)
    }
    fn retake(&mut self, wire: &mut Reader<'_>) -> Result<(), DecodeError> {
        let text = wire.text()?;
        self.clear();
        self.push_str(text);
        Ok(())
    }
}

impl<T: Wire, const N: usize> Wire for [T; N] {
    const MIN_SIZE: usize = N * T::MIN_SIZE;
    fn put(&self, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        self.iter().try_for_each(|item| item.put(out))
    }
    fn take(wire: &mut Reader<'_>) -> Result<Self, DecodeError> {
        wire.array(T::take)
    }
}

/// Appends a string.
pub(crate) fn put_str(text: &str, out: &mut Vec<u8>) -> Result<(), EncodeError> {
    let length = i32::try_from(text.len() + 1).map_err(|_| EncodeError::StringTooLong { length: text.len() })?;
    out.extend_from_slice(&length.to_be_bytes());
    out.extend_from_slice(text.as_bytes());
    out.push(0);
    Ok(())
}

/// Refuses an array whose length is not that of its length field.
///
/// # Errors
/// [`EncodeError::Length`]
pub fn check_length(
    type_name: &str,
    field: &str,
    found: usize,
    length_field: &str,
    expected: i64,
) -> Result<(), EncodeError> {
    if i64::try_from(found) == Ok(expected) {
        return Ok(());
    }
    let (type_name, field, length_field) = (type_name.to_owned(), field.to_owned(), length_field.to_owned());
    Err(EncodeError::Length { type_name, field, length_field, expected, found })
}

/// Fewest bytes of a row: the product of its dimensions and the fewest bytes of an element.
pub fn row_size(dims: &[i64], element: usize) -> usize {
    dims.iter().fold(element, |size, &n| size.saturating_mul(usize::try_from(n).unwrap_or(0)))
}

/// Reads a message from its first byte to its last.
#[derive(Debug, Clone)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    depth: usize,
    empty_left: usize,
    /// Deviations from the format are accepted and counted.
    lenient: bool,
    pub(crate) deviations: Deviations,
}

/// Deviations from the format that the decoders of LCM accept. The value is still clear.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Deviations {
    /// Booleans other than 0 and 1, which are true.
    pub booleans: u64,
    /// Strings that are not UTF-8, do not end with a NUL, or have length 0.
    pub strings: u64,
    /// Bytes after the last field.
    pub trailing_bytes: u64,
}

impl Deviations {
    /// The message follows the format.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

impl std::fmt::Display for Deviations {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let parts = [
            (self.booleans, "booleans other than 0 and 1"),
            (self.strings, "strings that are not UTF-8 with a final NUL"),
            (self.trailing_bytes, "bytes after the last field"),
        ];
        let parts: Vec<_> =
            parts.into_iter().filter(|part| part.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
        f.write_str(&parts.join(", "))
    }
}

impl<'a> Reader<'a> {
    /// A reader that stands before the first byte.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, depth: 0, empty_left: MAX_EMPTY, lenient: false, deviations: Deviations::default() }
    }

    /// As [`Reader::new`], for a reader that accepts and counts [`Deviations`].
    pub(crate) fn lenient(bytes: &'a [u8]) -> Self {
        Self { lenient: true, ..Self::new(bytes) }
    }

    fn error_before(&self, back: usize, problem: DecodeProblem) -> DecodeError {
        DecodeError { type_name: String::new(), path: String::new(), offset: self.at - back, problem }
    }

    /// The next `n` bytes.
    pub(crate) fn slice(&mut self, n: usize) -> Result<&'a [u8], DecodeError> {
        let rest = &self.bytes[self.at..];
        match rest.get(..n) {
            Some(slice) => {
                self.at += n;
                Ok(slice)
            }
            None => Err(self.error_before(0, DecodeProblem::Truncated { needed: n, remaining: rest.len() })),
        }
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        match self.bytes[self.at..].first_chunk() {
            Some(chunk) => {
                self.at += N;
                Ok(*chunk)
            }
            None => {
                Err(self.error_before(0, DecodeProblem::Truncated { needed: N, remaining: self.bytes.len() - self.at }))
            }
        }
    }

    /// Reads the fingerprint and compares it.
    ///
    /// # Errors
    /// [`DecodeProblem::Fingerprint`], [`DecodeProblem::Truncated`]
    pub fn fingerprint(&mut self, expected: u64) -> Result<(), DecodeError> {
        let found = u64::from_be_bytes(self.bytes()?);
        if found == expected {
            return Ok(());
        }
        Err(self.error_before(8, DecodeProblem::Fingerprint { found, expected }))
    }

    /// Refuses bytes after the last field.
    ///
    /// # Errors
    /// [`DecodeProblem::TrailingBytes`]
    pub fn finish(&mut self) -> Result<(), DecodeError> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            extra if self.lenient => {
                self.deviations.trailing_bytes = extra as u64;
                Ok(())
            }
            extra => Err(self.error_before(0, DecodeProblem::TrailingBytes { extra })),
        }
    }

    /// Reads a string without copying it.
    pub(crate) fn text(&mut self) -> Result<&'a str, DecodeError> {
        let length = i32::from_be_bytes(self.bytes()?);
        let Some(content) = usize::try_from(length).ok().and_then(|n| n.checked_sub(1)) else {
            return Err(self.error_before(4, DecodeProblem::StringLength { found: length }));
        };
        let needed = content + 1;
        let (text, end) = self.slice(needed)?.split_at(content);
        if end != [0] {
            return Err(self.error_before(1, DecodeProblem::StringEnd { found: end[0] }));
        }
        std::str::from_utf8(text).map_err(|_| self.error_before(needed, DecodeProblem::StringUtf8))
    }

    /// Reads a string; a lenient reader returns its bytes if they are not UTF-8.
    pub(crate) fn text_or_bytes(&mut self) -> Result<Result<&'a str, &'a [u8]>, DecodeError> {
        let before = self.at;
        let strict = self.text();
        if strict.is_ok() || !self.lenient {
            return strict.map(Ok);
        }
        self.at = before;
        let length = i32::from_be_bytes(self.bytes()?);
        let Ok(length) = usize::try_from(length) else { return strict.map(Ok) };
        let content = self.slice(length)?;
        self.deviations.strings += 1;
        let content = content.strip_suffix(&[0]).unwrap_or(content);
        Ok(std::str::from_utf8(content).map_err(|_| content))
    }

    /// Names the field that is being read, for errors.
    ///
    /// # Errors
    /// Those of `read`, with the field in their path.
    pub fn field<T>(
        &mut self,
        name: &str,
        read: impl FnOnce(&mut Self) -> Result<T, DecodeError>,
    ) -> Result<T, DecodeError> {
        read(self).map_err(|e| e.in_field(name))
    }

    /// Reads what stands inside a struct.
    ///
    /// # Errors
    /// [`DecodeProblem::TooDeep`], and those of `read`.
    pub fn nested<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, DecodeError>) -> Result<T, DecodeError> {
        self.enter()?;
        let value = read(self);
        self.leave();
        value
    }

    /// Steps into a struct.
    pub(crate) fn enter(&mut self) -> Result<(), DecodeError> {
        if self.depth == MAX_DEPTH {
            return Err(self.error_before(0, DecodeProblem::TooDeep { limit: MAX_DEPTH }));
        }
        self.depth += 1;
        Ok(())
    }

    /// Steps out of it.
    pub(crate) fn leave(&mut self) {
        self.depth -= 1;
    }

    /// Reads an array of fixed length.
    ///
    /// # Errors
    /// Those of `item`, with the index in their path.
    pub fn array<T, const N: usize>(
        &mut self,
        mut item: impl FnMut(&mut Self) -> Result<T, DecodeError>,
    ) -> Result<[T; N], DecodeError> {
        let mut failure = None;
        let array: [Option<T>; N] = std::array::from_fn(|index| {
            if failure.is_some() {
                return None;
            }
            item(self).map_err(|e| failure = Some(e.at_index(index))).ok()
        });
        match failure {
            Some(error) => Err(error),
            None => Ok(array.map(|item| item.expect("an item is missing only after a failure"))),
        }
    }

    /// Reads an array of the length that `length_field` holds; `min_item` is the fewest bytes of one element.
    ///
    /// # Errors
    /// [`DecodeProblem::NegativeLength`], [`DecodeProblem::Truncated`] before anything is allocated, and those of `item`.
    pub fn list<T>(
        &mut self,
        length_field: &str,
        length: i64,
        min_item: usize,
        item: impl FnMut(&mut Self) -> Result<T, DecodeError>,
    ) -> Result<Vec<T>, DecodeError> {
        let mut list = Vec::new();
        self.refill(&mut list, length_field, length, min_item, item)?;
        Ok(list)
    }

    /// Reads an array of bytes of the length that `length_field` holds, without copying it.
    ///
    /// # Errors
    /// As [`Reader::list`].
    pub fn byte_list(&mut self, length_field: &str, length: i64) -> Result<&'a [u8], DecodeError> {
        let length = self.claim(length_field, length, 1)?;
        self.slice(length)
    }

    /// [`Reader::list`], in the place of what is in `list`.
    ///
    /// # Errors
    /// As [`Reader::list`].
    pub fn refill<T>(
        &mut self,
        list: &mut Vec<T>,
        length_field: &str,
        length: i64,
        min_item: usize,
        mut item: impl FnMut(&mut Self) -> Result<T, DecodeError>,
    ) -> Result<(), DecodeError> {
        let length = self.claim(length_field, length, min_item)?;
        list.clear();
        list.reserve_exact(length);
        for index in 0..length {
            list.push(item(self).map_err(|e| e.at_index(index))?);
        }
        Ok(())
    }

    /// Reads structs over those that are in `list`, so that what they hold is used again too.
    ///
    /// # Errors
    /// As [`Reader::list`].
    pub fn retake_list<T: Wire>(
        &mut self,
        list: &mut Vec<T>,
        length_field: &str,
        length: i64,
        min_item: usize,
    ) -> Result<(), DecodeError> {
        let length = self.claim(length_field, length, min_item)?;
        list.truncate(length);
        for (index, item) in list.iter_mut().enumerate() {
            self.nested(|wire| item.retake(wire)).map_err(|e| e.at_index(index))?;
        }
        list.reserve_exact(length - list.len());
        for index in list.len()..length {
            list.push(self.nested(T::take).map_err(|e| e.at_index(index))?);
        }
        Ok(())
    }

    /// Checks that so many elements can follow.
    pub(crate) fn claim(&mut self, length_field: &str, length: i64, min_item: usize) -> Result<usize, DecodeError> {
        let (remaining, length_field) = (self.bytes.len() - self.at, || length_field.to_owned());
        let Ok(n) = usize::try_from(length) else {
            let problem = DecodeProblem::NegativeLength { length_field: length_field(), found: length };
            return Err(self.error_before(0, problem));
        };
        if min_item == 0 {
            let limit = MAX_EMPTY;
            match self.empty_left.checked_sub(n) {
                Some(left) => self.empty_left = left,
                None => {
                    let problem = DecodeProblem::TooManyEmpty { length_field: length_field(), found: length, limit };
                    return Err(self.error_before(0, problem));
                }
            }
        }
        let needed = n.saturating_mul(min_item);
        if needed > remaining {
            return Err(self.error_before(0, DecodeProblem::Truncated { needed, remaining }));
        }
        Ok(n)
    }
}
