//! Arrays of fixed length in TOML. The parser drops surplus elements of an array without an error; these functions do not.

use serde::de::{Deserialize, Deserializer, Error};

/// Reads an array of exactly `N` elements: `#[serde(deserialize_with = "array")]`.
///
/// # Errors
/// Another number of elements, or an element of the wrong type.
pub fn array<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(from: D) -> Result<[T; N], D::Error> {
    let elements = Vec::<T>::deserialize(from)?;
    let found = elements.len();
    elements.try_into().map_err(|_| D::Error::custom(format!("found {found} elements, expected {N}")))
}

/// Same as [`array()`], for a key that may be missing: `#[serde(default, deserialize_with = "optional_array")]`.
///
/// # Errors
/// See [`array()`].
pub fn optional_array<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    from: D,
) -> Result<Option<[T; N]>, D::Error> {
    array(from).map(Some)
}
