//! Errors of reading and changing parameters.

use crate::stack::StackError;

/// Parameters that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// The text is not TOML, has an unknown key, lacks a key, or has a value of the wrong type. The parser's message names line and key.
    #[error("{source_name}: {error}")]
    Parse {
        /// File name, or a description of the text.
        source_name: String,
        /// Message of the parser, with line and column.
        error: String,
    },
    /// An override names no parameter.
    #[error("unknown parameter \"{key}\"{hint}")]
    UnknownKey {
        /// The key as given.
        key: String,
        /// The keys of its table.
        hint: String,
    },
    /// An override has a value of the wrong type.
    #[error("parameter {key}: found `{found}`, expected {expected}")]
    BadValue {
        /// The key.
        key: String,
        /// The value as given.
        found: String,
        /// The present value and its type, or the accepted words.
        expected: String,
    },
    /// The formula of the stack is invalid.
    #[error(transparent)]
    Stack(#[from] StackError),
    /// A gait cannot be walked, or has an invalid name.
    #[error("gait {gait:?}: {key} is {found}, expected {expected}")]
    Gait {
        /// Name of the gait.
        gait: String,
        /// Key of its table, or `name`.
        key: &'static str,
        /// Its value.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A value is out of its range.
    #[error("parameter {key} is {found}, expected {expected}")]
    OutOfRange {
        /// The key.
        key: Box<str>,
        /// Its value.
        found: f64,
        /// The range, with its unit.
        expected: String,
    },
}
