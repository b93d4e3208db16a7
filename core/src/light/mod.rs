//! Emission and its sampling. One kind per file, which implements `LightModel`; `models!` is the table of them, its
//! other half the table of `scene/blob/lights.rs`.
//!
//! | kind | file | technique | density | power |
//! |---|---|---|---|---|
//! | area | `area.rs` | uniform on the triangle | r^2 / (A cos) | pi A L |
//! | environment map | `environment.rs` | alias tables over cells, bilinear luminance inside | exact | pi R^2 x integral |
//! | constant environment | `environment.rs` | uniform sphere | 1 / (4 pi) | pi R^2 x integral |
//! | point | `point.rs` | the point | delta | 4 pi I |
//! | directional | `directional.rs` | the direction | delta | pi R^2 E |
//! | spot | `spot.rs` | the point | delta | 2 pi (inner + (outer - inner) / 3) I |
//! | sun | `sun.rs` | uniform on the disk at infinity | counts as delta | pi R^2 E |
//! | sphere | `sphere.rs` | uniform in the cone around it | 1 / (2 pi (1 - cos)) | 4 pi^2 r^2 L |
//! | rectangle | `rectangle.rs` | uniform in its solid angle | 1 / solid angle | pi A L |
//! | disk | `disk.rs` | near: in the solid angle of a square around it; far: uniform on the disk | 1 / that; r^2 / (A cos) | pi A L |
//!
//! Rays that leave lights are sampled in `emit.rs`: from the whole surface of those that have one, by its area and the cosine;
//! towards the whole scene from those at infinity.
//!
//! A light is chosen by a [`LightSelector`] (power-weighted: `power.rs`; by a tree in scenes with many: `tree.rs`); every density stated here contains the
//! selection probability. What [`sample_of`] states for a direction is what [`area_pdf`], [`meet_shapes`] and
//! [`environment_pdf`] give for a scattered ray that finds the same light (NUMERICS MIS-3): for the environment and where
//! all directions to a shape are alike bit for bit, for others up to the rounding of the hit. Densities are finite and never NaN; where one would be infinite (edge-on or touching) both
//! the sampler and the density function give the direction up, and the scattered ray has it alone.

mod area;
mod directional;
mod disk;
mod emit;
mod environment;
mod meet;
mod mis;
mod point;
mod power;
mod rectangle;
mod shape;
mod sphere;
mod spot;
mod sun;
mod tree;

pub use area::{area_of, area_pdf, area_radiance, area_texture};
pub use emit::Emission8;
pub use environment::{environment_met, environment_pdf, environment_radiance};
pub use meet::{ShapeRays8, meet_shapes, nearest_shape};
pub use mis::power_heuristic;
pub use power::{PowerSelector, SceneExtent, luminance};
pub use tree::{LightTree, SURFACE_FLOOR, TreeSelector, build_light_tree, light_importance, light_node_of};

use self::emit::{Numbers8, SceneSphere};
use crate::scene::blob::{Light, LightKind, NONE};
use crate::scene::{Effects, Scene, gather};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// One light sample per lane, seen from the reference points.
#[derive(Clone, Copy, Debug)]
pub struct LightSample8 {
    /// Unit direction to the light, world space.
    pub wi: Vec3x8,
    /// Point on the light; for the environment and directional lights meaningless (see `infinite`).
    pub point: Vec3x8,
    /// Geometric unit normal of an area light at `point`; for point lights the direction back.
    pub normal: Vec3x8,
    /// Rounding error bound of `point` along `normal`, world units (NUMERICS OFF-1).
    pub point_error: F32x8,
    /// Radiance towards the reference point; delta lights: irradiance at normal incidence.
    pub radiance: Vec3x8,
    /// Selection probability times solid-angle density; delta lights: the selection probability.
    pub pdf: F32x8,
    /// Lanes whose light no scattered ray can hit.
    pub delta: Mask8,
    /// Lanes whose light is at infinity along `wi`.
    pub infinite: Mask8,
    /// Lanes with a usable sample.
    pub valid: Mask8,
    /// Lanes so near to a point light that its distance was taken for larger, or that it has no direction.
    pub clamped: Mask8,
}

impl LightSample8 {
    /// No sample in any lane.
    pub const NONE: Self = Self {
        wi: Vec3x8::ZERO,
        point: Vec3x8::ZERO,
        normal: Vec3x8::ZERO,
        point_error: F32x8::ZERO,
        radiance: Vec3x8::ZERO,
        pdf: F32x8::ZERO,
        delta: Mask8::NONE,
        infinite: Mask8::NONE,
        valid: Mask8::NONE,
        clamped: Mask8::NONE,
    };

    /// Takes over the lanes of `mask` from `other`.
    #[inline(always)]
    fn merge(&mut self, mask: Mask8, other: &Self) {
        self.wi = Vec3x8::select(mask, other.wi, self.wi);
        self.point = Vec3x8::select(mask, other.point, self.point);
        self.normal = Vec3x8::select(mask, other.normal, self.normal);
        self.point_error = mask.select(other.point_error, self.point_error);
        self.radiance = Vec3x8::select(mask, other.radiance, self.radiance);
        self.pdf = mask.select(other.pdf, self.pdf);
        self.delta = (mask & other.delta) | self.delta.and_not(mask);
        self.infinite = (mask & other.infinite) | self.infinite.and_not(mask);
        self.valid = (mask & other.valid) | self.valid.and_not(mask);
        self.clamped = (mask & other.clamped) | self.clamped.and_not(mask);
    }
}

/// Choice of a light for a reference point. [`TreeSelector`] and [`PowerSelector`] are built in; hosts may bring their
/// own.
///
/// Pictures are right if both functions tell the same probabilities and every light that could be seen from a point has
/// one above 0: delta lights (points, spots, parallel light, the sun) are found in no other way. How good the choice is shows in the noise only.
///
/// ```
/// use croupier::unstable::light::LightSelector;
/// use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
/// use croupier::{Plan, Scene, Session, SessionError};
/// use croupier::unstable::{accel::WideBvh, profile::Full};
///
/// /// All lights alike.
/// struct Uniform(u32);
///
/// impl LightSelector for Uniform {
///     fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
///         let pick = |r: u32| ((u64::from(r) * u64::from(self.0)) >> 32) as u32;
///         let light = U32x8::new(r.to_array().map(pick));
///         (light, self.probability(point, normal, light, mask))
///     }
///
///     fn probability(&self, _: Vec3x8, _: Vec3x8, _: U32x8, mask: Mask8) -> F32x8 {
///         mask.zero_unless(F32x8::splat(1.0 / self.0 as f32))
///     }
/// }
///
/// fn session<'s, 'm>(
///     scene: Scene<'s>,
///     plan: &Plan,
///     block: &'m mut [u8],
/// ) -> Result<Session<'s, 'm, Full, WideBvh<'s>, Uniform>, SessionError> {
///     let uniform = Uniform(scene.lights.len() as u32);
///     Session::builder(scene).light_selector(uniform).build(plan, block)
/// }
/// ```
pub trait LightSelector {
    /// Index in [`Records::lights`](crate::scene::Records::lights) and its probability from a 32-bit random number, for
    /// points with unit normals, world space; normals are 0 at points in media, where nothing may be left out for its
    /// direction. No such light, or a probability of 0: no light is sampled. What is said of
    /// lanes outside `mask` is ignored.
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8);

    /// Probability that [`Self::select`] picks `light` in the lanes of `mask`, 0 in the others.
    fn probability(&self, point: Vec3x8, normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8;

    /// The choice that kernels make whose profile has no light trees
    /// ([`Profile::LIGHT_TREES`](crate::unstable::profile::Profile::LIGHT_TREES)), so that they do without the code for
    /// them. Provided: the selector itself.
    fn without_tree(&self) -> impl LightSelector
    where
        Self: Sized,
    {
        self
    }
}

impl<S: LightSelector> LightSelector for &S {
    #[inline(always)]
    fn select(&self, point: Vec3x8, normal: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
        (*self).select(point, normal, r, mask)
    }

    #[inline(always)]
    fn probability(&self, point: Vec3x8, normal: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
        (*self).probability(point, normal, light, mask)
    }
}

/// Light of lanes without one: black, of no kind.
const IDLE: &Light = &Light {
    kind: NONE,
    triangle: NONE,
    area: 0.0,
    instance: 0,
    vector: [0.0; 3],
    emission: [0.0; 3],
    params: [0.0; 6],
};

/// The chosen lights of eight lanes; lanes outside the mask they were gathered with hold [`IDLE`].
struct Chosen {
    index: U32x8,
    /// [`LightKind`]s.
    kind: U32x8,
    /// See [`Light::triangle`].
    triangle: U32x8,
    area: F32x8,
    /// See [`Light::instance`].
    instance: U32x8,
    params: [F32x8; 6],
    /// Times at which they are seen.
    time: F32x8,
    /// May triangles be in instances?
    placed: bool,
    emission: Vec3x8,
    vector: Vec3x8,
}

impl Chosen {
    #[inline(always)]
    fn gather(scene: &Scene<'_>, light: U32x8, time: F32x8, placed: bool, mask: Mask8) -> Self {
        let index = U32x8::select(mask, light, U32x8::splat(NONE));
        let [[kind, triangle, area, instance, x, y, z, red], [green, blue, params @ ..]] =
            gather(scene.lights, index.to_array(), IDLE);
        Self {
            kind: kind.to_bits(),
            triangle: triangle.to_bits(),
            area,
            instance: instance.to_bits(),
            params,
            emission: Vec3x8::new(red, green, blue),
            vector: Vec3x8::new(x, y, z),
            index: light,
            time,
            placed,
        }
    }

    /// Lanes of `mask` whose light is of `kind`.
    #[inline(always)]
    fn of_kind(&self, kind: LightKind, mask: Mask8) -> Mask8 {
        mask & self.kind.eq(U32x8::splat(kind as u32))
    }
}

/// Contract of a light kind: what its file provides.
trait LightModel {
    /// Whether no scattered ray can find the light.
    const DELTA: bool;

    /// A direction to the light in the lanes of `mask`, seen from `p`, from three random words; the result's `pdf`
    /// is without the selection probability, other lanes may hold anything.
    fn sample(scene: &Scene<'_>, light: &Chosen, p: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8;

    /// Emitted power in luminance units: the weight of its selection.
    fn power(light: &Light, scene: &SceneExtent) -> f64;

    /// Rays that leave the light in the lanes of `mask`, without the selection probability; other lanes may hold anything.
    /// Provided: those of lights at infinity.
    #[inline(always)]
    fn emit(scene: &Scene<'_>, light: &Chosen, sphere: &SceneSphere, n: &Numbers8, mask: Mask8) -> Emission8 {
        let s = Self::sample(scene, light, sphere.centre(), n.words, mask);
        Emission8::from_infinity(s.wi, s.radiance / s.pdf, s.valid, sphere, n)
    }
}

macro_rules! models {
    ($($kind:ident => $model:ty),* $(,)?) => {
        /// Samples in the lanes of `mask`, without the selection probability. Kinds that need an effect outside the
        /// constant `profile` are not compiled in.
        #[inline(always)]
        fn sample_chosen(
            profile: Effects,
            scene: &Scene<'_>,
            light: &Chosen,
            p: Vec3x8,
            words: [U32x8; 3],
            mask: Mask8,
        ) -> LightSample8 {
            let mut out = LightSample8::NONE;
            // the second question is one test, where looking for a kind among eight lights takes ten
            $(if profile.intersects(Effects::of_light(LightKind::$kind))
                && scene.effects.intersects(Effects::of_light(LightKind::$kind))
            {
                let mask = light.of_kind(LightKind::$kind, mask);
                if mask.any() {
                    out.merge(mask, &<$model>::sample(scene, light, p, words, mask));
                }
            })*
            out
        }

        /// Rays in the lanes of `mask`, likewise.
        #[inline(always)]
        fn emit_chosen(
            profile: Effects,
            scene: &Scene<'_>,
            light: &Chosen,
            sphere: &SceneSphere,
            n: &Numbers8,
            mask: Mask8,
        ) -> Emission8 {
            let mut out = Emission8::NONE;
            $(if profile.intersects(Effects::of_light(LightKind::$kind))
                && scene.effects.intersects(Effects::of_light(LightKind::$kind))
            {
                let mask = light.of_kind(LightKind::$kind, mask);
                if mask.any() {
                    out.merge(mask, &<$model>::emit(scene, light, sphere, n, mask), <$model>::DELTA);
                }
            })*
            out
        }

        /// Power of one light in luminance units, the weight with which it is selected; 0 for a kind that does not
        /// exist. The formulas are in the table of this module.
        pub fn power(light: &Light, scene: &SceneExtent) -> f64 {
            match LightKind::from_u32(light.kind) {
                $(Some(LightKind::$kind) => <$model>::power(light, scene),)*
                None => 0.0,
            }
        }

        const fn is_delta(kind: LightKind) -> bool {
            match kind { $(LightKind::$kind => <$model>::DELTA),* }
        }
    };
}

models! {
    Area => area::Area,
    Environment => environment::Surroundings,
    Point => point::Point,
    Directional => directional::Directional,
    Spot => spot::Spot,
    Sun => sun::Sun,
    Sphere => sphere::Sphere,
    Rectangle => rectangle::Rectangle,
    Disk => disk::Disk,
}

// The two tables say the same of what both know.
const _: () = {
    let mut i = 0;
    while i < LightKind::ALL.len() {
        let kind = LightKind::ALL[i];
        assert!(Effects::of_light(kind).intersects(Effects::DELTA_LIGHTS) == is_delta(kind), "`DELTA` against effects");
        i += 1;
    }
};

/// Effects without which no triangle has an emission texture.
pub const TEXTURED_EMISSION: Effects = Effects::AREA_LIGHTS.with(Effects::PRINCIPLED).with(Effects::TEXTURES);

/// Chooses a light and a direction to it for every active lane.
///
/// `p` are the reference points, `n` their unit normals, 0 in media (a hint for the selector only; nothing below
/// the horizon is dropped, since surfaces may transmit). `words` are four independent 32-bit random numbers: the first chooses the
/// light, the others the position on it. Lanes that come out not `valid` scatter no direct light in this sample: black,
/// edge-on, behind the light, touching it, or at a distance whose square overflows.
///
/// Lights that need an effect outside the constant `profile` are not compiled in, and give no sample. Lights that move are
/// seen where they are when the shutter opens; [`sample_at`] is for other times.
#[inline(always)]
pub fn sample_of<S: LightSelector>(
    profile: Effects,
    scene: &Scene<'_>,
    selector: &S,
    p: Vec3x8,
    n: Vec3x8,
    words: [U32x8; 4],
    active: Mask8,
) -> LightSample8 {
    sample_at(profile, scene, selector, &Reference8 { p, n, time: F32x8::ZERO }, words, active)
}

/// Where and when lights are seen.
#[derive(Clone, Copy, Debug)]
pub struct Reference8 {
    /// Positions, world space.
    pub p: Vec3x8,
    /// Unit normals, 0 in media.
    pub n: Vec3x8,
    /// Times, see [`Ray8::time`](crate::geometry::Ray8::time).
    pub time: F32x8,
}

/// [`sample_of`] at given times.
#[inline(always)]
pub fn sample_at<S: LightSelector>(
    profile: Effects,
    scene: &Scene<'_>,
    selector: &S,
    at: &Reference8,
    words: [U32x8; 4],
    active: Mask8,
) -> LightSample8 {
    let (light, probability) = selector.select(at.p, at.n, words[0], active);
    // constant in profiles without instances
    let placed = profile.contains(Effects::INSTANCES) && scene.effects.contains(Effects::INSTANCES);
    let chosen = Chosen::gather(scene, light, at.time, placed, active);
    let possible = active & probability.gt(F32x8::ZERO);
    let mut out = sample_chosen(profile, scene, &chosen, at.p, [words[1], words[2], words[3]], possible);
    if profile.contains(TEXTURED_EMISSION) && scene.effects.contains(TEXTURED_EMISSION) {
        let area = chosen.of_kind(LightKind::Area, possible);
        let factor = area::sampled_factor(scene, &chosen, [words[1], words[2]], area);
        out.radiance = Vec3x8::select(area, out.radiance * factor, out.radiance);
    }
    out.pdf *= probability;
    out.valid &= usable(out.pdf) & out.wi.is_finite() & out.radiance.is_finite() & out.radiance.any_positive();
    out.pdf = out.valid.zero_unless(out.pdf);
    out.radiance = out.radiance.zero_unless(out.valid);
    out
}

/// Rays that leave the lights of the scene, of eight random words each; the lights are those that `selector` chooses at the
/// middle of the scene, so that those to which it gives no chance there emit nothing. Lights that move are where they are when the shutter opens.
#[inline(always)]
pub fn emission_of<S: LightSelector>(
    profile: Effects,
    scene: &Scene<'_>,
    selector: &S,
    [[choice, a, b, c], [d, e, side, _]]: [[U32x8; 4]; 2],
    active: Mask8,
) -> Emission8 {
    let sphere = SceneSphere::new(scene);
    let (light, probability) = selector.select(sphere.centre(), Vec3x8::ZERO, choice, active);
    let placed = profile.contains(Effects::INSTANCES) && scene.effects.contains(Effects::INSTANCES);
    let chosen = Chosen::gather(scene, light, F32x8::ZERO, placed, active);
    let possible = active & probability.gt(F32x8::ZERO);
    let n = Numbers8 { words: [a, b, c], u: [d, e].map(U32x8::to_unit), side: side.to_unit() };
    let mut out = emit_chosen(profile, scene, &chosen, &sphere, &n, possible);
    if profile.contains(TEXTURED_EMISSION) && scene.effects.contains(TEXTURED_EMISSION) {
        let textured = chosen.of_kind(LightKind::Area, possible);
        let factor = area::sampled_factor(scene, &chosen, [a, b], textured);
        out.power = Vec3x8::select(textured, out.power * factor, out.power);
    }
    out.power = out.power / probability;
    out.valid &= possible & out.power.is_finite() & out.power.any_positive() & out.d.is_finite() & out.o.is_finite();
    out
}

/// Densities to divide by: positive and finite.
#[inline(always)]
fn usable(pdf: F32x8) -> Mask8 {
    pdf.gt(F32x8::ZERO) & pdf.is_finite()
}
