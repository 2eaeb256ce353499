//! What a controller computed in a tick, for people and scripts that inspect a tick of a replay: all quantities stage by stage
//! ([`Dump::stages`]), and a typed summary for a screen ([`Overview`]).

mod overview;
mod serialize;

pub use overview::{ContactSummary, GaitSummary, LevelSummary, Overview, Phase, PhaseKind, TermSummary};

use lcmtypes::channels::Stage;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Every quantity of a tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dump {
    /// The stages that the tick reached, in the order of [`Stage::ALL`].
    pub stages: Vec<(Stage, Group)>,
    /// Summary for a screen.
    pub overview: Overview,
}

impl Dump {
    /// The quantities of a stage; `None` if the tick did not reach it.
    pub fn stage(&self, stage: Stage) -> Option<&Group> {
        self.stages.iter().find(|(s, _)| *s == stage).map(|(_, group)| group)
    }
}

/// A quantity with its name and unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// Name with frames, such as `v_H_des`: the key in JSON.
    pub name: String,
    /// Unit, such as `m/s`. Empty for a group and for a value without unit. Two units separated by a comma: linear, then angular rows.
    pub unit: &'static str,
    /// Value.
    pub value: Value,
}

/// Quantities in the order in which they were computed. As JSON, an object; units are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Group(Vec<Quantity>);

impl Group {
    /// An empty group.
    pub fn new() -> Self {
        Group::default()
    }

    /// Adds a value without unit.
    #[must_use]
    pub fn with(self, name: &str, value: impl Into<Value>) -> Self {
        self.with_unit(name, "", value)
    }

    /// Adds a value with its unit.
    #[must_use]
    pub fn with_unit(mut self, name: &str, unit: &'static str, value: impl Into<Value>) -> Self {
        self.0.push(Quantity { name: name.to_owned(), unit, value: value.into() });
        self
    }

    /// Whether it has no quantity.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Its quantities.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Quantity> {
        self.0.iter()
    }
}

impl FromIterator<Quantity> for Group {
    fn from_iter<I: IntoIterator<Item = Quantity>>(quantities: I) -> Self {
        Group(quantities.into_iter().collect())
    }
}

/// A value. As JSON, non-finite numbers are the strings `"inf"`, `"-inf"` and `"nan"`.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Yes or no.
    Flag(bool),
    /// An integer.
    Integer(i64),
    /// A real number.
    Number(f64),
    /// A name.
    Text(String),
    /// A vector.
    Numbers(Vec<f64>),
    /// A matrix, row by row.
    Matrix(Vec<Vec<f64>>),
    /// Values of the same kind.
    List(Vec<Value>),
    /// Named quantities.
    Group(Group),
}

macro_rules! from {
    ($($t:ty, $v:ident => $made:expr;)*) => {$(
        impl From<$t> for Value {
            fn from($v: $t) -> Self {
                $made
            }
        }
    )*};
}
from! {
    bool, v => Value::Flag(v);
    i32, v => Value::Integer(v.into());
    u32, v => Value::Integer(v.into());
    i64, v => Value::Integer(v);
    usize, v => Value::Integer(i64::try_from(v).unwrap_or(i64::MAX));
    f64, v => Value::Number(v);
    &str, v => Value::Text(v.to_owned());
    String, v => Value::Text(v);
    &[f64], v => Value::Numbers(v.to_vec());
    &Vec<f64>, v => Value::Numbers(v.clone());
    &DVector<f64>, v => Value::Numbers(v.as_slice().to_vec());
    &Vector3<f64>, v => Value::Numbers(v.as_slice().to_vec());
    &Matrix3<f64>, v => Value::Matrix(v.row_iter().map(|row| row.iter().copied().collect()).collect());
    &DMatrix<f64>, v => Value::Matrix(v.row_iter().map(|row| row.iter().copied().collect()).collect());
    Vec<Value>, v => Value::List(v);
    Group, v => Value::Group(v);
}

impl From<Vec<Group>> for Value {
    fn from(groups: Vec<Group>) -> Self {
        Value::List(groups.into_iter().map(Value::Group).collect())
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(v: [f64; N]) -> Self {
        Value::Numbers(v.to_vec())
    }
}
