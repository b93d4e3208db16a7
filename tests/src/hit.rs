//! Surfaces and emitters asked about by triangle, as tests know them.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::geometry::{self, Hit8, NO_INSTANCE, SurfaceHit8, SurfacePoint8};
use croupier::unstable::light::{self, LightSample8, LightSelector};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Hits of the triangles at parameter `t` and weights `u`, `v`, in the lanes of `mask`.
pub fn hit(scene: &Scene<'_>, triangle: U32x8, t: F32x8, u: F32x8, v: F32x8, mask: Mask8) -> SurfaceHit8 {
    SurfaceHit8::gather(scene, &Hit8 { hit: mask, t, triangle, u, v, instance: NO_INSTANCE })
}

/// Points with weights `u`, `v` on the triangles.
pub fn surface_point(scene: &Scene<'_>, triangle: U32x8, u: F32x8, v: F32x8, mask: Mask8) -> SurfacePoint8 {
    let s = hit(scene, triangle, F32x8::ZERO, u, v, mask);
    geometry::surface_point(s.corners, s.u, s.v)
}

/// [`light::area_pdf`] of directions `dir` that meet `triangle` at distance `t`.
#[expect(clippy::too_many_arguments, reason = "a ray, its hit and the selector's reference")]
pub fn area_pdf<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    p: Vec3x8,
    n: Vec3x8,
    triangle: U32x8,
    dir: Vec3x8,
    t: F32x8,
    mask: Mask8,
) -> F32x8 {
    let hit = hit(scene, triangle, t, F32x8::ZERO, F32x8::ZERO, mask);
    light::area_pdf(scene, selector, p, n, &hit, dir, mask)
}

/// [`light::area_radiance`] of `triangle`.
pub fn area_radiance(scene: &Scene<'_>, triangle: U32x8, dir: Vec3x8, ng: Vec3x8, mask: Mask8) -> Vec3x8 {
    let hit = hit(scene, triangle, F32x8::ZERO, F32x8::ZERO, F32x8::ZERO, mask);
    light::area_radiance(scene, &hit, dir, ng, mask)
}

/// [`light::sample_of`] with every kind of light.
pub fn sample<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    p: Vec3x8,
    n: Vec3x8,
    words: [U32x8; 4],
    mask: Mask8,
) -> LightSample8 {
    light::sample_of(Effects(u32::MAX), scene, selector, p, n, words, mask)
}
