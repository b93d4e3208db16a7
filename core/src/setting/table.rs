//! Tables of settings: their rows, and the macro that makes a struct of them.

use super::range::SettingRange;
use super::text::{Unreadable, Value};
use crate::rrs::ParseError;
use core::fmt;

/// Description of a setting: a row of [`Settings::TABLE`](crate::Settings::TABLE).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SettingInfo {
    /// Stable name in kebab-case.
    pub name: &'static str,
    /// Placeholder of a value in help texts, such as `N` or `relative|absolute`.
    pub value_name: &'static str,
    /// Meaning and unit in one line, without the range.
    pub help: &'static str,
    /// Values that the setting can have.
    pub range: SettingRange,
    /// The default is the scene's own value, in texts `scene`.
    pub from_scene: bool,
}

impl SettingInfo {
    /// The value that a text stands for.
    pub(crate) fn read<T: Value>(&'static self, text: &str) -> Result<T, SettingError> {
        match T::parse(text) {
            Ok(x) if self.range.contains(x.value()) => Ok(x),
            Ok(_) | Err(Unreadable::Text) => Err(SettingError::Value(self)),
            Err(Unreadable::Strategy(e)) => Err(SettingError::Strategy(e)),
        }
    }
}

/// Why a setting cannot be set from a text.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SettingError {
    /// No setting has the name.
    Name,
    /// The text is no value in the range of the setting.
    Value(&'static SettingInfo),
    /// The text is no roulette strategy.
    Strategy(ParseError),
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name => f.write_str("unknown setting"),
            Self::Value(SettingInfo { name, range, .. }) => write!(f, "{name}: need {range}"),
            Self::Strategy(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for SettingError {}

/// One table after the other.
pub(crate) const fn joined<const N: usize>(tables: &[&[SettingInfo]]) -> [SettingInfo; N] {
    let mut all = [tables[0][0]; N];
    let (mut table, mut row, mut at) = (0, 0, 0);
    while at < N {
        if row < tables[table].len() {
            all[at] = tables[table][row];
            (row, at) = (row + 1, at + 1);
        } else {
            (table, row) = (table + 1, 0);
        }
    }
    all
}

/// The range that a row names, or that of its type.
macro_rules! range_of {
    ($T:ty) => {
        <$T as $crate::setting::Value>::RANGE
    };
    ($T:ty, $range:expr) => {
        $range
    };
}

/// Does the row's default stand for the scene's own value?
macro_rules! from_scene {
    () => {
        false
    };
    (scene) => {
        true
    };
}

/// Makes a struct of settings from a table. A row is
/// `field: type = default => "name", "help"[, range[, scene]];`, where `scene` says that the default stands for the
/// scene's own value. Structs of settings within it follow under `nested`.
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $Struct:ident {$(
            $(#[$more:meta])*
            $field:ident: $T:ty = $default:expr => $name:literal, $help:literal $(, $range:expr $(, $scene:ident)?)?;
        )*}
        $(nested {$(
            $(#[$about:meta])*
            $nested:ident: $N:ty,
        )*})?
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $Struct {
            $(
                #[doc = concat!($help, " (`", $name, "`).")]
                $(#[$more])*
                pub $field: $T,
            )*
            $($($(#[$about])* pub $nested: $N,)*)?
        }

        impl Default for $Struct {
            fn default() -> Self {
                Self { $($field: $default,)* $($($nested: Default::default(),)*)? }
            }
        }

        impl $Struct {
            const ROWS: &'static [$crate::setting::SettingInfo] = &[$(
                $crate::setting::SettingInfo {
                    name: $name,
                    value_name: <$T as $crate::setting::Value>::PLACEHOLDER,
                    help: $help,
                    range: $crate::setting::range_of!($T $(, $range)?),
                    from_scene: $crate::setting::from_scene!($($($scene)?)?),
                },
            )*];

            /// Descriptions of all settings.
            pub const TABLE: &'static [$crate::setting::SettingInfo] =
                &$crate::setting::joined::<{ Self::ROWS.len() $($(+ <$N>::TABLE.len())*)? }>(
                    &[Self::ROWS $($(, <$N>::TABLE)*)?],
                );

            /// Sets the setting of this name in [`Self::TABLE`] from a text.
            ///
            /// # Errors
            /// No such name, or a text that is no value in the setting's range; then nothing changes.
            pub fn set(&mut self, name: &str, text: &str) -> Result<(), $crate::setting::SettingError> {
                let row = Self::ROWS.iter().find(|row| row.name == name);
                let Some(row) = row else {
                    $($(
                        match self.$nested.set(name, text) {
                            Err($crate::setting::SettingError::Name) => {}
                            found => return found,
                        }
                    )*)?
                    return Err($crate::setting::SettingError::Name);
                };
                let from_scene = row.from_scene && text == $crate::setting::FROM_SCENE;
                match name {
                    $($name => self.$field = if from_scene { $default } else { row.read(text)? },)*
                    _ => {}
                }
                Ok(())
            }

            /// Value of the setting of this name, `None` if there is no such name. As text, [`Self::set`] reads it
            /// back.
            pub fn get(&self, name: &str) -> Option<$crate::setting::SettingValue> {
                let value = self.value(name)?;
                let from_scene = Self::ROWS.iter().any(|row| row.name == name && row.from_scene);
                if from_scene && Self::default().value(name) == Some(value) {
                    return Some($crate::setting::SettingValue::FromScene);
                }
                Some(value)
            }

            pub(crate) fn value(&self, name: &str) -> Option<$crate::setting::SettingValue> {
                match name {
                    $($name => Some($crate::setting::Value::value(self.$field)),)*
                    _ => None $($(.or_else(|| self.$nested.value(name)))*)?,
                }
            }
        }
    };
}

pub(crate) use {from_scene, range_of, settings};
