//! Path guiding in stage `scatter`: the BSDF and the guide are sampled as one mixture, by whose density samples count.
//!
//! A sample comes from the guide with probability g, from the BSDF else, and counts f cos / (g q + (1 - g) p) with
//! both densities q and p at its direction, whichever it came from (Veach's balance heuristic for one sample). Next
//! event estimation is weighted against the mixture too, but for the first bounce of a path that is guided: its light
//! sample belongs to a sequence that goes on from iteration to iteration ([`crate::sampler`]), whose points depend on
//! each other, so that weights by what was learned from some would bias the others. It is weighted against the BSDF, and
//! so is the emission that the bounce meets, which is right with any weights that add up to 1. Delta lobes, which no guide
//! can find, count 1 / (1 - g) times. g is 0 at materials and in media that scatter into narrow lobes, and where the
//! guide's statistics promise nothing. In media the phase function has the place of the BSDF.

use super::class::Kernel as ClassKernel;
use super::guide_notes::GuideNote8;
use super::ledger::NO_RECORD;
use super::packets::Samples8;
use crate::bsdf::{self, Bsdf, Eval8, Inputs8, Sample8, Visitor, folded};
use crate::extension::Extension;
use crate::learn::guiding::{Guide, Guide8, NO_LEAF, UNKNOWN_SHARE, sphere};
use crate::rng::Key8;
use crate::scene::{Effects, Scene};
use crate::world::World;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Phong exponent from which on a lobe is too narrow for a guide: GGX widths below 0.05.
const NARROW: f32 = 2.0 / (0.05 * 0.05) - 2.0;

/// Mean cosine, of either sign, from which on phase functions are not guided: what they scatter depends on the path's
/// direction, and a leaf in a medium has the mean over those.
const FORWARD: f32 = 0.8;

/// Largest ratio of second moments that a single sample tells.
const MOST: f32 = 1e4;

/// What the guide has drawn for eight samples.
pub(super) struct Guided8<'a, 'm> {
    guide: &'a Guide<'m>,
    at: Guide8,
    /// Lanes whose direction is the guide's.
    chosen: Mask8,
    /// Those directions, world space.
    dir: Vec3x8,
    /// Their densities.
    pdf: F32x8,
    /// Lanes that are learned from.
    recorded: Mask8,
    /// Share of the guide in the one mixture that all samples count as in what is learned: that of guided samples, times
    /// the part of the samples that are guided.
    overall: F32x8,
    /// Lanes that may be guided.
    guided: Mask8,
    /// See [`Guidable8::first`].
    first: Mask8,
    /// Numbers of the BSDF's own samples.
    u: [F32x8; 3],
}

/// Lanes whose materials, or media, scatter into lobes that are wide enough for a guide.
#[inline(always)]
pub(super) fn wide_lobes<W: World>(scene: &Scene<'_>, kernel: ClassKernel, material: U32x8) -> Mask8 {
    let index = material.to_array();
    match kernel {
        ClassKernel::Surface(kind) => {
            let shininess = F32x8::from_fn(|i| {
                let m = scene.materials.get(index[i] as usize);
                m.map_or(f32::INFINITY, |m| bsdf::shininess_with::<<W::Extension as Extension>::Bsdf>(kind, m))
            });
            shininess.lt(F32x8::splat(NARROW))
        }
        ClassKernel::Phase if W::EFFECTS.contains(Effects::MEDIA) => {
            F32x8::from_fn(|i| scene.media.get(index[i] as usize).map_or(1.0, |m| m.g.abs())).lt(F32x8::splat(FORWARD))
        }
        _ => Mask8::NONE,
    }
}

/// The samples of a packet that a guide may decide about.
pub(super) struct Guidable8 {
    /// Lanes with lobes that are wide enough, at vertices where paths go on.
    wide: Mask8,
    /// Those of guided samples whose numbers belonged to sequences that go on.
    first: Mask8,
    /// Keys of the bounces: in `first` of sequences of this iteration alone.
    pub(super) key: Key8,
}

/// What a guide may decide about, whatever it has learned.
#[inline(never)]
pub(super) fn guidable<W: World>(world: &W, samples: &Samples8) -> Guidable8 {
    let mut g = Guidable8 { wide: Mask8::NONE, first: Mask8::NONE, key: samples.key };
    if samples.class.is_delta() || samples.continues.none() {
        return g;
    }
    g.wide = samples.continues & wide_lobes::<W>(world.scene(), samples.class.kernel(), samples.vertex.material);
    g.first = g.wide & samples.guided & g.key.goes_on(world.sampler());
    if g.first.any() {
        g.key = g.key.of_iteration(world.iteration().number, g.first);
    }
    g
}

/// Draws from the guide for a packet of one class; `None` if guiding is off or of no use. Lanes that are learned
/// from and not guided have a leaf and no direction.
#[inline(never)]
pub(super) fn draw<'a, 'm: 'a, W: World>(
    guide: &'a Guide<'m>,
    world: &W,
    samples: &Samples8,
    guidable: &Guidable8,
) -> Option<Guided8<'a, 'm>> {
    let learned = if world.learned().all_teach() { samples.active } else { samples.guided };
    let recorded = learned.and_not(samples.path.record.eq(U32x8::splat(NO_RECORD)));
    let lanes = guidable.wide & (samples.guided | recorded);
    if lanes.none() {
        return None;
    }
    let v = &samples.vertex;
    // by the vertex's key: if the leaf went with the light sample's numbers, the weights of MIS would be biased
    let normal = (samples.class.kernel() != ClassKernel::Phase).then_some(v.ns);
    let at = guide.at(v.p, normal, v.key.cache_jitter(world.sampler()), lanes);
    let overall = at.fraction * world.learned().guided_part(world.iteration().samples);
    let (at, recorded) = (at.only(samples.guided), lanes & recorded);
    if recorded.none() && !at.fraction.gt(F32x8::ZERO).any() {
        return None;
    }
    let words = guidable.key.guided_direction(world.sampler());
    let chosen = lanes & at.chosen(&words);
    let (mut dir, mut pdf) = (v.ns, F32x8::ZERO);
    if chosen.any() {
        let (d, q) = guide.sample(&at, words, chosen);
        (dir, pdf) = (Vec3x8::select(chosen, d, v.ns), chosen.zero_unless(q));
    }
    let u = guidable.key.scattering(world.sampler());
    Some(Guided8 { guide, at, chosen, dir, pdf, recorded, overall, guided: samples.guided, first: guidable.first, u })
}

/// One class's kernel on a packet, with the BSDF in the guide's directions.
pub(super) struct GuidedKernel<'a, 's> {
    pub(super) scene: &'a Scene<'s>,
    pub(super) samples: &'a Samples8,
    /// World directions of light samples; `None` where light sampling does not apply.
    pub(super) nee: Option<Vec3x8>,
    pub(super) u: [F32x8; 3],
    /// World directions of the guide, and the lanes that have one.
    pub(super) dir: Vec3x8,
    pub(super) chosen: Mask8,
}

impl<'a, 's> GuidedKernel<'a, 's> {
    pub(super) fn new(scene: &'a Scene<'s>, samples: &'a Samples8, nee: Option<Vec3x8>, g: &Guided8<'_, '_>) -> Self {
        Self { scene, samples, nee, u: g.u, dir: g.dir, chosen: g.chosen }
    }
}

/// What a [`GuidedKernel`] found.
pub(super) struct Both8 {
    /// Towards the light sample.
    pub(super) nee: Eval8,
    /// The BSDF's own sample.
    pub(super) own: Sample8,
    /// The BSDF in the guide's direction.
    pub(super) guided: Eval8,
    /// Shading frames.
    pub(super) frame: Frame8,
}

impl<'s> Visitor<'s> for GuidedKernel<'_, 's> {
    type Out = Both8;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Both8 {
        let v = &self.samples.vertex;
        let frame = Frame8::from_normal(v.ns);
        let wo = frame.to_local(v.wo);
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let b = B::gather(self.scene, &inputs, self.samples.active);
        let n = frame.to_local(v.ng);
        let eval = |wi: Vec3x8| {
            let wi = frame.to_local(wi);
            if B::FOLDED { folded::eval(&b, wo, wi, n) } else { b.eval(wo, wi) }
        };
        let nee = if B::DELTA { Eval8::ZERO } else { self.nee.map_or(Eval8::ZERO, eval) };
        let guided = if self.chosen.any() { eval(self.dir) } else { Eval8::ZERO };
        let own = if B::FOLDED { folded::sample(&b, wo, self.u, n) } else { b.sample(wo, self.u) };
        Both8 { nee, own, guided, frame }
    }
}

/// A sample of the mixture.
pub(super) struct Mixed8 {
    /// Towards the light sample, with the density that MIS weighs it against.
    pub(super) nee: Eval8,
    /// World direction.
    pub(super) wi: Vec3x8,
    /// Weight, density, delta lanes and valid lanes; `wi` means nothing.
    pub(super) sample: Sample8,
    pub(super) note: GuideNote8,
}

/// Samples of guided pixels and of others count in what is learned as if all had been drawn from one mixture, with the share
/// `overall` of the guide's (Veach's balance heuristic for many samples): its densities, and those that they were drawn with
/// over them. `[p, q]` are the densities of the BSDF and of the guide, and of `delta` lanes, which no guide can find, the
/// probabilities count alone. The share is that of the whole picture: leaves that mostly guided paths reach learn as if the
/// others had reached them too, which costs efficiency, never the mean.
#[inline(always)]
fn as_one_mixture(overall: F32x8, drawn: F32x8, [p, q]: [F32x8; 2], delta: Mask8) -> [F32x8; 2] {
    let all = (1.0 - overall) * delta.select(F32x8::ONE, p) + (!delta).zero_unless(overall * q);
    [all, drawn / all]
}

/// Mixes both samples.
#[inline(never)]
pub(super) fn mix(g: &Guided8<'_, '_>, both: &Both8, nee_direction: Option<Vec3x8>) -> Mixed8 {
    let (share, own) = (g.at.fraction, 1.0 - g.at.fraction);
    let used = share.gt(F32x8::ZERO);
    let (chosen, s) = (g.chosen, &both.own);
    let mut nee = both.nee;
    if let Some(wi) = nee_direction.filter(|_| used.any()) {
        let asked = (used & nee.f.any_positive()).and_not(g.first);
        nee.pdf = g.first.select(nee.pdf, own * nee.pdf + share * g.guide.pdf(&g.at, wi, asked));
    }
    let wi = Vec3x8::select(chosen, g.dir, both.frame.to_world(s.wi));
    let delta = s.delta.and_not(chosen);
    let p = chosen.select(both.guided.pdf, s.pdf);
    let asked = (used | g.recorded & g.at.known) & s.valid.and_not(delta | chosen);
    let q = chosen.select(g.pdf, g.guide.pdf(&g.at, wi, asked));
    let pdf = own * p + share * q;
    let possible = pdf.gt(F32x8::ZERO);
    let ratio = delta.select(F32x8::ONE / own, used.select(p / pdf, F32x8::ONE));
    let weight = Vec3x8::select(chosen, both.guided.f / pdf, s.weight * ratio);
    let valid = (chosen & both.guided.f.any_positive() & possible) | (s.valid & (delta | possible)).and_not(chosen);
    let learned = g.recorded & valid & (g.at.known | !delta);
    let [all, ratio] = as_one_mixture(g.overall, delta.select(own, pdf), [p, q], delta);
    let known = g.at.known.select(q / (q + p) * 254.99, F32x8::splat(UNKNOWN_SHARE as f32));
    let unguided = delta.select(own, pdf / p).min(F32x8::splat(MOST));
    // what is not guided is as it would be without the guide
    let promised = g.at.known & g.guided;
    let note = GuideNote8 {
        lanes: g.recorded,
        leaf: U32x8::select(learned, g.at.leaf, U32x8::splat(NO_LEAF)),
        unguided: (promised & learned).select(unguided, F32x8::ONE),
        nee_pdf: promised.select(both.nee.pdf, nee.pdf),
        share: (!delta).zero_unless(known).to_i32().to_u32(),
        point: if learned.any() { sphere::quantised(wi) } else { U32x8::splat(0) },
        pdf: (!delta).zero_unless(g.at.known.select(all, pdf)),
        ratio: g.at.known.select(ratio, F32x8::ONE),
        weighted_as_bsdf: g.first,
    };
    let pdf = g.first.select(p, pdf);
    let sample = Sample8 { wi: s.wi, weight: weight.zero_unless(valid), pdf, delta: delta & valid, valid };
    Mixed8 { nee, wi, sample, note }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::guiding::GuideSize;
    use crate::testing::block;

    /// At the first bounce of a path that is guided light samples and bounces are weighted by the BSDF's density, elsewhere by
    /// the mixture's, and what was sampled counts by the mixture's everywhere. Killed by: weights by what a guide has learned
    /// from points of the same sequence.
    #[test]
    fn first_bounces_are_weighted_as_without_the_guide() {
        let size = GuideSize::within(1 << 16, 1).expect("a size");
        let (mut memory, offset) = block(Guide::layout(size).expect("a layout").size);
        // one that knows nothing is uniform
        let guide = Guide::new(size, [[-1.0; 3], [1.0; 3]], &mut memory[offset..]).expect("a guide");
        let (all, up) = (Mask8::all_lanes(), Vec3x8::splat(0.0, 0.0, 1.0));
        let first = Mask8::from_bits(0b0000_1111);
        let chosen = Mask8::from_bits(0b0011_0011);
        let uniform = 0.25 / core::f32::consts::PI;
        let mut at = Guide8::NONE;
        (at.fraction, at.known) = (F32x8::splat(0.5), all);
        let g = Guided8 {
            guide: &guide,
            at,
            chosen,
            dir: up,
            pdf: F32x8::splat(uniform),
            recorded: all,
            overall: F32x8::splat(0.5),
            guided: all,
            first,
            u: [F32x8::ZERO; 3],
        };
        let eval = |f: f32, pdf: f32| Eval8 { f: Vec3x8::splat(f, f, f), pdf: F32x8::splat(pdf) };
        let weight = Vec3x8::splat(0.8, 0.8, 0.8);
        let own = Sample8 { wi: up, weight, pdf: F32x8::splat(0.3), delta: Mask8::NONE, valid: all };
        let both = Both8 { nee: eval(0.1, 0.2), own, guided: eval(0.4, 0.5), frame: Frame8::from_normal(up) };
        let m = mix(&g, &both, Some(up));
        let mixture = |p: f32| 0.5 * p + 0.5 * uniform;
        for i in 0..8 {
            let (p, is_first) = (if chosen.lane(i) { 0.5 } else { 0.3 }, first.lane(i));
            let want = |p: f32| if is_first { p } else { mixture(p) };
            let close = |x: f32, want: f32| assert!((x / want - 1.0).abs() < 1e-5, "lane {i}: {x} for {want}");
            close(m.nee.pdf.lane(i), want(0.2));
            close(m.sample.pdf.lane(i), want(p));
            close(m.sample.weight.lane(i)[0], if chosen.lane(i) { 0.4 } else { 0.8 * 0.3 } / mixture(p));
            close(m.note.unguided.lane(i), mixture(p) / p);
            close(m.note.nee_pdf.lane(i), 0.2);
            assert_eq!(m.note.weighted_as_bsdf.lane(i), is_first);
        }
    }

    /// A tenth of the samples are guided, with share 0.4: what both kinds draw has one density together, the mean of theirs,
    /// so that a direction counts the same whichever kind found it; against f64. Killed by: densities exchanged, the guided
    /// samples' own mixture for all of them, a share of delta lobes that is not theirs.
    #[test]
    fn samples_of_two_kinds_count_as_one_mixture() {
        let (part, share) = (0.1_f32, 0.4_f32);
        let (p, q) = ([0.0, 0.01, 0.3, 0.3, 2.0, 9.0, 0.5, 0.5], [4.0, 30.0, 0.0, 0.3, 0.01, 0.0, 7.0, 0.0]);
        let delta = Mask8::from_bits(0b1100_0000);
        let all = |g: f32, i: usize| {
            let (p, q) = if i >= 6 { (1.0, 0.0) } else { (p[i], q[i]) };
            (1.0 - f64::from(g)) * p + f64::from(g) * q
        };
        for g in [share, 0.0] {
            let drawn = F32x8::from_fn(|i| all(g, i) as f32);
            let [one, ratio] = as_one_mixture(
                F32x8::splat(part * share),
                drawn,
                [p, q].map(|x| F32x8::from_fn(|i| x[i] as f32)),
                delta,
            );
            for i in 0..8 {
                let want = 0.1 * all(share, i) + 0.9 * all(0.0, i);
                assert!((f64::from(one.lane(i)) / want - 1.0).abs() < 1e-6, "lane {i}: {} for {want}", one.lane(i));
                let want = all(g, i) / want;
                assert!((f64::from(ratio.lane(i)) - want).abs() < 1e-6 * (1.0 + want), "lane {i}: {}", ratio.lane(i));
            }
        }
    }
}
