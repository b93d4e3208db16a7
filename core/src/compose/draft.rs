//! A blob in the making: sections one behind the other in the caller's memory.

use crate::memory::{BLOCK_ALIGN, MemoryError};
use crate::scene::blob::{ALIGN, Header, MAGIC, Section, SectionKind, VERSION, content_hash};
use bytemuck::Pod;
use core::ops::Range;

/// First byte of the first section: room for an entry of each kind in the table.
const FIRST: usize = (size_of::<Header>() + SectionKind::ALL.len() * size_of::<Section>()).next_multiple_of(ALIGN);

/// Bytes of a blob with some sections.
#[derive(Clone, Copy, Debug)]
pub(super) struct Length(pub Option<usize>);

impl Length {
    /// A blob without sections.
    pub(super) const fn new() -> Self {
        Self(Some(FIRST))
    }

    /// With a section more.
    pub(super) fn with<T: Pod>(self, count: usize) -> Self {
        Self(self.0.and_then(|b| {
            let end = count.checked_mul(size_of::<T>())?.checked_add(b)?.checked_next_multiple_of(ALIGN)?;
            Some(end).filter(|end| *end <= isize::MAX as usize)
        }))
    }
}

/// Bytes of a section as its records.
pub(super) fn records<T: Pod>(bytes: &mut [u8]) -> &mut [T] {
    bytemuck::try_cast_slice_mut(bytes).unwrap_or(&mut [])
}

/// A blob in the making.
pub(super) struct Draft<'m> {
    bytes: &'m mut [u8],
    /// Entries of the section table.
    sections: u32,
    /// End of the last section.
    end: usize,
}

impl<'m> Draft<'m> {
    /// An empty blob in a block, which must be aligned to [`BLOCK_ALIGN`].
    pub(super) fn new(bytes: &'m mut [u8]) -> Result<Self, MemoryError> {
        if !bytes.as_ptr().addr().is_multiple_of(BLOCK_ALIGN) {
            return Err(MemoryError::Misaligned);
        }
        let too_small = MemoryError::TooSmall { needed: FIRST, given: bytes.len() };
        bytes.get_mut(..FIRST).ok_or(too_small)?.fill(0);
        Ok(Self { bytes, sections: 0, end: FIRST })
    }

    /// Adds a section of `count` records, behind all others, with the bytes that the block has there; none if that is
    /// 0.
    /// Returns where it is.
    pub(super) fn section<T: Pod>(&mut self, kind: SectionKind, count: usize) -> Result<Range<usize>, MemoryError> {
        let start = self.end;
        let given = self.bytes.len();
        let too_small = |needed| MemoryError::TooSmall { needed, given };
        let end = count.checked_mul(size_of::<T>()).and_then(|n| n.checked_add(start));
        let end = end.ok_or(too_small(usize::MAX))?;
        let padded = end.checked_next_multiple_of(ALIGN).ok_or(too_small(usize::MAX))?;
        self.bytes.get_mut(end..padded).ok_or(too_small(padded))?.fill(0);
        if count > 0 {
            let (stride, offset, count) = (size_of::<T>() as u32, start as u64, count as u64);
            let at = size_of::<Header>() + self.sections as usize * size_of::<Section>();
            let entry = self.bytes.get_mut(at..at + size_of::<Section>()).ok_or(too_small(FIRST))?;
            entry.copy_from_slice(bytemuck::bytes_of(&Section { kind: kind as u32, stride, offset, count }));
            self.sections += 1;
        }
        self.end = padded;
        Ok(start..end)
    }

    /// Adds a section with these records.
    pub(super) fn copy<T: Pod>(&mut self, kind: SectionKind, records: &[T]) -> Result<Range<usize>, MemoryError> {
        let range = self.section::<T>(kind, records.len())?;
        if let Some(place) = self.bytes.get_mut(range.clone()) {
            place.copy_from_slice(bytemuck::cast_slice(records));
        }
        Ok(range)
    }

    /// Records of a section.
    pub(super) fn records<T: Pod>(&mut self, range: &Range<usize>) -> &mut [T] {
        records(self.bytes.get_mut(range.clone()).unwrap_or(&mut []))
    }

    /// Bytes of several sections.
    pub(super) fn split<const N: usize>(&mut self, ranges: [&Range<usize>; N]) -> [&mut [u8]; N] {
        let parts = self.bytes.get_disjoint_mut(ranges.map(Clone::clone));
        parts.unwrap_or_else(|_| core::array::from_fn(|_| Default::default()))
    }

    /// Bytes behind the last section.
    pub(super) fn rest(&self) -> Range<usize> {
        self.end..self.bytes.len()
    }

    /// Moves bytes, `from` to `to` and on.
    pub(super) fn shift(&mut self, from: Range<usize>, to: usize) {
        if from.end <= self.bytes.len() && to <= from.start && from.start <= from.end {
            self.bytes.copy_within(from, to);
        }
    }

    /// The blob, with its header.
    pub(super) fn finish(self) -> &'m mut [u8] {
        let Self { bytes, sections, end } = self;
        let Some(blob) = bytes.get_mut(..end) else { return &mut [] };
        if let Some((head, content)) = blob.split_at_mut_checked(size_of::<Header>()) {
            let hash = content_hash(content);
            let (length, reserved) = (end as u64, [0; 8]);
            let header = Header { magic: MAGIC, version: VERSION, sections, length, hash, reserved };
            head.copy_from_slice(bytemuck::bytes_of(&header));
        }
        blob
    }
}
