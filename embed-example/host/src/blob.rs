//! Writes scene blobs: header, section table, sections, content hash ([`croupier::unstable::scene::blob`]).

use bytemuck::{Pod, Zeroable};
use croupier::unstable::scene::blob::{ALIGN, Header, MAGIC, Section, SectionKind, VERSION, content_hash};
use std::fmt;
use std::ops::Deref;

/// One unit of allocation; its alignment is the blob's.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u8; ALIGN]);

/// Bytes that start at a multiple of [`ALIGN`], so that a blob in them traverses fastest.
#[derive(Clone)]
pub struct AlignedBytes {
    lines: Vec<Line>,
    length: usize,
}

impl AlignedBytes {
    /// Zeros of that length. The system provides large ones page by page when they are first touched.
    pub fn zeroed(length: usize) -> Self {
        Self { lines: bytemuck::zeroed_vec(length.div_ceil(ALIGN)), length }
    }

    /// Zeros of that length, or `None` where the system has not enough memory.
    pub fn try_zeroed(length: usize) -> Option<Self> {
        Some(Self { lines: bytemuck::try_zeroed_vec(length.div_ceil(ALIGN)).ok()?, length })
    }
}

impl Deref for AlignedBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.lines)[..self.length]
    }
}

impl AsRef<[u8]> for AlignedBytes {
    fn as_ref(&self) -> &[u8] {
        self
    }
}

impl AsMut<[u8]> for AlignedBytes {
    fn as_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.length]
    }
}

impl fmt::Debug for AlignedBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AlignedBytes({} bytes)", self.length)
    }
}

/// Collects sections and lays them out, in the order in which they were added.
///
/// ```
/// use croupier::unstable::scene::blob::{Header, SectionKind};
/// use croupier_host::blob::BlobWriter;
/// let mut writer = BlobWriter::default();
/// writer.section(SectionKind::Tables, &[0.25f32, 0.5]);
/// let bytes = writer.finish();
/// assert_eq!(&bytes[..8], b"CROUPIER");
/// assert_eq!(bytes.len() % 64, 0);
/// ```
#[derive(Default)]
pub struct BlobWriter<'a> {
    sections: Vec<(Section, &'a [u8])>,
}

impl<'a> BlobWriter<'a> {
    /// Adds the records of one kind; an empty section is left out, which reads the same.
    pub fn section<T: Pod>(&mut self, kind: SectionKind, records: &'a [T]) -> &mut Self {
        if !records.is_empty() {
            let (stride, count) = (size_of::<T>() as u32, records.len() as u64);
            self.sections
                .push((Section { kind: kind as u32, stride, offset: 0, count }, bytemuck::cast_slice(records)));
        }
        self
    }

    /// Kinds and bytes of the sections added so far.
    pub fn sizes(&self) -> Vec<(SectionKind, u64)> {
        let sizes = self.sections.iter().map(|(s, bytes)| (SectionKind::from_u32(s.kind), bytes.len() as u64));
        sizes.filter_map(|(kind, bytes)| Some((kind?, bytes))).collect()
    }

    /// The blob; its length is a multiple of [`ALIGN`] and the gaps between sections are zeros.
    pub fn finish(mut self) -> AlignedBytes {
        let table = size_of::<Header>() + self.sections.len() * size_of::<Section>();
        let mut end = table.next_multiple_of(ALIGN);
        for (section, bytes) in &mut self.sections {
            section.offset = end as u64;
            end = (end + bytes.len()).next_multiple_of(ALIGN);
        }
        let mut blob = AlignedBytes::zeroed(end);
        let out = blob.as_mut();
        for (i, (section, bytes)) in self.sections.iter().enumerate() {
            let entry = size_of::<Header>() + i * size_of::<Section>();
            out[entry..entry + size_of::<Section>()].copy_from_slice(bytemuck::bytes_of(section));
            let offset = section.offset as usize;
            out[offset..offset + bytes.len()].copy_from_slice(bytes);
        }
        let header = Header {
            magic: MAGIC,
            version: VERSION,
            sections: self.sections.len() as u32,
            length: end as u64,
            hash: content_hash(&out[size_of::<Header>()..]),
            reserved: [0; 8],
        };
        out[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
        blob
    }
}
