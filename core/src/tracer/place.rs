//! Where in the statistics the samples of arrived vertices belong.

use super::root::Roots;
use super::roulette::Arrival8;
use crate::accel::Intersector;
use crate::bsdf;
use crate::learn::cache::Kind;
use crate::light::LightSelector;
use crate::profile::Profile;
use crate::rng::Key8;
use crate::rrs::Space;
use crate::session::Session;
use croupier_simd::{F32x8, U32x8, Vec3x8};

/// Channels that reflect less than this are not learned from: the quotient would be noise.
const DARKEST: f32 = 1e-3;

/// Where a vertex's samples are logged, and how its bin's values become its own.
pub(super) struct Place8 {
    /// Bins.
    pub bin: U32x8,
    /// Samples are logged times this.
    pub scale: Vec3x8,
    /// What was logged counts times this here.
    pub unscale: Vec3x8,
}

/// Numbers in [0, 1): the key's own bits, of which everything that a vertex draws is a hash. The low 8 of each word,
/// which the first two axes do not see, make the third.
fn jitter(key: Key8) -> [F32x8; 3] {
    let rest = key.lo << 24 | (key.hi & U32x8::splat(0xff)) << 16;
    [key.lo, key.hi, rest].map(U32x8::to_unit)
}

/// 1 / x where x is at least `floor`, 0 elsewhere.
fn inverse(x: Vec3x8, floor: f32) -> Vec3x8 {
    let one = |x: F32x8| x.ge(F32x8::splat(floor)).zero_unless(F32x8::ONE / x.max(F32x8::splat(floor)));
    Vec3x8::new(one(x.x), one(x.y), one(x.z))
}

/// The bins of arrived vertices, keyed by the direction that the model states ([`bsdf::CacheDirection`]). Samples are logged over the albedo, so that a
/// texture or a black and a white thing in one cell do not pass for noise.
pub(super) fn place<P: Profile, I: Intersector, L: LightSelector>(
    session: &Session<'_, '_, P, I, L>,
    a: &Arrival8<'_>,
    space: Space,
    roots: &Roots<'_>,
) -> Place8 {
    let v = &*a.vertex;
    let learned = session.learned();
    match space {
        Space::Scene => {
            let mirrored = v.ns * (v.ns.dot(v.wo) * F32x8::splat(2.0)) - v.wo;
            let by_normal = bsdf::lanes_of(bsdf::kinds_keyed_by_normal(), &a.kind);
            let by_view = bsdf::lanes_of(bsdf::kinds_keyed_by_view(), &a.kind);
            let dir = Vec3x8::select(by_view, v.wo, Vec3x8::select(by_normal, v.ns, mirrored));
            let seen = v.depth.eq(U32x8::splat(1));
            let kind = U32x8::select(by_normal, U32x8::splat(Kind::Diffuse as u32), U32x8::splat(Kind::Glossy as u32));
            let first = U32x8::splat(Kind::FirstDiffuse as u32 - Kind::Diffuse as u32);
            let kind = kind + U32x8::select(seen, first, U32x8::splat(0));
            let known = if learned.weighs_pixels() { a.active } else { a.active.and_not(seen) };
            let bin = learned.scene_bins(kind, v.p, dir, jitter(v.key), known);
            let mut unscale = a.albedo;
            if (seen & a.active).any() {
                // in one cell bright pixels see bright samples: only their ratio is alike, whatever a pixel's samples
                let share = roots.targets(v.root, a.active).share;
                let own = inverse(v.error_weight * share.sqr(), f32::MIN_POSITIVE);
                unscale = Vec3x8::select(seen, own.map(F32x8::sqrt), unscale);
            }
            Place8 { bin, scale: inverse(unscale, DARKEST), unscale }
        }
        Space::Image => {
            let (film, depth) = (roots.targets(v.root, a.active).film.to_array(), v.depth.to_array());
            let mut bin = [0; 8];
            for i in a.active.lanes() {
                bin[i] = learned.image_bin(film[i], depth[i]);
            }
            Place8 { bin: U32x8::new(bin), scale: v.beta, unscale: inverse(v.beta, f32::MIN_POSITIVE) }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    /// No bit of a key moves two axes, each axis has its whole range. Killed by: an axis used twice, a shift by less.
    #[test]
    fn axes_share_no_bits() {
        let bits = |lo: u32, hi: u32| jitter(Key8 { lo: U32x8::splat(lo), hi: U32x8::splat(hi) }).map(|x| x.lane(5));
        assert_eq!(bits(0, 0), [0.0; 3]);
        assert!(bits(!0, !0).iter().all(|x| (0.9999..1.0).contains(x)));
        for bit in 0..64 {
            let key = 1u64 << bit;
            let moved = bits(key as u32, (key >> 32) as u32).iter().filter(|x| **x > 0.0).count();
            assert_eq!(moved, 1, "bit {bit}");
        }
    }

    /// Of keys as vertices have them: uniform, and no axis goes with another or with what the first sample draws to
    /// scatter. 64k keys, so that correlations of 0.02 are 5 standard deviations. Killed by: keys that count, an axis
    /// that is drawn again.
    #[test]
    fn jitter_is_uniform_and_independent() {
        let mut rows: Vec<[f64; 7]> = Vec::new();
        for k in 0..8192u32 {
            let index = U32x8::from_fn(|i| 8 * k + i as u32);
            let key = Key8::camera(1, index, U32x8::splat(k & 3)).child(U32x8::splat(0));
            let (j, drawn) = (jitter(key), key.child(U32x8::splat(0)).uniforms(0));
            let column = |c: usize| if c < 3 { j[c] } else { drawn[c - 3] };
            rows.extend((0..8).map(|i| core::array::from_fn(|c| f64::from(column(c).lane(i)))));
        }
        let mean = |f: &dyn Fn(&[f64; 7]) -> f64| rows.iter().map(f).sum::<f64>() / rows.len() as f64;
        for a in 0..3 {
            for b in 0..7 {
                let moment = 12.0 * mean(&|r| (r[a] - 0.5) * (r[b] - 0.5));
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((moment - expected).abs() < 0.02, "axes {a} and {b}: {moment}");
            }
            assert!((mean(&|r| r[a]) - 0.5).abs() < 0.006, "axis {a}");
        }
    }
}
