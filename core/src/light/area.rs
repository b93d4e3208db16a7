//! Emitting triangles: uniform radiance from the front side (counter-clockwise), nothing from the back.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `triangle` | index | |
//! | `area` | world units squared | > 0 |
//! | `emission` | radiance | >= 0 |
//! | `instance` | 1 + index of the instance around it, or 0 | |
//!
//! Of a triangle in an instance, corners and area are those in the world at the time of the ray; `area` is that when the
//! shutter opens, and serves the choice of lights.
//!
//! Points are uniform on the triangle; seen from distance r under the angle cos at the light their solid-angle density
//! is r^2 / (A cos).

use super::emit::{Emission8, Numbers8, SceneSphere};
use super::{Chosen, LightModel, LightSample8, LightSelector, SceneExtent, luminance, usable};
use crate::geometry::{self, OFFSET_BOUND, Placed8, SurfaceHit8};
use crate::scene::Scene;
use crate::scene::blob::{Light, NONE, PrincipledTexture};
use crate::texture;
use core::f64::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Smallest cosine at the light. Below it the cosine is mostly rounding; the sampler and the density give up alike, so
/// that scattered rays carry the whole of what is there (1e-12 of a light's irradiance).
const MIN_COS: f32 = 1e-6;

/// The triangles of eight lanes.
struct Corners {
    a: Vec3x8,
    b: Vec3x8,
    c: Vec3x8,
}

impl Corners {
    /// Lanes outside `mask` and indices out of range give the zero triangle.
    #[inline(always)]
    fn gather(scene: &Scene<'_>, triangle: U32x8, mask: Mask8) -> Self {
        let [a, b, c] = geometry::corners(scene, U32x8::select(mask, triangle, U32x8::splat(NONE)));
        Self { a, b, c }
    }

    /// Unit normal of the front side; NaN for a degenerate triangle.
    #[inline(always)]
    fn normal(&self) -> Vec3x8 {
        geometry::triangle_normal(self.a, self.b, self.c).normalize()
    }

    /// Brings those that are in instances to the world.
    fn place(&mut self, scene: &Scene<'_>, light: &Chosen, mask: Mask8) -> Placed8 {
        let index = light.index.to_array();
        let instance = light.instance.to_array();
        let path: [[u32; 2]; 8] = core::array::from_fn(|i| geometry::instances_of_light(scene, index[i], instance[i]));
        let instance = [0, 1].map(|level| U32x8::from_fn(|i| path[i][level]));
        let placed = geometry::place(scene, instance, light.time, [self.a, self.b, self.c], mask);
        [self.a, self.b, self.c] = placed.corners;
        placed
    }
}

/// Solid-angle density of a uniform point on a triangle of `area` at distance `r`, its front seen under `cos`; 0 where
/// the front is not seen or r^2 underflows. Infinite for overflow (NUMERICS SOL-3): the callers drop that.
#[inline(always)]
pub(super) fn density(r: F32x8, cos: F32x8, area: F32x8) -> F32x8 {
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
    fn sample(scene: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8 {
        if light.placed {
            return sample_placed(scene, light, p, words, mask);
        }
        let corners = Corners::gather(scene, light.triangle, mask);
        on_triangle(&corners, &corners.normal(), &light.area, light, &p, &words)
    }

    /// Power of a Lambertian emitter.
    fn power(light: &Light, _: &SceneExtent) -> f64 {
        PI * f64::from(light.area) * luminance(light.emission)
    }

    #[inline(always)]
    fn emit(scene: &Scene<'_>, light: &Chosen, sphere: &SceneSphere, n: &Numbers8, mask: Mask8) -> Emission8 {
        // points are the same from wherever they are seen
        let s = Self::sample(scene, light, sphere.centre(), n.words, mask);
        Emission8::from_surface((s.point, s.normal, s.point_error), light.emission, light.area, n)
    }
}

/// Factors of the radiance at the points of triangles with these vertex indices and barycentric weights of b and c: 1
/// where the material has no emission texture.
#[inline(always)]
fn factor(scene: &Scene<'_>, vertices: [[u32; 3]; 8], material: [u32; 8], [b, c]: [F32x8; 2], mask: Mask8) -> Vec3x8 {
    let corner = |k: usize| {
        Vec3x8::from_fn(|i| scene.vertices.get(vertices[i][k] as usize).map_or([0.0; 3], |v| [v.uv[0], v.uv[1], 0.0]))
    };
    let uv = corner(0) * (F32x8::ONE - b - c) + corner(1) * b + corner(2) * c;
    let bits = mask.bits();
    let reference = |l: usize| {
        let m = if bits >> l & 1 == 1 { scene.materials.get(material[l] as usize) } else { None };
        m.and_then(|m| scene.principled(m)).and_then(|r| r.textures.get(PrincipledTexture::Emission as usize))
    };
    texture::referenced(scene, &core::array::from_fn(reference), [uv.x, uv.y]).1
}

/// Emission textures at the points that [`Area`] samples with `words`.
pub(super) fn sampled_factor(scene: &Scene<'_>, light: &Chosen, words: [U32x8; 2], mask: Mask8) -> Vec3x8 {
    let triangle = light.triangle.to_array();
    let of = |i: usize| scene.triangles.get(triangle[i] as usize);
    let mut vertices: [[u32; 3]; 8] = core::array::from_fn(|i| of(i).map_or([NONE; 3], |t| t.vertex));
    if !scene.instances.is_empty() {
        let mut corners = Corners::gather(scene, light.triangle, mask);
        // `Area` samples b and c in exchanged places there
        for i in corners.place(scene, light, mask).mirrored.lanes() {
            vertices[i].swap(1, 2);
        }
    }
    let material = core::array::from_fn(|i| of(i).map_or(NONE, |t| t.material));
    factor(scene, vertices, material, barycentric(words.map(U32x8::to_unit)), mask)
}

/// Emission textures at the points of `hit`: the factor of what [`area_radiance`] gives. 1 outside `mask`.
#[inline(never)]
pub fn area_texture(scene: &Scene<'_>, hit: &SurfaceHit8, mask: Mask8) -> Vec3x8 {
    factor(scene, hit.vertices, hit.material, [hit.u, hit.v], mask)
}

/// Unit normals and areas, those in the lanes of `placed` by `normal`, which is as long as twice the area.
#[inline(always)]
fn in_instances(placed: Mask8, normal: Vec3x8, others: Vec3x8, areas: F32x8) -> (Vec3x8, F32x8) {
    (Vec3x8::select(placed, normal.normalize(), others), placed.select(normal.length() * 0.5, areas))
}

/// Uniform points on triangles with unit normals `normal` and areas `area`, seen from `p`.
#[inline(always)]
fn on_triangle(
    corners: &Corners,
    &normal: &Vec3x8,
    &area: &F32x8,
    light: &Chosen,
    &p: &Vec3x8,
    words: &[U32x8; 3],
) -> LightSample8 {
    let [b, c] = barycentric([words[0], words[1]].map(U32x8::to_unit));
    let a = F32x8::ONE - b - c;
    let point = corners.a * a + corners.b * b + corners.c * c;
    let d = point - p;
    let r = d.length();
    let wi = d / r;
    let pdf = density(r, -normal.dot(wi), area);
    let bound = |v: Vec3x8| v.abs().dot(normal.abs());
    LightSample8 {
        wi,
        point,
        normal,
        point_error: (bound(corners.a) * a + bound(corners.b) * b + bound(corners.c) * c) * OFFSET_BOUND,
        radiance: light.emission,
        pdf,
        valid: pdf.gt(F32x8::ZERO),
        ..LightSample8::NONE
    }
}

/// [`LightModel::sample`] in scenes with instances. What they add to the error at the end of a shadow ray is that of a ray
/// that leaves the triangle, and that of the distance along which the ray is brought into the instance.
#[inline(never)]
fn sample_placed(scene: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8 {
    let mut corners = Corners::gather(scene, light.triangle, mask);
    let placed = corners.place(scene, light, mask);
    let in_instance = placed.condition.gt(F32x8::ZERO);
    let (normal, area) = in_instances(in_instance, placed.normal, corners.normal(), light.area);
    let sample = on_triangle(&corners, &normal, &area, light, &p, &words);
    let normal = sample.normal.abs();
    let far = placed.condition * (sample.point - p).abs().max_component() * OFFSET_BOUND;
    let more = placed.rounding.dot(normal) + far * (normal.x + normal.y + normal.z);
    let point_error = sample.point_error + more;
    LightSample8 { point_error, valid: sample.valid.and_not(placed.hidden), ..sample }
}

/// Density with which [`super::sample_of`] at `p`, `n` chooses the unit directions `dir` that have met the triangles of
/// `hit`: selection probability times solid-angle density. 0 outside `mask`, for triangles that do not emit, from
/// behind, and where the sampler gives up.
#[inline(always)]
pub fn area_pdf<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    p: Vec3x8,
    n: Vec3x8,
    hit: &SurfaceHit8,
    dir: Vec3x8,
    mask: Mask8,
) -> F32x8 {
    let emits = mask & hit.emitters();
    if emits.none() {
        return F32x8::ZERO;
    }
    let area = |i: usize| scene.lights.get(hit.light[i] as usize).map_or(0.0, |l: &Light| l.area);
    let [a, b, c] = hit.corners;
    let corners = Corners { a, b, c };
    let mut normal = corners.normal();
    let mut area = F32x8::from_fn(area);
    if !scene.instances.is_empty() {
        (normal, area) = in_instances(hit.placed(), hit.normal, normal, area);
    }
    let pdf = density(hit.t, -normal.dot(dir), area);
    let pdf = pdf * selector.probability(p, n, U32x8::new(hit.light), emits);
    (emits & usable(pdf)).zero_unless(pdf)
}

/// Radiance that the triangles of `hit` emit against the unit ray directions `dir`; `ng` are their geometric normals by
/// winding. 0 outside `mask`, from behind and for triangles that do not emit.
#[inline(always)]
pub fn area_radiance(scene: &Scene<'_>, hit: &SurfaceHit8, dir: Vec3x8, ng: Vec3x8, mask: Mask8) -> Vec3x8 {
    let mask = mask & dir.dot(ng).lt(F32x8::ZERO);
    Vec3x8::from_fn(|i| scene.lights.get(hit.light[i] as usize).map_or([0.0; 3], |l| l.emission)).zero_unless(mask)
}

/// Corners of the emitting triangle of light `index` in the world when the shutter opens, and a normal of its front, as long
/// as twice the area.
pub(super) fn in_world(scene: &Scene<'_>, index: u32, light: &Light) -> ([[f32; 3]; 3], [f32; 3]) {
    let corner = |k: usize| {
        let t = scene.triangles.get(light.triangle as usize);
        let p = t.and_then(|t| scene.vertices.get(t.vertex[k] as usize)).map_or([0.0; 3], |v| v.p);
        Vec3x8::splat(p[0], p[1], p[2])
    };
    let instance = geometry::instances_of_light(scene, index, light.instance).map(U32x8::splat);
    let corners = [corner(0), corner(1), corner(2)];
    let [a, b, c] = corners;
    let placed = geometry::place(scene, instance, F32x8::ZERO, corners, Mask8::all_lanes());
    let normal = if light.instance == 0 { geometry::triangle_normal(a, b, c) } else { placed.normal };
    (placed.corners.map(|p| p.lane(0)), normal.lane(0))
}

/// Area of the emitting triangle of light `index` in the world when the shutter opens, for [`Light::area`].
pub fn area_of(scene: &Scene<'_>, index: u32, light: &Light) -> f32 {
    let (_, [x, y, z]) = in_world(scene, index, light);
    0.5 * Vec3x8::splat(x, y, z).length().lane(0)
}
