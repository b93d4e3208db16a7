//! Memory of the caller: sizes are asked for first, then each block is carved once.

use bytemuck::Pod;
use core::fmt;

/// Alignment of blocks, bytes.
pub const BLOCK_ALIGN: usize = 64;

/// Size and alignment of a block that the caller provides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Size of the block, bytes.
    pub size: usize,
    /// Alignment of its first byte, bytes.
    pub align: usize,
}

/// Reason why a block cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryError {
    /// The block is too small.
    TooSmall {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// The block does not start at a multiple of [`BLOCK_ALIGN`].
    Misaligned,
}

impl fmt::Display for MemoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooSmall { needed, given } => write!(f, "memory block needs {needed} bytes, {given} given"),
            Self::Misaligned => write!(f, "memory block must start at a multiple of {BLOCK_ALIGN} bytes"),
        }
    }
}

impl core::error::Error for MemoryError {}

/// Sum of the bytes of successive slices, each starting at a multiple of [`BLOCK_ALIGN`]; `None` if that is not
/// addressable.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measure(pub Option<usize>);

impl Measure {
    pub(crate) const fn new() -> Self {
        Self(Some(0))
    }

    pub(crate) fn add<T: Pod>(self, n: usize) -> Self {
        Self(self.0.and_then(|b| {
            let bytes = n.checked_mul(size_of::<T>())?.checked_add(BLOCK_ALIGN - 1)? & !(BLOCK_ALIGN - 1);
            b.checked_add(bytes).filter(|&b| b <= isize::MAX as usize)
        }))
    }

    pub(crate) fn layout(self) -> Option<Layout> {
        self.0.map(|size| Layout { size, align: BLOCK_ALIGN })
    }
}

/// Source of successive slices of a block.
pub(crate) struct Carver<'m> {
    rest: &'m mut [u8],
}

impl<'m> Carver<'m> {
    /// Checks size and alignment of the block.
    pub(crate) fn new(block: &'m mut [u8], layout: Layout) -> Result<Self, MemoryError> {
        let given = block.len();
        let rest = block.get_mut(..layout.size).ok_or(MemoryError::TooSmall { needed: layout.size, given })?;
        if layout.size > 0 && rest.as_ptr().addr() % BLOCK_ALIGN != 0 {
            return Err(MemoryError::Misaligned);
        }
        Ok(Self { rest })
    }

    /// Takes the next record, as [`Self::take_unset`] does.
    pub(crate) fn take_one<T: Pod>(&mut self) -> Result<&'m mut T, MemoryError> {
        let given = self.rest.len();
        self.take_unset(1)?.first_mut().ok_or(MemoryError::TooSmall { needed: size_of::<T>(), given })
    }

    /// Takes the next `n` records with the bytes that the caller's memory holds: slabs are written before they are
    /// read. The sequence of calls must be that of [`Measure::add`]. Pages that are never used need not exist. `Debug` shows the bytes that are there.
    pub(crate) fn take_unset<T: Pod>(&mut self, n: usize) -> Result<&'m mut [T], MemoryError> {
        let used = n * size_of::<T>();
        let padded = (used + BLOCK_ALIGN - 1) & !(BLOCK_ALIGN - 1);
        let given = self.rest.len();
        let rest = core::mem::take(&mut self.rest);
        let (head, tail) = rest.split_at_mut_checked(padded).ok_or(MemoryError::TooSmall { needed: padded, given })?;
        self.rest = tail;
        let head = head.get_mut(..used).ok_or(MemoryError::TooSmall { needed: used, given })?;
        bytemuck::try_cast_slice_mut(head).map_err(|_| MemoryError::Misaligned)
    }
}
