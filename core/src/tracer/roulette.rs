//! Stage `roulette`: how many samples each arrived vertex gets. The masks n = 0 (the path ends) and n >= 1 (it waits
//! with n samples) are the packet's roulette masks; one comb rounds the whole packet, another deals out light samples.

use super::ledger::{NO_BIN, NO_RECORD};
use super::place::{Place8, place};
use super::settle::Found8;
use super::shard::Shard;
use super::vertex::{RESERVE, Vertex8, pack_samples};
use crate::accel::Intersector;
use crate::bsdf;
use crate::light::LightSelector;
use crate::profile::Profile;
use crate::rrs::{self, Learned8, Vertices8};
use crate::scene::Scene;
use crate::scene::blob::MaterialKind;
use crate::session::Session;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Eight vertices that paths have arrived at.
pub(super) struct Arrival8<'a> {
    pub vertex: &'a mut Vertex8,
    /// Weight of the bounce that led here.
    pub weight: Vec3x8,
    /// [`MaterialKind`] per lane.
    pub kind: [u32; 8],
    /// 0 unless the strategy needs it.
    pub albedo: Vec3x8,
    pub active: Mask8,
}

/// Phong exponents of the materials; 0 where there is none.
fn shininess(scene: &Scene<'_>, a: &Arrival8<'_>) -> F32x8 {
    let material = a.vertex.material.to_array();
    F32x8::from_fn(|i| {
        let kind = MaterialKind::from_u32(a.kind[i]);
        kind.zip(scene.materials.get(material[i] as usize)).map_or(0.0, |(kind, m)| bsdf::shininess(kind, m))
    })
}

impl Shard<'_> {
    /// Rounds the factors of a packet and stores what goes on.
    pub(super) fn roulette<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        a: Arrival8<'_>,
    ) {
        let settings = self.job.settings;
        let strategy = settings.strategy;
        let state = session.learned();
        let v = &*a.vertex;
        let mut logged = None;
        let mut learned = Learned8::NONE;
        if strategy.needs_image() || settings.shadow_roulette {
            learned = state.image8(v.error_weight);
            if let Some(space) = strategy.space() {
                let found = place(session, &a, space, &self.roots);
                state.local8(&mut learned, found.bin, found.unscale, a.active);
                self.counters.look_ups.count(a.active.count());
                logged = Some(found);
            }
        }
        let (s, finite) = strategy.checked_factor(&Vertices8 {
            beta: v.beta,
            last_weight: a.weight,
            albedo: a.albedo,
            albedo_product: v.albedo_product,
            depth: v.depth,
            shininess: if strategy.needs_shininess() { shininess(session.scene(), &a) } else { F32x8::ZERO },
            learned,
        });
        self.counters.factors_not_finite += u64::from(a.active.and_not(finite).count());
        let [least, most] = settings.learning.factors;
        let s = if logged.is_some() { s.clamp(least, most) } else { s };
        let s = self.bound(s, v.root, a.active);
        let n = rrs::comb(a.active.zero_unless(s), self.comb_bits());
        self.record_factors(a.active, s, v);
        if let Some(c) = settings.control_variate.of(&learned) {
            // what the samples rounded away, or added, is expected to have given (Szecsi et al. 2003)
            let rounded = F32x8::ONE - F32x8::from_fn(|i| n[i] as f32) / s;
            let found = Found8 { pixel: v.beta * c * rounded, local: a.weight * c * rounded };
            self.gather(a.active, v.root, v.ledger, &found);
        }
        if let Some(p) = &logged {
            self.record_places(a.active, v, p, a.weight / s);
        }
        let (root, ledger, depth) = (v.root.to_array(), v.ledger.to_array(), v.depth.to_array());
        let beta = v.beta / s;
        let plays = settings.shadow_roulette && logged.is_some();
        let drawn = if plays { learned.nee_probability(beta, a.albedo) } else { F32x8::ONE };
        let lit = if plays { self.lit(n, drawn, &a) } else { n };
        a.vertex.beta = beta;
        a.vertex.drawn = drawn;
        a.vertex.albedo_product *= a.albedo.mean();
        a.vertex.samples = U32x8::from_fn(|i| pack_samples(n[i], lit[i]));
        a.vertex.bin = logged.map_or(U32x8::splat(NO_BIN), |p| p.bin);
        let records = a.vertex.records();
        for i in a.active.lanes() {
            let Some(class) = MaterialKind::from_u32(a.kind[i]).filter(|_| n[i] > 0) else {
                self.counters.paths_terminated += 1;
                self.close(root[i], ledger[i], depth[i]);
                continue;
            };
            let extra = n[i] - 1;
            self.counters.splits += u64::from(extra);
            self.counters.light_samples_skipped += u64::from(n[i] - lit[i]);
            let r = self.roots.get(root[i]);
            r.splits = r.splits.saturating_add(extra);
            // the lane's share of `open` passes to the waiting vertex
            self.pool.push(class as usize, records[i]);
        }
    }

    /// How many of the `n` samples of each vertex draw a light sample, if each does with the chance `drawn`: one more
    /// comb. Delta vertices, which draw none anyway, keep n, so that all wait in one ring.
    fn lit(&mut self, n: [u32; 8], drawn: F32x8, a: &Arrival8<'_>) -> [u32; 8] {
        let delta = (0..8).fold(0, |m, i| m | (bsdf::delta_kinds() >> a.kind[i] & 1) << i);
        let play = (a.active & drawn.lt(F32x8::ONE)).and_not(Mask8::from_bits(delta));
        if play.none() {
            return n;
        }
        let wanted = drawn * F32x8::from_fn(|i| n[i] as f32);
        let lit = rrs::comb(play.zero_unless(wanted), self.comb_bits());
        core::array::from_fn(|i| if play.bits() >> i & 1 == 1 { lit[i] } else { n[i] })
    }

    /// Tells the samples that led here where the vertex's samples are logged and what they count.
    fn record_places(&mut self, active: Mask8, v: &Vertex8, place: &Place8, inner: Vec3x8) {
        let active = active.and_not(v.ledger.eq(U32x8::splat(NO_RECORD)));
        let (ledger, bin) = (v.ledger.to_array(), place.bin.to_array());
        for i in active.lanes() {
            self.ledger.arrive(ledger[i], bin[i], place.scale.lane(i), inner.lane(i));
        }
    }

    /// Factors above 1 fall to 1 where waiting room or the camera sample's split budget is short: before any weight is
    /// computed, so that the estimate stays unbiased.
    fn bound(&mut self, s: F32x8, root: U32x8, active: Mask8) -> F32x8 {
        let splitting = active & s.gt(F32x8::ONE);
        if splitting.none() {
            return s;
        }
        let mut cut = Mask8::NONE;
        if self.pool.free() < active.count() as usize + RESERVE {
            cut = splitting;
            self.counters.splits_limited_by_ring += u64::from(splitting.count());
        } else {
            let budget = self.job.settings.split_budget;
            let root = root.to_array();
            let bits =
                splitting.lanes().filter(|&i| self.roots.get(root[i]).splits >= budget).fold(0, |m, i| m | 1 << i);
            cut |= Mask8::from_bits(bits);
            self.counters.splits_limited_by_budget += u64::from(cut.count());
        }
        cut.select(F32x8::ONE, s)
    }

    fn record_factors(&mut self, active: Mask8, s: F32x8, v: &Vertex8) {
        if self.aovs.is_empty() {
            return;
        }
        let (s, root, depth) = (s.to_array(), v.root.to_array(), v.depth.to_array());
        for i in active.lanes() {
            let pixel = self.roots.get(root[i]).target.pixel as usize;
            if let Some(aov) = self.aovs.get_mut(pixel) {
                let d = (depth[i].clamp(1, 4) - 1) as usize;
                aov.factor[d] += f64::from(s[i]);
                aov.vertices[d] += 1.0;
            }
        }
    }
}
