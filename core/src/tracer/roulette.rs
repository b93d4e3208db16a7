//! Stage `roulette`: how many samples each arrived vertex gets. The masks n = 0 (the path ends) and n >= 1 (it waits with
//! n samples) are the packet's roulette masks; one comb rounds the whole packet.

use super::shard::Shard;
use super::vertex::{RESERVE, Vertex8};
use crate::accel::Intersector;
use crate::bsdf::{self, Bsdf, Inputs8, Visitor};
use crate::profile::Profile;
use crate::rrs::{self, Vertices8};
use crate::scene::Scene;
use crate::scene::blob::MaterialKind;
use crate::session::Session;
use croupier_simd::{F32x8, Frame8, Mask8, U32x8, Vec3x8};

/// Eight vertices that paths have arrived at.
pub(super) struct Arrival8 {
    pub vertex: Vertex8,
    /// Weight of the bounce that led here.
    pub weight: Vec3x8,
    /// [`MaterialKind`] per lane.
    pub kind: [u32; 8],
    pub active: Mask8,
}

struct AlbedoOf<'a, 's> {
    scene: &'a Scene<'s>,
    vertex: &'a Vertex8,
    mask: Mask8,
}

impl<'s> Visitor<'s> for AlbedoOf<'_, 's> {
    type Out = Vec3x8;

    #[inline(never)]
    fn visit<B: Bsdf<'s>>(self) -> Vec3x8 {
        let v = self.vertex;
        let inputs = Inputs8 { material: v.material, reflectance: v.reflectance };
        let wo = Frame8::from_normal(v.ns).to_local(v.wo);
        B::gather(self.scene, &inputs, self.mask).albedo(wo)
    }
}

/// Albedos of eight vertices of any classes.
fn albedo<P: Profile>(scene: &Scene<'_>, a: &Arrival8) -> Vec3x8 {
    let mut out = Vec3x8::ZERO;
    let mut left = a.active.bits();
    while left != 0 {
        let kind = a.kind[left.trailing_zeros() as usize & 7];
        let bits = a.active.lanes().filter(|&i| a.kind[i] == kind).fold(0, |m, i| m | 1 << i);
        left &= !bits;
        let mask = Mask8::from_bits(bits);
        let of = MaterialKind::from_u32(kind)
            .and_then(|k| bsdf::dispatch_in(P::EFFECTS, k, AlbedoOf { scene, vertex: &a.vertex, mask }));
        out = Vec3x8::select(mask, of.unwrap_or(Vec3x8::ONE), out);
    }
    out
}

impl Shard<'_> {
    /// Rounds the factors of a packet and stores what goes on.
    pub(super) fn roulette<P: Profile, I: Intersector>(&mut self, session: &Session<'_, '_, P, I>, a: Arrival8) {
        let strategy = self.plan.settings().strategy;
        let mut v = a.vertex;
        let albedo = if strategy.needs_albedo() { albedo::<P>(session.scene(), &a) } else { Vec3x8::ZERO };
        let s = strategy.factor(&Vertices8 {
            beta: v.beta,
            last_weight: a.weight,
            albedo,
            albedo_product: v.albedo_product,
            depth: v.depth,
        });
        let s = self.bound(s, v.root, a.active);
        let n = rrs::comb(a.active.zero_unless(s), self.comb_bits());
        self.record_factors(a.active, s, &v);
        v.beta = v.beta / s;
        v.albedo_product *= albedo.mean();
        v.count = U32x8::new(n);
        let root = v.root.to_array();
        let records = v.to_records();
        for i in a.active.lanes() {
            let Some(class) = MaterialKind::from_u32(a.kind[i]).filter(|_| n[i] > 0) else {
                self.counters.roulette_kills += 1;
                self.close(root[i]);
                continue;
            };
            let extra = n[i] - 1;
            self.counters.splits += u64::from(extra);
            let r = self.roots.get(root[i]);
            r.splits = r.splits.saturating_add(extra);
            // the lane's share of `open` passes to the waiting vertex
            self.pool.push(class as usize, records[i]);
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
            self.counters.ring_capped += u64::from(splitting.count());
        } else {
            let budget = self.plan.settings().split_budget;
            let root = root.to_array();
            let bits =
                splitting.lanes().filter(|&i| self.roots.get(root[i]).splits >= budget).fold(0, |m, i| m | 1 << i);
            cut |= Mask8::from_bits(bits);
            self.counters.budget_capped += u64::from(cut.count());
        }
        cut.select(F32x8::ONE, s)
    }

    fn record_factors(&mut self, active: Mask8, s: F32x8, v: &Vertex8) {
        if self.aovs.is_empty() {
            return;
        }
        let (s, root, depth) = (s.to_array(), v.root.to_array(), v.depth.to_array());
        for i in active.lanes() {
            let pixel = self.roots.get(root[i]).pixel as usize;
            if let Some(aov) = self.aovs.get_mut(pixel) {
                let d = (depth[i].clamp(1, 4) - 1) as usize;
                aov.factor[d] += f64::from(s[i]);
                aov.vertices[d] += 1.0;
            }
        }
    }
}
