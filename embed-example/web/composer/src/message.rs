//! Messages of errors, in the page's memory.

use core::fmt::{self, Display, Write};

/// Bytes of the longest message; longer ones are cut.
pub(crate) const MESSAGE_BYTES: usize = 256;

/// Writes into what is left of a slice.
struct Cut<'a>(&'a mut [u8]);

impl Write for Cut<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let n = text.len().min(self.0.len());
        let (place, rest) = core::mem::take(&mut self.0).split_at_mut_checked(n).ok_or(fmt::Error)?;
        place.iter_mut().zip(text.bytes()).for_each(|(to, from)| *to = from);
        self.0 = rest;
        Ok(())
    }
}

/// Writes the message; its length, at least 1.
pub(crate) fn written(message: &impl Display, room: &mut [u8]) -> usize {
    let given = room.len();
    let mut cut = Cut(room);
    // whatever is not written is missing in the message
    let _ = write!(cut, "{message}");
    given.saturating_sub(cut.0.len()).max(1)
}
