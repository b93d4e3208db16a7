//! Stage `occlude`: shadow rays to light samples.

use super::scatter::LitSamples;
use super::shard::Shard;
use crate::accel::{self, Intersector, Ray8};
use crate::cost::COST_SHADOW;
use crate::light::{LightSample8, LightSelector};
use crate::profile::Profile;
use crate::session::Session;
use croupier_simd::{F32x8, Mask8, Vec3x8};

impl Shard<'_> {
    /// The lanes of `mask` whose light sample nothing hides.
    pub(super) fn occlude<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        s: &LitSamples<'_>,
        l: &LightSample8,
        mask: Mask8,
    ) -> Mask8 {
        let v = s.vertex;
        let finite = accel::shadow_ray(v.p, v.ng, v.error, l.point, l.normal, l.point_error);
        let far_o = accel::offset(v.p, v.ng, v.error, l.wi);
        let ray = Ray8 {
            o: Vec3x8::select(l.infinite, far_o, finite.o),
            d: Vec3x8::select(l.infinite, l.wi, finite.d),
            tmin: F32x8::ZERO,
            tmax: l.infinite.select(F32x8::INFINITY, finite.tmax),
        };
        self.counters.occlude.count(mask.count());
        self.counters.shadow_rays += u64::from(mask.count());
        self.charge(mask, v.root, s.ledger, COST_SHADOW);
        mask.and_not(session.intersector().occluded(&ray, mask))
    }
}
