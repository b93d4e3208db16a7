//! The media that paths are inside of: a bit each, so that media may be nested, overlap and touch. The lowest index is
//! the medium that a path meets (see [`crate::scene::blob::Medium`]).

use super::surfaces::own_surfaces;
use crate::accel::Intersector;
use crate::geometry::{self, Ray8, SurfaceHit8};
use crate::scene::Scene;
use crate::scene::blob::{MAX_MEDIA, NONE};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight sets of media.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MediaSet8(U32x8);

const _: () = assert!(MAX_MEDIA <= 24, "a set shares a word with a depth of 8 bits");

/// Indices of the media behind the front sides of materials.
#[inline(always)]
pub(crate) fn media_behind(scene: &Scene<'_>, material: &[u32; 8]) -> [u32; 8] {
    material.map(|m| scene.materials.get(m as usize).map_or(NONE, |m| m.medium))
}

/// The bit of a medium; 0 for [`NONE`].
fn bit(medium: u32) -> u32 {
    if medium < MAX_MEDIA as u32 { 1 << medium } else { 0 }
}

impl MediaSet8 {
    /// Outside of all media.
    pub(crate) const NONE: Self = Self(U32x8::splat(0));

    /// The same set in all lanes.
    pub(crate) fn splat(set: u32) -> Self {
        Self(U32x8::splat(set))
    }

    /// The sets of `o` in the lanes of `mask`.
    #[inline(always)]
    pub(crate) fn select(self, mask: Mask8, o: Self) -> Self {
        Self(U32x8::select(mask, o.0, self.0))
    }

    /// Word of eight sets and depths.
    #[inline(always)]
    pub(crate) fn pack(self, depth: U32x8) -> U32x8 {
        depth | self.0 << 8
    }

    /// Sets and depths of a word.
    #[inline(always)]
    pub(crate) fn unpack(word: U32x8) -> (Self, U32x8) {
        (Self(word >> 8), word & U32x8::splat(0xff))
    }

    /// Lanes that are inside any medium.
    #[inline(always)]
    pub(crate) fn inside(self) -> Mask8 {
        !self.0.eq(U32x8::splat(0))
    }

    /// Index of the medium that each lane meets; [`NONE`] outside of all.
    #[inline(always)]
    pub(crate) fn met(self) -> U32x8 {
        U32x8::new(self.0.to_array().map(|set| if set == 0 { NONE } else { set.trailing_zeros() }))
    }

    /// Lanes whose boundary of `medium` lies within a medium of lower index, and so does not count.
    #[inline(always)]
    pub(crate) fn hides(self, medium: &[u32; 8]) -> Mask8 {
        let below = U32x8::new(medium.map(|m| bit(m).wrapping_sub(u32::from(bit(m) != 0))));
        !(self.0 & below).eq(U32x8::splat(0))
    }

    /// The sets behind boundaries of `medium` (an index, or [`NONE`]) in the lanes of `crossing`, which go on to the
    /// inside in the lanes of `inwards`, else to the outside. From what is known of a side, not by what was before: a
    /// missed crossing does not stay wrong.
    #[inline(always)]
    pub(crate) fn across(self, medium: &[u32; 8], inwards: Mask8, crossing: Mask8) -> Self {
        let bits = U32x8::new(medium.map(bit));
        let set = U32x8::select(inwards, self.0 | bits, self.0 & !bits);
        Self(U32x8::select(crossing, set, self.0))
    }
}

/// Most surfaces that are looked at on the way out of the scene.
const MOST_SURFACES: usize = 4096;

/// The set of media that the point `p` is inside of: the first boundary of each medium that a ray from there meets says
/// on which side it was, when the shutter opens. Rays in eight directions vote, so that a gap in a boundary misleads one of them only.
pub(crate) fn media_at<I: Intersector>(scene: &Scene<'_>, intersector: &I, p: [f32; 3]) -> u32 {
    let a = 0.577_350_3_f32;
    let d = Vec3x8::from_fn(|i| {
        let sign = |bit: usize| if i >> bit & 1 == 1 { a } else { -a };
        // not quite diagonal, so that no ray runs along edges of boxes
        [sign(0) * 1.03, sign(1) * 0.89, sign(2) * 1.07]
    })
    .normalize();
    let mut ray = Ray8::unbounded(Vec3x8::from_fn(|_| p), d);
    let (mut active, mut known, mut inside) = (Mask8::all_lanes(), [0u32; 8], [0u32; 8]);
    for _ in 0..MOST_SURFACES {
        let mut hit = intersector.closest(&ray, active);
        hit.hit &= active;
        active = hit.hit;
        if active.none() {
            break;
        }
        let mut surface = SurfaceHit8::gather(scene, &hit);
        let mut point = surface.place(scene, ray.time);
        own_surfaces(intersector, &ray, &mut hit, &mut surface, &mut point);
        let medium = media_behind(scene, &surface.material);
        let leaving = d.dot(point.ng).gt(F32x8::ZERO);
        for i in active.lanes() {
            let bit = bit(medium[i]) & !known[i];
            known[i] |= bit;
            inside[i] |= if leaving.lane(i) { bit } else { 0 };
        }
        ray.o = geometry::offset(point.p, point.ng, point.error, d);
    }
    (0..MAX_MEDIA as u32).map(|m| 1 << m).filter(|bit| inside.iter().filter(|set| **set & bit != 0).count() > 4).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: priorities the other way round, a bit of another medium cleared, a set that is toggled.
    #[test]
    fn the_first_medium_wins_and_hides_the_others() {
        let all = Mask8::all_lanes();
        let medium = [0, 1, 2, NONE, 23, NONE, 2, 1];
        let inside = MediaSet8::NONE.across(&medium, all, all).across(&medium, all, all);
        assert_eq!(inside.met().to_array(), medium);
        let deeper = inside.across(&[1; 8], all, all);
        assert_eq!(deeper.met().to_array(), [0, 1, 1, 1, 1, 1, 1, 1]);
        assert_eq!(deeper.hides(&[2; 8]).bits(), 0xff);
        assert_eq!(deeper.hides(&[1; 8]).bits(), 0b0000_0001);
        assert_eq!(deeper.hides(&[NONE; 8]).bits(), 0);
        let out = deeper.across(&[1; 8], Mask8::NONE, Mask8::first(7));
        assert_eq!(out.met().to_array(), [0, NONE, 2, NONE, 23, NONE, 2, 1]);
        let (set, depth) = MediaSet8::unpack(inside.pack(U32x8::splat(200)));
        assert_eq!((set.met().to_array(), depth.to_array()), (medium, [200; 8]));
    }
}
