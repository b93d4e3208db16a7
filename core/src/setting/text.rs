//! Types of values that settings can have, and how they are written.

use super::range::{BYTE_SUFFIXES, SettingRange, SettingValue};
use crate::film::{Aov, AovSet};
use crate::rrs::{Norm, ParseError, Strategy};
use crate::sampler::Sampler;

/// A type of values that settings can have.
pub(crate) trait Value: Copy {
    /// Placeholder in help texts.
    const PLACEHOLDER: &'static str;

    /// All values of the type that make sense, for settings that name no narrower range.
    const RANGE: SettingRange;

    /// The value that a text stands for, in range or not.
    fn parse(text: &str) -> Result<Self, Unreadable>;

    /// The value as one of any setting.
    fn value(self) -> SettingValue;
}

/// Why a text is no value of a type.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Unreadable {
    /// Text that no value of the type is written as.
    Text,
    /// Text that is no roulette strategy.
    Strategy(ParseError),
}

impl Value for bool {
    const PLACEHOLDER: &'static str = "true|false";
    const RANGE: SettingRange = SettingRange::Flag;

    fn parse(text: &str) -> Result<Self, Unreadable> {
        text.parse().map_err(|_| Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Flag(self)
    }
}

/// `albedo,depth`, `true`, `false`.
impl Value for AovSet {
    const PLACEHOLDER: &'static str = Aov::ALTERNATIVES;
    const RANGE: SettingRange = SettingRange::Set(Aov::NAMES);

    fn parse(text: &str) -> Result<Self, Unreadable> {
        Self::from_text(text).ok_or(Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Aovs(self)
    }
}

impl Value for u32 {
    const PLACEHOLDER: &'static str = "N";
    const RANGE: SettingRange = SettingRange::Integers { min: 0, max: Self::MAX as u64 };

    fn parse(text: &str) -> Result<Self, Unreadable> {
        text.parse().map_err(|_| Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Integer(self.into())
    }
}

impl Value for u64 {
    const PLACEHOLDER: &'static str = "N";
    const RANGE: SettingRange = SettingRange::Integers { min: 0, max: Self::MAX };

    fn parse(text: &str) -> Result<Self, Unreadable> {
        text.parse().map_err(|_| Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Integer(self)
    }
}

/// Sizes of memory: `65536`, `32KiB`, `24MiB`, `1GiB`.
impl Value for usize {
    const PLACEHOLDER: &'static str = "BYTES";
    const RANGE: SettingRange = SettingRange::Bytes;

    fn parse(text: &str) -> Result<Self, Unreadable> {
        let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit());
        let suffix = text.get(digits.len()..).unwrap_or("");
        let (_, shift) = BYTE_SUFFIXES.iter().find(|(name, _)| *name == suffix).ok_or(Unreadable::Text)?;
        let number: Self = digits.parse().map_err(|_| Unreadable::Text)?;
        number.checked_mul(1 << shift).ok_or(Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Bytes(self as u64)
    }
}

impl Value for f32 {
    const PLACEHOLDER: &'static str = "X";
    const RANGE: SettingRange = SettingRange::Numbers { min: Self::MIN, max: Self::MAX };

    fn parse(text: &str) -> Result<Self, Unreadable> {
        text.parse().map_err(|_| Unreadable::Text)
    }

    fn value(self) -> SettingValue {
        SettingValue::Number(self)
    }
}

/// `LO:HI`.
impl Value for [f32; 2] {
    const PLACEHOLDER: &'static str = "LO:HI";
    const RANGE: SettingRange = SettingRange::Pair { first: [f32::MIN, f32::MAX], second: [f32::MIN, f32::MAX] };

    fn parse(text: &str) -> Result<Self, Unreadable> {
        let (first, second) = text.split_once(':').ok_or(Unreadable::Text)?;
        Ok([f32::parse(first)?, f32::parse(second)?])
    }

    fn value(self) -> SettingValue {
        SettingValue::Pair(self)
    }
}

/// Columns and rows, `WxH`.
impl Value for [u32; 2] {
    const PLACEHOLDER: &'static str = "WxH";
    const RANGE: SettingRange = SettingRange::Size { max_pixels: u64::MAX };

    fn parse(text: &str) -> Result<Self, Unreadable> {
        let (width, height) = text.split_once(['x', 'X']).ok_or(Unreadable::Text)?;
        Ok([u32::parse(width)?, u32::parse(height)?])
    }

    fn value(self) -> SettingValue {
        SettingValue::Size(self)
    }
}

impl Value for Strategy {
    const PLACEHOLDER: &'static str = "NAME";
    const RANGE: SettingRange = SettingRange::Strategy;

    fn parse(text: &str) -> Result<Self, Unreadable> {
        Self::parse(text).map_err(Unreadable::Strategy)
    }

    fn value(self) -> SettingValue {
        SettingValue::Strategy(self)
    }
}

/// Makes enums that have names by `names!` values of settings.
macro_rules! named_values {
    ($($T:ty),*) => {$(
        impl $crate::setting::Value for $T {
            const PLACEHOLDER: &'static str = <$T>::ALTERNATIVES;
            const RANGE: $crate::setting::SettingRange = $crate::setting::SettingRange::Words(<$T>::NAMES);

            fn parse(text: &str) -> Result<Self, $crate::setting::Unreadable> {
                <$T>::from_name(text).ok_or($crate::setting::Unreadable::Text)
            }

            fn value(self) -> $crate::setting::SettingValue {
                $crate::setting::SettingValue::Word(self.name())
            }
        }
    )*};
}

pub(crate) use named_values;

named_values!(Norm, Sampler);
