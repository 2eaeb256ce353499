//! Dumps as JSON.

use super::{Dump, Group, Value};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

/// A number; as a string if it is not finite.
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

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Value::Flag(v) => serializer.serialize_bool(*v),
            Value::Integer(v) => serializer.serialize_i64(*v),
            Value::Number(v) => Number(*v).serialize(serializer),
            Value::Text(v) => serializer.serialize_str(v),
            Value::Numbers(v) => Numbers(v).serialize(serializer),
            Value::Matrix(rows) => serializer.collect_seq(rows.iter().map(|row| Numbers(row))),
            Value::List(items) => serializer.collect_seq(items),
            Value::Group(group) => group.serialize(serializer),
        }
    }
}

impl Serialize for Group {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.iter().len()))?;
        self.iter().try_for_each(|quantity| map.serialize_entry(&quantity.name, &quantity.value))?;
        map.end()
    }
}

/// The stages by name; without the overview.
impl Serialize for Dump {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.stages.iter().map(|(stage, group)| (stage.name(), group)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::channels::Stage;
    use nalgebra::DMatrix;

    #[test]
    fn json_keeps_every_number_and_leaves_units_out() {
        let qp = Group::new()
            .with_unit("bounds", "N", [f64::NEG_INFINITY, 1.5])
            .with("rows", &DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 3.0, f64::NAN]))
            .with("levels", vec![Group::new().with("on", true)]);
        let dump = Dump { stages: vec![(Stage::Qp, qp)], ..Dump::default() };
        let json = serde_json::to_string(&dump).unwrap();
        assert_eq!(json, r#"{"qp":{"bounds":["-inf",1.5],"rows":[[1.0,2.0],[3.0,"nan"]],"levels":[{"on":true}]}}"#);
    }
}
