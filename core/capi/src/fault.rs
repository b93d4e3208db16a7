//! What goes wrong, and how it becomes a status and a message.
//!
//! Faults of the boundary are [`Fault`]s, which are written without the formatting of the standard library: entry
//! points that know no other faults contain no panics, which is checked by linking. Errors of the core come as
//! [`Failure`]s.

use crate::status::croupier_status;
use core::ffi::c_char;
use core::fmt::{self, Write};
use core::hint::black_box;

/// Text about a failure, for people: what was wrong with which object, with numbers.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct croupier_message {
    /// UTF-8, ended by a zero byte, cut off between two characters where it is too long. Empty after a call that succeeded.
    pub text: [c_char; 256],
}

/// A fault at the boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fault {
    pub status: croupier_status,
    /// What it is about, such as a parameter.
    pub about: &'static str,
    /// Index of it.
    pub index: Option<u64>,
    /// What is needed and what is there.
    pub sizes: Option<[u64; 2]>,
}

impl Fault {
    pub(crate) const fn new(status: croupier_status, about: &'static str) -> Self {
        Self { status, about, index: None, sizes: None }
    }

    /// `needed` and not `given`, of anything that is counted.
    pub(crate) const fn sizes(about: &'static str, needed: usize, given: usize) -> Self {
        let sizes = Some([needed as u64, given as u64]);
        Self { status: croupier_status::CROUPIER_SIZE, about, index: None, sizes }
    }

    pub(crate) const fn at(self, index: u64) -> Self {
        Self { index: Some(index), ..self }
    }
}

/// An error of the core that has a status.
pub(crate) trait CoreError: fmt::Display {
    fn status(&self) -> croupier_status;
}

/// Any failure of a call.
pub(crate) enum Failure<E> {
    Fault(Fault),
    Core(E),
}

impl<E> From<Fault> for Failure<E> {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl<E: CoreError> From<E> for Failure<E> {
    fn from(error: E) -> Self {
        Self::Core(error)
    }
}

/// What a call answers when it fails.
pub(crate) trait Explain {
    fn status(&self) -> croupier_status;
    fn explain(&self, text: &mut Text<'_>);
}

impl Explain for Fault {
    fn status(&self) -> croupier_status {
        self.status
    }

    fn explain(&self, text: &mut Text<'_>) {
        text.put(self.about);
        if let Some(index) = self.index {
            text.put(" ");
            text.number(index);
        }
        text.put(": ");
        text.put(self.status.text());
        if let Some([needed, given]) = self.sizes {
            text.put(", needed ");
            text.number(needed);
            text.put(", given ");
            text.number(given);
        }
    }
}

impl<E: CoreError> Explain for Failure<E> {
    fn status(&self) -> croupier_status {
        match self {
            Self::Fault(fault) => fault.status,
            Self::Core(error) => error.status(),
        }
    }

    fn explain(&self, text: &mut Text<'_>) {
        match self {
            Self::Fault(fault) => fault.explain(text),
            // a text never fails
            Self::Core(error) => _ = write!(text, "{error}"),
        }
    }
}

/// A message that is being written.
pub(crate) struct Text<'a> {
    /// Bytes without the last, which stays 0.
    rest: core::slice::IterMut<'a, c_char>,
}

impl<'a> Text<'a> {
    /// Clears a buffer; texts that are longer are cut off in front of the first character that does not fit, and end with a zero byte in any case.
    pub(crate) fn new(buffer: &'a mut [c_char]) -> Self {
        // byte by byte: `croupier_check_processor` runs where wide registers are not there
        buffer.iter_mut().for_each(|c| *c = black_box(0));
        let room = buffer.len().saturating_sub(1);
        Self { rest: buffer.get_mut(..room).unwrap_or_default().iter_mut() }
    }

    pub(crate) fn put(&mut self, text: &str) {
        for byte in text.bytes() {
            // bytes of a character, of which the first one tells the number
            let length = match byte {
                0x80..0xc0 => 0,
                0xc0..0xe0 => 2,
                0xe0..0xf0 => 3,
                0xf0.. => 4,
                _ => 1,
            };
            if self.rest.len() < length {
                self.rest = [].iter_mut();
            }
            if let Some(c) = self.rest.next() {
                *c = black_box(byte as c_char);
            }
        }
    }

    fn number(&mut self, number: u64) {
        let mut power = 1u64;
        while number.checked_div(power).is_some_and(|q| q >= 10) {
            power = power.saturating_mul(10);
        }
        while let Some(q) = number.checked_div(power) {
            let digit = q.checked_rem(10).unwrap_or(0);
            if let Some(c) = self.rest.next() {
                *c = (b'0' as c_char).wrapping_add(digit as c_char);
            }
            power = power.checked_div(10).unwrap_or(0);
        }
    }
}

impl Write for Text<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.put(text);
        Ok(())
    }
}

/// Runs the body of a function: its status, and the message if one is wanted.
///
/// # Safety
/// `message` is null, or the caller's promise holds for it.
pub(crate) unsafe fn finish<E: Explain>(
    message: *mut croupier_message,
    body: impl FnOnce() -> Result<(), E>,
) -> croupier_status {
    let result = body();
    // SAFETY: the caller's promise; any bytes are such a struct, and it has no alignment.
    let message = unsafe { message.as_mut() };
    match (result, message) {
        (Ok(()), message) => {
            if let Some(first) = message.and_then(|m| m.text.first_mut()) {
                *first = 0;
            }
            croupier_status::CROUPIER_OK
        }
        (Err(e), message) => {
            if let Some(message) = message {
                e.explain(&mut Text::new(&mut message.text));
            }
            e.status()
        }
    }
}

/// The body of a function: a block that ends with `Ok(())` or fails.
macro_rules! answer {
    ($message:expr, $E:ty, $body:block) => {{
        let body = || -> Result<(), $E> { $body };
        // SAFETY: the caller's promise.
        unsafe { $crate::fault::finish($message, body) }
    }};
}

/// What follows from the caller's promise (documentation of the crate) for one pointer.
macro_rules! promised {
    ($call:expr) => {{
        // SAFETY: the caller's promise.
        unsafe { $call }
    }};
}

pub(crate) use {answer, promised};

#[cfg(test)]
mod tests {
    use super::*;

    /// Texts that are cut off are UTF-8, and nothing follows the cut. Killed by: bytes that are taken one by one.
    #[test]
    fn texts_end_with_a_whole_character() {
        for (room, expected) in
            [(1, ""), (2, "a"), (3, "a"), (4, "aß"), (6, "aß"), (7, "aß€"), (10, "aß€"), (11, "aß€🂡"), (12, "aß€🂡b")]
        {
            let mut buffer = [1; 16];
            let Some(short) = buffer.get_mut(..room) else { panic!("room in the buffer") };
            let mut text = Text::new(short);
            text.put("aß");
            text.put("€🂡");
            text.put("b");
            text.number(7);
            let bytes = buffer.map(|c| c as u8);
            let found = core::ffi::CStr::from_bytes_until_nul(&bytes).map(|t| t.to_str().unwrap_or("not UTF-8"));
            let found = found.unwrap_or("no end");
            assert_eq!(found, expected, "{room} bytes");
        }
    }
}
