//! Scattering about a shading normal that is not the surface's own, without losing energy: normal maps, interpolated
//! normals ([`Bsdf::FOLDED`]).
//!
//! A lobe about a tilted normal reaches below the surface. What goes there is lost (black fringes), and what should pass
//! and does not is lost as well. Here a direction that the model takes for reflected, but which is on the other side of
//! the surface (or the other way round), is mirrored at the surface: a ray that runs into the relief bounces off it once
//! more, evenly. So
//!
//! ```text
//! f'(wi) = f(wi) where the model agrees with the surface on the side of wi, else 0
//!        + f(wi mirrored) where the model takes that for the side on which wi is
//! ```
//!
//! The mirroring keeps solid angles, so that the integral of f' is exactly the albedo of the model at the cosine between
//! wo and the shading normal, and nothing jumps where wi crosses the horizon. The density is folded in the same way. That
//! leaves wo: the shading normal has to be on its side, which is seen to where normals are made (`tracer/relief.rs`).
//!
//! Compared with others: bending the normal until the mirror direction is above the surface (Keller et al., "The Iray
//! Light Transport Simulation and Rendering System", 2017, appendix; Cycles) keeps mirrors from being black, but wide
//! lobes still lose what is below; the microfacet model of Schüssler, Heitz, Hanika and Dachsbacher ("Microfacet-based
//! Normal Mapping for Robust Monte Carlo Path Tracing", 2017) is reciprocal, but needs three evaluations and still loses
//! energy of third and higher order, and is for opaque models only. This is not reciprocal, as shading normals never are.

use super::{Bsdf, Eval8, Sample8};
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// `w` mirrored at the surface of unit normal `n`.
#[inline(always)]
fn mirrored(w: Vec3x8, n: Vec3x8) -> Vec3x8 {
    w - n * (w.dot(n) * 2.0)
}

/// Lanes in which the model reflects wo -> wi, and lanes in which the surface does.
#[inline(always)]
fn sides(wo: Vec3x8, wi: Vec3x8, n: Vec3x8) -> [Mask8; 2] {
    [(wo.z * wi.z).gt(F32x8::ZERO), (wo.dot(n) * wi.dot(n)).gt(F32x8::ZERO)]
}

/// Lanes where `a` and `b` are the same.
#[inline(always)]
fn same(a: Mask8, b: Mask8) -> Mask8 {
    !(a ^ b)
}

/// Value and density of the model `b` folded at the surface of unit normal `n`, in the local frame.
#[inline(always)]
pub fn eval<'s, B: Bsdf<'s>>(b: &B, wo: Vec3x8, wi: Vec3x8, n: Vec3x8) -> Eval8 {
    let [by_model, by_surface] = sides(wo, wi, n);
    let own = b.eval(wo, wi).zero_unless(same(by_model, by_surface));
    let image = mirrored(wi, n);
    let folds = same((wo.z * image.z).gt(F32x8::ZERO), by_surface);
    if folds.none() {
        return own;
    }
    let other = b.eval(wo, image).zero_unless(folds);
    Eval8 { f: own.f + other.f, pdf: own.pdf + other.pdf }
}

/// A sample of the folded model. Its weight is that of the direction that was mirrored, which has the right mean, its
/// density that of [`eval`].
#[inline(always)]
pub fn sample<'s, B: Bsdf<'s>>(b: &B, wo: Vec3x8, u: [F32x8; 3], n: Vec3x8) -> Sample8 {
    let mut s = b.sample(wo, u);
    let [by_model, by_surface] = sides(wo, s.wi, n);
    let folds = s.valid.and_not(same(by_model, by_surface));
    let image = mirrored(s.wi, n);
    s.wi = Vec3x8::select(folds, image, s.wi);
    // of the two directions that end there, the one that was not sampled
    let [_, by_surface] = sides(wo, s.wi, n);
    let both = (s.valid & same((wo.z * image.z).gt(F32x8::ZERO), by_surface)).and_not(s.delta);
    if both.any() {
        s.pdf += both.zero_unless(b.eval(wo, image).pdf);
    }
    s
}
