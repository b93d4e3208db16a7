//! One record per camera sample in flight: what its whole tree of paths has found.

use super::free_list::FreeList;
use crate::film::Half;
use crate::memory::{Carver, Measure, MemoryError};
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// A camera sample whose paths are not all finished.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct CameraSample {
    /// Radiance found so far; f64 because a split sample sums thousands of terms.
    pub radiance: [f64; 3],
    /// Waiting vertices and lanes in flight that belong to it.
    pub open: u32,
    /// Rays traced for it.
    pub rays: u32,
    /// Pixel that it belongs to.
    pub target: PixelTarget,
    /// Samples that its splits have added.
    pub splits: u32,
    /// Time of its rays, see [`Ray8::time`](crate::geometry::Ray8::time). It makes eight words of what [`Roots::targets`]
    /// reads.
    pub time: f32,
}

/// The pixel of a camera sample.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PixelTarget {
    /// What a squared error of a sample's rgb counts in the error of the picture.
    pub error_weight: [f32; 3],
    /// Samples of the pixel over those of the mean pixel; `error_weight` times its square is that of the pixel.
    pub share: f32,
    /// Film index, below 2^31, and in the highest bit whether the sample is of the second half of the pixel's.
    film: u32,
    /// Number of the pixel in the shard, below 2^30, and in the highest bits whether the sample is its first of the
    /// iteration, and whether it may be guided; see [`Self::numbered`].
    pixel: u32,
}

/// Bit of a pixel's first sample.
const FIRST: u32 = 1 << 31;
/// Bit of a sample that may be guided.
const GUIDED: u32 = 1 << 30;
/// Both of them.
const BITS: u32 = FIRST | GUIDED;
/// Bit of a film index whose sample is of the second half.
const SECOND: u32 = 1 << 31;

impl PixelTarget {
    /// The target of sample `sample`, of this iteration, of pixel `pixel` of the shard.
    pub(crate) fn numbered(error_weight: [f32; 3], share: f32, film: u32, pixel: u32, sample: u32) -> Self {
        Self { error_weight, share, film: film & !SECOND, pixel: pixel & !BITS | if sample == 0 { FIRST } else { 0 } }
    }

    /// The same of a sample that may be guided, or may not.
    #[inline(always)]
    pub(crate) fn with_guiding(self, guided: bool) -> Self {
        Self { pixel: self.pixel | if guided { GUIDED } else { 0 }, ..self }
    }

    /// The same of a sample of a half.
    #[inline(always)]
    pub(crate) fn with_half(self, half: Half) -> Self {
        Self { film: self.film & !SECOND | if half == Half::Second { SECOND } else { 0 }, ..self }
    }

    /// Film index.
    #[inline(always)]
    pub(crate) fn film(&self) -> u32 {
        self.film & !SECOND
    }

    /// Half of the pixel's samples that the sample belongs to.
    #[inline(always)]
    pub(crate) fn half(&self) -> Half {
        if self.film & SECOND == 0 { Half::First } else { Half::Second }
    }

    /// Number of the pixel in the shard.
    #[inline(always)]
    pub(crate) fn pixel(&self) -> usize {
        (self.pixel & !BITS) as usize
    }

    /// Is it the pixel's first sample of the iteration?
    pub(crate) fn is_first(&self) -> bool {
        self.pixel & FIRST != 0
    }
}

/// The pixels of eight camera samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PixelTarget8 {
    /// See [`PixelTarget::error_weight`].
    pub error_weight: Vec3x8,
    /// See [`PixelTarget::share`].
    pub share: F32x8,
    /// Film indices.
    pub film: U32x8,
}

/// Bytes of a camera sample in flight, with its place in the list of free slots.
pub(crate) const BYTES_PER_ROOT: usize = size_of::<CameraSample>() + size_of::<u32>();

/// One record per lane read as a row: `target` and the words behind it.
const ROW: usize = core::mem::offset_of!(CameraSample, target) / 4;
const _: () = assert!(ROW + 8 <= size_of::<CameraSample>() / 4);

/// A fixed slab of roots.
#[derive(Debug)]
pub(crate) struct Roots<'m> {
    slots: &'m mut [CameraSample],
    free: FreeList<'m>,
    /// What a number without a slot stands for: there is none, unless others have written into the block.
    nobody: CameraSample,
}

impl<'m> Roots<'m> {
    pub(crate) fn measure(m: Measure, capacity: usize) -> Measure {
        FreeList::measure(m.add::<CameraSample>(capacity), capacity)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, capacity: usize) -> Result<Self, MemoryError> {
        let slots = c.take_unset(capacity)?;
        Ok(Self { slots, free: FreeList::carve(c, capacity)?, nobody: Zeroable::zeroed() })
    }

    /// How many slots are free, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> u64 {
        self.free.suspend()
    }

    /// See [`FreeList::resume`].
    pub(crate) fn resume(&mut self, free: u64) -> Option<()> {
        self.free.resume(free)
    }

    /// Forgets all that is open.
    pub(crate) fn reset(&mut self) {
        self.free.reset();
    }

    /// A new root with one open lane. `None` cannot happen while roots outnumber vertices by two packets.
    #[inline]
    pub(crate) fn open(&mut self, target: PixelTarget) -> Option<u32> {
        let slot = self.free.take()?;
        *self.slots.get_mut(slot as usize)? = CameraSample { target, open: 1, ..Zeroable::zeroed() };
        Some(slot)
    }

    /// The pixels of the roots in `mask`; 0 in other lanes.
    #[inline(always)]
    pub(crate) fn targets(&self, slots: U32x8, mask: Mask8) -> PixelTarget8 {
        let row = |slot: u32| match self.slots.get(slot as usize) {
            Some(root) => {
                let words: &[f32; size_of::<CameraSample>() / 4] = bytemuck::cast_ref(root);
                F32x8::new(core::array::from_fn(|k| words[ROW + k]))
            }
            None => F32x8::ZERO,
        };
        let [a, b, c, d, e, f, g, h] = U32x8::select(mask, slots, U32x8::splat(u32::MAX)).to_array();
        let rows = [row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)];
        let [x, y, z, share, film, ..] = F32x8::transpose(rows);
        PixelTarget8 { error_weight: Vec3x8::new(x, y, z), share, film: film.to_bits() & U32x8::splat(!SECOND) }
    }

    /// The times of the roots in `mask`; 0 in other lanes.
    #[inline(never)]
    pub(crate) fn times(&self, slots: U32x8, mask: Mask8) -> F32x8 {
        let slots = U32x8::select(mask, slots, U32x8::splat(u32::MAX)).to_array();
        F32x8::from_fn(|i| self.slots.get(slots[i] as usize).map_or(0.0, |root| root.time))
    }

    /// Lanes of `mask` whose camera samples may be guided.
    #[inline(always)]
    pub(crate) fn guided(&self, slots: U32x8, mask: Mask8) -> Mask8 {
        let slots = slots.to_array();
        let words = U32x8::from_fn(|i| self.slots.get(slots[i] as usize).map_or(0, |root| root.target.pixel));
        mask.and_not((words & U32x8::splat(GUIDED)).eq(U32x8::splat(0)))
    }

    /// The root in a slot.
    #[inline(always)]
    pub(crate) fn find(&mut self, slot: u32) -> Option<&mut CameraSample> {
        self.slots.get_mut(slot as usize)
    }

    /// The root in a slot, or nobody's.
    pub(crate) fn get(&mut self, slot: u32) -> &mut CameraSample {
        self.slots.get_mut(slot as usize).unwrap_or(&mut self.nobody)
    }

    /// Closes one vertex or lane; the finished root if it was the last.
    pub(crate) fn close(&mut self, slot: u32) -> Option<CameraSample> {
        let root = self.slots.get_mut(slot as usize)?;
        root.open -= 1;
        if root.open > 0 {
            return None;
        }
        let done = *root;
        self.free.give(slot);
        Some(done)
    }
}
