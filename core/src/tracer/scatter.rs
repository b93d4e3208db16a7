//! Stage `scatter`: one BSDF sample per lane, and the BSDF's value towards the light samples. All lanes run one kernel.

use super::class::Kernel as ClassKernel;
use super::crossing::media_towards;
use super::guide_notes::GuideNote8;
use super::guided::{self, GuidedKernel};
use super::packets::{RayState8, Samples8};
use super::shading::dispatch;
use crate::bsdf::{Bsdf, Eval8, HenyeyGreenstein, Inputs8, Sample8, Visitor, folded};
use crate::geometry::{self, Ray8};
use crate::rng::Key8;
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Where eight samples of vertices go on.
pub(crate) struct Scattered8 {
    /// BSDF towards the light samples; 0 where there is none.
    pub nee: Eval8,
    /// Scattered rays, in the lanes that go on.
    pub rays: RayState8,
    /// Lanes whose weight is not finite.
    pub broken: Mask8,
}

/// One class's kernel on a packet.
struct Kernel<'a, 's> {
    scene: &'a Scene<'s>,
    samples: &'a Samples8,
    /// World directions of light samples; `None` where light sampling does not apply.
    nee: Option<Vec3x8>,
    u: [F32x8; 3],
    /// Towards the light sample, the scattered direction (local in `wi`), shading frames. Written in place: [`visit`] would
    /// return it as an option, which without LTO is copied twice on its way.
    found: &'a mut (Eval8, Sample8, Frame8),
}

impl<'s> Visitor<'s> for Kernel<'_, 's> {
    type Out = ();

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) {
        let v = &self.samples.vertex;
        let frame = Frame8::from_normal(v.ns);
        let wo = frame.to_local(v.wo);
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let b = B::gather(self.scene, &inputs, self.samples.active);
        if B::FOLDED {
            let n = frame.to_local(v.ng);
            let nee = self.nee.map_or(Eval8::ZERO, |wi| folded::eval(&b, wo, frame.to_local(wi), n));
            *self.found = (nee, folded::sample(&b, wo, self.u, n), frame);
            return;
        }
        let nee = match self.nee {
            Some(wi) if !B::DELTA => b.eval(wo, frame.to_local(wi)),
            _ => Eval8::ZERO,
        };
        *self.found = (nee, b.sample(wo, self.u), frame);
    }
}

/// Samples the BSDFs of a packet, and evaluates them in the world directions `nee`. `note` becomes what path guiding learns
/// from, if it asked: a result of its size would be copied for all packets.
#[inline(always)]
pub(crate) fn scatter<W: World>(
    world: &W,
    samples: &Samples8,
    nee: Option<Vec3x8>,
    note: &mut GuideNote8,
) -> Scattered8 {
    let mut key = samples.key;
    if W::GUIDING
        && let Some(guide) = world.learned().guide()
    {
        let guidable = guided::guidable(world, samples);
        key = guidable.key;
        if let Some(guided) = guided::draw(guide, world, samples, &guidable)
            && let kernel = GuidedKernel::new(world.scene(), samples, nee, &guided)
            && let Some(both) = visit::<W, _>(samples, kernel)
        {
            let m = guided::mix(&guided, &both, nee);
            *note = m.note;
            return onwards(world, samples, key, m.nee, &m.sample, m.wi);
        }
    }
    let mut found = nothing();
    let u = key.scattering(world.sampler());
    visit::<W, _>(samples, Kernel { scene: world.scene(), samples, nee, u, found: &mut found });
    let (nee, s, frame) = found;
    onwards(world, samples, key, nee, &s, frame.to_world(s.wi))
}

/// Calls `kernel` with what scatters the samples. `None` for a class outside the profile, which cannot be: sessions refuse
/// such scenes.
#[inline(always)]
fn visit<'s, W: World, V: Visitor<'s>>(samples: &Samples8, kernel: V) -> Option<V::Out> {
    match samples.class.kernel() {
        ClassKernel::Surface(kind) => dispatch::<W, _>(kind, kernel),
        ClassKernel::Phase if W::EFFECTS.contains(Effects::MEDIA) => Some(kernel.visit::<HenyeyGreenstein>()),
        _ => None,
    }
}

/// The rays of the samples `s`, which were drawn with `key`, in the world directions `wi`.
#[inline(always)]
fn onwards<W: World>(world: &W, samples: &Samples8, key: Key8, nee: Eval8, s: &Sample8, wi: Vec3x8) -> Scattered8 {
    let v = &samples.vertex;
    let beta = v.beta * s.weight;
    let valid = samples.continues & s.valid;
    let finite = beta.is_finite();
    let depth = samples.path.depth + U32x8::splat(1);
    Scattered8 {
        nee,
        broken: valid.and_not(finite),
        rays: RayState8 {
            active: valid & beta.any_positive() & finite,
            ray: Ray8::unbounded(geometry::offset(v.p, v.ng, v.error, wi), wi).at(samples.time),
            from: v.p,
            normal: v.ng,
            travelled: F32x8::ZERO,
            media: media_towards(world, samples, wi),
            beta,
            weight: s.weight,
            pdf: s.pdf,
            skip_mis: s.delta,
            path: super::path::Path8 { depth, ..samples.path },
            key: key.next_vertex(world.sampler(), depth),
            albedo_product: v.albedo_product,
            error_weight: v.error_weight,
        },
    }
}

/// Nothing in any lane.
fn nothing() -> (Eval8, Sample8, Frame8) {
    let up = Vec3x8::splat(0.0, 0.0, 1.0);
    let (weight, pdf, none) = (Vec3x8::ZERO, F32x8::ZERO, Mask8::NONE);
    (Eval8::ZERO, Sample8 { wi: up, weight, pdf, delta: none, valid: none }, Frame8::from_normal(up))
}
