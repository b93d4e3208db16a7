//! Stage `roulette`: how many samples each arrived vertex gets. The masks n = 0 (the path ends) and n >= 1 (it waits
//! with n samples) are the packet's roulette masks; one comb rounds the whole packet, another decides which samples draw
//! light samples.

use super::book::{Beyond, Bookkeeping};
use super::cache_key::cache_lookup;
use super::packets::Contribution8;
use super::ring::RESERVE;
use super::shading::Arrival8;
use super::vertex::pack_samples;
use crate::bsdf;
use crate::extension::Extension;
use crate::learn::cache::NO_BIN;
use crate::rrs::{self, Learned8, MAX_FACTOR, MIN_FACTOR, Strategy, Vertices8};
use crate::scene::Scene;
use crate::scene::blob::MaterialKind;
use crate::settings::Settings;
use crate::world::World;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg32;

/// Numbers of the combs of one shard in one iteration: one for each packet, so they depend on the order of packets,
/// which is a function of scene and settings.
#[derive(Debug)]
pub(crate) struct CombNumbers {
    generator: Pcg32,
    /// How many were drawn.
    drawn: u64,
}

impl CombNumbers {
    pub(super) fn new(seed: u64, iteration: u64, shard: u32) -> Self {
        let stream = (iteration << 20 | u64::from(shard)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        Self { generator: Pcg32::seed_from_u64(seed ^ stream), drawn: 0 }
    }

    /// How many numbers were drawn, for [`Self::resume`].
    pub(super) fn suspend(&self) -> u64 {
        self.drawn
    }

    /// Goes on after so many numbers.
    pub(super) fn resume(mut self, drawn: u64) -> Self {
        self.generator.advance(drawn);
        self.drawn = drawn;
        self
    }

    /// 32 random bits.
    fn next(&mut self) -> u32 {
        self.drawn += 1;
        self.generator.next_u32()
    }
}

/// What roulette decided for eight vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decision8 {
    /// Samples of each; 0 ends the path.
    pub n: [u32; 8],
    /// How many of them draw a light sample.
    pub with_nee: [u32; 8],
}

/// Phong exponents of the materials; 0 where there is none.
fn shininess<W: World>(scene: &Scene<'_>, a: &Arrival8) -> F32x8 {
    let material = a.vertex.material.to_array();
    F32x8::from_fn(|i| {
        let kind = MaterialKind::from_u32(a.kind[i]);
        kind.zip(scene.materials.get(material[i] as usize))
            .map_or(0.0, |(kind, m)| bsdf::shininess_with::<<W::Extension as Extension>::Bsdf>(kind, m))
    })
}

/// The host's factors, clamped as those of strategies, and the lanes in which they were finite.
#[inline(always)]
fn own_factor<W: World>(world: &W, v: &Vertices8, built_in: F32x8, finite: Mask8) -> (F32x8, Mask8) {
    let s = world.extension().factor(v, built_in);
    let own = s.is_finite();
    (own.select(s, F32x8::ONE).clamp(MIN_FACTOR, MAX_FACTOR), finite & own)
}

/// Rounds the factors of the vertices that paths have arrived at, and gives the vertices their samples; `free` are the
/// slots left in the ring.
#[inline(always)]
pub(crate) fn roulette<W: World>(
    world: &W,
    settings: &Settings,
    book: &mut Bookkeeping<'_>,
    comb: &mut CombNumbers,
    free: usize,
    a: &mut Arrival8,
) -> Decision8 {
    let strategy = settings.strategy;
    let (v, active) = (&a.vertex, a.active);
    let mut key = None;
    let mut learned = Learned8::NONE;
    if strategy.needs_image() || settings.shadow_roulette {
        let state = world.learned();
        learned = state.image8(v.error_weight);
        if let Some(space) = strategy.space() {
            let found = cache_lookup(world, book, a, space);
            state.local8(&mut learned, found.bin, found.unscale, active);
            book.counters.look_ups.count(active.count());
            key = Some(found);
        }
    }
    // throughput undoes guiding: simple rules play by the albedos that it would have without (EARS, section 6.4)
    let by_albedo = W::GUIDING && guides(world) && strategy.space().is_none();
    let vertices = Vertices8 {
        beta: if by_albedo { Vec3x8::grey(v.albedo_product) } else { v.beta },
        last_weight: a.weight,
        albedo: a.albedo,
        albedo_product: v.albedo_product,
        depth: v.path.depth,
        shininess: if strategy.needs_shininess() { shininess::<W>(world.scene(), a) } else { F32x8::ZERO },
        learned,
    };
    let (s, finite) = strategy.checked_factor(&vertices);
    let (s, finite) = if W::Extension::ROULETTE { own_factor(world, &vertices, s, finite) } else { (s, finite) };
    book.counters.factors_not_finite += u64::from(active.and_not(finite).count());
    let [least, most] = settings.learning.factors;
    let s = if key.is_some() { s.clamp(least, most) } else { s };
    let s = limit(settings, book, free, s, v.path.root, active);
    let n = rrs::comb(active.zero_unless(s), comb.next());
    book.record_factors(active, &v.path, s);
    if let Some(c) = settings.control_variate.of(&learned) {
        // what the samples rounded away, or added, is expected to have given (Szecsi et al. 2003)
        let rounded = F32x8::ONE - F32x8::from_fn(|i| n[i] as f32) / s;
        let found = Contribution8 { pixel: v.beta * c * rounded, local: a.weight * c * rounded };
        book.accumulate(active, &v.path, &found, Beyond::Unknown);
    }
    if let Some(k) = &key {
        book.arrive(active, &v.path, k.bin, k.scale, a.weight / s);
    } else if W::GUIDING {
        book.arrive(active, &v.path, U32x8::splat(NO_BIN), Vec3x8::ZERO, a.weight / s);
    }
    let beta = v.beta / s;
    let nee_roulette = settings.shadow_roulette && key.is_some();
    let nee_probability = if nee_roulette { learned.nee_probability(beta, a.albedo) } else { F32x8::ONE };
    let with_nee = if nee_roulette { samples_with_nee(comb, n, nee_probability, a) } else { n };
    let v = &mut a.vertex;
    v.beta = beta;
    v.nee_probability = nee_probability;
    if by_albedo && !matches!(strategy, Strategy::Albedo(_)) {
        // the largest channel, as rules that play by throughput take it
        v.albedo_product *= a.albedo.max_component() / s;
    } else {
        v.albedo_product *= a.albedo.mean();
    }
    v.samples = U32x8::from_fn(|i| pack_samples(n[i], with_nee[i]));
    v.bin = key.map_or(U32x8::splat(NO_BIN), |k| k.bin);
    Decision8 { n, with_nee }
}

/// Are samples guided?
#[inline(always)]
fn guides<W: World>(world: &W) -> bool {
    let learned = world.learned();
    learned.guide().is_some() && learned.guides()
}

/// How many of the `n` samples of each vertex draw a light sample, if each does with probability `nee_probability`: one
/// more comb. Delta vertices, which draw none anyway, keep n, so that all wait in one queue.
fn samples_with_nee(comb: &mut CombNumbers, n: [u32; 8], nee_probability: F32x8, a: &Arrival8) -> [u32; 8] {
    let delta = bsdf::lanes_of(bsdf::delta_kinds(), &a.kind);
    let play = (a.active & nee_probability.lt(F32x8::ONE)).and_not(delta);
    if play.none() {
        return n;
    }
    let wanted = nee_probability * F32x8::from_fn(|i| n[i] as f32);
    let with_nee = rrs::comb(play.zero_unless(wanted), comb.next());
    core::array::from_fn(|i| if play.bits() >> i & 1 == 1 { with_nee[i] } else { n[i] })
}

/// Factors above 1 fall to 1 where waiting room or the camera sample's split budget is short: before any weight is
/// computed, so that the estimate stays unbiased.
#[inline]
fn limit(settings: &Settings, book: &mut Bookkeeping<'_>, free: usize, s: F32x8, root: U32x8, active: Mask8) -> F32x8 {
    let splitting = active & s.gt(F32x8::ONE);
    if splitting.none() {
        return s;
    }
    let mut cut = Mask8::NONE;
    if free < active.count() as usize + RESERVE {
        cut = splitting;
        book.counters.splits_limited_by_ring += u64::from(splitting.count());
    } else {
        let root = root.to_array();
        let spent = |i: &usize| book.roots.get(root[*i]).splits >= settings.split_budget;
        let bits = splitting.lanes().filter(spent).fold(0, |m, i| m | 1 << i);
        cut |= Mask8::from_bits(bits);
        book.counters.splits_limited_by_budget += u64::from(cut.count());
    }
    cut.select(F32x8::ONE, s)
}
