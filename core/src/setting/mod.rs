//! A setting: its row in the table, its range, its value as text.
//!
//! `settings!` makes of one table a struct with public fields, its defaults, and what a host needs to offer every
//! setting without knowing any of them: names, help, ranges, values from and to text. **A new setting is one row**; the
//! program's flags, help and error messages, and the tests, follow from it. A type of values that no setting has had yet
//! needs an implementation of [`Value`] besides.

mod range;
mod table;
mod text;

pub(crate) use range::FROM_SCENE;
pub use range::{SettingRange, SettingValue};
pub use table::{SettingError, SettingInfo};
pub(crate) use table::{from_scene, joined, range_of, settings};
pub(crate) use text::{Unreadable, Value, named_values};
