//! Errors of texts and messages.

/// Error in a `.lcm` text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The text breaks a rule of the language.
    #[error("{file}:{line}:{column}: found {found}, expected {expected}")]
    Syntax {
        /// Name of the text, as given.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1, in characters.
        column: usize,
        /// Text found.
        found: String,
        /// Text expected by the language.
        expected: String,
    },
}

/// Error in encoding a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The length of an array differs from its length field.
    #[error("{type_name}.{field} has {found} elements, its length field {length_field} is {expected}")]
    Length {
        /// Type with the array.
        type_name: String,
        /// The array.
        field: String,
        /// Length field.
        length_field: String,
        /// Value of that field.
        expected: i64,
        /// Elements in the array.
        found: usize,
    },
    /// A string is too long for its 32-bit length.
    #[error("a string has {length} bytes, LCM allows at most {}", i32::MAX - 1)]
    StringTooLong {
        /// Its length in bytes.
        length: usize,
    },
    /// A value tree does not match its type.
    #[error("{type_name}{}{path}: found {found}, expected {expected}", if path.is_empty() { "" } else { ", field " })]
    Shape {
        /// Type of the message.
        type_name: String,
        /// Path in the message, such as `state.q[3]`.
        path: String,
        /// Kind of the value.
        found: String,
        /// Kind expected by the type.
        expected: String,
    },
}

/// Error in decoding a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{type_name}{}{path}, byte {offset}: {problem}", if path.is_empty() { "" } else { ", field " })]
pub struct DecodeError {
    /// Expected type.
    pub type_name: String,
    /// Path in the message, such as `state.q[3]`; empty for the whole message.
    pub path: String,
    /// Offset in the message, fingerprint included.
    pub offset: usize,
    /// The problem.
    pub problem: DecodeProblem,
}

/// Kind of a decoding error.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum DecodeProblem {
    #[error("found fingerprint {found:016x}, expected {expected:016x}")]
    Fingerprint { found: u64, expected: u64 },
    #[error("no known type has the fingerprint {found:016x}")]
    UnknownFingerprint { found: u64 },
    #[error("{remaining} bytes remain, expected at least {needed}")]
    Truncated { needed: usize, remaining: usize },
    #[error("{length_field} is {found}, expected a length of 0 or more")]
    NegativeLength { length_field: String, found: i64 },
    #[error("{length_field} is {found}, but its elements take no bytes, so at most {limit} are allowed")]
    TooManyEmpty { length_field: String, found: i64, limit: usize },
    #[error("structs are nested deeper than {limit}")]
    TooDeep { limit: usize },
    #[error("string length (with its final NUL) is {found}, expected 1 or more")]
    StringLength { found: i32 },
    #[error("last byte of a string is {found:#04x}, expected NUL")]
    StringEnd { found: u8 },
    #[error("a string is not UTF-8")]
    StringUtf8,
    #[error("boolean is {found}, expected 0 or 1")]
    Boolean { found: u8 },
    #[error("{extra} bytes follow the last field, expected none")]
    TrailingBytes { extra: usize },
}

impl DecodeError {
    /// Prepends a field to the path; called as an error is passed up.
    pub(crate) fn in_field(mut self, name: &str) -> Self {
        let dot = if self.path.is_empty() || self.path.starts_with('[') { "" } else { "." };
        self.path = format!("{name}{dot}{}", self.path);
        self
    }

    /// Prepends an array index to the path.
    pub(crate) fn at_index(self, index: usize) -> Self {
        self.in_field(&format!("[{index}]"))
    }

    /// Sets the type of the message.
    pub(crate) fn of_type(mut self, name: &str) -> Self {
        self.type_name = name.to_owned();
        self
    }
}
