//! Scattering models in the local shading frame: +z is the shading normal, `wo` points to the viewer, `wi` to where the
//! path goes on (or to the light). All directions are unit vectors. Radiance transport: transmission into a medium of
//! relative index eta scales radiance by 1 / eta^2.
//!
//! One model per file; [`dispatch`] is the table of those that materials have. [`HenyeyGreenstein`], the phase function
//! of media, is none of them. Reflecting models return nothing for `wo.z <= 0` or `wi.z <= 0`; the dielectrics and the
//! null boundary take both sides. Lanes that hold NaN scatter nothing and never touch their neighbours.

mod compensation;
mod conductor;
mod dielectric;
mod diffuse;
pub mod folded;
pub mod fresnel;
pub mod ggx;
mod henyey_greenstein;
mod lobes;
mod mirror;
mod null;
mod own;
mod plastic;
pub mod principled;
mod roughconductor;
mod roughdielectric;
mod roughplastic;
mod thindielectric;
pub mod warp;

pub use conductor::Conductor;
pub use dielectric::Dielectric;
pub use diffuse::Diffuse;
pub use henyey_greenstein::HenyeyGreenstein;
pub use lobes::{CacheDirection, Lobes, MIRROR_SHININESS, ModelFacts};
pub use mirror::Mirror;
pub use null::Null;
pub use own::NoBsdf;
pub use plastic::Plastic;
pub use principled::Principled;
pub use roughconductor::RoughConductor;
pub use roughdielectric::RoughDielectric;
pub use roughplastic::RoughPlastic;
pub use thindielectric::ThinDielectric;

use crate::scene::blob::{Material, MaterialKind, NONE};
use crate::scene::{Effects, Scene};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Value of `f(wo, wi) |cos wi|` and the solid-angle density of sampling `wi`.
#[derive(Clone, Copy, Debug)]
pub struct Eval8 {
    /// `f |cos|`, 1/sr; 0 for delta lobes.
    pub f: Vec3x8,
    /// Density of [`Bsdf::sample`]'s non-delta part, 1/sr, lobe probabilities included.
    pub pdf: F32x8,
}

impl Eval8 {
    /// Zeros in every lane, the result of models that have delta lobes only.
    pub const ZERO: Self = Self { f: Vec3x8::ZERO, pdf: F32x8::ZERO };

    /// `self` where `mask`, else 0.
    #[inline(always)]
    fn zero_unless(self, mask: Mask8) -> Self {
        Self { f: self.f.zero_unless(mask), pdf: mask.zero_unless(self.pdf) }
    }
}

/// One sampled direction per lane.
#[derive(Clone, Copy, Debug)]
pub struct Sample8 {
    /// Local direction, unit.
    pub wi: Vec3x8,
    /// `f |cos| / pdf` (delta lobes: their weight over the lobe's probability).
    pub weight: Vec3x8,
    /// Solid-angle density, as [`Eval8::pdf`]; meaningless in delta lanes.
    pub pdf: F32x8,
    /// Lanes that sampled a delta lobe.
    pub delta: Mask8,
    /// Lanes with a usable sample; others scatter nothing (weight 0).
    pub valid: Mask8,
}

impl Sample8 {
    /// A sample of a delta lobe in the lanes of `valid`.
    #[inline(always)]
    fn delta(wi: Vec3x8, weight: Vec3x8, valid: Mask8) -> Self {
        Self { wi, weight, pdf: F32x8::ZERO, delta: valid, valid }.masked()
    }

    /// Lanes that are not valid get weight 0 and a harmless unit direction.
    #[inline(always)]
    fn masked(self) -> Self {
        Self {
            wi: Vec3x8::select(self.valid, self.wi, Vec3x8::splat(0.0, 0.0, 1.0)),
            weight: self.weight.zero_unless(self.valid),
            pdf: self.valid.zero_unless(self.pdf),
            delta: self.delta & self.valid,
            valid: self.valid,
        }
    }
}

/// Inputs of a model per lane.
#[derive(Clone, Copy, Debug)]
pub struct Inputs8 {
    /// Material index.
    pub material: U32x8,
    /// Reflectance after texturing.
    pub reflectance: Vec3x8,
}

/// One scattering model over eight lanes, `'s` the scene whose tables it may keep a reference to. Two-sidedness is the
/// caller's: for two-sided materials the frame already faces `wo`.
pub trait Bsdf<'s>: Copy + 's {
    /// Lobes of the model.
    const LOBES: Lobes;

    /// Direction that keys the learned statistics.
    const CACHE_DIRECTION: CacheDirection;

    /// Whether the model has delta lobes only: no light sampling.
    const DELTA: bool = Self::LOBES.delta_only();

    /// Whether the tracer folds the model at the surface ([`folded`]).
    const FOLDED: bool = false;

    /// Gathers the parameters of the lanes in `active`; other lanes may hold any material index.
    fn gather(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self;

    /// Value and density of the non-delta part.
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8;

    /// Samples `wi` with three numbers in [0, 1): the first two choose the direction, the third the lobe.
    fn sample(&self, wo: Vec3x8, u: [F32x8; 3]) -> Sample8;

    /// Directional-hemispherical reflectance + transmittance to use in roulette by albedo; an estimate in [0, 1].
    fn albedo(&self, wo: Vec3x8) -> Vec3x8;

    /// Share of the light from `wo` that passes straight on, unscattered, in [0, 1]. The tracer chooses: with this
    /// probability the path goes on as if nothing were there, else what the other functions describe takes place, which
    /// is what the model scatters given that light does not pass.
    #[inline(always)]
    fn straight(&self, _wo: Vec3x8) -> F32x8 {
        F32x8::ZERO
    }

    /// Phong exponent of a material of this model, for roulette by shininess: 0 (diffuse) to [`MIRROR_SHININESS`].
    fn shininess(material: &Material) -> f32;
}

/// Code to run with the model of a material kind; see [`dispatch`].
pub trait Visitor<'s> {
    /// Result of the visit.
    type Out;

    /// Called with the model.
    fn visit<B: Bsdf<'s>>(self) -> Self::Out;
}

/// Rows are `kind => model`, or `kind => model, model without` its part in [`Effects::MULTIPLE_SCATTERING`], which
/// kernel profiles without that effect compile in place of it.
macro_rules! models {
    ($($kind:ident => $model:ty $(, $plain:ty)?;)*) => {
        /// Facts of the model of `kind`, known without running it.
        #[expect(clippy::extra_unused_lifetimes, reason = "a model names it")]
        pub const fn facts<'s>(kind: MaterialKind) -> ModelFacts {
            match kind {
                $(MaterialKind::$kind => ModelFacts {
                    lobes: <$model as Bsdf<'s>>::LOBES,
                    cache_direction: <$model as Bsdf<'s>>::CACHE_DIRECTION,
                }),*
            }
        }

        /// [`Bsdf::shininess`] of the model of `kind`.
        #[expect(clippy::extra_unused_lifetimes, reason = "a model names it")]
        pub fn shininess<'s>(kind: MaterialKind, material: &Material) -> f32 {
            match kind { $(MaterialKind::$kind => <$model as Bsdf<'s>>::shininess(material)),* }
        }

        /// Calls `v` with the model of `kind`: the one table of the models.
        #[inline(always)]
        pub fn dispatch<'s, V: Visitor<'s>>(kind: MaterialKind, v: V) -> V::Out {
            match kind { $(MaterialKind::$kind => v.visit::<$model>()),* }
        }

        /// [`dispatch`] for a kernel profile: models outside the constant `profile` are not compiled in and give
        /// `None`.
        #[inline(always)]
        pub fn dispatch_in<'s, V: Visitor<'s>>(profile: Effects, kind: MaterialKind, v: V) -> Option<V::Out> {
            match kind {
                $(MaterialKind::$kind if profile.contains(Effects::of_material(MaterialKind::$kind)) => {
                    $(if !profile.contains(Effects::MULTIPLE_SCATTERING) {
                        return Some(v.visit::<$plain>());
                    })?
                    Some(v.visit::<$model>())
                })*
                _ => None,
            }
        }
    };
}

models! {
    Diffuse => Diffuse;
    Mirror => Mirror;
    Conductor => Conductor;
    RoughConductor => RoughConductor<'s>, RoughConductor<'s, false>;
    Dielectric => Dielectric;
    RoughDielectric => RoughDielectric<'s>, RoughDielectric<'s, false>;
    ThinDielectric => ThinDielectric;
    Plastic => Plastic;
    RoughPlastic => RoughPlastic<'s>, RoughPlastic<'s, false>;
    Null => Null;
    Principled => Principled<'s>;
    Own => NoBsdf;
}

/// [`dispatch_in`], with `B` for materials of a host's own model if it has one.
#[inline(always)]
pub(crate) fn dispatch_with<'s, B: Bsdf<'s>, V: Visitor<'s>>(
    profile: Effects,
    own: bool,
    kind: MaterialKind,
    v: V,
) -> Option<V::Out> {
    match kind {
        MaterialKind::HOSTS if own => Some(v.visit::<B>()),
        MaterialKind::HOSTS => None,
        _ => dispatch_in(profile, kind, v),
    }
}

/// [`shininess`], with `B` for materials of a host's own model.
pub(crate) fn shininess_with<B: for<'s> Bsdf<'s>>(kind: MaterialKind, material: &Material) -> f32 {
    match kind {
        MaterialKind::HOSTS => B::shininess(material),
        _ => shininess(kind, material),
    }
}

/// A set of material kinds, a bit each, from a table of one entry per kind.
macro_rules! kinds_where {
    (|$kind:ident| $holds:expr) => {{
        let (mut bits, mut i) = (0, 0);
        while i < MaterialKind::ALL.len() {
            let $kind = MaterialKind::ALL[i];
            bits |= ($holds as u32) << $kind as u32;
            i += 1;
        }
        bits
    }};
}

/// Bits of the kinds that have nothing but delta lobes ([`Bsdf::DELTA`]).
pub(crate) const fn delta_kinds() -> u32 {
    const KINDS: u32 = kinds_where!(|kind| facts(kind).lobes.delta_only());
    KINDS
}

/// Bits of the kinds that scatter from behind as well.
pub(crate) const fn transmissive_kinds() -> u32 {
    const KINDS: u32 = kinds_where!(|kind| facts(kind).lobes.contains(Lobes::TRANSMISSION));
    KINDS
}

/// Bits of the kinds that light may pass straight on.
pub(crate) const fn straight_kinds() -> u32 {
    const KINDS: u32 = kinds_where!(|kind| facts(kind).lobes.contains(Lobes::STRAIGHT));
    KINDS
}

/// Bits of the kinds whose learned statistics are keyed by the shading normal.
pub(crate) const fn kinds_keyed_by_normal() -> u32 {
    const KINDS: u32 = kinds_where!(|kind| matches!(facts(kind).cache_direction, CacheDirection::Normal));
    KINDS
}

/// Bits of the kinds whose learned statistics are keyed by the viewing direction.
pub(crate) const fn kinds_keyed_by_view() -> u32 {
    const KINDS: u32 = kinds_where!(|kind| matches!(facts(kind).cache_direction, CacheDirection::View));
    KINDS
}

/// Lanes whose `kind` is in the set `kinds`: a comparison for each kind of a constant set.
#[inline(always)]
pub(crate) fn lanes_of(kinds: u32, kind: &[u32; 8]) -> Mask8 {
    let kind = U32x8::new(*kind);
    let mut lanes = Mask8::NONE;
    for k in MaterialKind::ALL {
        if kinds >> *k as u32 & 1 == 1 {
            lanes |= kind.eq(U32x8::splat(*k as u32));
        }
    }
    lanes
}

// The two tables say the same of what both know.
const _: () = {
    let transmissive = kinds_where!(|kind| kind.facts().transmissive);
    let delta = kinds_where!(|kind| kind.facts().delta);
    assert!(transmissive == transmissive_kinds(), "`transmissive` of a row against `Lobes::TRANSMISSION`");
    assert!(delta == delta_kinds(), "`delta` of a row against `Lobes::DIFFUSE` and `Lobes::GLOSSY`");
};

/// Material of lanes without one: parameters with which every model stays finite.
const IDLE: &Material = &Material {
    kind: 0,
    flags: 0,
    texture: NONE,
    table: NONE,
    reflectance: [0.0; 3],
    alpha: 1.0,
    eta: [1.5; 3],
    fdr: 0.5,
    k: [0.0; 3],
    medium: NONE,
};

/// The materials of eight lanes.
#[derive(Clone, Copy)]
struct Materials8<'s>([&'s Material; 8]);

impl<'s> Materials8<'s> {
    /// Lanes outside `active` get [`IDLE`], whatever index they hold.
    #[inline(always)]
    fn new(scene: &Scene<'s>, inputs: &Inputs8, active: Mask8) -> Self {
        let (index, bits) = (inputs.material.to_array(), active.bits());
        let of = |i: usize| {
            let m = if bits >> i & 1 == 1 { scene.materials.get(index[i] as usize) } else { None };
            m.unwrap_or(IDLE)
        };
        Self([of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)])
    }

    /// One number per lane.
    #[inline(always)]
    fn get(&self, f: impl Fn(&Material) -> f32) -> F32x8 {
        F32x8::from_fn(|i| f(self.0[i]))
    }

    /// One triple per lane.
    #[inline(always)]
    fn rgb(&self, f: impl Fn(&Material) -> [f32; 3]) -> Vec3x8 {
        Vec3x8::from_fn(|i| f(self.0[i]))
    }
}

impl fresnel::Index8 {
    /// Relative indices of the materials of the lanes in `active`.
    #[inline(always)]
    fn gather(scene: &Scene<'_>, inputs: &Inputs8, active: Mask8) -> Self {
        Self::new(Materials8::new(scene, inputs, active).get(|m| m.eta[0]))
    }
}

/// `wo` mirrored at the normal.
#[inline(always)]
fn mirrored(wo: Vec3x8) -> Vec3x8 {
    Vec3x8::new(-wo.x, -wo.y, wo.z)
}

/// `w` seen from the side of the interface that `below` lanes are on: z negated there. Isotropic models do not change
/// under it.
#[inline(always)]
fn flip(w: Vec3x8, below: Mask8) -> Vec3x8 {
    Vec3x8::new(w.x, w.y, below.select(-w.z, w.z))
}
