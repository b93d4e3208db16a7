//! Stage `pass`: rays that go straight on through what they meet: boundaries of media, thin sheets, holes of cut-outs.
//!
//! Such a passage is no vertex: it has no factor of roulette, adds no segment, and the ray keeps the density of the bounce
//! that it began with, so that the weight against light samples stays right, which see through the same things
//! ([`super::occlude`]). The rays wait in the ring, a record each, and go on in a packet of their kind.

use super::book::Bookkeeping;
use super::class::PacketClass;
use super::crossing::across;
use super::media_set::MediaSet8;
use super::packets::RayState8;
use super::path::Path8;
use super::ring::{Ring, Taken8};
use super::shading::Arrival8;
use super::vertex::{PathVertex, pack_samples};
use crate::geometry::{self, Ray8, SurfaceHit8};
use crate::rng::Key8;
use crate::sampler::Sampler;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

impl RayState8 {
    /// The lanes as records that wait: [`PathVertex::of_columns`], with root, depth, record and samples at the places of a
    /// vertex.
    fn columns(&self) -> [[F32x8; 8]; 4] {
        let f = F32x8::from_bits;
        let (o, d, n) = (self.ray.o, self.ray.d, self.normal);
        // densities are never negative
        let pdf = self.skip_mis.select(F32x8::splat(-1.0), self.pdf);
        let one_sample = f(U32x8::splat(pack_samples(1, 0)));
        [
            [o.x, o.y, o.z, self.travelled, n.x, n.y, n.z, pdf],
            [
                d.x,
                d.y,
                d.z,
                self.from.x,
                self.from.y,
                self.from.z,
                f(self.path.root),
                f(self.media.pack(self.path.depth)),
            ],
            [
                self.beta.x,
                self.beta.y,
                self.beta.z,
                self.weight.x,
                self.weight.y,
                self.weight.z,
                f(self.key.lo),
                f(self.key.hi),
            ],
            [
                self.albedo_product,
                f(self.path.record),
                one_sample,
                F32x8::ZERO,
                F32x8::ZERO,
                self.error_weight.x,
                self.error_weight.y,
                self.error_weight.z,
            ],
        ]
    }

    /// Rays from their records.
    fn from_columns(c: [[F32x8; 8]; 4], active: Mask8) -> Self {
        let [a, b, d, e] = c;
        let (media, depth) = MediaSet8::unpack(b[7].to_bits());
        Self {
            active,
            ray: Ray8::unbounded(Vec3x8::new(a[0], a[1], a[2]), Vec3x8::new(b[0], b[1], b[2])),
            from: Vec3x8::new(b[3], b[4], b[5]),
            normal: Vec3x8::new(a[4], a[5], a[6]),
            travelled: a[3],
            media,
            beta: Vec3x8::new(d[0], d[1], d[2]),
            weight: Vec3x8::new(d[3], d[4], d[5]),
            pdf: a[7],
            skip_mis: a[7].lt(F32x8::ZERO),
            path: Path8 { root: b[6].to_bits(), record: e[1].to_bits(), depth },
            key: Key8 { lo: d[6].to_bits(), hi: d[7].to_bits() },
            albedo_product: e[0],
            error_weight: Vec3x8::new(e[5], e[6], e[7]),
        }
    }
}

/// The rays that were just taken out of the ring.
#[inline(never)]
pub(crate) fn straight_rays(ring: &Ring<'_>, taken: &Taken8) -> RayState8 {
    RayState8::from_columns(PathVertex::columns(ring.records(taken)), Mask8::first(taken.lanes))
}

/// Lets the rays of `lanes` wait at the points `o`, `distance` from their last vertices, within `media`.
#[inline(never)]
pub(crate) fn wait(
    ring: &mut Ring<'_>,
    rays: &RayState8,
    lanes: Mask8,
    (o, distance, media): (Vec3x8, F32x8, MediaSet8),
    sampler: Sampler,
) {
    let on = RayState8 {
        ray: Ray8::unbounded(o, rays.ray.d).at(rays.ray.time),
        travelled: distance,
        media,
        key: rays.key.straight_on(sampler),
        ..*rays
    };
    let records = PathVertex::of_columns(on.columns());
    // the lane's share of `open` passes to the waiting ray
    lanes.lanes().for_each(|i| ring.push(PacketClass::STRAIGHT, records[i]));
}

/// Sends those of the rays on that their surfaces let pass; returns their lanes.
#[inline(always)]
pub(crate) fn pass<W: World>(
    world: &W,
    book: &mut Bookkeeping<'_>,
    ring: &mut Ring<'_>,
    rays: &RayState8,
    hit: &SurfaceHit8,
    a: &Arrival8,
) -> Mask8 {
    let possible = hit.mask & a.straight.gt(F32x8::ZERO);
    if possible.none() {
        return Mask8::NONE;
    }
    let passed = possible & rays.key.straight().lt(a.straight);
    let (v, d) = (&a.vertex, rays.ray.d);
    let media = across(world, rays.media, hit, v.ng, d, passed);
    wait(ring, rays, passed, (geometry::offset(v.p, v.ng, v.error, d), hit.t, media), world.sampler());
    book.counters.passed.count(passed.count());
    passed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: two fields in one column, a row or column that a vertex keeps elsewhere, a density that forgets that
    /// light sampling cannot reach its ray, a key that is drawn from twice.
    #[test]
    fn rays_survive_the_ring() {
        let f = |k: usize| F32x8::from_fn(|i| (100 * k + i) as f32);
        let u = |k: usize| U32x8::from_fn(|i| (1000 * k + i) as u32);
        let v3 = |k: usize| Vec3x8::new(f(k), f(k + 1), f(k + 2));
        let skip_mis = Mask8::from_bits(0b1010_0110);
        let rays = RayState8 {
            active: Mask8::all_lanes(),
            ray: Ray8::unbounded(v3(1), v3(4)),
            from: v3(7),
            normal: v3(10),
            travelled: f(13),
            media: MediaSet8::unpack(u(14) << 8).0,
            beta: v3(15),
            weight: v3(18),
            pdf: f(21),
            skip_mis,
            path: Path8 { root: u(22), record: u(23), depth: U32x8::from_fn(|i| 193 + i as u32) },
            key: Key8 { lo: u(24), hi: u(25) },
            albedo_product: f(26),
            error_weight: v3(27),
        };
        let records = PathVertex::of_columns(rays.columns());
        for (i, r) in records.iter().enumerate() {
            assert_eq!((r.count(), r.with_nee()), (1, 0));
            assert_eq!((r.root(), r.record()), (22_000 + i as u32, 23_000 + i as u32));
        }
        let columns = PathVertex::columns(core::array::from_fn(|i| &records[7 - i]));
        let back = RayState8::from_columns(columns, Mask8::first(5));
        assert_eq!(back.active.bits(), 0b1_1111);
        for i in 0..8 {
            let vectors = |r: &RayState8, i| {
                [r.ray.o, r.ray.d, r.from, r.normal, r.beta, r.weight, r.error_weight].map(|v| v.lane(i))
            };
            assert_eq!(vectors(&back, i), vectors(&rays, 7 - i));
            let numbers = |r: &RayState8, i| [r.travelled, r.albedo_product, r.ray.tmax].map(|x| x.lane(i));
            assert_eq!(numbers(&back, i), numbers(&rays, 7 - i));
            assert_eq!(
                (back.path.lane(i), back.media.met().lane(i)),
                (rays.path.lane(7 - i), rays.media.met().lane(7 - i))
            );
            assert_eq!((back.key.lo.lane(i), back.key.hi.lane(i)), (rays.key.lo.lane(7 - i), rays.key.hi.lane(7 - i)));
            assert_eq!(back.skip_mis.lane(i), rays.skip_mis.lane(7 - i));
            assert!(back.skip_mis.lane(i) || back.pdf.lane(i) == rays.pdf.lane(7 - i));
        }
    }
}
