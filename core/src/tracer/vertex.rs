//! A path vertex, as one lane of a packet and as a record that waits for its samples.

use super::media_set::MediaSet8;
use super::path::Path8;
use crate::rng::Key8;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// One waiting vertex, 128 bytes: four rows of eight words, so that eight of them transpose into [`PathVertex8`]. A ray on
/// its way waits in the same record ([`super::passing`]).
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct PathVertex {
    rows: [[f32; 8]; 4],
}

/// Eight path vertices, one per lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathVertex8 {
    /// Position, world space.
    pub p: Vec3x8,
    /// Bound of its rounding error along `ng`.
    pub error: F32x8,
    /// Geometric unit normal; 0 in a medium.
    pub ng: Vec3x8,
    /// Shading unit normal, already facing `wo` on two-sided materials; `wo` in a medium.
    pub ns: Vec3x8,
    /// Unit direction back along the path.
    pub wo: Vec3x8,
    /// Prefix weight of every sample: throughput over all factors so far.
    pub beta: Vec3x8,
    /// Reflectance after texturing; single-scattering albedo in a medium.
    pub reflectance: Vec3x8,
    /// Material index; index of the medium in a medium.
    pub material: U32x8,
    /// Media that it is inside of; on a surface, those on the side of `wo`.
    pub media: MediaSet8,
    /// Camera sample, ledger record of the sample that led here, and path segments from the camera to here.
    pub path: Path8,
    /// Random key.
    pub key: Key8,
    /// Product of the albedos of the vertices before this one, mean over rgb.
    pub albedo_product: F32x8,
    /// Samples left, the number of the next one, and how many of those left have next event estimation: see [`pack_samples`].
    pub samples: U32x8,
    /// Probability that a sample has next event estimation ([`crate::rrs::Learned8::nee_probability`]).
    pub nee_probability: F32x8,
    /// Bin of the learned statistics, [`NO_BIN`](crate::learn::cache::NO_BIN) if there is none.
    pub bin: U32x8,
    /// See [`PixelTarget::error_weight`](super::root::PixelTarget::error_weight).
    pub error_weight: Vec3x8,
}

/// Row and column of the words that are read or changed while a vertex (or a ray) waits: [`super::passing`] has them in
/// the same places.
const ROOT: (usize, usize) = (1, 6);
const RECORD: (usize, usize) = (3, 1);
const SAMPLES: (usize, usize) = (3, 2);

/// The word of a vertex with `count` samples to draw, the first `with_nee` of them with a light sample. A byte each: no
/// factor is larger than [`crate::rrs::MAX_FACTOR`].
pub(crate) fn pack_samples(count: u32, with_nee: u32) -> u32 {
    debug_assert!(count < 256 && with_nee <= count);
    count | with_nee << 16
}

const _: () = assert!(crate::rrs::MAX_FACTOR < 255.0);

impl PathVertex {
    /// Eight records of words by row and column.
    #[inline(always)]
    pub(super) fn of_columns(columns: [[F32x8; 8]; 4]) -> [Self; 8] {
        let [a, b, c, d] = columns.map(|c| F32x8::transpose(c).map(F32x8::to_array));
        core::array::from_fn(|i| Self { rows: [a[i], b[i], c[i], d[i]] })
    }

    /// The words of eight records, by row and column.
    #[inline(always)]
    pub(super) fn columns(v: [&Self; 8]) -> [[F32x8; 8]; 4] {
        let mut columns = [[F32x8::ZERO; 8]; 4];
        for (r, c) in columns.iter_mut().enumerate() {
            let mut rows = [F32x8::ZERO; 8];
            for (row, v) in rows.iter_mut().zip(v) {
                *row = F32x8::new(v.rows[r]);
            }
            *c = F32x8::transpose(rows);
        }
        columns
    }

    fn samples(&self) -> u32 {
        self.rows[SAMPLES.0][SAMPLES.1].to_bits()
    }

    /// Samples left.
    pub(crate) fn count(&self) -> u32 {
        self.samples() & 0xff
    }

    /// Samples left that have next event estimation. They come first.
    pub(crate) fn with_nee(&self) -> u32 {
        self.samples() >> 16
    }

    /// Root slot.
    pub(crate) fn root(&self) -> u32 {
        self.rows[ROOT.0][ROOT.1].to_bits()
    }

    /// Ledger record.
    pub(crate) fn record(&self) -> u32 {
        self.rows[RECORD.0][RECORD.1].to_bits()
    }

    /// Takes `m` of its samples; returns the number of the first.
    pub(crate) fn take(&mut self, m: u32) -> u32 {
        let first = self.samples() >> 8 & 0xff;
        let (count, with_nee) = (self.count().saturating_sub(m), self.with_nee().saturating_sub(m));
        self.rows[SAMPLES.0][SAMPLES.1] = f32::from_bits(count | (first.wrapping_add(m) & 0xff) << 8 | with_nee << 16);
        first
    }
}

impl PathVertex8 {
    #[inline]
    fn columns(&self) -> [[F32x8; 8]; 4] {
        let f = F32x8::from_bits;
        [
            [self.p.x, self.p.y, self.p.z, self.error, self.ng.x, self.ng.y, self.ng.z, f(self.material)],
            [
                self.ns.x,
                self.ns.y,
                self.ns.z,
                self.wo.x,
                self.wo.y,
                self.wo.z,
                f(self.path.root),
                f(self.media.pack(self.path.depth)),
            ],
            [
                self.beta.x,
                self.beta.y,
                self.beta.z,
                self.reflectance.x,
                self.reflectance.y,
                self.reflectance.z,
                f(self.key.lo),
                f(self.key.hi),
            ],
            [
                self.albedo_product,
                f(self.path.record),
                f(self.samples),
                self.nee_probability,
                f(self.bin),
                self.error_weight.x,
                self.error_weight.y,
                self.error_weight.z,
            ],
        ]
    }

    #[inline]
    fn from_columns(c: [[F32x8; 8]; 4]) -> Self {
        let [a, b, d, e] = c;
        let (media, depth) = MediaSet8::unpack(b[7].to_bits());
        Self {
            p: Vec3x8::new(a[0], a[1], a[2]),
            error: a[3],
            ng: Vec3x8::new(a[4], a[5], a[6]),
            material: a[7].to_bits(),
            media,
            ns: Vec3x8::new(b[0], b[1], b[2]),
            wo: Vec3x8::new(b[3], b[4], b[5]),
            path: Path8 { root: b[6].to_bits(), record: e[1].to_bits(), depth },
            beta: Vec3x8::new(d[0], d[1], d[2]),
            reflectance: Vec3x8::new(d[3], d[4], d[5]),
            key: Key8 { lo: d[6].to_bits(), hi: d[7].to_bits() },
            albedo_product: e[0],
            samples: e[2].to_bits(),
            nee_probability: e[3],
            bin: e[4].to_bits(),
            error_weight: Vec3x8::new(e[5], e[6], e[7]),
        }
    }

    /// The eight lanes as records.
    #[inline]
    pub(crate) fn records(&self) -> [PathVertex; 8] {
        PathVertex::of_columns(self.columns())
    }

    /// Loads one record per lane.
    #[inline]
    pub(crate) fn from_records(v: [&PathVertex; 8]) -> Self {
        Self::from_columns(PathVertex::columns(v))
    }
}

#[cfg(test)]
impl PathVertex {
    /// A vertex of nothing but samples.
    pub(crate) fn of_samples(count: u32, with_nee: u32) -> Self {
        let mut v: Self = Zeroable::zeroed();
        v.rows[SAMPLES.0][SAMPLES.1] = f32::from_bits(pack_samples(count, with_nee));
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: two fields sharing a column, transposing the wrong way.
    #[test]
    fn vertices_survive_the_ring() {
        let f = |k: usize| F32x8::from_fn(|i| (100 * k + i) as f32);
        let u = |k: usize| U32x8::from_fn(|i| (1000 * k + i) as u32);
        let v3 = |k: usize| Vec3x8::new(f(k), f(k + 1), f(k + 2));
        let v = PathVertex8 {
            p: v3(1),
            error: f(4),
            ng: v3(5),
            ns: v3(8),
            wo: v3(11),
            beta: v3(14),
            reflectance: v3(17),
            material: u(20),
            media: MediaSet8::unpack(u(24) << 8).0,
            path: Path8 { root: u(21), record: u(28), depth: U32x8::from_fn(|i| 93 + i as u32) },
            key: Key8 { lo: u(22), hi: u(23) },
            albedo_product: f(25),
            samples: u(26),
            nee_probability: f(27),
            bin: u(29),
            error_weight: v3(30),
        };
        let records = v.records();
        for (i, r) in records.iter().enumerate() {
            assert_eq!((r.samples(), r.root(), r.record()), (26_000 + i as u32, 21_000 + i as u32, 28_000 + i as u32));
        }
        let back = PathVertex8::from_records(core::array::from_fn(|i| &records[7 - i]));
        for i in 0..8 {
            assert_eq!(back.p.lane(i), v.p.lane(7 - i));
            assert_eq!(back.reflectance.lane(i), v.reflectance.lane(7 - i));
            assert_eq!((back.key.lo.lane(i), back.key.hi.lane(i)), (v.key.lo.lane(7 - i), v.key.hi.lane(7 - i)));
            assert_eq!(back.albedo_product.lane(i), v.albedo_product.lane(7 - i));
            assert_eq!(
                (back.samples.lane(i), back.nee_probability.lane(i)),
                (v.samples.lane(7 - i), v.nee_probability.lane(7 - i))
            );
            assert_eq!(back.bin.lane(i), v.bin.lane(7 - i));
            assert_eq!(back.error_weight.lane(i), v.error_weight.lane(7 - i));
            assert_eq!(back.path.lane(i), v.path.lane(7 - i));
            assert_eq!(back.media.met().lane(i), v.media.met().lane(7 - i));
        }
    }
}
