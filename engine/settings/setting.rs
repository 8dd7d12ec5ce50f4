//! What a setting is, which values it may have, and how a group of them is declared.

use serde::Serialize;
use serde_json::Value;
use std::fmt;
use std::ops::{Bound, RangeBounds};

/// A setting of a run: what it is called, what it may be and what it does. The default is that of its group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Its name, with dots, as `--set` takes it.
    pub name: &'static str,
    /// Of what its number is a count or a multiple; empty where it is a plain number, or none.
    pub unit: &'static str,
    /// Which values it may have.
    pub range: Range,
    /// Its effect.
    pub meaning: &'static str,
}

/// Which values a setting may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Whole numbers from the first to the second.
    Whole(u64, u64),
    /// One of these whole numbers.
    OneOf(&'static [u64]),
    /// Finite numbers from the first up to a bound.
    Number(f64, Bound<f64>),
    /// A learning rate: a number, or one at the start and one at the end; both positive, or both 0.
    Rate,
    /// Three numbers from 0 to 1.
    Colour,
    /// True or false.
    Switch,
    /// One of these words.
    Word(&'static [&'static str]),
    /// The path of a file, or null.
    Path,
}

/// Declares a group of settings, a `struct`: a field's comment is the meaning that the manual and `ivv train --list-settings` show, then
/// come type, default, unit and range. Gives `Default` and `SETTINGS`. Groups within a group follow `with`.
macro_rules! settings {
    (@group) => { Default::default() };
    (@group $default:expr) => { $default };
    (
        $(#[$attribute:meta])*
        pub struct $group:ident in $prefix:literal {
            $($(#[doc = $meaning:literal])+ $name:ident: $of:ty = $default:expr, $unit:literal, $range:expr;)*
        }
        $(with { $($(#[$inner_attribute:meta])* $inner:ident: $inner_of:ty $(= $of_group:expr)?,)* })?
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $group {
            $($(#[doc = $meaning])+ pub $name: $of,)*
            $($($(#[$inner_attribute])* pub $inner: $inner_of,)*)?
        }

        impl Default for $group {
            fn default() -> Self {
                $group { $($name: $default,)* $($($inner: $crate::settings::settings!(@group $($of_group)?),)*)? }
            }
        }

        impl $group {
            pub const SETTINGS: &[$crate::settings::Setting] = &[$($crate::settings::Setting {
                name: concat!($prefix, stringify!($name)),
                unit: $unit,
                range: $range,
                meaning: concat!($($meaning),+).trim_ascii_start(),
            },)*];
        }
    };
}
pub(crate) use settings;

impl Setting {
    /// Its value in `settings`, a run's settings, which may leave out any.
    #[doc(hidden)]
    pub fn of<'a>(&self, settings: &'a Value) -> Option<&'a Value> {
        settings.pointer(&format!("/{}", self.name.replace('.', "/")))
    }

    pub(crate) fn check(&self, value: &Value) -> Result<(), String> {
        if self.range.contains(value) {
            return Ok(());
        }
        // JSON writes every number that is not finite as null.
        let found = if value.is_null() { "not a finite number".to_owned() } else { value.to_string() };
        Err(format!("{} is {found}; expected {}", self.name, self.range))
    }
}

/// `settings` in the form of their file, so that numbers of 32 bits are shown as they were written.
pub(crate) fn as_written(settings: &impl Serialize) -> Result<Value, String> {
    let text = serde_json::to_string(settings).map_err(|e| e.to_string())?;
    serde_json::from_str(&text).map_err(|e| e.to_string())
}

impl Range {
    pub(crate) const COUNT: Range = Range::Whole(1, u32::MAX as u64);
    pub(crate) const NOT_NEGATIVE: Range = Range::Number(0.0, Bound::Unbounded);
    pub(crate) const SHARE: Range = Range::Number(0.0, Bound::Included(1.0));
    /// A share that is never all.
    pub(crate) const BELOW_ONE: Range = Range::Number(0.0, Bound::Excluded(1.0));
    /// A contribution, or a rest of light, that may be left out.
    pub(crate) const CUT: Range = Range::Number(0.0, Bound::Excluded(0.5));

    #[doc(hidden)]
    pub fn contains(&self, value: &Value) -> bool {
        match self {
            Range::Whole(least, most) => value.as_u64().is_some_and(|value| (*least..=*most).contains(&value)),
            Range::OneOf(all) => value.as_u64().is_some_and(|value| all.contains(&value)),
            Range::Number(least, most) => {
                value.as_f64().is_some_and(|value| (Bound::Included(*least), *most).contains(&value))
            }
            Range::Rate => is_rate(value),
            Range::Colour => value.as_array().is_some_and(|channels| {
                let is_channel = |c: &Value| c.as_f64().is_some_and(|c| (0.0..=1.0).contains(&c));
                channels.len() == 3 && channels.iter().all(is_channel)
            }),
            Range::Switch => value.is_boolean(),
            Range::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
            Range::Path => value.is_string() || value.is_null(),
        }
    }
}

fn is_rate(value: &Value) -> bool {
    let end = |name: &str| value.get(name).and_then(Value::as_f64);
    match (value.as_object(), end("start"), end("end")) {
        (Some(ends), Some(start), Some(end)) => {
            ends.len() == 2 && ((start > 0.0 && end > 0.0) || (start == 0.0 && end == 0.0))
        }
        (Some(_), ..) => false,
        (None, ..) => value.as_f64().is_some_and(|rate| rate >= 0.0),
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Range::Whole(0, u64::MAX) => write!(f, "a whole number"),
            Range::Whole(least, u64::MAX) => write!(f, "a whole number, {least} or more"),
            Range::Whole(least, most) => write!(f, "a whole number from {least} to {most}"),
            Range::OneOf(all) => write!(f, "{}", list(all)),
            Range::Number(least, Bound::Included(most)) => write!(f, "a number from {least} to {most}"),
            Range::Number(least, Bound::Excluded(most)) => write!(f, "a number of at least {least} and below {most}"),
            Range::Number(least, Bound::Unbounded) => write!(f, "a number, {least} or more"),
            Range::Rate => {
                write!(f, "a number above 0, or {{\"start\": A, \"end\": B}} with both above 0; 0 turns it off")
            }
            Range::Colour => write!(f, "three numbers from 0 to 1, such as [0.5,0.5,0.5]"),
            Range::Switch => write!(f, "true or false"),
            Range::Word(words) => write!(f, "{}", list(words)),
            Range::Path => write!(f, "the path of a file, or null"),
        }
    }
}

fn list(all: &[impl ToString]) -> String {
    let all: Vec<String> = all.iter().map(ToString::to_string).collect();
    match all.as_slice() {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        all => all.concat(),
    }
}
