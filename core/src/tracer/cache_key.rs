//! Where in the learned statistics the samples of arrived vertices belong.

use super::book::Bookkeeping;
use super::shading::Arrival8;
use crate::bsdf;
use crate::learn::cache::VertexKind8;
use crate::rrs::Space;
use crate::scene::Effects;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Channels that reflect less than this are not learned from: the quotient would be noise.
const DARKEST: f32 = 1e-3;

/// Bins of eight vertices, and how a bin's values become a vertex's own.
pub(super) struct CacheKey8 {
    /// Bins.
    pub bin: U32x8,
    /// Samples are logged times this.
    pub scale: Vec3x8,
    /// What was logged counts times this here.
    pub unscale: Vec3x8,
}

/// 1 / x where x is at least `floor`, 0 elsewhere.
#[inline]
fn inverse(x: Vec3x8, floor: f32) -> Vec3x8 {
    let one = |x: F32x8| x.ge(F32x8::splat(floor)).zero_unless(F32x8::ONE / x.max(F32x8::splat(floor)));
    Vec3x8::new(one(x.x), one(x.y), one(x.z))
}

/// The bins of arrived vertices, keyed by the direction that decides what their model reflects
/// ([`bsdf::CacheDirection`]). Samples are logged over the albedo, so that a texture, or a black and a white thing in one
/// cell, does not count as noise.
pub(super) fn cache_lookup<W: World>(world: &W, book: &Bookkeeping<'_>, a: &Arrival8, space: Space) -> CacheKey8 {
    let (v, active) = (&a.vertex, a.active);
    let learned = world.learned();
    match space {
        Space::Scene => {
            let mirrored = v.ns * (v.ns.dot(v.wo) * F32x8::splat(2.0)) - v.wo;
            let by_normal = bsdf::lanes_of(bsdf::kinds_keyed_by_normal(), &a.kind);
            let in_medium = if W::EFFECTS.contains(Effects::MEDIA) { a.in_medium() } else { Mask8::NONE };
            let by_view = bsdf::lanes_of(bsdf::kinds_keyed_by_view(), &a.kind) | in_medium;
            let dir = Vec3x8::select(by_view, v.wo, Vec3x8::select(by_normal, v.ns, mirrored));
            let seen = v.path.depth.eq(U32x8::splat(1));
            let known = if learned.weighs_pixels() { active } else { active.and_not(seen) };
            let (kind, jitter) = (VertexKind8::of(by_normal, in_medium, seen), v.key.cache_jitter(world.sampler()));
            let bin = learned.scene_bins(kind, v.p, dir, jitter, known);
            let mut unscale = a.albedo;
            if (seen & active).any() {
                // in one cell bright pixels see bright samples: only their ratio is alike, whatever a pixel's samples
                let share = book.roots.targets(v.path.root, active).share;
                let own = inverse(v.error_weight * share.sqr(), f32::MIN_POSITIVE);
                unscale = Vec3x8::select(seen, own.map(F32x8::sqrt), unscale);
            }
            CacheKey8 { bin, scale: inverse(unscale, DARKEST), unscale }
        }
        Space::Image => {
            let film = book.roots.targets(v.path.root, active).film.to_array();
            let depth = v.path.depth.to_array();
            let mut bin = [0; 8];
            for i in active.lanes() {
                bin[i] = learned.image_bin(film[i], depth[i]);
            }
            CacheKey8 { bin: U32x8::new(bin), scale: v.beta, unscale: inverse(v.beta, f32::MIN_POSITIVE) }
        }
    }
}
