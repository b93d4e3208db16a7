//! What one shard notes in one iteration: directions in which the bounce of a sample found light, or from which the power
//! of a light path arrived.
//!
//! A full log holds a uniform sample of all that was offered: number n replaces one that is chosen by a hash of n, with
//! probability capacity / n (Vitter, "Random Sampling with a Reservoir", 1985, algorithm R), so that each counts as
//! offered / capacity of them. Nothing but the order in the shard decides, and no step takes longer than another.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::size::GuideSize;
use crate::memory::{Carver, Layout, Measure, MemoryError};
use crate::rng::mix;
use bytemuck::{Pod, Zeroable};
use croupier_simd::F32x8;

/// No leaf: of samples that are not learned from.
pub const NO_LEAF: u32 = u32::MAX;

/// Share of directions that had no density to compare.
pub const UNKNOWN_SHARE: u32 = 255;

/// Largest square of a contribution; greater ones count as this.
const MAX_SQUARE: f32 = 1e15;
/// Range of densities, 1/sr.
const PDF_RANGE: [f32; 2] = [1e-15, 1e15];

/// Power that has arrived along a light path.
pub(super) struct Arrival {
    /// Where: [`Guide::place`](super::Guide::place).
    pub(super) place: u32,
    /// Power, mean of rgb.
    pub(super) power: f32,
    /// Density with which a BSDF would sample the direction, 1/sr.
    pub(super) pdf: f32,
}

/// A direction that contributed, 12 bytes; or one from which power arrived, see [`Self::arrival`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GuideHit {
    /// Leaf, and below it in 8 bits the share, see [`Self::share`]; of light paths the place.
    leaf: u32,
    /// Point of the square, [`super::sphere::quantised`].
    pub(super) point: u32,
    /// Upper halves of two floats: square of the contribution, and below it the density of the direction, of which nothing
    /// counts but whether it is 0, as in delta lobes; of light paths the power, and a density below 0.
    value: u32,
}

impl GuideHit {
    /// Leaf.
    pub(super) fn leaf(&self) -> u32 {
        self.leaf >> 8
    }

    /// Density of the guide over the sum of its density and the BSDF's, in (0, 1); `None` if there was no guide.
    pub(super) fn share(&self) -> Option<f32> {
        let share = self.leaf & 0xff;
        (share != UNKNOWN_SHARE).then_some((share as f32 + 0.5) / 255.0)
    }

    /// Square of the contribution, and the density of the direction, 1/sr, both within 2^-7.
    pub(super) fn square_and_pdf(&self) -> [f32; 2] {
        [f32::from_bits(self.value & 0xffff_0000), f32::from_bits(self.value << 16)]
    }

    /// What the bounce contributed, over its density.
    pub(super) fn contribution(&self) -> f32 {
        let [square, _] = self.square_and_pdf();
        F32x8::splat(square).sqrt().lane(0)
    }

    /// The arrival of a light path, if it is none of a camera path's directions.
    pub(super) fn arrival(&self) -> Option<Arrival> {
        let [power, pdf] = self.square_and_pdf();
        (pdf < 0.0).then_some(Arrival { place: self.leaf, power, pdf: -pdf })
    }

    /// Are these numbers that a log may hold?
    fn is_sound(&self) -> bool {
        let [square, pdf] = self.square_and_pdf();
        (0.0..=MAX_SQUARE).contains(&square) && (0.0..=PDF_RANGE[1]).contains(&pdf.abs())
    }
}

/// Directions that contributed, of one shard in the current iteration.
#[derive(Debug)]
pub struct GuideLog<'m> {
    hits: &'m mut [GuideHit],
    /// How many were offered.
    offered: u32,
}

impl<'m> GuideLog<'m> {
    /// Bytes of an entry.
    pub(crate) const HIT_BYTES: usize = size_of::<GuideHit>();

    /// Size and alignment of the block that [`Self::new`] needs; `None` if it cannot be addressed.
    pub fn layout(size: GuideSize) -> Option<Layout> {
        Self::measure(Measure::new(), size).layout()
    }

    /// Empty log in a block of its own.
    ///
    /// # Errors
    /// A block that does not fit.
    pub fn new(size: GuideSize, block: &'m mut [u8]) -> Result<Self, MemoryError> {
        let given = block.len();
        let layout = Self::layout(size).ok_or(MemoryError::TooSmall { needed: usize::MAX, given })?;
        Self::carve(&mut Carver::new(block, layout)?, size)
    }

    pub(crate) fn measure(m: Measure, size: GuideSize) -> Measure {
        m.add::<GuideHit>(size.hits as usize)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, size: GuideSize) -> Result<Self, MemoryError> {
        Ok(Self { hits: c.take_unset(size.hits as usize)?, offered: 0 })
    }

    /// How many were offered.
    pub(crate) fn offered(&self) -> u32 {
        self.offered
    }

    /// Goes on with what the memory holds.
    pub(crate) fn resume(&mut self, offered: u32) {
        self.offered = offered;
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.offered = 0;
    }

    /// Adds a direction: the leaf it was sampled in, the share of its density that is the guide's (0 to 254 of 254,
    /// [`UNKNOWN_SHARE`] where nothing was known), its point of the square ([`super::sphere::quantised`]), the square
    /// of what the bounce contributed (over its density), the density, 1/sr, 0 for delta lobes, of which only the
    /// share of samples to guide is learned. What contributed nothing, and what is not finite, is left out. `false` if
    /// another one, or this one, is lost for want of room.
    #[inline]
    pub fn add(&mut self, leaf: u32, share: u32, point: u32, square: f32, pdf: f32) -> bool {
        let finite = square.is_finite() && pdf.is_finite();
        if !(finite && square > 0.0 && pdf >= 0.0 && leaf >> 24 == 0) {
            return true;
        }
        let [least, most] = PDF_RANGE;
        let value = square.min(MAX_SQUARE).to_bits() & 0xffff_0000
            | if pdf > 0.0 { pdf.clamp(least, most).to_bits() >> 16 } else { 0 };
        let hit = GuideHit { leaf: leaf << 8 | share.min(UNKNOWN_SHARE), point, value };
        self.insert(hit)
    }

    /// Adds power that has arrived along a light path: where ([`super::Guide::place`]), the point of the direction that it
    /// came from, the power, and the density with which the BSDF would have sampled the direction, 1/sr.
    #[inline]
    pub(crate) fn add_light(&mut self, place: u32, point: u32, power: f32, pdf: f32) {
        if !(power.is_finite() && pdf.is_finite() && power >= f32::MIN_POSITIVE) {
            return;
        }
        let [least, most] = PDF_RANGE;
        let value = power.min(MAX_SQUARE).to_bits() & 0xffff_0000 | (-pdf.clamp(least, most)).to_bits() >> 16;
        self.insert(GuideHit { leaf: place, point, value });
    }

    fn insert(&mut self, hit: GuideHit) -> bool {
        let (n, room) = (u64::from(self.offered), self.hits.len() as u64);
        self.offered = self.offered.saturating_add(1);
        let place = if n < room { n } else { mix(n) % (n + 1) };
        if let Some(slot) = self.hits.get_mut(usize::try_from(place).unwrap_or(usize::MAX)) {
            *slot = hit;
        }
        n < room
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.len_of(self.offered)
    }

    /// Is it empty?
    pub fn is_empty(&self) -> bool {
        self.offered == 0
    }

    /// Number of directions that each entry stands for.
    pub(super) fn weight(&self) -> f32 {
        if self.is_empty() { 1.0 } else { (f64::from(self.offered) / self.len().max(1) as f64) as f32 }
    }

    /// The entries.
    pub(super) fn hits(&self) -> &[GuideHit] {
        self.hits.get(..self.len()).unwrap_or(&[])
    }

    /// The entries as bytes.
    pub(crate) fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self.hits())
    }

    /// The first entry in the bytes of [`Self::bytes`] with numbers that none has.
    pub(crate) fn unsound(bytes: &[u8]) -> Option<usize> {
        bytes.chunks_exact(Self::HIT_BYTES).position(|b| !bytemuck::pod_read_unaligned::<GuideHit>(b).is_sound())
    }

    /// Takes the bytes of [`Self::bytes`] of a log to which `offered` directions were offered.
    pub(crate) fn load(&mut self, offered: u32, bytes: &[u8]) {
        let to: &mut [u8] = bytemuck::cast_slice_mut(self.hits);
        to.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        self.offered = offered;
    }

    /// Number of entries of a log of this capacity to which `offered` directions were offered.
    pub(crate) fn len_of(&self, offered: u32) -> usize {
        (offered as usize).min(self.hits.len())
    }

    /// Number of directions that were offered and that it has no entries of.
    pub fn thinned(&self) -> u32 {
        self.offered - self.len() as u32
    }
}
