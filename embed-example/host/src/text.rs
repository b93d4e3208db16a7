//! Parts of messages: quoted input, numbers, sizes.
//!
//! What a file holds may be a megabyte long or move the cursor of a terminal; a message shows a short excerpt of it with
//! control characters escaped.

use std::borrow::Cow;
use std::fmt::Write;
use std::path::Path;

/// Most bytes of an excerpt; a message has three of them at most, so that it quotes 300 bytes at most.
pub const EXCERPT: usize = 90;

/// Most bytes of a path in a message: its end, which tells files apart, is kept.
pub const PATH_EXCERPT: usize = 200;

/// What ends an excerpt of a longer text.
const ELLIPSIS: &str = "...";

/// Whether a terminal would not show the character as it is: controls, separators of lines, directions of writing.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The text with control characters escaped as in Rust, whole.
///
/// ```
/// assert_eq!(croupier_host::text::escaped("a\u{1b}[31m"), "a\\u{1b}[31m");
/// ```
pub fn escaped(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_hidden) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len() + 16);
    text.chars().for_each(|c| push_escaped(&mut out, c));
    out.into()
}

fn push_escaped(out: &mut String, c: char) {
    if is_hidden(c) { out.extend(c.escape_default()) } else { out.push(c) }
}

/// The beginning of a text from a file, escaped: [`EXCERPT`] bytes at most, with an ellipsis if there is more.
///
/// ```
/// use croupier_host::text::{EXCERPT, excerpt};
/// assert_eq!(excerpt("glass"), "glass");
/// let long = excerpt(&"x".repeat(1 << 20)).into_owned();
/// assert!(long.len() <= EXCERPT && long.ends_with("x..."));
/// ```
pub fn excerpt(text: &str) -> Cow<'_, str> {
    if text.len() <= EXCERPT && !text.chars().any(is_hidden) {
        return text.into();
    }
    let room = EXCERPT - ELLIPSIS.len();
    let mut out = String::with_capacity(EXCERPT + 16);
    for c in text.chars() {
        let before = out.len();
        push_escaped(&mut out, c);
        if out.len() > room {
            out.truncate(before);
            out.push_str(ELLIPSIS);
            break;
        }
    }
    out.into()
}

/// A path for messages, escaped: if it is longer than [`PATH_EXCERPT`] bytes, its end.
pub fn path(path: &Path) -> String {
    let whole = path.to_string_lossy();
    let text = escaped(&whole);
    if text.len() <= PATH_EXCERPT {
        return text.into_owned();
    }
    let mut start = text.len() - PATH_EXCERPT + ELLIPSIS.len();
    while !text.is_char_boundary(start) {
        start += 1;
    }
    format!("{ELLIPSIS}{}", text.get(start..).unwrap_or_default())
}

/// A number with up to seven significant digits, those of `f32` with as many as tell them from their neighbours; with an
/// exponent below 1e-4 and from 1e7.
///
/// ```
/// use croupier_host::text::number;
/// assert_eq!([0.25, -3.0, 1e30, 0.1 + 0.2].map(number), ["0.25", "-3", "1e30", "0.3"]);
/// ```
pub fn number(x: f64) -> String {
    let narrow = x as f32;
    let text = if f64::from(narrow) == x { format!("{narrow:e}") } else { format!("{x:.6e}") };
    let rounded: f64 = text.parse().unwrap_or(x);
    let size = rounded.abs();
    if !rounded.is_finite() || size == 0.0 || (1e-4..1e7).contains(&size) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// A size as in `1.5 GiB`: three digits, units of 1024.
///
/// ```
/// use croupier_host::text::bytes;
/// assert_eq!([0, 1023, 1536, 2 << 30].map(bytes), ["0 bytes", "1023 bytes", "1.50 KiB", "2.00 GiB"]);
/// ```
pub fn bytes(n: u64) -> String {
    let mut size = n as f64;
    let mut unit = "bytes";
    for next in ["KiB", "MiB", "GiB", "TiB", "PiB", "EiB"] {
        if size < 1024.0 {
            break;
        }
        (size, unit) = (size / 1024.0, next);
    }
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = match (unit, size) {
        ("bytes", _) => write!(out, "{n} bytes"),
        (_, x) if x < 9.995 => write!(out, "{x:.2} {unit}"),
        (_, x) if x < 99.95 => write!(out, "{x:.1} {unit}"),
        (_, x) => write!(out, "{x:.0} {unit}"),
    };
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a cut inside a character or an escape, an escape that is not counted, a limit that is passed.
    #[test]
    fn excerpts_are_short_and_plain() {
        for unit in ["x", "\u{1b}", "ä", "\u{1f600}", "\u{202e}", "a\u{7}"] {
            for n in 0..200 {
                let text = unit.repeat(n);
                let e = excerpt(&text);
                assert!(e.len() <= EXCERPT && !e.chars().any(is_hidden), "{n} of {unit:?}: {e}");
                let whole = escaped(&text);
                assert!(*e == *whole || (whole.len() > EXCERPT - 3 && e.ends_with(ELLIPSIS)), "{n} of {unit:?}: {e}");
                assert!(whole.starts_with(e.trim_end_matches('.')), "{n} of {unit:?}: {e}");
                let p = path(Path::new(&text));
                assert!(p.len() <= PATH_EXCERPT && whole.ends_with(p.trim_start_matches('.')), "{n} of {unit:?}: {p}");
            }
        }
    }

    /// Killed by: digits of a sum's rounding, a number that is written out with thirty zeros, rounding to another unit.
    #[test]
    fn numbers_are_short() {
        let cases = [(f64::from(1e30f32), "1e30"), (-1e9, "-1e9"), (0.0001, "0.0001"), (1e-5, "1e-5")];
        let more = [(f64::from(0.1f32), "0.1"), (f64::NAN, "NaN"), (f64::NEG_INFINITY, "-inf"), (9_999_999.9, "1e7")];
        for (x, wanted) in cases.into_iter().chain(more) {
            assert_eq!(number(x), wanted);
        }
        assert_eq!([10_234, 1 << 20, 999 << 20, u64::MAX].map(bytes), ["9.99 KiB", "1.00 MiB", "999 MiB", "16.0 EiB"]);
    }
}
