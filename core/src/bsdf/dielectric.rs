//! Smooth dielectric interface: reflects F, transmits 1 - F along Snell's direction, radiance scaled by 1 / eta^2. The
//! lobe is chosen with probability F.
//!
//! | parameter | meaning | range |
//! |---|---|---|
//! | `eta[0]` | int_ior / ext_ior; +z is the exterior | `ETA_RANGE` |

use super::fresnel::{self, Index8};
use super::{Bsdf, CacheDirection, Eval8, Inputs8, Lobes, Sample8, lobes, mirrored};
use crate::scene::Scene;
use crate::scene::blob::Material;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Smooth dielectric interface.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    index: Index8,
}

impl Bsdf<'_> for Dielectric {
    const LOBES: Lobes = Lobes::REFLECTION.with(Lobes::TRANSMISSION).with(Lobes::SPECULAR);
    const CACHE_DIRECTION: CacheDirection = CacheDirection::View;

    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self { index: Index8::gather(scene, inputs, active) }
    }

    #[inline(always)]
    fn eval(&self, _: Vec3x8, _: Vec3x8) -> Eval8 {
        Eval8::ZERO
    }

    #[inline(always)]
    fn sample(&self, wo: Vec3x8, [_, _, u]: [F32x8; 3]) -> Sample8 {
        let index = self.index.seen_from(wo.z.lt(F32x8::ZERO));
        let inverse = index.inverse;
        let i = fresnel::dielectric(wo.z.abs(), index);
        let reflect = u.lt(i.reflectance);
        let through = Vec3x8::new(-wo.x * inverse, -wo.y * inverse, -(i.cos_t.copysign(wo.z)));
        let wi = Vec3x8::select(reflect, mirrored(wo), through);
        let weight = reflect.select(F32x8::ONE, inverse * inverse);
        // at the rounding edge of eta = 1 and cos = 0 neither ray leaves the surface
        let valid = wo.z.abs().gt(F32x8::ZERO) & wi.z.abs().gt(F32x8::ZERO);
        Sample8::delta(wi, Vec3x8::grey(weight), valid)
    }

    /// 1: no energy is lost.
    #[inline(always)]
    fn albedo(&self, _: Vec3x8) -> Vec3x8 {
        Vec3x8::ONE
    }

    fn shininess(_: &Material) -> f32 {
        lobes::MIRROR_SHININESS
    }
}
