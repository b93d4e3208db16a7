//! Emitting triangles: uniform radiance from the front side (counter-clockwise), nothing from the back.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `triangle` | index | |
//! | `area` | world units squared | > 0 |
//! | `emission` | radiance | >= 0 |
//!
//! Points are uniform on the triangle; seen from distance r under the angle cos at the light their solid-angle density
//! is r^2 / (A cos).

use super::{Chosen, LightModel, LightSample8, LightSelector, SceneExtent, luminance, usable};
use crate::accel;
use crate::scene::Scene;
use crate::scene::blob::{Light, NONE};
use core::f64::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Smallest cosine at the light. Below it the cosine is mostly rounding; the sampler and the density give up alike, so
/// that scattered rays carry the whole of what is there (1e-12 of a light's irradiance).
const MIN_COS: f32 = 1e-6;
/// 32 u, u = 2^-24 (NUMERICS OFF-1).
const ERROR: f32 = 32.0 / 16_777_216.0;

/// The triangles of eight lanes.
struct Corners {
    a: Vec3x8,
    b: Vec3x8,
    c: Vec3x8,
}

impl Corners {
    /// Lanes outside `mask` and indices out of range give the zero triangle.
    #[inline(always)]
    fn gather(scene: &Scene<'_>, triangle: [u32; 8], mask: Mask8) -> Self {
        let mut p = [[[0.0f32; 3]; 8]; 3];
        for i in mask.lanes() {
            let Some(t) = scene.triangles.get(triangle[i] as usize) else { continue };
            for (corner, vertex) in p.iter_mut().zip(t.vertex) {
                corner[i] = scene.vertices.get(vertex as usize).map_or([0.0; 3], |v| v.p);
            }
        }
        let [a, b, c] = p.map(|k| Vec3x8::from_fn(|i| k[i]));
        Self { a, b, c }
    }

    /// Unit normal of the front side; NaN for a degenerate triangle.
    #[inline(always)]
    fn normal(&self) -> Vec3x8 {
        accel::normal(self.a, self.b, self.c).normalize()
    }
}

/// Solid-angle density of a uniform point on a triangle of `area` at distance `r`, its front seen under `cos`; 0 where
/// the front is not seen or r^2 underflows. Infinite for overflow (NUMERICS SOL-3): the callers drop that.
#[inline(always)]
fn density(r: F32x8, cos: F32x8, area: F32x8) -> F32x8 {
    let r_sqr = r * r;
    let seen = cos.gt(F32x8::splat(MIN_COS)) & r_sqr.ge(F32x8::splat(f32::MIN_POSITIVE));
    seen.zero_unless(r_sqr / (area * cos))
}

/// Area-preserving map of the unit square to barycentric weights of b and c, without square roots (Heitz, "A
/// Low-Distortion Map Between Triangle and Square", 2019): folds the square along its diagonal.
#[inline(always)]
fn barycentric(u: [F32x8; 2]) -> [F32x8; 2] {
    let upper = u[1].gt(u[0]);
    let half = upper.select(u[0], u[1]) * 0.5;
    [upper.select(half, u[0] - half), upper.select(u[1] - half, half)]
}

/// Emitting triangle.
pub(super) struct Area;

impl LightModel for Area {
    const DELTA: bool = false;

    #[inline(always)]
    fn sample(scene: &Scene<'_>, light: &Chosen<'_>, p: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8 {
        let corners = Corners::gather(scene, light.record.map(|l| l.triangle), mask);
        let [b, c] = barycentric([words[0], words[1]].map(U32x8::to_unit));
        let a = F32x8::ONE - b - c;
        let point = corners.a * a + corners.b * b + corners.c * c;
        let normal = corners.normal();
        let d = point - p;
        let r = d.length();
        let wi = d / r;
        let pdf = density(r, -normal.dot(wi), F32x8::from_fn(|i| light.record[i].area));
        let bound = |v: Vec3x8| v.abs().dot(normal.abs());
        LightSample8 {
            wi,
            point,
            normal,
            point_error: (bound(corners.a) * a + bound(corners.b) * b + bound(corners.c) * c) * ERROR,
            radiance: light.emission,
            pdf,
            valid: pdf.gt(F32x8::ZERO),
            ..LightSample8::NONE
        }
    }

    /// Of a Lambertian emitter.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        PI * f64::from(light.area) * luminance(light.emission)
    }
}

/// The lights of the triangles of `mask`; [`NONE`] where there is none.
#[inline(always)]
fn light_of(scene: &Scene<'_>, triangle: [u32; 8], mask: Mask8) -> [u32; 8] {
    let mut light = [NONE; 8];
    for i in mask.lanes() {
        light[i] = scene.triangles.get(triangle[i] as usize).map_or(NONE, |t| t.light);
    }
    light
}

/// Density with which [`super::sample`] at `p`, `n` chooses the unit direction `dir` that meets `triangle` at distance
/// `t`: selection probability times solid-angle density. 0 outside `mask`, for triangles that do not emit, from behind,
/// and where the sampler gives up.
#[inline(always)]
#[expect(
    clippy::too_many_arguments,
    reason = "a ray, its hit and the selector's reference; a struct would be built once per call"
)]
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
    let triangle = triangle.to_array();
    let light = light_of(scene, triangle, mask);
    let emits = mask.and_not(U32x8::new(light).eq(U32x8::splat(NONE)));
    if emits.none() {
        return F32x8::ZERO;
    }
    let area = |i: usize| scene.lights.get(light[i] as usize).map_or(0.0, |l: &Light| l.area);
    let normal = Corners::gather(scene, triangle, emits).normal();
    let pdf = density(t, -normal.dot(dir), F32x8::from_fn(area));
    let pdf = pdf * selector.probability(p, n, U32x8::new(light), emits);
    (emits & usable(pdf)).zero_unless(pdf)
}

/// Radiance that `triangle` emits against the unit ray direction `dir`; `ng` is its geometric normal by winding. 0
/// outside `mask`, from behind and for triangles that do not emit.
#[inline(always)]
pub fn area_radiance(scene: &Scene<'_>, triangle: U32x8, dir: Vec3x8, ng: Vec3x8, mask: Mask8) -> Vec3x8 {
    let mask = mask & dir.dot(ng).lt(F32x8::ZERO);
    let light = light_of(scene, triangle.to_array(), mask);
    Vec3x8::from_fn(|i| scene.lights.get(light[i] as usize).map_or([0.0; 3], |l| l.emission)).zero_unless(mask)
}
