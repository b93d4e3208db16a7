//! Values of settings, and the ranges that hold them.

use crate::film::AovSet;
use crate::rrs::Strategy;
use core::fmt;

/// Values that a setting can have.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SettingRange {
    /// True and false.
    Flag,
    /// Whole numbers.
    Integers {
        /// Smallest one.
        min: u64,
        /// Largest one.
        max: u64,
    },
    /// Numbers of bytes.
    Bytes,
    /// Finite numbers.
    Numbers {
        /// Smallest one.
        min: f32,
        /// Largest one.
        max: f32,
    },
    /// Finite numbers above 0.
    Positive,
    /// Two numbers.
    Pair {
        /// Smallest and largest first number.
        first: [f32; 2],
        /// Smallest and largest second number.
        second: [f32; 2],
    },
    /// Columns and rows of at least one pixel.
    Size {
        /// Largest number of pixels.
        max_pixels: u64,
    },
    /// One of these words.
    Words(&'static [&'static str]),
    /// One of these words, or a finite number.
    WordsOrNumber(&'static [&'static str]),
    /// Lists of these words with commas between, true or false.
    Set(&'static [&'static str]),
    /// Roulette strategies with parameters that are numbers.
    Strategy,
}

impl SettingRange {
    /// Is this value in the range?
    pub fn contains(&self, value: SettingValue) -> bool {
        use SettingValue as V;
        match (*self, value) {
            (Self::Flag, V::Flag(_)) | (Self::Bytes, V::Bytes(_)) | (Self::Set(_), V::Aovs(_)) => true,
            (Self::Integers { min, max }, V::Integer(x)) => (min..=max).contains(&x),
            (Self::Numbers { min, max }, V::Number(x)) => (min..=max).contains(&x),
            (Self::Positive, V::Number(x)) => x > 0.0 && x.is_finite(),
            (Self::Pair { first, second }, V::Pair([a, b])) => {
                (first[0]..=first[1]).contains(&a) && (second[0]..=second[1]).contains(&b)
            }
            (Self::Size { max_pixels }, V::Size([w, h])) => {
                (1..=max_pixels).contains(&u64::from(w).saturating_mul(u64::from(h)))
            }
            (Self::Words(words) | Self::WordsOrNumber(words), V::Word(word)) => words.contains(&word),
            (Self::WordsOrNumber(_), V::Number(x)) => x.is_finite(),
            #[expect(clippy::eq_op, reason = "equal to itself unless a parameter is NaN")]
            (Self::Strategy, V::Strategy(s)) => s == s,
            _ => false,
        }
    }
}

/// What to write, such as `a number from 0 to 1`.
impl fmt::Display for SettingRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |f: &mut fmt::Formatter<'_>, words: &[&str], last: &str| {
            words.iter().enumerate().try_for_each(|(i, word)| match i {
                0 => f.write_str(word),
                _ if i + 1 < words.len() => write!(f, ", {word}"),
                _ => write!(f, "{last}{word}"),
            })
        };
        match self {
            Self::Flag => f.write_str("true or false"),
            Self::Integers { min, max } => write!(f, "a whole number from {min} to {max}"),
            Self::Bytes => f.write_str("a number of bytes as in 65536, 32KiB, 24MiB or 1GiB"),
            Self::Numbers { min, max } => write!(f, "a number from {min} to {max}"),
            Self::Positive => f.write_str("a finite number above 0"),
            Self::Pair { first: [a, b], second: [c, d] } => {
                write!(f, "two numbers as in 0.5:2, from {a} to {b} and from {c} to {d}")
            }
            Self::Size { max_pixels } => {
                f.write_str("columns and rows as in 640x480, at least 1x1 and at most ")?;
                match max_pixels.is_power_of_two() {
                    true => write!(f, "2^{} pixels", max_pixels.trailing_zeros()),
                    false => write!(f, "{max_pixels} pixels"),
                }
            }
            Self::Words(words) => list(f, words, " or "),
            Self::WordsOrNumber(words) => {
                list(f, words, ", ")?;
                f.write_str(" or a finite number")
            }
            Self::Set(words) => {
                f.write_str("true, false or some of ")?;
                list(f, words, ",")
            }
            Self::Strategy => {
                f.write_str("a roulette strategy with its options: ")?;
                Strategy::TABLE
                    .iter()
                    .enumerate()
                    .try_for_each(|(i, (name, _))| write!(f, "{}{name}", if i == 0 { "" } else { ", " }))
            }
        }
    }
}

/// What may follow a number of bytes, and by how many bits it shifts.
pub(super) const BYTE_SUFFIXES: [(&str, u32); 4] = [("", 0), ("KiB", 10), ("MiB", 20), ("GiB", 30)];

/// Text of a value that is the scene's own.
pub(crate) const FROM_SCENE: &str = "scene";

/// Value of any setting. As text it is what [`Settings::set`](crate::Settings::set) reads back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SettingValue {
    /// The scene's own value.
    FromScene,
    /// True or false.
    Flag(bool),
    /// A whole number.
    Integer(u64),
    /// A number of bytes.
    Bytes(u64),
    /// A number.
    Number(f32),
    /// Two numbers.
    Pair([f32; 2]),
    /// Columns and rows.
    Size([u32; 2]),
    /// A name.
    Word(&'static str),
    /// Auxiliary values.
    Aovs(AovSet),
    /// A roulette strategy with its options.
    Strategy(Strategy),
}

impl SettingValue {
    /// Shows the value's bytes, for hashes: those of different values of one setting differ.
    pub(crate) fn bytes(self, mut show: impl FnMut(&[u8])) {
        let mut word = |x: u32| show(&x.to_le_bytes());
        match self {
            Self::FromScene => {}
            Self::Flag(x) => word(x.into()),
            Self::Integer(x) | Self::Bytes(x) => show(&x.to_le_bytes()),
            Self::Number(x) => word(x.to_bits()),
            Self::Pair(xs) => xs.into_iter().for_each(|x| word(x.to_bits())),
            Self::Size(xs) => xs.into_iter().for_each(word),
            Self::Word(x) => show(x.as_bytes()),
            Self::Aovs(x) => word(x.bits()),
            Self::Strategy(x) => {
                x.option_bits().into_iter().for_each(&mut word);
                show(x.name().as_bytes());
            }
        }
    }
}

impl fmt::Display for SettingValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FromScene => f.write_str(FROM_SCENE),
            Self::Flag(x) => x.fmt(f),
            Self::Integer(x) => x.fmt(f),
            Self::Bytes(0) => f.write_str("0"),
            Self::Bytes(x) => {
                let whole = |(_, shift): &&(&str, u32)| x.trailing_zeros() >= *shift;
                let (suffix, shift) = BYTE_SUFFIXES.iter().rev().find(whole).unwrap_or(&("", 0));
                write!(f, "{}{suffix}", x >> shift)
            }
            Self::Number(x) => x.fmt(f),
            Self::Pair([a, b]) => write!(f, "{a}:{b}"),
            Self::Size([w, h]) => write!(f, "{w}x{h}"),
            Self::Word(x) => x.fmt(f),
            Self::Aovs(x) => x.fmt(f),
            Self::Strategy(x) => x.fmt(f),
        }
    }
}
