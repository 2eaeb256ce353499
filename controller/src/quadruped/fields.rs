//! The list of state fields, and everything that is derived from it: the struct, its snapshot message, its digests and its dump.

use crate::digest::Digest;
use crate::dump::Value;
use crate::error::RestoreError;
use nalgebra::Vector3;

/// A part of a tick that contains state fields in its digest or dump.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Stage `estimation`.
    Estimation,
    /// Stage `gait` while the robot stands or walks.
    Gait,
    /// Stage `gait` while the robot stands up or sits down.
    StandSit,
    /// Stage `output`.
    Output,
}

/// A type of state fields: its form in a message, in a digest and in a dump.
pub trait Field: Copy {
    /// Type of the message field.
    type Message: Copy;

    /// Converts to the message field.
    fn to_message(self) -> Self::Message;

    /// Converts from the message field.
    ///
    /// # Errors
    /// [`RestoreError::Value`] for a number that names no value of an enumeration; `field` is the name for the error.
    fn from_message(field: &'static str, message: Self::Message) -> Result<Self, RestoreError>;

    /// Whether every floating-point number in it satisfies `accepts`.
    fn all(self, accepts: fn(f64) -> bool) -> bool;

    /// Mixes its bits into a digest.
    fn digest(self, digest: &mut Digest);

    /// Its form in a dump.
    fn value(self) -> Value;

    /// A value that differs from the default, and from `example` of most other numbers.
    #[cfg(test)]
    fn example(n: u8) -> Self;
}

/// Converts a field from a message and checks its numbers.
///
/// # Errors
/// [`RestoreError::Value`] or [`RestoreError::NotFinite`], with the name of the field.
pub fn read<T: Field>(field: &'static str, message: T::Message, accepts: fn(f64) -> bool) -> Result<T, RestoreError> {
    let value = T::from_message(field, message)?;
    if value.all(accepts) { Ok(value) } else { Err(RestoreError::NotFinite { field }) }
}

/// Accepts finite numbers.
pub fn finite(x: f64) -> bool {
    x.is_finite()
}

/// Accepts finite numbers and +infinity.
pub fn finite_or_infinity(x: f64) -> bool {
    x.is_finite() || x == f64::INFINITY
}

/// Accepts every number.
pub fn any(_: f64) -> bool {
    true
}

/// Implements [`Field`] for types that are the same in the message.
macro_rules! plain_field {
    ($($t:ty, $x:ident, $accepts:ident => all $all:expr, digest $d:ident $digest:expr, example $n:ident $example:expr;)*) => {$(
        impl Field for $t {
            type Message = $t;
            #[inline(always)]
            fn to_message(self) -> $t {
                self
            }
            #[inline(always)]
            fn from_message(_: &'static str, message: $t) -> Result<Self, RestoreError> {
                Ok(message)
            }
            #[allow(unused_variables, reason = "integers need no check")]
            fn all(self, $accepts: fn(f64) -> bool) -> bool {
                let $x = self;
                $all
            }
            #[inline(always)]
            fn digest(self, $d: &mut Digest) {
                let $x = self;
                $digest;
            }
            fn value(self) -> Value {
                self.into()
            }
            #[cfg(test)]
            fn example($n: u8) -> Self {
                $example
            }
        }
    )*};
}

plain_field! {
    i32, x, accepts => all true, digest d d.word(u64::from(x.cast_unsigned())), example n i32::from(n) + 1;
    i64, x, accepts => all true, digest d d.word(x.cast_unsigned()), example n i64::from(n) + 1;
    f64, x, accepts => all accepts(x), digest d d.f64(x), example n f64::from(n) + 0.5;
    [f64; 2], x, accepts => all x.into_iter().all(accepts), digest d d.f64s(&x), example n [0.25, 0.75].map(|x| x + f64::from(n));
}

/// 0 or 1 in the message: not every LCM implementation can encode arrays of `boolean`.
impl Field for bool {
    type Message = i8;

    #[inline(always)]
    fn to_message(self) -> i8 {
        i8::from(self)
    }

    fn from_message(field: &'static str, message: i8) -> Result<Self, RestoreError> {
        match message {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(RestoreError::Value { field, found: message.into(), last: 1 }),
        }
    }

    fn all(self, _: fn(f64) -> bool) -> bool {
        true
    }

    #[inline(always)]
    fn digest(self, digest: &mut Digest) {
        digest.word(u64::from(self));
    }

    fn value(self) -> Value {
        self.into()
    }

    #[cfg(test)]
    fn example(_: u8) -> Self {
        true
    }
}

impl Field for Vector3<f64> {
    type Message = [f64; 3];

    #[inline(always)]
    fn to_message(self) -> [f64; 3] {
        self.into()
    }

    #[inline(always)]
    fn from_message(_: &'static str, message: [f64; 3]) -> Result<Self, RestoreError> {
        Ok(message.into())
    }

    fn all(self, accepts: fn(f64) -> bool) -> bool {
        self.iter().copied().all(accepts)
    }

    #[inline(always)]
    fn digest(self, digest: &mut Digest) {
        digest.vec3(&self);
    }

    fn value(self) -> Value {
        (&self).into()
    }

    #[cfg(test)]
    fn example(n: u8) -> Self {
        Vector3::new(0.125, 0.375, 0.625).add_scalar(f64::from(n))
    }
}

/// Implements [`Field`] for an enumeration with the constant `ALL`, which lists its values by their number in the message; `$name` gives the name
/// of a value in a dump.
macro_rules! enum_field {
    ($($t:ty, $x:ident => $name:expr;)*) => {$(
        impl $crate::quadruped::fields::Field for $t {
            type Message = i8;
            #[inline(always)]
            fn to_message(self) -> i8 {
                self as i8
            }
            fn from_message(field: &'static str, message: i8) -> Result<Self, $crate::error::RestoreError> {
                let found = usize::try_from(message).ok().and_then(|i| Self::ALL.get(i).copied());
                let last = Self::ALL[Self::ALL.len() - 1] as i64;
                found.ok_or($crate::error::RestoreError::Value { field, found: message.into(), last })
            }
            fn all(self, _: fn(f64) -> bool) -> bool {
                true
            }
            #[inline(always)]
            fn digest(self, digest: &mut $crate::digest::Digest) {
                digest.word(self as u64);
            }
            fn value(self) -> $crate::dump::Value {
                let $x = self;
                $name.into()
            }
            #[cfg(test)]
            fn example(n: u8) -> Self {
                Self::ALL[1 + usize::from(n) % (Self::ALL.len() - 1)]
            }
        }
    )*};
}

/// Defines the state struct and derives from one list of fields:
///
/// - the struct, with `PerLeg` for the fields of `legs` and `Vec<f64>` (one number for each joint) for those of `joints`,
/// - `zeros`, the state with every number zero,
/// - `write` and `read`, the conversion to and from the snapshot message, whose fields have the same names,
/// - `digest`, `digest_leg`, `digest_joints`: the fields of a [`Part`] in the order of the list,
/// - `dump`, `dump_leg`, `dump_joints`: the same for a dump.
///
/// A field of the message that is not in the list does not compile, and neither does a field of the list that is not in the message. `digest` and `dump` name
/// the parts that contain the field; the list may be empty: `digest [], dump []`.
macro_rules! state_fields {
    (@accepts) => { $crate::quadruped::fields::finite };
    (@accepts $accepts:ident) => { $crate::quadruped::fields::$accepts };
    (@unit) => { "" };
    (@unit $unit:literal) => { $unit };
    (@dump $group:ident, $part:ident, $name:ident, $value:expr, [$($unit:literal)?], [$($dump:ident $(as $label:literal)?),*]) => {
        let _unit: &'static str = state_fields!(@unit $($unit)?);
        $(
            if $part == Part::$dump {
                $group = $group.with_unit(state_fields!(@label $name $($label)?), _unit, $value);
            }
        )*
    };
    (@label $name:ident) => { stringify!($name) };
    (@label $name:ident $label:literal) => { $label };
    (
        $(#[$attr:meta])*
        pub struct $State:ident, message $Message:ident;
        robot {$(
            $robot:ident: $Robot:ty
            $(, unit $robot_unit:literal)?
            $(, accepts $robot_accepts:ident)?
            , digest [$($robot_digest:ident),*]
            , dump [$($robot_dump:ident $(as $robot_label:literal)?),*];
        )*}
        legs {$(
            $leg:ident: $Leg:ty
            $(, unit $leg_unit:literal)?
            $(, accepts $leg_accepts:ident)?
            , digest [$($leg_digest:ident),*]
            , dump [$($leg_dump:ident $(as $leg_label:literal)?),*];
        )*}
        joints {$(
            $joint:ident, unit $joint_unit:literal
            , digest [$($joint_digest:ident),*]
            , dump [$($joint_dump:ident $(as $joint_label:literal)?),*];
        )*}
    ) => {
        $(#[$attr])*
        pub struct $State {
            $(pub $robot: $Robot,)*
            $(pub $leg: PerLeg<$Leg>,)*
            $(pub $joint: Vec<f64>,)*
        }

        impl $State {
            /// The state with every number zero.
            fn zeros(nj: usize) -> Self {
                $State {
                    $($robot: Default::default(),)*
                    $($leg: Default::default(),)*
                    $($joint: vec![0.0; nj],)*
                }
            }

            /// Writes the state into its snapshot message. Allocates nothing if the message has the robot's size.
            pub fn write(&self, message: &mut $Message) {
                let $Message { nj, $($robot,)* $($leg,)* $($joint,)* } = message;
                *nj = i32::try_from(self.q_des.len()).expect("robots have fewer than 2^31 joints");
                $(*$robot = Field::to_message(self.$robot);)*
                $(*$leg = self.$leg.0.map(Field::to_message);)*
                $($joint.clone_from(&self.$joint);)*
            }

            /// Replaces the state by that of a message. The joint arrays are exchanged with those of the message, so nothing is allocated.
            ///
            /// # Errors
            /// The message has another number of joints, a non-finite number, or a number that names no mode, gait or phase. The state is then
            /// unchanged.
            pub fn read(&mut self, message: &mut $Message) -> Result<(), RestoreError> {
                $(
                    let (found, expected) = (message.$joint.len(), self.$joint.len());
                    if found != expected {
                        return Err(RestoreError::Joints { found, expected });
                    }
                )*
                $(
                    if message.$joint.iter().any(|x| !x.is_finite()) {
                        return Err(RestoreError::NotFinite { field: stringify!($joint) });
                    }
                )*
                $(
                    let accepts = state_fields!(@accepts $($robot_accepts)?);
                    let $robot = fields::read(stringify!($robot), message.$robot, accepts)?;
                )*
                $(
                    let accepts = state_fields!(@accepts $($leg_accepts)?);
                    let mut $leg = self.$leg;
                    for leg in Leg::ALL {
                        $leg[leg] = fields::read(stringify!($leg), message.$leg[leg as usize], accepts)?;
                    }
                )*
                $(self.$robot = $robot;)*
                $(self.$leg = $leg;)*
                $(std::mem::swap(&mut self.$joint, &mut message.$joint);)*
                Ok(())
            }

            /// Mixes the fields of a part into a digest: those of the robot as a whole.
            #[inline(always)]
            pub fn digest(&self, part: Part, digest: &mut Digest) {
                $(
                    const { &[$(Part::$robot_digest),*] as &[Part] }
                        .contains(&part)
                        .then(|| Field::digest(self.$robot, digest));
                )*
            }

            /// Mixes the fields of a part into a digest: those of one leg.
            #[inline(always)]
            pub fn digest_leg(&self, part: Part, leg: Leg, digest: &mut Digest) {
                $(
                    const { &[$(Part::$leg_digest),*] as &[Part] }
                        .contains(&part)
                        .then(|| Field::digest(self.$leg[leg], digest));
                )*
            }

            /// Mixes the fields of a part into a digest: the joint arrays.
            #[inline(always)]
            pub fn digest_joints(&self, part: Part, digest: &mut Digest) {
                $(
                    const { &[$(Part::$joint_digest),*] as &[Part] }
                        .contains(&part)
                        .then(|| digest.f64s(&self.$joint));
                )*
            }

            /// Adds the fields of a part to a group of a dump: those of the robot as a whole.
            pub fn dump(&self, part: Part, mut group: Group) -> Group {
                $(state_fields!(
                    @dump group, part, $robot, Field::value(self.$robot), [$($robot_unit)?],
                    [$($robot_dump $(as $robot_label)?),*]
                );)*
                group
            }

            /// Adds the fields of a part to a group of a dump: those of one leg.
            pub fn dump_leg(&self, part: Part, leg: Leg, mut group: Group) -> Group {
                $(state_fields!(
                    @dump group, part, $leg, Field::value(self.$leg[leg]), [$($leg_unit)?],
                    [$($leg_dump $(as $leg_label)?),*]
                );)*
                group
            }

            /// Adds the fields of a part to a group of a dump: the joint arrays.
            pub fn dump_joints(&self, part: Part, mut group: Group) -> Group {
                $(state_fields!(
                    @dump group, part, $joint, &self.$joint, [$joint_unit],
                    [$($joint_dump $(as $joint_label)?),*]
                );)*
                group
            }

            /// A state in which every field has a value of its own.
            #[cfg(test)]
            fn example(nj: u8) -> Self {
                let mut n = 0;
                let mut next = || {
                    n += 1;
                    n
                };
                $State {
                    $($robot: Field::example(next()),)*
                    $($leg: PerLeg([(); 4].map(|()| Field::example(next()))),)*
                    $($joint: (0..nj).map(|_| Field::example(next())).collect(),)*
                }
            }

            /// Names of the fields in which two states are equal.
            #[cfg(test)]
            fn equal_fields(&self, other: &Self) -> Vec<&'static str> {
                let mut equal = Vec::new();
                $(if self.$robot == other.$robot { equal.push(stringify!($robot)); })*
                $(if self.$leg == other.$leg { equal.push(stringify!($leg)); })*
                $(if self.$joint == other.$joint { equal.push(stringify!($joint)); })*
                equal
            }

            /// Names of all fields.
            #[cfg(test)]
            const NAMES: &[&str] = &[$(stringify!($robot),)* $(stringify!($leg),)* $(stringify!($joint),)*];
        }
    };
}

pub(super) use {enum_field, state_fields};
