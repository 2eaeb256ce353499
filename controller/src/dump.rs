//! What a controller computed in a tick, as a tree with names: for a person or a script that looks into one tick of a replay.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

/// A quantity of a tick, or a group of them.
///
/// As JSON, numbers that JSON does not have are the texts `"inf"`, `"-inf"` and `"nan"`.
#[derive(Clone, Debug, PartialEq)]
pub enum Quantity {
    /// Yes or no.
    Flag(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Number(f64),
    /// A name.
    Text(String),
    /// A vector.
    Numbers(Vec<f64>),
    /// A matrix, row by row.
    Matrix(Vec<Vec<f64>>),
    /// Several of a kind.
    List(Vec<Quantity>),
    /// Quantities by name, in the order in which they were computed.
    Group(Vec<(String, Quantity)>),
}

impl Quantity {
    /// An empty group.
    pub fn group() -> Self {
        Quantity::Group(Vec::new())
    }

    /// The group with one quantity more. What is no group becomes one.
    #[must_use]
    pub fn with(self, name: &str, quantity: impl Into<Quantity>) -> Self {
        let mut members = if let Quantity::Group(members) = self { members } else { Vec::new() };
        members.push((name.to_owned(), quantity.into()));
        Quantity::Group(members)
    }

    /// The quantity at a path such as `tasks.levels.0.H`.
    pub fn get(&self, path: &str) -> Option<&Quantity> {
        path.split('.').try_fold(self, |at, step| match at {
            Quantity::Group(members) => members.iter().find(|(name, _)| name == step).map(|(_, member)| member),
            Quantity::List(items) => items.get(step.parse::<usize>().ok()?),
            _ => None,
        })
    }
}

/// Every quantity of a tick, stage by stage: groups named as [`crate::Stage::name`], as far as the tick came.
#[derive(Clone, Debug, PartialEq)]
pub struct Dump(pub Quantity);

impl Default for Dump {
    fn default() -> Self {
        Dump(Quantity::group())
    }
}

macro_rules! from {
    ($($t:ty, $v:ident => $made:expr;)*) => {$(
        impl From<$t> for Quantity {
            fn from($v: $t) -> Self {
                $made
            }
        }
    )*};
}
from! {
    bool, v => Quantity::Flag(v);
    i32, v => Quantity::Integer(v.into());
    u32, v => Quantity::Integer(v.into());
    i64, v => Quantity::Integer(v);
    f64, v => Quantity::Number(v);
    &str, v => Quantity::Text(v.to_owned());
    String, v => Quantity::Text(v);
    &[f64], v => Quantity::Numbers(v.to_vec());
    &Vec<f64>, v => Quantity::Numbers(v.clone());
    &DVector<f64>, v => Quantity::Numbers(v.as_slice().to_vec());
    &Vector3<f64>, v => Quantity::Numbers(v.as_slice().to_vec());
    &Matrix3<f64>, v => Quantity::Matrix(v.row_iter().map(|row| row.iter().copied().collect()).collect());
    &DMatrix<f64>, v => Quantity::Matrix(v.row_iter().map(|row| row.iter().copied().collect()).collect());
    Vec<Quantity>, v => Quantity::List(v);
}

impl<const N: usize> From<[f64; N]> for Quantity {
    fn from(v: [f64; N]) -> Self {
        Quantity::Numbers(v.to_vec())
    }
}

/// A number, or its name where JSON has no number.
struct Number(f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            x if x.is_finite() => serializer.serialize_f64(x),
            x if x.is_nan() => serializer.serialize_str("nan"),
            x if x > 0.0 => serializer.serialize_str("inf"),
            _ => serializer.serialize_str("-inf"),
        }
    }
}

/// A row of numbers.
struct Numbers<'a>(&'a [f64]);

impl Serialize for Numbers<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut items = serializer.serialize_seq(Some(self.0.len()))?;
        self.0.iter().try_for_each(|x| items.serialize_element(&Number(*x)))?;
        items.end()
    }
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Quantity::Flag(v) => serializer.serialize_bool(*v),
            Quantity::Integer(v) => serializer.serialize_i64(*v),
            Quantity::Number(v) => Number(*v).serialize(serializer),
            Quantity::Text(v) => serializer.serialize_str(v),
            Quantity::Numbers(v) => Numbers(v).serialize(serializer),
            Quantity::Matrix(rows) => serializer.collect_seq(rows.iter().map(|row| Numbers(row))),
            Quantity::List(items) => serializer.collect_seq(items),
            Quantity::Group(members) => {
                let mut map = serializer.serialize_map(Some(members.len()))?;
                members.iter().try_for_each(|(name, member)| map.serialize_entry(name, member))?;
                map.end()
            }
        }
    }
}

impl Serialize for Dump {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_becomes_json_without_losing_a_number() {
        let tree = Quantity::group()
            .with("bounds", [f64::NEG_INFINITY, 1.5])
            .with("rows", &DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 3.0, f64::NAN]))
            .with("levels", vec![Quantity::group().with("on", true)]);
        let json = serde_json::to_string(&Dump(tree.clone())).unwrap();
        assert_eq!(json, r#"{"bounds":["-inf",1.5],"rows":[[1.0,2.0],[3.0,"nan"]],"levels":[{"on":true}]}"#);
        assert_eq!(tree.get("levels.0.on"), Some(&Quantity::Flag(true)));
        assert_eq!(tree.get("levels.1.on"), None);
    }
}
