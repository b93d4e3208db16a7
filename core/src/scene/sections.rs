//! The header and the section table: where each kind's records are.

use super::blob::{ALIGN, Header, MAGIC, Section, SectionKind, VERSION, content_hash};
use super::error::{SceneError, SectionFault};
use bytemuck::Pod;
use core::ops::Range;

/// Number of section kinds.
const KINDS: usize = SectionKind::ALL.len();

/// Where the sections of a blob are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SectionTable {
    entries: [Option<Section>; KINDS],
    /// Content hash, verified.
    pub(crate) hash: u64,
}

/// A blob whose header, hash and section table are sound.
#[derive(Clone, Copy)]
pub(crate) struct Sections<'s> {
    blob: &'s [u8],
    table: SectionTable,
}

impl SectionTable {
    fn entry(&self, kind: SectionKind) -> Option<Section> {
        self.entries.get(kind as usize).copied().flatten()
    }

    /// Bytes of all records of section `kind` within the blob.
    pub(crate) fn whole(&self, kind: SectionKind) -> Option<Range<usize>> {
        let s = self.entry(kind)?;
        let (start, end) = (usize::try_from(s.offset).ok()?, usize::try_from(end(&s)?).ok()?);
        Some(start..end)
    }

    /// Bytes of record `index` of section `kind` within the blob.
    pub(crate) fn record(&self, kind: SectionKind, index: u32) -> Option<Range<usize>> {
        let s = self.entry(kind).filter(|s| u64::from(index) < s.count)?;
        let start = u64::from(index).checked_mul(u64::from(s.stride))?.checked_add(s.offset)?;
        let start = usize::try_from(start).ok()?;
        Some(start..start.checked_add(s.stride as usize)?)
    }
}

impl<'s> Sections<'s> {
    pub(super) fn new(bytes: &'s [u8]) -> Result<Self, SceneError> {
        let given = bytes.len() as u64;
        let head = bytes.get(..size_of::<Header>());
        let head = head.ok_or(SceneError::Truncated { needed: size_of::<Header>() as u64, given })?;
        let header: Header = bytemuck::pod_read_unaligned(head);
        if header.magic != MAGIC {
            return Err(SceneError::Magic);
        }
        if header.version != VERSION {
            return Err(SceneError::Version(header.version));
        }
        // Every record is made of 4-byte words; the two 8-byte fields of the header and table are copied out.
        if bytemuck::try_cast_slice::<u8, u32>(bytes.get(..4).unwrap_or(&[])).is_err() {
            return Err(SceneError::Misaligned);
        }
        let truncated = SceneError::Truncated { needed: header.length, given };
        let length = usize::try_from(header.length).map_err(|_| truncated)?;
        let blob = bytes.get(..length).ok_or(truncated)?;
        let content = blob
            .get(size_of::<Header>()..)
            .ok_or(SceneError::Truncated { needed: size_of::<Header>() as u64, given: header.length })?;
        let found = content_hash(content);
        if found != header.hash {
            return Err(SceneError::Hash { stated: header.hash, found });
        }
        if header.reserved != [0; 8] {
            return Err(SceneError::Header);
        }
        if header.sections as usize > KINDS {
            return Err(SceneError::SectionCount(header.sections));
        }
        // At most an entry per kind: no overflow.
        let table_bytes = (header.sections as usize).saturating_mul(size_of::<Section>());
        let table_end = table_bytes.saturating_add(size_of::<Header>()) as u64;
        let table = content.get(..table_bytes);
        let table = table.ok_or(SceneError::Truncated { needed: table_end, given: header.length })?;
        let mut sections = Self { blob, table: SectionTable { entries: [None; KINDS], hash: header.hash } };
        for entry in table.chunks_exact(size_of::<Section>()) {
            sections.enter(bytemuck::pod_read_unaligned(entry), table_end)?;
        }
        Ok(sections)
    }

    /// Checks one entry against the blob and those entered before.
    fn enter(&mut self, s: Section, table_end: u64) -> Result<(), SceneError> {
        let kind = SectionKind::from_u32(s.kind).ok_or(SceneError::UnknownSection(s.kind))?;
        let bad = |fault| SceneError::Section { kind, fault };
        if s.offset < table_end || !s.offset.is_multiple_of(ALIGN as u64) {
            return Err(bad(SectionFault::Offset(s.offset)));
        }
        let end = end(&s).filter(|e| *e <= self.blob.len() as u64 && s.count <= i32::MAX as u64);
        let end = end.ok_or(bad(SectionFault::Count(s.count)))?;
        for (other, k) in self.table.entries.iter().zip(SectionKind::ALL) {
            let Some(o) = other else { continue };
            if *k == kind {
                return Err(bad(SectionFault::Repeated));
            }
            // Empty sections hold no bytes to share.
            let other_end = self::end(o).unwrap_or(u64::MAX);
            if s.offset < end && o.offset < other_end && s.offset < other_end && o.offset < end {
                return Err(bad(SectionFault::Overlaps(*k)));
            }
        }
        if let Some(place) = self.table.entries.get_mut(kind as usize) {
            *place = Some(s);
        }
        Ok(())
    }

    /// Sections of a blob with this table, which were sound; what `bytes` lacks is missing.
    pub(crate) fn assume_sound(table: SectionTable, bytes: &'s [u8]) -> Self {
        Self { blob: bytes, table }
    }

    /// Where they are.
    pub(crate) fn table(&self) -> SectionTable {
        self.table
    }

    /// The records of section `kind`, none if there is no such section.
    pub(super) fn records<T: Pod>(&self, kind: SectionKind) -> Result<&'s [T], SceneError> {
        let Some(s) = self.table.entry(kind) else { return Ok(&[]) };
        let bad = |fault| SceneError::Section { kind, fault };
        if s.stride as usize != size_of::<T>() {
            return Err(bad(SectionFault::Stride(s.stride)));
        }
        let range = usize::try_from(s.offset).ok().zip(end(&s).and_then(|e| usize::try_from(e).ok()));
        let bytes = range.and_then(|(start, end)| self.blob.get(start..end));
        bytemuck::try_cast_slice(bytes.ok_or(bad(SectionFault::Count(s.count)))?).map_err(|_| SceneError::Misaligned)
    }

    /// The only record of section `kind`.
    pub(super) fn one<T: Pod>(&self, kind: SectionKind) -> Result<&'s T, SceneError> {
        match self.records(kind)? {
            [record] => Ok(record),
            other => Err(SceneError::Section { kind, fault: SectionFault::Count(other.len() as u64) }),
        }
    }
}

/// First byte after a section, unless that overflows.
fn end(s: &Section) -> Option<u64> {
    s.count.checked_mul(u64::from(s.stride))?.checked_add(s.offset)
}
